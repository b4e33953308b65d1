# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Runs, bags and loggers' files opened from Python; it is ``rig_nodes.open``. `rig import` makes its runs of files here too."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from ..analysis import build_report, gather, info_of, write_report
from ..bags import (
    OpenedBags,
    Profile,
    is_loggers_file,
    not_sqlite,
    read_measurement,
    read_profile,
    sequence_name,
    time_above_0,
    why_none,
    write_bag,
)
from ..base import RigError, brief, no_file, quoted
from .given import path_of
from .rig import Rig, load, rig_from
from .run import Run
from .temporary import Temporary

if TYPE_CHECKING:
    from ..bags import Measurement


def open(
    path: str | Path,
    *,
    rig: Rig | str | None = None,
    profile: str | Path | None = None,
    orders: str | None = None,
    period: str | None = None,
) -> Run:
    r"""Open a run, a bag or the file of a logger.

    Parameters
    ----------
    path : str or Path
        Folder of a run, a bag of MCAP or sqlite3, or a logger's file (csv, parquet, mf4, dat, mat, xlsx, tdms).
    rig : Rig or str, optional
        The rig whose inertias, ratios and instrument errors hold for a logger's file; an exported run has its own.
    profile : str or Path, optional
        Profile that assigns the columns of a logger's file, where they are not named as the rig's signals.
    orders : str, optional
        When which gear was ordered in a logger's file, ``"TIME:FROM-TO, ..."`` with times in s.
    period : str, optional
        Time between the rows of a logger's file without times, e.g. ``"0.1 ms"``.

    Returns
    -------
    Run
        The run. That of a logger's file or a bag of sqlite3 is temporary until it is saved.

    Raises
    ------
    RigError
        When there is no such file, it cannot be read, or something that it does not hold is not given.

    Examples
    --------
    >>> run = rig_nodes.load("hydmag").simulate("demo")
    >>> bool(rig_nodes.open(run.save("runs/second")).signals["p1"].max() == run.signals["p1"].max())
    True
    >>> size = Path("log.csv").write_text("time [s],p1 [MPa]\n0.0,0.1\n0.1,0.2\n")
    >>> rig_nodes.open("log.csv")
    Traceback (most recent call last):
    rig_nodes.base.errors.RigError: log.csv: its rig is not given, and the results depend on this rig's inertias, ratios and
    instrument errors; name it by --rig NAME, in Python by rig=NAME, or in a profile
    """
    if not isinstance(path, str | Path):
        raise RigError(f"path is {brief(path)}, expected that of a run's folder, a bag or a logger's file")
    if is_loggers_file(str(path)):
        return _imported(Path(path), rig, profile, orders, period)
    given = [name for name, one in (("rig", rig), ("profile", profile), ("orders", orders), ("period", period)) if one is not None]
    if given and not Path(path).exists():
        raise RigError(f"{path}: {no_file(path)}")
    if given:
        raise RigError(f"{path}: {given[0]} is for loggers' files; a run has its own")
    with OpenedBags([path]) as bags:
        bags.check_began()
        if not any(".db3" in file.suffixes for file in bags.files):
            return Run(Path(path))
        if bags.damage:
            raise RigError(f"{path}: {not_sqlite(Path(path))}")  # which says what cannot be read
        with Temporary() as kept:
            for number, piece in enumerate(bags.pieces):
                shutil.copy(piece.path, kept.folder / f"run_{number}.mcap")
    return Run(kept.folder, temporary=kept)


def _imported(path: Path, rig: Rig | str | None, profile: str | Path | None, orders: str | None, period: str | None) -> Run:
    """Return the run of a logger's file."""
    read = None if profile is None else read_profile(path_of("profile", profile))
    if period is not None:
        read = replace(read or Profile(), period=time_above_0(period, "period"), time=None)
    if rig is None and read is not None and read.rig:
        rig = load(read.rig, **read.settings)
    elif isinstance(rig, str | Path):
        rig = load(rig, **(read.settings if read else {}))
    elif rig is not None:
        rig = rig_from(rig)
    found = read_measurement(path, read, rig.config.as_dict() if rig else None, "rig=" if rig else "", orders)
    if found is None:
        why = why_none(path, rig.config.as_dict()) if rig else "its rig is not known"
        raise RigError(f"{path}: {why}; give a profile, which rig import {quoted(path)} proposes")
    with Temporary() as kept:
        report = imported(found, kept.folder, path)
    return Run(kept.folder, report, kept)


def imported(found: Measurement, folder: Path, path: Path) -> dict:
    """Write a measurement as a run into a folder.

    Parameters
    ----------
    found : Measurement
        The measurement.
    folder : Path
        The run's folder.
    path : Path
        The file that was measured.

    Returns
    -------
    dict
        Its report, which is written beside the bag.

    Raises
    ------
    RigError
        When the folder cannot be written.
    """
    write_bag(found, folder, sequence_name(path))
    bag = gather(folder)
    run = {**info_of(bag), "mode": "import", "end": {"state": "ended", "reason": f"the file {path.name} ended"}}
    report = build_report(bag, run)
    write_report(folder, report)
    return report
