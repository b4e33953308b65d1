# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The files that options of verbs name for writing: what may be written there, decided before the verb begins.

Each such option has an OutputFile as its type; cli.main checks all of a verb's. A file that exists is only replaced when it is an
older product of the same kind (base.products).
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from ..base import KINDS, NEVER, Kind, RigError, check_product

STDOUT = "-"
OF_A_RUN = ("report.json", "metadata.yaml", "procedure.json", "sweep.json", "tune.json")  # names that the rig's folders use


class OutputFolder:
    """The type of an option that names a folder in which files are written, beside what it may hold."""

    def __call__(self, text: str) -> Path:
        """Return the folder of an argument; ArgumentTypeError for a file, and for a folder of a run or a rig."""
        path = Path(text)
        if path.exists() and not path.is_dir():
            raise argparse.ArgumentTypeError(f"{text}: it is a file, expected a folder")
        if path.is_dir() and (_of_the_rig(path) or any(path.glob("*.yaml"))):
            raise argparse.ArgumentTypeError(f"{text}: it is the folder of a run or a rig, expected one for these files")
        return path


class OutputFile:
    """The type of an option that names a file to write.

    Attributes
    ----------
    kind : Kind, str or callable
        What is written: a kind, its name in KINDS, or what returns that name from the arguments of the verb.
    to_stdout : bool
        True when ``-`` stands for the terminal.
    """

    def __init__(self, kind: Kind | str | Callable[[argparse.Namespace], str], to_stdout: bool = False) -> None:
        self.kind, self.to_stdout = kind, to_stdout

    def __call__(self, text: str) -> Path | str:
        """Return the path of an argument, or ``-``."""
        return text if text == STDOUT and self.to_stdout else Path(text)

    def kind_for(self, args: argparse.Namespace) -> Kind:
        """Return the kind that is written with these arguments."""
        kind = self.kind(args) if callable(self.kind) else self.kind
        return kind if isinstance(kind, Kind) else KINDS.get(kind, NEVER)


def output_options(parser: argparse.ArgumentParser, args: argparse.Namespace | None = None) -> Iterator[argparse.Action]:
    """Yield the options of a parser that name files to write; with arguments only those of the chosen verb below the verb."""
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            chosen = action.choices if args is None else [getattr(args, action.dest)]
            for name in chosen:
                yield from output_options(action.choices[name], args)
        elif isinstance(action.type, OutputFile):
            yield action


def check_outputs(parser: argparse.ArgumentParser, args: argparse.Namespace) -> None:
    """Refuse every file to write of a verb's arguments that may not be written.

    Parameters
    ----------
    parser : ArgumentParser
        Parser of the verb.
    args : Namespace
        What it has parsed.

    Raises
    ------
    RigError
        As :func:`may_write`.
    """
    for action in output_options(parser, args):
        path = getattr(args, action.dest)
        if isinstance(path, Path):
            option = action.option_strings[0] if action.option_strings else action.dest
            may_write(option, path, action.type.kind_for(args), args)


def may_write(option: str, path: Path, kind: Kind, args: argparse.Namespace) -> None:
    """Refuse a file that may not be written.

    Parameters
    ----------
    option : str
        Name of the option, for the error.
    path : Path
        The file.
    kind : Kind
        What will be written.
    args : Namespace
        Arguments of the verb; no file that they name for reading is replaced.

    Raises
    ------
    RigError
        When it is a folder, a device, has another ending, is in no folder, has a name that a run's folder needs, is what the verb
        reads, or exists and is no older product of this kind.
    """
    what = f"{option} {path}"
    try:
        if path.is_dir():
            raise RigError(f"{what}: it is a folder, expected a file")
        if not path.absolute().parent.is_dir():
            raise RigError(f"{what}: there is no folder {path.parent}")
        if path.exists() and not path.is_file():
            raise RigError(f"{what}: it is a device, expected a file")
        if kind.endings and path.suffix.lower() not in kind.endings:
            raise RigError(f"{what}: what is written there is a file that ends in {' or '.join(kind.endings)}")
        if path.name.lower() in OF_A_RUN and _of_the_rig(path.absolute().parent):
            raise RigError(f"{what}: the folder is one of the rig's, which keeps its own {path.name.lower()}; choose another name")
        if not path.exists():
            return
        if any(os.path.samefile(path, other) for other in _named(args, path) if os.path.isfile(other)):
            raise RigError(f"{what}: it is a file that is read; name another one")
        check_product(what, path, kind)
    except OSError as error:
        raise RigError(f"{what}: it cannot be written there ({error.strerror})") from None


def _of_the_rig(folder: Path) -> bool:
    """Return True for a folder with a bag, or with one of the files that the rig keeps in its folders."""
    return any(folder.glob("*.mcap*")) or any(folder.glob("*.db3*")) or any((folder / name).exists() for name in OF_A_RUN)


def _named(args: argparse.Namespace, path: Path) -> Iterator[str]:
    """Yield everything but ``path`` itself that the arguments of a verb may name as a file, alone or behind KIND: and KEY=."""

    def texts(value: Any) -> Iterator[str]:
        if isinstance(value, (list, tuple)):
            for one in value:
                yield from texts(one)
        elif isinstance(value, (str, Path)) and value is not path:
            yield str(value)

    for text in texts(list(vars(args).values())):
        for part in (text, text.partition(":")[2], text.partition("=")[2]):
            if part:
                yield part
