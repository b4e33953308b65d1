# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The shifts of a running rig: when one has ended, the messages around it become a short bag, and that a figure with a verdict.

nodes.panel.panel uses it. The process nodes.panel.pictures draws.
"""

from __future__ import annotations

import asyncio
import json
import sys
import tempfile
from collections import deque
from collections.abc import Callable, Coroutine, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...bags import BagWriter, Fields, cdr, encoder
from ...base import RigError
from ...rig import CONTROLLER_COMMAND, CONTROLLER_EVENTS, GEAR_WAS, NEUTRAL, SHIFT_ORDERED
from .tracks import KEPT

if TYPE_CHECKING:
    from ...rig import Catalogue
    from .tracks import Tracks

BEFORE, AFTER = 2.0, 1.5  # s of messages before the order and after the end, by which the settling of a shift is found
MOST = 12  # figures that are kept
LONGEST_LINE = 4_000_000  # bytes of one answer
ENDS = ("shift_done", "shift_aborted")  # events
Row = tuple[int, str, bytes]  # time [ns], topic, message


class Shifts:
    """Figures of the last shifts.

    Attributes
    ----------
    found : deque of dict
        What is told of each shift, the last one at the end; ``number`` counts from 1, ``key`` is for its pictures.

    Parameters
    ----------
    tell : callable
        It is called with each new one.
    """

    def __init__(self, tell: Callable[[dict[str, Any]], None]) -> None:
        self.found: deque[dict[str, Any]] = deque(maxlen=MOST)
        self._tell = tell
        self._folder = tempfile.TemporaryDirectory(prefix="rig-panel-")
        self._drawn, self._number = 0, 0  # orders of which a figure was tried, and shifts among them
        self._ordered: float | None = None
        self._due: tuple[float, float] | None = None  # time of the order, and from when on the shift is drawn [s]
        self._process: asyncio.subprocess.Process | None = None
        self._work: set[asyncio.Task] = set()
        self._turn = asyncio.Lock()

    def forget(self) -> None:
        """Drop what has not ended; for a rig that has begun again."""
        self._ordered = self._due = None

    def event(self, name: str, t: float, tracks: Tracks, known: Catalogue) -> None:
        """Take an event of the controller at a time [s]."""
        if name == SHIFT_ORDERED:
            if self._due is not None:  # the next shift begins before the last one has settled
                self._draw(self._due[0], tracks, known)
            self._ordered = t
        elif name in ENDS and self._ordered is not None:
            self._due, self._ordered = (self._ordered, t + AFTER), None

    def look(self, tracks: Tracks, known: Catalogue) -> None:
        """Draw a shift that has settled."""
        if self._due is not None and tracks.now >= self._due[1]:
            self._draw(self._due[0], tracks, known)

    async def picture(self, key: int, name: str) -> bytes:
        """Return a figure of a shift, drawn when it is asked for first; RigError when there is none."""
        folder = Path(self._folder.name) / str(key)
        if not (folder / name).is_file():
            answer = await self._asked("draw", str(folder), name)
            if "error" in answer:
                raise RigError(answer["error"])
        return (folder / name).read_bytes()

    async def measured(self, file: Path, record: Mapping[str, Any]) -> dict[str, Any]:
        """Return what :func:`nodes.panel.measured.measured` finds in a file; RigError when it cannot be used."""
        answer = await self._asked("measured", str(file), record)
        if "error" in answer:
            raise RigError(answer["error"])
        return answer

    async def close(self) -> None:
        """End the process and remove the figures."""
        for task in self._work:
            task.cancel()
        if self._process is not None and self._process.returncode is None:
            self._process.kill()
            await self._process.wait()
        self._folder.cleanup()

    def _draw(self, ordered: float, tracks: Tracks, known: Catalogue) -> None:
        self._due = None
        self._drawn += 1
        self._spawn(self._described(self._drawn, messages_around(tracks, known, ordered), known))

    def prepare(self) -> None:
        """Start the process that draws, which loads for some seconds, before the first shift."""
        self._spawn(self._begin_in_turn())

    def _spawn(self, work: Coroutine[Any, Any, None]) -> None:
        task = asyncio.get_running_loop().create_task(work)
        self._work.add(task)
        task.add_done_callback(self._work.discard)

    async def _begin_in_turn(self) -> None:
        async with self._turn:
            await self._begin()

    async def _begin(self) -> None:
        if self._process is None or self._process.returncode is not None:
            self._process = await asyncio.create_subprocess_exec(
                *(sys.executable, "-P", "-m", "rig_nodes.nodes.panel.pictures"),
                stdin=asyncio.subprocess.PIPE,
                stdout=asyncio.subprocess.PIPE,
                limit=LONGEST_LINE,
                start_new_session=True,  # Ctrl-C is for the page
            )

    async def _asked(self, *order: Any) -> dict[str, Any]:
        """Return the answer of the process that draws."""
        async with self._turn:
            await self._begin()
            assert self._process is not None and self._process.stdin is not None and self._process.stdout is not None
            self._process.stdin.write(f"{json.dumps(order)}\n".encode())
            await self._process.stdin.drain()
            line = await self._process.stdout.readline()
        return json.loads(line) if line else {"error": "the process that draws has ended"}

    async def _described(self, key: int, rows: list[Row], known: Catalogue) -> None:
        folder = Path(self._folder.name) / str(key)
        try:
            await asyncio.to_thread(write_bag, folder, rows, known)
            answer = await self._asked("describe", str(folder))
        except RigError as error:  # e.g. of a full disk
            answer = {"error": str(error)}
        for bag in folder.glob("*.mcap"):
            bag.unlink()
        if not answer:
            return  # a gear that was engaged without slip is no shift
        self._number += 1
        self.found.append({"kind": "shift", "number": self._number, "key": key} | answer)
        self._tell(self.found[-1])


def messages_around(tracks: Tracks, known: Catalogue, ordered: float) -> list[Row]:
    """Return the kept messages around a shift by time, with all that are latched, and an event on the gear that was in before.

    Parameters
    ----------
    tracks : Tracks
        The messages.
    known : Catalogue
        Their topics.
    ordered : float
        Time of the order [s].
    """
    first, at = round(1e9 * max(ordered - BEFORE, tracks.now - KEPT, 0.0)), round(1e9 * ordered)
    rows, gear = [], NEUTRAL
    for topic, messages in tracks.messages.items():
        latched = known.topics[topic].qos == "latched"
        stamps = ((cdr.stamp(data) if len(data) >= 12 else -1, data) for data in messages)
        rows += [(max(t, 0), topic, data) for t, data in stamps if t >= first or latched]
    before = [data for data in tracks.messages[CONTROLLER_COMMAND] if len(data) >= 12 and cdr.stamp(data) < at]
    if before:
        gear = int(Fields(known.topics[CONTROLLER_COMMAND].ros_type).of(before[-1])["gear"])
    said = encoder(known.topics[CONTROLLER_EVENTS].ros_type).encode(first, 0, GEAR_WAS, f"gear {gear} was in", float(gear))
    return sorted([*rows, (first, CONTROLLER_EVENTS, said)], key=lambda row: row[0])


def write_bag(folder: Path, rows: list[Row], known: Catalogue) -> None:
    """Write messages by time as a bag; RigError when it cannot be written."""
    writer = BagWriter(folder, "shift", topics=known.topics)
    for t, topic, data in rows:
        writer.write(topic, known.topics[topic].ros_type, data, t)
    writer.close()
