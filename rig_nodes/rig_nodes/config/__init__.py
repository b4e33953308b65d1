"""Configuration files of the rig and how they are read; used by everything that has settings.

YAML 1.2 with refused duplicate keys; errors name file, line, reason and what would be right.
"""

from __future__ import annotations

import hashlib
import os
import pickle
import sys
from contextlib import suppress
from functools import lru_cache
from importlib.metadata import version
from pathlib import Path

from ..compiled import cache_root
from ..errors import RigError, no_file

CONFIG_DIR = Path(__file__).resolve().parent


def package_file(name: str) -> Path:
    """Path of a file that ships with the package."""
    return CONFIG_DIR / name


def load_yaml(path: str | Path):
    """Plain dicts, lists and scalars of a YAML file; :func:`load_marked` keeps the lines.

    Raises RigError when the file is missing, is not YAML or repeats a key.
    """
    return _load(path, "safe")


def load_marked(path: str | Path):
    """Like :func:`load_yaml` but the maps know the line of each key (``map.lc.key(name)``)."""
    return _load(path, "rt")


def _load(path: str | Path, kind: str):
    path = Path(path)
    try:
        about = path.stat()
        return pickle.loads(_parsed(path.absolute(), path, kind, about.st_mtime_ns, about.st_size))
    except FileNotFoundError:
        raise RigError(f"{path}: there is no such file") from None
    except IsADirectoryError:
        raise RigError(f"{path}: {no_file(path)}") from None
    except OSError as error:
        raise RigError(f"{path}: cannot be read as text ({error})") from None


@lru_cache(maxsize=64)
def _parsed(_absolute: Path, path: Path, kind: str, _changed: int, _size: int) -> bytes:
    """The file's content, pickled: a copy for each reader, in a fiftieth of the time that reading it anew takes.

    What is remembered belongs to a file as it was when it was read: its place, time of change and size. What ships
    with the package is kept between processes too: to read it takes a fifth of a second.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        raise RigError(f"{path}: cannot be read as text ({error})") from None
    if not path.is_relative_to(CONFIG_DIR):
        return _read(path, text, kind)
    made_by = f"{kind} {version('ruamel.yaml')} {sys.version_info[:2]}"
    key = hashlib.sha256(f"{made_by}\0{text}".encode()).hexdigest()[:16]
    name = f"{'-'.join(path.relative_to(CONFIG_DIR).parts)}.{kind}"  # a rig and a sequence may be named alike
    kept = cache_root().parent / "read-configuration" / f"{name}.{key}"
    with suppress(OSError):
        return kept.read_bytes()
    content = _read(path, text, kind)
    with suppress(OSError):  # a folder that cannot be written: it is read anew each time
        kept.parent.mkdir(parents=True, exist_ok=True)
        part = kept.with_name(f".{kept.name}.{os.getpid()}")
        part.write_bytes(content)
        os.replace(part, kept)
        for old in kept.parent.glob(f"{name}.*"):
            if old != kept:
                old.unlink()
    return content


def _read(path: Path, text: str, kind: str) -> bytes:
    from ruamel.yaml import YAML
    from ruamel.yaml.error import MarkedYAMLError, YAMLError

    reader = YAML(typ=kind, pure=True)
    try:
        content = reader.load(text)
    except MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        line = f":{mark.line + 1}" if mark else ""
        problem = (error.problem or str(error)).strip().split("\n")[0]
        raise RigError(f"{path}{line}: {problem}; expected YAML with each key once") from None
    except YAMLError as error:
        raise RigError(f"{path}: is not YAML ({str(error).splitlines()[0]})") from None
    if content is None:
        raise RigError(f"{path}: it is empty, expected a map of keys")
    return pickle.dumps(content, pickle.HIGHEST_PROTOCOL)
