# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Configuration files of the rig and how they are read; everything that has settings uses this module.

The files are YAML 1.2 without duplicate keys; errors state file, line, reason and what would be right.
"""

from __future__ import annotations

import stat
from functools import lru_cache
from pathlib import Path
from typing import Any

from .errors import RigError, no_file
from .keep import kept, kept_folder
from .versions import version_of
from .yaml_file import MOST_BYTES, List, Map, read_yaml

CONFIG_DIR = Path(__file__).resolve().parent
RIGS_DIR = CONFIG_DIR.parent / "rigs"
RUN_FILE = "run.json"  # in a run's folder: what was ordered (runs.run_file)
TEMPLATE_DIR = CONFIG_DIR.parent / "rig" / "template"  # template of a new rig
_READERS = ("config.py", "yaml_file.py")  # the kept content of a file depends on their code too


def package_file(name: str) -> Path:
    """Return the path of a file that is installed with the package."""
    return CONFIG_DIR / name


def load_yaml(path: str | Path) -> Any:
    """Read the maps, lists and scalars of a YAML file; each map and list stores its lines (base.yaml_file).

    Parameters
    ----------
    path : str or Path
        The file.

    Returns
    -------
    object
        The content of the file.

    Raises
    ------
    RigError
        When the file is missing, is not YAML, repeats a key, or is larger than a file of settings can be.
    """
    path = Path(path)
    try:
        about = path.stat()
        if not stat.S_ISREG(about.st_mode):
            raise RigError(f"{path}: {no_file(path) if stat.S_ISDIR(about.st_mode) else 'it is no ordinary file'}")
        if about.st_size > MOST_BYTES:
            raise RigError(f"{path}: it has {about.st_size} bytes, expected at most {MOST_BYTES} of a YAML file")
        return _marked(_parsed(path.absolute(), path, about.st_mtime_ns, about.st_size))
    except FileNotFoundError:
        raise RigError(f"{path}: there is no such file") from None
    except (OSError, ValueError) as error:
        raise RigError(f"{path}: cannot be read as text ({error})") from None


def _plain(node: object) -> object:
    """Convert maps and lists to what JSON can hold: the kind of each, its line, its lines and its content."""
    if isinstance(node, Map):
        return [0, node.line, list(node), list(node.lines.values()), [_plain(value) for value in node.values()]]
    if isinstance(node, List):
        return [1, node.line, node.lines, [_plain(value) for value in node]]
    return node


def _marked(node: Any) -> Any:
    """Convert the result of :func:`_plain` back to maps and lists, new ones for each reader."""
    if type(node) is not list:
        return node
    if node[0] == 0:
        _, line, keys, lines, values = node
        out = Map(line)
        for key, value in zip(keys, values, strict=True):
            out[key] = _marked(value)
        out.lines = dict(zip(keys, lines, strict=True))
        return out
    _, line, lines, values = node
    out = List(line)
    out.extend(map(_marked, values))
    out.lines = lines
    return out


@lru_cache(maxsize=64)
def _parsed(_absolute: Path, path: Path, _changed: int, _size: int) -> object:
    """The content of a file as :func:`_plain` gives it, from which each reader makes its own in a fiftieth of the time.

    A remembered content belongs to the file as it was when it was read: its path, time of change and size. For files of the
    package the content is also kept on disk for later processes, because reading takes a fifth of a second.
    """
    text = path.read_text(encoding="utf-8")
    if not path.is_relative_to(CONFIG_DIR.parent):
        return _plain(read_yaml(path, text))
    name = "-".join(path.relative_to(CONFIG_DIR.parent).with_suffix(".json").parts)
    return kept(kept_folder("read-configuration") / name, _readers() + b"\0" + text.encode(), lambda: _plain(read_yaml(path, text)))


@lru_cache(maxsize=1)
def _readers() -> bytes:
    """What decides the content of a file in addition to its text."""
    sources = b"\0".join((CONFIG_DIR / name).read_bytes() for name in _READERS)
    return sources + version_of("ruamel.yaml").encode()
