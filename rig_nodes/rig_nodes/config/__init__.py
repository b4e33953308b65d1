"""Configuration files of the rig and how they are read; used by everything that has settings.

YAML 1.2 with refused duplicate keys; errors name file, line, reason and what would be right.
"""

from __future__ import annotations

import pickle
from functools import lru_cache
from pathlib import Path

from ruamel.yaml import YAML
from ruamel.yaml.error import MarkedYAMLError, YAMLError

from ..errors import RigError

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
    except OSError as error:
        raise RigError(f"{path}: cannot be read as text ({error})") from None


@lru_cache(maxsize=64)
def _parsed(_absolute: Path, path: Path, kind: str, _changed: int, _size: int) -> bytes:
    """The file's content, pickled: a copy for each reader, in a fiftieth of the time that reading it anew takes.

    What is remembered belongs to a file as it was when it was read: its place, time of change and size.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        raise RigError(f"{path}: cannot be read as text ({error})") from None
    reader = YAML(typ=kind, pure=True)
    try:
        return pickle.dumps(reader.load(text), pickle.HIGHEST_PROTOCOL)
    except MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        line = f":{mark.line + 1}" if mark else ""
        problem = (error.problem or str(error)).strip().split("\n")[0]
        raise RigError(f"{path}{line}: {problem}; expected YAML with each key once") from None
    except YAMLError as error:
        raise RigError(f"{path}: is not YAML ({str(error).splitlines()[0]})") from None
