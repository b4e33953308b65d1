# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Read a bag of any length piece by piece for a report or a comparison; every verb that makes one uses it."""

from __future__ import annotations

from pathlib import Path

from ..bags import PIECE, UNREADABLE, Bag, OpenedBags, orders_in
from ..base import RigError
from ..rig import transmission_of
from .clutch_torques import put_torques
from .faults import fault_lines, faults_in, never_begun
from .gathered import SMALL, Gathered, Thinned
from .loops import STEP, put_loops
from .measured_error import instruments_of, uncertainty
from .peak import put_peaks
from .run_report import info_of, no_rig, plain, record_of
from .side_by_side import Source
from .state_at_order import put_states


def gathering(source: Path | str, small: Bag, run: dict, annex_a: float | None = None, thinner: Thinned | None = None) -> Gathered:
    """Return what gathers the sources of build_report from the pieces of a bag.

    Parameters
    ----------
    source : Path or str
        The run's folder or file.
    small : Bag
        Events and description of the whole run, with the names of all topics (OpenedBags.bag).
    run : dict
        As in :func:`analysis.run_report.build_report`.
    annex_a : float, optional
        As in :func:`analysis.run_report.build_report`.
    thinner : Thinned, optional
        As in Gathered.

    Raises
    ------
    RigError
        When the bag's record of its rig is invalid.
    """
    try:
        record = small.record = record_of(small, run)  # a bag whose run ended before time began holds none
    except RigError:
        with OpenedBags([source]) as opened:
            opened.check_began()  # of a run without a beginning not even its rig is recorded
        raise
    try:
        box = transmission_of(record) if record["structure"]["gears"] else None
        return Gathered(source, small, orders_in(small.events()), box, annex_a, thinner)
    except UNREADABLE as error:
        raise no_rig(error) from None


def gather(
    source: Path | str, run: dict | None = None, annex_a: float | None = None, recover: bool = False, most_rows: int = 0
) -> Gathered:
    """Return what build_report needs of a bag of any length, which is read piece by piece.

    Parameters
    ----------
    source : Path or str
        The run's folder or file.
    run : dict, optional
        As in :func:`analysis.run_report.build_report`; by default what the bag records.
    annex_a : float, optional
        As in :func:`analysis.run_report.build_report`.
    recover : bool
        True to read the undamaged part of a cut or damaged bag.
    most_rows : int
        Rows of Gathered.thinned at most; 0 where it is not asked for.

    Raises
    ------
    BagError
        When the bag is damaged or missing.
    RigError
        When its record of its rig is invalid.
    """
    with OpenedBags([source]) as opened:
        small = opened.bag([topic for topic, ros_type in opened.types.items() if ros_type in SMALL])
        length = (opened.last - opened.first) / 1e9
    found = gathering(source, small, run or info_of(small), annex_a, Thinned(length, most_rows) if most_rows else None)
    for piece in Bag.pieces(source, PIECE, recover):
        found.add(piece)
    return found


def source_of(name: str, bag: Gathered) -> Source:
    """Return a run as a comparison takes it, from its bag with ``most_rows``; RigError when it holds no shifts to compare."""
    bag.check_began()
    if not bag.structure.gears:
        raise RigError(f"{name}: is of a rig without gears; runs with shifts can be compared")
    injected = faults_in(bag.events())
    faults: list[str] | None = fault_lines(injected)
    if info_of(bag).get("imported") or (bag.recorded_from and not injected):
        faults = None  # it may have been ill before what the bag holds
    elif not bag.recorded_from:
        faults = [*fault_lines(injected), *never_begun(injected, bag.record.get("faults") or ())]
    return Source(name, bag.thinned(), bag.record, _shifts_report(bag), faults)


def _shifts_report(bag: Gathered) -> dict:
    """Return shifts and their largest errors, as in the report of a bag, or no shifts when it has no rows for them."""
    try:
        recording, rows = bag.shifts()
    except RigError:
        return {"shifts": []}
    if not info_of(bag).get("imported"):
        put_torques(bag, rows, recording.transmission)
        put_peaks(bag, rows, recording.transmission)
        put_states(bag, bag.record, recording.transmission, rows)
        put_loops(rows, info_of(bag).get("loops"), ((t, value) for t, _, name, _, value in bag.events() if name == STEP))
    instruments = instruments_of(bag.record)
    return plain(
        {"shifts": rows, "uncertainty": [uncertainty(row, instruments, recording.transmission, recording.period) for row in rows]}
    )
