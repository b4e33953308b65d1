# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Where a run is written, and settings and parameters given on the command line; used by the verbs that run something
and by the nodes' processes.
"""

from __future__ import annotations

from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import RigError

if TYPE_CHECKING:
    from collections.abc import Iterator


def free_folder(name: str) -> Path:
    """The next runs/<name>-<n> that nobody has taken; it is not made."""
    number = 1
    while (folder := Path("runs") / f"{name}-{number}").exists():
        number += 1
    return folder


def run_folder(out: str | None, name: str) -> Path:
    """The folder for a run: ``out``, which must be new or empty, or the next free runs/<name>-<n>."""
    folder = free_folder(name) if out is None else Path(out)
    try:
        if out is not None and folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
            raise RigError(f"--out {out}: it exists and is not an empty folder; choose a new name")
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RigError(f"{folder}: cannot be made ({error.strerror}); choose another place with --out") from None
    return folder


@contextmanager
def unless_empty(folder: Path) -> Iterator[None]:
    """Keeps a run's folder when what should fill it fails, unless nothing was written to it."""
    try:
        yield
    except BaseException:
        with suppress(OSError):  # one that is not empty stays
            folder.rmdir()
        raise


def parse_settings(settings: list[str]) -> dict[str, str]:
    """KEY=VALUE pairs of --set as a dict; RigError when one is not a pair or comes twice."""
    return pairs("--set", settings, 'KEY=VALUE, e.g. alfa46.t12="200 ms"')


def parse_parameters(parameters: list[str]) -> dict[str, str]:
    """NAME=VALUE pairs of --with as a dict; RigError as :func:`parse_settings`."""
    return pairs("--with", parameters, 'NAME=VALUE, e.g. speed="1500 rpm"')


def pairs(option: str, texts: list[str], example: str) -> dict[str, str]:
    """KEY=VALUE texts of an option as a dict; RigError, with how it is written, as :func:`parse_settings`."""
    out: dict[str, str] = {}
    for text in texts:
        key, sign, value = text.partition("=")
        if not sign or not key or not value:
            raise RigError(f"{option} {text}: expected {example}")
        if key in out:
            raise RigError(f"{option} {key} is given twice")
        out[key] = value
    return out
