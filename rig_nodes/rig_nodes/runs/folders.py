# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The folder into which a run is written, and the settings and parameters that are given on the command line.

The commands that run something and the processes of the nodes use it.
"""

from __future__ import annotations

import os
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

from ..base import RUN_FILE, RigError

if TYPE_CHECKING:
    from collections.abc import Iterator


def _free_folder(name: str) -> Path:
    """Return the next runs/<name>-<n> that does not exist; it is not made."""
    number = 1
    while os.path.lexists(folder := Path("runs") / f"{name}-{number}"):
        number += 1
    return folder


def run_folder(out: str | None, name: str) -> Path:
    """Make the folder for a run.

    Parameters
    ----------
    out : str or None
        The folder, which must be new or empty; None for the next free runs/<name>-<n>.
    name : str
        Name of the run.

    Returns
    -------
    Path
        The folder.

    Raises
    ------
    RigError
        When the folder is not empty or cannot be made.
    """
    folder = _free_folder(name) if out is None else Path(out)
    try:
        while True:
            try:
                folder.mkdir(parents=True)
            except FileExistsError:
                if out is None and os.path.lexists(folder):  # a run that was started at the same time has taken it
                    folder = _free_folder(name)
                    continue
                if not folder.is_dir() or any(folder.iterdir()):
                    raise RigError(f"{folder}: it exists and is not an empty folder; choose a new name") from None
            return folder
    except OSError as error:
        raise RigError(f"{folder}: cannot be made ({error.strerror}); choose another place") from None


@contextmanager
def unless_empty(folder: Path) -> Iterator[None]:
    """Keep a run's folder when the block that fills it fails, but remove it when nothing was written to it but the order."""
    try:
        yield
    except BaseException:
        with suppress(OSError):  # one that is not empty stays
            if {path.name for path in folder.iterdir()} == {RUN_FILE}:
                (folder / RUN_FILE).unlink()
            folder.rmdir()
        raise


def parse_settings(settings: list[str]) -> dict[str, str]:
    """Return the KEY=VALUE pairs of --set as a dict; RigError when one is not a pair or comes twice."""
    return pairs("--set", settings, 'KEY=VALUE, e.g. alfa46.t12="200 ms"')


def parse_parameters(parameters: list[str]) -> dict[str, str]:
    """Return the NAME=VALUE pairs of --with as a dict; RigError when one is not a pair or comes twice."""
    return pairs("--with", parameters, 'NAME=VALUE, e.g. speed="1500 rpm"')


def pairs(option: str, texts: list[str], example: str) -> dict[str, str]:
    """Return the KEY=VALUE texts of an option as a dict.

    Parameters
    ----------
    option : str
        Name of the option, for the errors.
    texts : list of str
        The texts.
    example : str
        How a text is written, for the errors.

    Returns
    -------
    dict of str to str
        Values by key.

    Raises
    ------
    RigError
        When a text is not a pair, or a key comes twice.
    """
    out: dict[str, str] = {}
    for text in texts:
        key, sign, value = text.partition("=")
        if not sign or not key or not value:
            raise RigError(f"{option} {text}: expected {example}")
        if key in out:
            raise RigError(f"{option} {key} is given twice")
        out[key] = value
    return out
