# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A run or a rig as a file of another kind: what ``Run.export``, ``Rig.export`` and `rig export` write."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from ..bags import FILE_KINDS, Order, Signals, export
from ..base import RigError, atomic_write
from ..rig import check_gearbox
from .given import product, seconds_of

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from ..rig import RigConfig

    Progress = Callable[[float, str], None]  # time [s] up to which the run is read, and a text


CAN_LOGS = "blf", "asc", "log"  # the other kinds of files of a run are tables


class Exported(NamedTuple):
    """What was written.

    Parameters
    ----------
    file : Path
        The file.
    count : int
        Number of its signals; in a CAN log of its frames.
    left_out : list of str
        Topics of the run that give no signals.
    cut_off : str
        A sentence when the run was cut off; empty otherwise.
    """

    file: Path
    count: int
    left_out: list[str]
    cut_off: str


def exported(
    run: Path,
    target: Path,
    signals: Sequence[str] = (),
    period: str | float | None = None,
    units: str = "si",
    watch: Callable[[float | None], Progress] | None = None,
) -> Exported:
    """Write a run to a file of the kind that its ending says.

    Parameters
    ----------
    run : Path
        The run's folder or bag.
    target : Path
        The file, which must not be there yet.
    signals, period, units : sequence of str, str, float or None, str
        As of :meth:`Run.export`.
    watch : callable, optional
        Called with the length of the run [s], None where it is not known, it returns what is called as the run is read.

    Returns
    -------
    Exported
        What was written.

    Raises
    ------
    RigError
        When there is no such kind, the file cannot be written, or the run or its signals cannot be read.
    """
    kind = next((name for name, endings in FILE_KINDS.items() if target.suffix.lower() in endings), None)
    if kind is None:
        raise RigError(f"{target}: its ending says no kind of file; expected {', '.join(one[0] for one in FILE_KINDS.values())}")
    if target.exists():
        raise RigError(f"{target}: is there already; choose a new name")
    seconds = seconds_of("period", period)
    if kind in CAN_LOGS:
        if signals or seconds is not None or units != "si":
            raise RigError(
                f"{target}: {kind} holds the frames of the rig's CAN database; signals, period and units are for other files"
            )
        from ..runs import export_can_log  # which loads the compiler

        count, cut_off = export_can_log(kind, run, target, watch(None) if watch else None)
        return Exported(target, count, [], cut_off)
    if seconds is not None and kind in ("mf4", "mat"):
        raise RigError(
            f"{target}: a period is for csv and parquet, which hold one table; {kind} holds each signal with its own times"
        )
    found = Signals(run, list(signals), units)
    progress = watch(found.length / 1e9) if watch else None
    export(kind, Order(found, target, None if seconds is None else round(seconds * 1e9), progress))
    return Exported(target, sum(len(group.columns) for group in found.groups), found.left_out, found.cut_off)


def export_rig(config: RigConfig, file: Path) -> None:
    """Write what a controller needs to know of a rig, of the kind that the file's ending says; as ``Rig.export``."""
    from ..controllers import csv_text, dbc_text, header_text, markdown_text, record_of

    of_rigs = {  # ending of a file -> what it is, as `rig export` calls it, and its content
        ".dbc": ("dbc", dbc_text),
        ".csv": ("registers", csv_text),
        ".md": ("registers", markdown_text),
        ".h": ("record", header_text),
    }
    if (kind := of_rigs.get(file.suffix.lower())) is None:
        raise RigError(f"{file}: its ending says no kind of file of a rig; expected {', '.join(of_rigs)}")
    what, text = kind
    check_gearbox(config, f"export {what}")
    atomic_write(product("file", file, what), text(record_of(config)))
