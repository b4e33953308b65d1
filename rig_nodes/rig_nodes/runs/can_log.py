# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Writes a run as a CAN log: the frames that rig and controller would have exchanged on a bus, at their simulated times.

`rig export blf | asc | log` uses it. The frames are made of the recorded samples and answers, as the CAN plug makes them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import chain
from operator import itemgetter
from pathlib import Path
from typing import NamedTuple

from ..bags import DESCRIBING, IN_MEMORY, Bag, OpenedBags, started, whole
from ..base import RigError
from ..controllers import (
    ADDRESS,
    ADDRESS_CLAIMED,
    FUNCTION,
    LEVELS,
    ActiveCode,
    ControllerInputs,
    RigFrames,
    identifier,
    need_can,
    record_of,
)
from ..rig import (
    CONTROLLER_COMMAND,
    CONTROLLER_EVENTS,
    NEUTRAL,
    RED_BUTTON,
    SHIFT_ORDERED,
    STATUS,
    TRIPPED,
    WARNING,
    config_of_record,
)
from .rerun import RIG_EVENTS, SAMPLES

WRITERS = {"blf": "BLFWriter", "asc": "ASCWriter", "log": "CanutilsLogWriter"}  # of python-can, by kind
LATE = 50_000_000  # ns by which a message's place in the file may be later than its time
NAME = (FUNCTION << 40).to_bytes(8, "little")  # of the rig in the log; its identity number, which is random on a bus, is 0


class _Sample(NamedTuple):
    sample: int
    current: tuple[float, ...]
    measured: tuple[float, ...]


class _Answer(NamedTuple):
    sample: int
    gear: int
    shifting: bool
    flags: int
    level: int
    command: tuple[float, ...]


def export_can_log(kind: str, run: Path, target: Path, progress: Callable[[float, str], None] | None = None) -> tuple[int, str]:
    """Write the log.

    Parameters
    ----------
    kind : str
        Key of WRITERS.
    run : Path
        The run's folder or its .mcap file.
    target : Path
        The log; it appears whole or not at all.
    progress : callable, optional
        Callable that receives the time from its begin [s] up to which the bag has been read, and a text.

    Returns
    -------
    int
        Number of frames.
    str
        A sentence when the run was cut off, else empty.

    Raises
    ------
    RigError
        When the run has no samples of a controller, its rig is of another version, or a package is missing.
    """
    can = need_can()
    with OpenedBags([run]) as index:
        index.check_began()
        small, counts = index.bag([topic for topic, one in index.types.items() if one in DESCRIBING]), index.counts
        _, cut_off = index.end()
    if not counts.get(SAMPLES) or not counts.get(CONTROLLER_COMMAND):
        raise RigError(f"{small.path}: holds no samples and answers of a shift controller, of which CAN frames could be made")
    config = config_of_record(small.record, str(small.path))
    record, states, active = record_of(config), _states(small), ActiveCode(config)
    requests, rows = _requests(small), _rows(run, index.first, progress)
    first = []  # what is before the first answer, which has the level
    for row in rows:
        first.append(row)
        if isinstance(row[1], _Answer):
            break
    level = LEVELS[next(one.level for _, one in first if isinstance(one, _Answer))]
    count, stamp = 0, 0
    with whole(target) as part, open(part, "wb") if kind == "blf" else open(part, "w", encoding="utf-8") as file:
        log = getattr(can, WRITERS[kind])(file)
        if kind == "asc":  # python-can puts the date of the export there, and 1970
            file.seek(0)
            file.truncate()
            began = started(small, index.last - index.first)
            date = f"{began:%a %b %d %H:%M:%S}.{began.microsecond // 1000:03d} {began:%Y}"
            file.write(f"date {date}\nbase hex  timestamps absolute\ninternal events logged\nBegin Triggerblock {date}\n")
            file.write(" 0.000000 Start of measurement\n")
            log.header_written = True  # its own would have the date 1970

        def put(number: int, data: bytes, extended: bool) -> None:
            nonlocal count
            count += 1
            log.on_message_received(can.Message(stamp * 1e-9, number, extended, channel=0, data=data))

        put(identifier(ADDRESS_CLAIMED, ADDRESS), NAME, True)
        frames, shifting = RigFrames(record, level, put), False
        for stamp, one in chain(first, rows):
            if isinstance(one, _Answer):
                frames.answer(one.sample, one.command, one.gear, one.shifting, one.flags)
                frames.gear, frames.shifting, shifting = one.gear, int(one.shifting), one.shifting
                continue
            while len(requests) > 1 and requests[1][0] <= stamp:
                del requests[0]
            while states and states[0][0] <= stamp:
                active.take(states.pop(0)[1])
            for number, data in active.due(one.sample, ADDRESS):
                put(number, data, True)
            inputs = ControllerInputs(one.sample, stamp * 1e-9, requests[0][1], one.current, one.measured)
            frames.take(inputs, shifting, True)
        log.stop()
    return count, cut_off


def _requests(small: Bag) -> list[tuple[int, int]]:
    """Return from when [ns] which gear was requested; a trip requests neutral."""
    found = [(0, NEUTRAL)]
    for t, topic, name, _, value in small.events():
        if topic == CONTROLLER_EVENTS and name == SHIFT_ORDERED:
            found.append((round(t * 1e9), int(value)))
        elif topic == RIG_EVENTS and name == TRIPPED:
            found.append((round(t * 1e9), NEUTRAL))
    return found


def _states(small: Bag) -> list[tuple[int, str]]:
    """Return from when [ns] the rig is in its safe state for which reason; empty for none."""
    return [
        (round(t * 1e9), text if name in (TRIPPED, RED_BUTTON) else "")
        for t, topic, name, text, _ in small.events()
        if topic == RIG_EVENTS and (name == RED_BUTTON or (name.startswith(STATUS) and name != WARNING))
    ]


def _rows(run: Path, begin: int, progress: Callable[[float, str], None] | None) -> Iterator[tuple[int, _Sample | _Answer]]:
    """Yield samples and answers with their times [ns], an answer behind the sample of the same time.

    ``begin`` is the first log time of the bag [ns], which may be a date.
    """
    held: list[tuple[int, int, _Sample | _Answer]] = []
    for piece in Bag.pieces(run, IN_MEMORY):
        if piece.counts.get(SAMPLES):
            times, (sample, current, measured) = piece.fields(SAMPLES, ["sample", "current", "measured"])
            held += [
                (round(t * 1e9), 0, _Sample(int(n), tuple(i), tuple(m)))
                for t, n, i, m in zip(times.tolist(), sample.tolist(), current.tolist(), measured.tolist())
            ]
        if piece.counts.get(CONTROLLER_COMMAND):
            names = ["sample", "gear", "shifting", "flags", "level", "duty", "setpoint"]
            times, columns = piece.fields(CONTROLLER_COMMAND, names)
            for t, n, gear, shifting, flags, level, duty, setpoint in zip(times.tolist(), *(one.tolist() for one in columns)):
                command = setpoint if level else duty
                held.append((round(t * 1e9), 1, _Answer(int(n), int(gear), bool(shifting), int(flags), int(level), tuple(command))))
        held.sort(key=itemgetter(0, 1))
        done = piece.last - begin
        ready = [row for row in held if row[0] < done - LATE]
        held = held[len(ready) :]
        yield from ((t, one) for t, _, one in ready)
        if progress:
            progress(done / 1e9, f"read up to {done / 1e9:.0f} s")
    yield from ((t, one) for t, _, one in held)
