# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Files of loggers and of other tools as channels with a name, a unit, values and, where the file has them, times.

bags.exchange.imported makes measurements of them. Each format has a file of its own in ``formats``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ...base import RigError, brief, meant, no_file
from .cells import MISSING, Cells, numbers_in
from .formats.format import format_of
from .provenance import digest_of

if TYPE_CHECKING:
    from ...base import Floats

CUT = "the file is cut off; what it holds until there was taken"
LARGEST = 4 << 30  # bytes of a file, which is read as a whole


@dataclass(frozen=True)
class Form:
    """Form of a CSV file; a fact that is None is found from the file's content. Lines count from 1.

    Attributes
    ----------
    encoding, delimiter, decimal, thousands : str or None
        The encoding by its name in Python, and the signs; a blank as delimiter stands for any number of blanks.
    header, units, data : int or None
        Lines of the names, of the units when they have a line of their own, and of the first values.
    missing : tuple of str
        Texts of cells that have no value.
    sheet : str or None
        Sheet of a workbook.
    """

    encoding: str | None = None
    delimiter: str | None = None
    decimal: str | None = None
    thousands: str | None = None
    header: int | None = None
    units: int | None = None
    data: int | None = None
    missing: tuple[str, ...] = MISSING
    sheet: str | None = None


@dataclass(frozen=True)
class Channel:
    """One channel of a file.

    Attributes
    ----------
    head, name, unit : str
        Its head, which no other channel of the file should have, and the name and unit in it.
    content : (n,) array of float or Cells
        Numbers, NaN where there is none; or cells that become numbers when they are asked for.
    times : (n,) array of float, optional
        Its own times [s], where the file has them.
    over : str
        What it is recorded over in place of times, such as an angle.
    missing : tuple of float
        Numbers that stand where a value is missing.
    """

    head: str
    name: str
    unit: str
    content: Floats | Cells
    times: Floats | None = None
    over: str = ""
    missing: tuple[float, ...] = ()

    @cached_property
    def values(self) -> Floats:
        """The numbers, (rows,), NaN where there is none; RigError with the place when the channel has something else."""
        found = self.content.numbers() if isinstance(self.content, Cells) else self.content
        return np.where(np.isin(found, self.missing), np.nan, found) if self.missing else found

    @property
    def kind(self) -> str:
        """What the channel holds: ``numbers``, ``text``, ``dates and times``, or a type by its name."""
        return self.content.kind if isinstance(self.content, Cells) else "numbers"

    def words(self) -> dict[str, int]:
        """Return the texts that were taken for missing values without being declared, with their numbers."""
        return self.content.words if isinstance(self.content, Cells) else {}

    def texts(self) -> list[str]:
        """Return the values as texts, empty where there is none."""
        return (
            self.content.texts() if isinstance(self.content, Cells) else [f"{x:g}" if x == x else "" for x in self.values.tolist()]
        )


@dataclass(frozen=True)
class Foreign:
    """A file.

    Attributes
    ----------
    path : Path
        The file.
    channels : list of Channel
        Its channels in their order.
    form : Form
        Its form when it is text.
    provenance : dict or None
        Provenance of an exported run.
    notes : list of str
        What was left out or recognized in reading, as sentences.
    period : tuple of (float, str) or None
        Time between rows [s] that a line above the values states, and the place of this line.
    start : float or None
        Date of time 0 [s since 1970-01-01 UTC], where the file has it beside its times.
    """

    path: Path
    channels: list[Channel]
    form: Form = field(default_factory=Form)
    provenance: dict | None = None
    notes: list[str] = field(default_factory=list)
    period: tuple[float, str] | None = None
    start: float | None = None

    def row(self, number: int) -> str:
        """Return the place of a row in the file, for errors."""
        return f"line {number + self.form.data}" if self.form.data else f"row {number + 1}"

    def digest(self) -> str:
        """Return the SHA-256 of the file."""
        return digest_of(self.path)


def read_foreign(path: str | Path, form: Form | None = None) -> Foreign:
    """Read a file.

    Parameters
    ----------
    path : str or Path
        A file of one of the formats, by its content.
    form : Form, optional
        Form of a CSV file; its signs hold for the texts of a table too.

    Returns
    -------
    Foreign
        The channels.

    Raises
    ------
    RigError
        When the file cannot be used; the error is one sentence.
    """
    path = Path(path)
    if not path.is_file():
        raise RigError(f"{path}: {no_file(path)}")
    try:
        size = path.stat().st_size
        if size > LARGEST:
            raise RigError(f"{path}: has {size} bytes, and a file is read as a whole, at most {LARGEST}; split it")
        if not size:
            raise RigError(f"{path}: is empty")
        form = form or Form()
        found = format_of(path).channels(path, form)
    except OSError as error:
        raise RigError(f"{path}: cannot be read ({error.strerror or error})") from None
    missing = numbers_in(form.missing, found.form.decimal)
    return replace(found, channels=[replace(one, missing=missing) for one in found.channels]) if missing else found


def named(channels: Sequence[Channel], head: str, where: str) -> Channel | None:
    """Return the channel with this head, this name or this last part of a path; RigError, with ``where``, when several have it."""
    found = [one for one in channels if one.head == head] or [one for one in channels if one.name == head]
    found = found or [one for one in channels if one.head.endswith((f".{head}", f"/{head}"))]
    if len(found) > 1:
        shown = ", ".join(f"'{one.head}'" for one in found[:4])
        raise RigError(
            f"{where}: '{head}' is there {len(found)} times, as {shown}{' and more' if len(found) > 4 else ''}; name one of these"
        )
    return found[0] if found else None


def column(foreign: Foreign, head: str, where: str) -> Channel:
    """Return the channel with a head or name; RigError, which begins with ``where``, when there is none."""
    found = named(foreign.channels, head, where)
    if found is None:
        names = [one.name for one in foreign.channels]
        raise RigError(f"{where}: {foreign.path} has no column {brief(head)}; {meant(head, names)}")
    return found
