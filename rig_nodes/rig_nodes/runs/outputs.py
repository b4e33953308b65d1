# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the rig publishes and when: from the rig's state to encoded messages, without ROS.

The nodes of the rig container publish the messages, and runs.bag_outputs writes the same bytes for runs without listeners.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from itertools import repeat
from typing import Any

import numpy as np

from ..bags import encoder
from ..base import SAMPLE, SAMPLE_NS, TICK_SAMPLES
from ..controllers import Plug, own_signals
from ..rig import CONTROLLER_COMMAND, WARNING
from .cuts import topic_of
from .rig import Rig
from .topics import SCALAR_SAMPLES, Readings, States

MEASUREMENT = "rig_msgs/msg/Measurement"
BLOCK = "/instruments/hmg4000"


class Outputs:
    """The messages that are due at each sample boundary, with their sequence numbers.

    Parameters
    ----------
    rig : Rig
        The rig whose state is sent.
    run_info : dict
        The record of the run.
    commands : bool, optional
        True to send /controller/command too, where no node of the controller publishes it; by default that is done for an
        embedded controller.
    controller : Plug, optional
        The plug whose own signals are sent too.
    """

    def __init__(self, rig: Rig, run_info: dict, commands: bool | None = None, controller: Plug | None = None) -> None:
        self.rig, self.states, self._readings = rig, States(rig), Readings(rig.config.catalogue)
        self.commands = rig.embedded if commands is None else commands
        self._answered = -1  # sample of the newest command that went out
        self._cut_answered = dict.fromkeys(rig.cuts.devices, -1)  # the same for the answer of each cut device inside
        self.counts: dict[str, int] = {}
        self._types = {name: topic.ros_type for name, topic in rig.config.catalogue.all_topics.items()}
        self._encoders: dict[str, Callable] = {}
        self._queued: list[tuple] = []
        self._columns, self._rounds = list(self.states.measured.values()), 0  # of the transducers, and how often they went out
        self._run_info = run_info
        self._mirrors = self.states.mirrors()
        self._status, self._started = rig.status, False
        self._own = dict(controller.signals) if controller is not None else {}
        self._own_blocks = own_signals.Blocks(len(self._own))

    def reading(self, name: str) -> float:
        """Return the newest value of a signal that was sent [SI], as a listener has it; NaN before the first."""
        return self._readings.reading(name)

    def period(self, name: str) -> int:
        """Return the number of controller samples between two messages with a signal."""
        return self.states.period(self._readings.topic(name))

    def event(self, topic: str, name: str, text: str, value: float = 0.0) -> None:
        """Queue an event of the present time; it is sent with the next :meth:`due`."""
        self._queued.append((topic, self.rig.time_ns, name, text, float(value)))

    def signals_row(self, sample: int, values: Sequence[float]) -> None:
        """Queue the controller's own signals at its answer to a sample; they are sent in blocks."""
        for first, rows in self._own_blocks.add(sample, values):
            fields = first, SAMPLE, *rows.shape, rows.ravel()
            self._queued.append((own_signals.BLOCK, first * SAMPLE_NS, *fields))

    def setpoint(self, topic: str, value: float, enable: bool) -> None:
        """Queue a setpoint of the present time, where no sequencer node publishes it."""
        self._queued.append((topic, self.rig.time_ns, float(value), bool(enable)))

    def due(self) -> Iterator[tuple[str, int, bytes]]:
        """Yield all messages that are due now; it is called once at time 0 and once after each sample.

        Yields
        ------
        topic : str
            Topic of the message.
        stamp : int
            Its time stamp [ns].
        data : bytes
            The encoded message.
        """
        rig, now, sample = self.rig, self.rig.time_ns, self.rig.sample
        if not self._started:
            yield from self._once()
        answered = rig.newest_command
        if self.commands and answered > self._answered:
            self._answered = answered
            yield self._message(CONTROLLER_COMMAND, answered * SAMPLE_NS, *self.states.command())
        self._watch_status()
        self._watch_faults()
        if self._queued or rig.cuts.devices:
            yield from self._unforeseen()
        for topic, fields in self.states.each_sample():
            yield self._message(topic, now, *fields)
        if sample % TICK_SAMPLES == 0:
            self.states.refresh()
            for topic, fields in self.states.topics.items():
                yield self._message(topic, now, *fields())
            if sample > 0:
                first, rows = rig.take_rows(rig.rows_per_sample * TICK_SAMPLES)
                self.states.turn(rows[None])
                stamp = first // rig.rows_per_sample * SAMPLE_NS
                yield self._message(BLOCK, stamp, first, rig.row_period, *rows.shape, rows.ravel())
        if sample % SCALAR_SAMPLES == 0:
            row = rig.row()
            yield from self._measured(now, row)
            shown = row.tolist()
            for topic, mirror, values in self._mirrors:
                self.counts[topic] = self.counts.get(topic, 0) + 1
                yield topic, now, mirror.encode(now, *values(shown, self.states.angles, rig.gauges.effective))

    def _once(self) -> Iterator[tuple[str, int, bytes]]:
        """What is sent when time begins: the record of the run, and what the numbers of other messages mean."""
        self._started = True
        rig, now = self.rig, self.rig.time_ns
        yield self._message("/rig/run_info", now, json.dumps(self._run_info, sort_keys=True))
        names = rig.logger_names
        units = [rig.config.catalogue.signal(name).unit for name in names]
        yield self._message("/instruments/channels", now, names, units, rig.row_period)
        for topic, fields in self.states.once():
            yield self._message(topic, now, *fields)
        if self._own:
            names, units = list(self._own), list(self._own.values())
            yield self._message(own_signals.CHANNELS, now, names, units, SAMPLE)

    def _unforeseen(self) -> Iterator[tuple[str, int, bytes]]:
        """What has no fixed rate: the ends of cuts, and the events and setpoints that were queued."""
        if self.rig.cuts.devices:
            yield from self._cuts(self.rig.time_ns)
        for topic, stamp, *values in self._queued:
            yield self._message(topic, stamp, *values)
        self._queued.clear()

    def _cuts(self, now: int) -> Iterator[tuple[str, int, bytes]]:
        """The ports of the devices outside the plant, and the answers of those that have no node of their own."""
        cuts = self.rig.cuts
        for device in cuts.devices:
            answered, answer = cuts.answered(device)
            if cuts.embedded and answered > self._cut_answered[device]:
                self._cut_answered[device] = answered
                yield self._message(topic_of(device, "answer"), answered * SAMPLE_NS, answered, *answer)
            if cuts.is_due():
                yield self._message(topic_of(device, "port"), now, self.rig.sample, *cuts.port(device))

    def _measured(self, now: int, row: np.ndarray) -> Iterator[tuple[str, int, bytes]]:
        """What each transducer shows, from a logger row (channels,); these messages are the most and go out together."""
        numbers, topics, seq = row[self._columns], self.states.measured, self._rounds
        self._rounds += 1
        self.counts.update(dict.fromkeys(topics, self._rounds))
        self._readings.fields.update(zip(topics, zip(numbers.tolist())))
        return zip(topics, repeat(now), encoder(MEASUREMENT).encode_each(now, seq, numbers))

    def _message(self, topic: str, stamp: int, *values: Any) -> tuple[str, int, bytes]:
        encode = self._encoders.get(topic)
        if encode is None:
            encode = self._encoders[topic] = encoder(self._types[topic]).encode
        seq = self.counts.get(topic, 0)
        self.counts[topic] = seq + 1
        self._readings.fields[topic] = values
        return topic, stamp, encode(stamp, seq, *values)

    def _watch_faults(self) -> None:
        if self.rig.faults is not None:
            for news in self.rig.faults.take_news():
                self.event("/rig/events", news.name, news.text, news.value)

    def _watch_status(self) -> None:
        for stamp, sentence, value in self.rig.warnings:
            self._queued.append(("/rig/events", stamp, WARNING, sentence, value))
        self.rig.warnings.clear()
        status = self.rig.status
        if status != self._status:
            self._status = status
            self.event(
                "/rig/events", f"rig_{status.name.lower()}", self.rig.reason or f"the rig is {status.name.lower()}", float(status)
            )
