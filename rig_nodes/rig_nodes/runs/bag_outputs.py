# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The messages of runs.outputs for a bag, where nobody waits for them: they are made in blocks of up to a second.

``simulate``, ``rerun`` and the recording of an FMU use it. The bag is the same as one that is written message by message; what
is sent at a fixed rate costs a tenth.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..bags import BagWriter, Column, encoder
from ..base import SAMPLE, SAMPLE_NS, TICK_SAMPLES
from ..controllers import Plug
from ..rig import CONTROLLER_COMMAND, absolute_pressures
from .moments import Moments
from .outputs import BLOCK, MEASUREMENT, Outputs
from .rig import Rig
from .topics import SCALAR_SAMPLES, state_fields

if TYPE_CHECKING:
    from collections.abc import Iterable

    from ..base import Ints

TICKS = 200  # ticks in a block; its rows must still be in the rig's ring of 2 s
LENGTH = TICKS * TICK_SAMPLES  # of a block [samples]
# places in the order of the messages of one sample: what is sent once, command, what has no fixed rate, what has one
RANKS = 1 << 40
COMMAND, UNFORESEEN, REGULAR = 1 << 10, 1 << 11, 1 << 38
CONTROLLER = "/instruments/controller"


class BagOutputs(Outputs):
    """Messages of a rig that are written into a bag.

    Parameters
    ----------
    bag : BagWriter
        The bag; it is not closed here.
    rig : Rig
        The rig whose state is written.
    run_info : dict
        The record of the run.
    commands : bool, optional
        As for Outputs.
    controller : Plug, optional
        As for Outputs.
    """

    def __init__(
        self, bag: BagWriter, rig: Rig, run_info: dict, commands: bool | None = None, controller: Plug | None = None
    ) -> None:
        """Prepare the first block; the class describes the parameters."""
        super().__init__(rig, run_info, commands, controller)
        self._bag, self._moments = bag, Moments(rig)
        fields = state_fields(self._moments)
        self._in_blocks = {topic: fields[topic] for topic in self.states.topics if topic in fields}
        # the rig does not keep what these are made of
        self._at_ticks: dict[str, list[tuple]] = {topic: [] for topic in self.states.topics if topic not in fields}
        # nobody acts inside a tick where the controller runs in the plant's own loop and no device is cut out
        self.by_samples = (rig.shifts and not rig.embedded) or bool(rig.config.cut_out)
        self._changes = rig.gauges.changes
        self._mirrored = [one.name for one in absolute_pressures(rig.config.structure)] if rig.shifts else []
        self._begin(-1)

    def _begin(self, before: int) -> None:
        """Begin a block behind the boundary of a sample."""
        self._before = self._now = before  # newest boundary of the last block, and of this one
        self._single: list[tuple[int, str, int, bytes]] = []  # place in the order, topic, stamp and bytes of other messages
        self._commands: list[tuple[int, int, tuple]] = []  # boundary, sample answered and fields of each command from outside
        for fields in self._at_ticks.values():
            fields.clear()
        self._moments.begin()
        self._noise = {name: self.rig.gauges.effective(name) for name in self._mirrored}

    @property
    def room(self) -> int:
        """Number of samples that the rig may move before the next :meth:`boundary`, at a tick and if nothing is to act earlier."""
        if self.by_samples or self._now < 1:  # at its first sample the rig says that it is ready
            return 1
        samples = TICK_SAMPLES if self._at_ticks else LENGTH
        room, faults = samples - self._now % samples, self.rig.faults
        return room if faults is None else min(room, max(1, faults.next - self._now))

    def boundary(self) -> None:
        """Take what is due now and since the last call; called at time 0 and after each move of at most :attr:`room` samples.

        Raises
        ------
        RigError
            When the bag cannot be written.
        """
        rig, sample = self.rig, self.rig.sample
        if self._changes != rig.gauges.changes or self._moments.is_over():
            # a block states once what is the same in all of its messages
            self._changes, self._now = rig.gauges.changes, sample - 1
            self.flush()
        elif sample - self._before > LENGTH or sample % LENGTH == 0:
            # it ends before this boundary, with which a chunk of the bag begins
            self._now = sample - 1
            self.flush()
        self._now = sample
        if not self._started:
            self._put(0, self._once())
        if self.commands and not rig.embedded and (answered := rig.newest_command) > self._answered:
            self._answered = answered
            self._commands.append((sample, answered, self.states.command()))
        self._watch_status()
        self._watch_faults()
        if self._queued or rig.cuts.devices:
            self._put(UNFORESEEN, self._unforeseen())
        if sample % TICK_SAMPLES == 0:
            self._moments.note()
            for topic, fields in self._at_ticks.items():
                fields.append(self.states.topics[topic]())
        if self._before < 0:
            self.flush()  # the topics of all rates are known to the bag now

    def _put(self, rank: int, messages: Iterable[tuple[str, int, bytes]]) -> None:
        first = (self._now - self._before) * RANKS + rank
        self._single += [(first + k, *message) for k, message in enumerate(messages)]

    def reading(self, name: str) -> float:
        """Return the newest value of a signal that was sent [SI], as a listener has it; NaN before the first."""
        topic = self._readings.topic(name)
        # a sequence reads before the boundary of its tick
        fields, now = self._readings.fields, max(self._now, self.rig.sample - 1)
        if now >= 0 and topic in self.states.measured:
            row = self.rig.row_of(now - now % SCALAR_SAMPLES)
            fields[topic] = (row[self.states.measured[topic]],)
        elif topic in self._in_blocks:
            tick = now - now % TICK_SAMPLES
            if tick > self._before:  # otherwise the fields are those of the last block's end
                self._moments.show(np.array([tick]))
                fields[topic] = _at(0, self._in_blocks[topic]())
        elif self._at_ticks.get(topic):
            fields[topic] = self._at_ticks[topic][-1]
        elif topic == CONTROLLER_COMMAND and self._commands:
            fields[topic] = self._commands[-1][2]
        elif topic == CONTROLLER_COMMAND and self.commands and self.rig.embedded and now > 0:
            fields[topic] = _at(0, self._law(now - 1, 1))
        elif topic == CONTROLLER and now >= 0:
            fields[topic] = _at(0, self._seen(np.array([now])))
        return self._readings.reading(name)

    def flush(self) -> None:
        """Write what was taken, and begin a new block.

        Raises
        ------
        RigError
            When the bag cannot be written.
        """
        try:
            if self._now > self._before or self._single:
                self._bag.write_columns(self._columns_due())
        finally:  # what could not be written is given up
            self._begin(self._now)

    def finish(self) -> None:
        """Write all that was due until now, the boundary of the present sample only if it was taken; the run ends here.

        Raises
        ------
        RigError
            When the bag cannot be written.
        """
        self._now = max(self._now, self.rig.sample - 1)
        self.flush()

    # ---- the columns of a block

    def _columns_due(self) -> list[Column]:
        out = [_one(*single) for single in self._single]
        boundaries = np.arange(self._before + 1, self._now + 1)
        out += self._of_commands(boundaries)
        rank = REGULAR
        if self.rig.shifts:
            out.append(self._column(CONTROLLER, rank, boundaries, *self._seen(boundaries)))
        ticks = boundaries[boundaries % TICK_SAMPLES == 0]
        self._moments.show(ticks)
        angles = np.tile(np.array(self.states.angles), (len(ticks), 1))
        if len(ticks):
            out += self._of_states(rank, ticks)
            rank += len(self.states.topics) + 1
            if len(full := ticks[ticks > 0]):
                per_sample = self.rig.rows_per_sample
                per_tick = per_sample * TICK_SAMPLES
                first, rows = self.rig.take_rows(per_tick * len(full))
                rows = rows.reshape(len(full), per_tick, -1)
                starts = first + per_tick * np.arange(len(full))
                fields = (starts, self.rig.row_period, *rows.shape[1:], rows.reshape(len(full), -1))
                out.append(self._column(BLOCK, rank, full, *fields, stamps=starts // per_sample * SAMPLE_NS))
                angles[ticks > 0] = self.states.turn(rows)
            rank += 1
        scalars = ticks % SCALAR_SAMPLES == 0
        return out + self._of_transducers(rank, ticks[scalars], angles[scalars])

    def _of_commands(self, boundaries: Ints) -> list[Column]:
        """The commands of the embedded controller, or those that came from outside."""
        if not self.commands:
            return []
        if self.rig.embedded:
            answered = boundaries[boundaries > 0] - 1
            if not len(answered):
                return []
            fields = self._law(int(answered[0]), len(answered))
            return [self._column(CONTROLLER_COMMAND, COMMAND, answered + 1, *fields, stamps=answered * SAMPLE_NS)]
        return [
            _one((at - self._before) * RANKS + COMMAND, *self._message(CONTROLLER_COMMAND, answered * SAMPLE_NS, *fields))
            for at, answered, fields in self._commands
        ]

    def _law(self, first: int, count: int) -> tuple[Any, ...]:
        """The fields of the embedded controller's commands that answer samples, as States.command has them."""
        rows = self.rig.law_commands(first, count)
        outputs = (rows.shape[1] - 2) // 2
        level, flags = self.states.command()[3:5]
        gear, shifting = rows[:, 0].astype(np.int64), rows[:, 1] > 0.0
        return (first + np.arange(count), gear, shifting, level, flags, rows[:, 2 : 2 + outputs], rows[:, 2 + outputs :])

    def _seen(self, samples: Ints) -> tuple[Any, ...]:
        """The fields of what the controller measures at samples."""
        fields = []
        for values in self.rig.seen(self._rows(samples).T):
            fields.append(np.empty((len(samples), len(values))))
            for k, value in enumerate(values):
                fields[-1][:, k] = value
        return samples, *fields

    def _rows(self, samples: Ints) -> np.ndarray:
        """The rows (n, channels) of samples that follow each other at the same distance, in the ring itself."""
        stride = int(samples[1] - samples[0]) if len(samples) > 1 else 1
        return self.rig.rows_in_ring(stride * SAMPLE, int(samples[0]) // stride, len(samples))

    def _of_states(self, rank: int, ticks: Ints) -> list[Column]:
        """The state messages of ticks."""
        out = []
        for k, topic in enumerate(self.states.topics):
            if topic in self._in_blocks:
                fields = self._in_blocks[topic]()
                out.append(self._column(topic, rank + 1 + k, ticks, *fields))
                self._readings.fields[topic] = _at(-1, fields)
            else:
                rows = zip(ticks.tolist(), self._at_ticks[topic])
                out += [
                    _one((at - self._before) * RANKS + rank + 1 + k, *self._message(topic, at * SAMPLE_NS, *fields))
                    for at, fields in rows
                ]
        return out

    def _of_transducers(self, rank: int, samples: Ints, angles: np.ndarray) -> list[Column]:
        """What each transducer shows at samples, and the same in messages for other tools."""
        if not len(samples):
            return []
        rows, count = self._rows(samples), len(samples)
        places, stamps = (samples - self._before) * RANKS + rank, samples * SAMPLE_NS
        seqs = self._rounds + np.arange(count)
        self._rounds += count
        out = []
        if times := len(self._columns):  # all have the same stamps and numbers
            values = rows[:, self._columns].T.ravel()
            data = encoder(MEASUREMENT).encode_block(np.tile(stamps, times), np.tile(seqs, times), values)
            for k, topic in enumerate(self.states.measured):
                self.counts[topic] = self._rounds
                out.append(Column(topic, places + k, stamps, data[k * count : (k + 1) * count]))
        places = places + len(out)
        for k, (topic, form, values) in enumerate(self._mirrors):
            self.counts[topic] = self.counts.get(topic, 0) + count
            data = form.encode_block(stamps, *values(rows.T, angles.T, self._noise.__getitem__))
            out.append(Column(topic, places + k, stamps, data))
        return out

    def _column(self, topic: str, rank: int, samples: Ints, *fields: Any, stamps: Ints | None = None) -> Column:
        """Messages of a topic at the boundaries of samples, each field an array (n, ...) or the same in all of them."""
        first = self.counts.get(topic, 0)
        self.counts[topic] = first + len(samples)
        stamps = samples * SAMPLE_NS if stamps is None else stamps
        data = encoder(self._types[topic]).encode_block(stamps, first + np.arange(len(samples)), *fields)
        return Column(topic, (samples - self._before) * RANKS + rank, stamps, data)


def _at(place: int, fields: Iterable[Any]) -> tuple:
    """The fields of one of several messages."""
    return tuple(value[place] if isinstance(value, np.ndarray) else value for value in fields)


def _one(place: int, topic: str, stamp: int, data: bytes) -> Column:
    """A column of one message."""
    return Column(topic, np.array([place]), np.array([stamp]), np.frombuffer(data, np.uint8)[None])
