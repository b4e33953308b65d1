# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Timing of a replay: which message is due when, with rate, start, pause, single messages, jumps, loop and the clock.

nodes.replay uses it and publishes the messages that are due. It depends neither on ROS nor on the wall clock: the caller
passes the time.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple, TypeAlias

from .limits import LAST

CLOCK = None  # stands in place of a message when the clock is due
STRIDE = 0.05  # longest wall time [s] made up for at once; 50 ms at rate 10 are 500 messages of a 1 kHz topic
BATCH = 1000  # largest number of due items handed out at once, so that a pause never waits for more

Message: TypeAlias = Any  # any object that identifies the message for the caller
Due: TypeAlias = tuple[Message, int]


class Played(NamedTuple):
    """A recording to replay.

    Parameters
    ----------
    messages : callable
        Begins a pass: for two recorded times [ns] it returns an iterator of (time [ns], message) with ascending times,
        from the first of the two to before the second.
    first, end : int
        Recorded times at which passes begin and end [ns].
    early : callable
        For a recorded time [ns], the messages from before it that are due when the replay begins there.
    """

    messages: Callable[[int, int], Iterator[tuple[int, Message]]]
    first: int
    end: int
    early: Callable[[int], Sequence[tuple[int, Message]]] = lambda _: ()


class Player:
    """The order and the pace of one replay.

    Every pass begins with the clock at its first time and with the messages of ``early``, which were sent earlier and still
    hold. Then messages and clock follow in recorded time; at equal times the clock comes first. In a loop, a pass begins one
    clock period after the last message of the previous pass. A stall of more than 50 ms is not made up for: the replay
    continues from where it stood, and ``behind`` adds up such stalls [s].
    """

    def __init__(
        self,
        played: Played,
        *,
        rate: float = 1.0,
        loop: bool = False,
        paused: bool = False,
        period: int = 5_000_000,
        hole: int = LAST,
    ) -> None:
        """Prepare a replay; it begins with the first :meth:`take`.

        Parameters
        ----------
        played : Played
            What is replayed.
        rate : float
            Recorded seconds per second; inf replays as fast as possible.
        loop : bool
            True to begin again after the last message.
        paused : bool
            True to begin paused.
        period : int
            Recorded time between two clocks [ns].
        hole : int
            Recorded time without a message [ns] beyond which the replay goes on one period later with the next message.
        """
        self._messages, first, end, self._early = played
        self.rate, self.loop, self.paused = rate, loop, paused
        self.clock = first  # last time of the clock [ns]
        self.passes = 0
        self.behind = 0.0
        self._period, self._hole = period, hole
        self._span = first, end
        self._rest: Iterator[tuple[int, Message]] = iter(())
        self._ahead: tuple[int, Message] | None = None  # the next message of this pass
        self._first = first  # time at which this pass began
        self._last = first  # time of the last message taken in this pass
        self._tick = first
        self._before_hole = -1  # time of the message before the last hole that was jumped over [ns]
        self._offset = 0.0  # recorded time since the beginning of the pass [ns], reached at _wall
        self._wall: float | None = None  # time of the caller's clock [s] at which _offset was reached
        self._jump: int | None = None  # recorded time at which the replay goes on [ns], where that is not the next one
        self._steps = 0

    @property
    def finished(self) -> bool:
        """True when nothing will become due any more."""
        return not self.loop and self.pass_over

    @property
    def pass_over(self) -> bool:
        """True when this pass has no message left."""
        return self._wall is not None and self._jump is None and self._ahead is None

    def pause(self) -> None:
        """Stop the clock and make nothing due until :meth:`resume` or :meth:`play_next`."""
        self.paused = True

    def resume(self, now: float) -> None:
        """Continue from where the pause began; ``now`` is the caller's time [s]."""
        if self.paused:
            self.paused, self._steps = False, 0
            if self._wall is not None:
                self._wall = now

    def play_next(self) -> bool:
        """Make the next message due while paused; return False when not paused."""
        self._steps += self.paused
        return self.paused

    def seek(self, time: int) -> None:
        """Continue, or stay paused, at a recorded time [ns]; later passes begin where they did."""
        self._jump, self._steps = time, 0
        self.clock = time

    def play(self, first: int, end: int, now: float) -> None:
        """Play from one recorded time to before another [ns], in all later passes too; ``now`` is the caller's time [s]."""
        self._span = first, end
        self.seek(first)
        self.resume(now)

    def take(self, now: float) -> list[Due]:
        """Return what became due by ``now`` [s] and was not taken yet, in order: (message or CLOCK, time [ns])."""
        due: list[Due] = []
        elapsed = 0.0
        if self._jump is not None:
            first, self._jump, self._offset = self._jump, None, 0.0
            self.passes = max(self.passes, 1)
            self._begin(due, first)
        elif self._wall is None:
            self._start_pass(due)
        else:
            elapsed = now - self._wall
        self._wall = now
        if self.paused:
            while self._steps:
                self._steps -= 1
                self._take_step(due)
            return due
        if math.isinf(self.rate):
            self._offset = math.inf
        else:
            self._offset += min(elapsed, STRIDE) * self.rate * 1e9
            self.behind += max(0.0, elapsed - STRIDE)
        self._collect(due)
        if math.isinf(self.rate):
            self._offset = self.clock - self._first
        return due

    def wait(self, now: float) -> float:
        """Return the seconds from ``now`` [s] until something is due: 0 when it is due already, inf when paused or finished."""
        if self._wall is None or self._jump is not None:
            return 0.0
        if self.finished or self.paused:
            return 0.0 if self._steps and not self.finished else math.inf
        if math.isinf(self.rate):
            return 0.0
        at = min(self._tick, self._ahead[0]) - self._first if self._ahead is not None else self._last - self._first + self._period
        return max(0.0, (at - self._offset) / self.rate / 1e9 - (now - self._wall))

    def lateness(self, time: int, now: float) -> float:
        """Return the seconds from when a message was due until ``now``.

        Parameters
        ----------
        time : int
            Recorded time of the message, which was taken last [ns].
        now : float
            The caller's time [s].

        Returns
        -------
        float
            Delay [s], never negative.
        """
        if self.paused or math.isinf(self.rate) or time <= self._before_hole:
            return 0.0
        due = max(time - self._first, 0)
        return max(0.0, now - self._wall + (self._offset - due) / self.rate / 1e9)

    def _start_pass(self, due: list[Due]) -> None:
        self.passes += 1
        self._begin(due, self._span[0])

    def _begin(self, due: list[Due], first: int) -> None:
        """Begin at a recorded time [ns], with the clock and with what holds from before."""
        self._first = self._last = self._tick = first
        self._before_hole = -1
        self._rest = self._messages(first, self._span[1])
        self._ahead = next(self._rest, None)
        self._take_clock(due, first)
        self._jump_over_hole()
        due += [(message, time) for time, message in self._early(first)]

    def _take_next(self, due: list[Due], ahead: tuple[int, Message]) -> None:
        self._last, message = ahead
        due.append((message, self._last))
        self._ahead = next(self._rest, None)
        self._jump_over_hole()

    def _jump_over_hole(self) -> None:
        """Put the next message one period behind the last one where no message comes for longer than a hole."""
        if self._ahead is not None and (gap := self._ahead[0] - self._last) > self._hole:
            self._before_hole = self._last
            self._first += gap - self._period
            self._tick = self._ahead[0]

    def _take_clock(self, due: list[Due], time: int) -> None:
        """Make the clock due; the next clock follows on the grid of the pass."""
        due.append((CLOCK, time))
        self.clock = time
        self._tick = self._first + ((time - self._first) // self._period + 1) * self._period

    def _collect(self, due: list[Due]) -> None:
        """Make everything up to the offset due, over as many passes as it spans."""
        while len(due) < BATCH:
            if self._ahead is not None:
                time = self._ahead[0]
                if min(time, self._tick) - self._first > self._offset:
                    return
                if self._tick <= time:
                    self._take_clock(due, self._tick)
                else:
                    self._take_next(due, self._ahead)
            elif self.loop and self._offset >= (length := self._last - self._first + self._period):
                self._offset -= length
                self._start_pass(due)
            else:
                return

    def _take_step(self, due: list[Due]) -> None:
        if self._ahead is None:
            if not self.loop:
                return
            self._offset = 0.0
            self._start_pass(due)
            if self._ahead is None:
                return
        time = self._ahead[0]
        if time > self.clock:
            self._take_clock(due, time)
        self._take_next(due, self._ahead)
        self._offset = max(self._offset, float(time - self._first))
