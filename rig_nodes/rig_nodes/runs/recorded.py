# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Run a sequence on the rig and keep the logger's rows in memory: no ROS, no bag, no encoding.

runs.procedure uses it for campaigns; the rows are the same, bit for bit, as in the bag of ``simulate``.
"""

from __future__ import annotations

import ctypes
from dataclasses import dataclass, field
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from ..analysis import Moment
from ..bags import Logged, Recording
from ..base import SAMPLE, TICK_SAMPLES, RigError
from ..controllers import Plug
from ..plant import part as parts
from ..rig import CONTROLLER_COMMAND, SHIFT_ORDERED, WARNING, RigConfig
from .rig import Rig
from .rig_base import RigStatus
from .sequence import Sequence
from .sequence_runner import SequenceFailed
from .simulation import AFTER_TRIP, advance_with, next_poll, rig_for, runner_on
from .topics import SCALAR_SAMPLES, Readings, States

if TYPE_CHECKING:
    from collections.abc import Iterator

    from .sequence_runner import SequenceRunner

CHUNK = 500  # controller samples between two looks into the ring of rows, which holds at least 1.9 s
FIRST_ROWS = 300_000  # for which there is room at first: 30 s at 10 kHz; memory that is not written costs nothing
KEPT_MEMORY = 1 << 28  # bytes that are freed and yet kept for the next run


@dataclass(frozen=True)
class Run:
    """The result of a recorded run.

    Parameters
    ----------
    recording : Recording or Logged
        All channels of the rig [SI]; of a rig with gears with the orders of gear.
    end : dict
        ``state`` (ended, failed, tripped) and ``reason``.
    events : list of (float, str, str, float)
        Time [s], name, text and value of each event of sequencer and controller, and of each warning of a trip.
    plant_states : dict of str to (rows,) array
        By signal, its true values on the rows of the recording [SI]. They are taken once a controller sample, so all rows of
        that millisecond have the same value.
    at_orders : dict of float to Moment
        How the rig stood at each order of a gear, by its time [s].
    """

    recording: Recording | Logged
    end: dict
    events: list[tuple[float, str, str, float]] = field(default_factory=list)
    plant_states: dict[str, np.ndarray] = field(default_factory=dict)
    at_orders: dict[float, Moment] = field(default_factory=dict)


class PlantStates:
    """Signals of the state topics and of the controller's commands, taken once a controller sample."""

    def __init__(self, rig: Rig, signals: tuple[str, ...]) -> None:
        self.signals, self._states, self._readings = signals, States(rig), Readings(rig.config.catalogue)
        self._fields = self._states.topics | ({CONTROLLER_COMMAND: self._states.command} if rig.shifts else {})
        self._topics = sorted({self._readings.topic(name) for name in signals})
        unknown = [name for name in signals if self._readings.topic(name) not in self._fields]
        if unknown:
            raise RigError(
                f"{', '.join(unknown)}: only signals of state topics and of {CONTROLLER_COMMAND} are known without a "
                "transducer; ./rig list signals lists them"
            )
        self._values: list[list[float]] = []

    def note(self) -> None:
        """Keep the present values."""
        self._states.refresh()
        for topic in self._topics:
            self._readings.fields[topic] = self._fields[topic]()
        self._values.append([self._readings.reading(name) for name in self.signals])

    def on_rows(self, rows: int, per_sample: int) -> dict[str, np.ndarray]:
        """Return the values (rows,) of each signal, with each sample repeated ``per_sample`` times."""
        values = np.repeat(np.array(self._values).reshape(-1, len(self.signals)), per_sample, axis=0)[:rows]
        return dict(zip(self.signals, np.ascontiguousarray(values.T)))


class Listener:
    """A listener on the topics for a sequence that needs readings, which also keeps what the sequence's bench sends.

    It takes the place of Outputs: it publishes nothing, but gives readings as if all had been published.

    Parameters
    ----------
    rig : Rig
        The rig on which the sequence runs.
    signals : list of str
        Signals that will be read; others of transducers may be read too.
    plant_states : PlantStates, optional
        Takes true values at each sample.
    controller : Plug, optional
        A plug in place of the embedded controller.

    Raises
    ------
    RigError
        When a recorded sequence cannot wait for the topic of a signal.
    """

    def __init__(
        self, rig: Rig, signals: list[str], plant_states: PlantStates | None = None, controller: Plug | None = None
    ) -> None:
        """Find the topics of the signals; the class describes the parameters."""
        self.rig, self.plant_states, self.controller, self.events, self.orders = rig, plant_states, controller, [], []
        self.at_orders: dict[float, Moment] = {}
        self._states, self._readings = States(rig), Readings(rig.config.catalogue)
        topics = {self._readings.topic(name) for name in signals}
        self._command = CONTROLLER_COMMAND in topics
        self._ticked = sorted(topics & self._states.topics.keys())
        unknown = topics - {CONTROLLER_COMMAND} - self._states.topics.keys() - self._states.measured.keys()
        if unknown:
            raise RigError(f"{', '.join(sorted(unknown))}: no topic that a recorded sequence can wait for")

    def period(self, signal: str) -> int:
        """Return the number of controller samples between two messages with this signal."""
        return self._states.period(self._readings.topic(signal))

    def reading(self, name: str) -> float:
        """Return the reading of Outputs.reading; called at a tick, before any message of that tick is sent."""
        topic = self._readings.topic(name)
        if topic in self._states.measured and self.rig.sample:
            newest = (self.rig.sample - 1) // SCALAR_SAMPLES * SCALAR_SAMPLES
            self._readings.fields[topic] = (self.rig.row_of(newest)[self._states.measured[topic]],)
        return self._readings.reading(name)

    def present(self, name: str) -> float:
        """Return the true value of a signal of a state topic, or of the controller's commands, at this moment [SI]."""
        topic = self._readings.topic(name)
        self._states.refresh()
        self._readings.fields[topic] = self._states.command() if topic == CONTROLLER_COMMAND else self._states.topics[topic]()
        return self._readings.reading(name)

    def advance(self, samples: int) -> None:
        """Move the rig by a whole number of ticks [samples] and receive what is sent on the way."""
        if self._ticked:
            self._go(samples - TICK_SAMPLES)
            samples = TICK_SAMPLES
            self._states.refresh()
            for topic in self._ticked:
                self._readings.fields[topic] = self._states.topics[topic]()
        if self._command:
            self._go(samples - 1)
            samples = 1
            self._readings.fields[CONTROLLER_COMMAND] = self._states.command()
        self._go(samples)
        self.events += [(stamp / 1e9, WARNING, sentence, value) for stamp, sentence, value in self.rig.warnings]
        self.rig.warnings.clear()

    def _go(self, samples: int) -> None:
        if self.plant_states is None and self.controller is None:
            self.rig.advance_samples(samples)
            return
        for _ in range(samples):
            if self.controller is not None and self.rig.status == RigStatus.TRIPPED:
                return
            if self.plant_states is not None:
                self.plant_states.note()
            if self.controller is None:
                self.rig.advance_samples(1)
            else:
                advance_with(self.rig, self.controller)

    def event(self, topic: str, name: str, text: str, value: float = 0.0) -> None:
        """Keep an event of the present time."""
        now = self.rig.time_ns / 1e9
        self.events.append((now, name, text, float(value)))
        if name == SHIFT_ORDERED:
            before = self.orders[-1][2] if self.orders else 0
            self.orders.append((now, before, int(value)))
            self.at_orders[now] = moment_of(self.rig)

    def setpoint(self, topic: str, value: float, enable: bool) -> None:
        """Ignore a setpoint that the rig has taken, because it has no other listener here."""


def moment_of(rig: Rig) -> Moment:
    """Return how a rig stands now, for the state at an order of its report."""
    structure = rig.config.structure
    oils = [float(rig.device(one.name)["oil_temperature"]) for one in structure.of_role(parts.OIL)]
    found: dict[str, dict[str, float]] = {"piston": {}, "temperature": {}, "empty": {}}
    for clutch in structure.clutches:
        device = rig.device(clutch.name)
        for name, values in found.items():
            if name in (device.dtype.names or ()):
                values[clutch.called] = float(device[name])
    return Moment(oils[0] if oils else None, found["piston"], found["temperature"], found["empty"])


@cache
def keep_freed_memory() -> None:
    """Make the C library keep freed memory: the system returns it page by page, which costs 40 ns for each row of a run."""
    trim_threshold, mmap_threshold = -1, -3  # numbers of malloc.h
    mallopt = ctypes.CDLL(None).mallopt
    mallopt(mmap_threshold, KEPT_MEMORY >> 3)  # 32 MB, the most that it takes
    mallopt(trim_threshold, KEPT_MEMORY)


class Rows:
    """Collects the rows of a rig before its ring overwrites them.

    Parameters
    ----------
    rig : Rig
        The rig that makes the rows.
    period : float
        Time from row to row [s].

    Raises
    ------
    RigError
        When the period does not divide a controller sample, or is not a whole number of the plant's steps.
    """

    def __init__(self, rig: Rig, period: float) -> None:
        self.rig, self.period = rig, period
        self.per_sample = round(SAMPLE / period)
        if abs(self.per_sample * period - SAMPLE) > 1e-12 or self.per_sample < 1:
            raise RigError(f"rows every {period * 1e6:g} us do not fit into samples of 1000 us; take e.g. 100 us or 8 us")
        count = rig.rows_in_ring(period, 0, 0).shape[1]  # raises for a period that is not a whole number of steps
        keep_freed_memory()
        # one array for each channel: Linux may need 0.1 s to find the huge pages for a single large one
        self._columns = [np.empty(FIRST_ROWS) for _ in range(count)]
        self._taken = 0

    def take(self, sample: int) -> None:
        """Take the rows before that of a sample."""
        first, last = self._taken, sample * self.per_sample
        if last > self._columns[0].size:
            for number, column in enumerate(self._columns):
                self._columns[number] = np.empty(2 * last)
                self._columns[number][:first] = column[:first]
        rows = self.rig.rows_in_ring(self.period, first, last - first)
        for number, column in enumerate(self._columns):
            column[first:last] = rows[:, number]
        self._taken = last

    def keep_up(self, sample: int) -> None:
        """Take the rows before that of a sample where CHUNK samples are waiting: every copy costs as much as some 500 numbers."""
        if sample * self.per_sample - self._taken >= CHUNK * self.per_sample:
            self.take(sample)

    def channels(self) -> dict[str, np.ndarray]:
        """Return the values (rows,) of each channel [SI]."""
        return {name: column[: self._taken] for name, column in zip(self.rig.channels, self._columns)}


def record(
    config: RigConfig,
    sequence: Sequence,
    seed: int = 1,
    rows_per_second: int | None = None,
    period: float | None = None,
    plant_states: tuple[str, ...] = (),
    controller: Plug | None = None,
    delay: int = 1,
) -> Run:
    """Run a sequence on a rig and keep its rows.

    A sequence that fails keeps what was recorded until then. Rows are taken as they are and not averaged.

    Parameters
    ----------
    config : RigConfig
        The rig's configuration.
    sequence : Sequence
        The sequence to run.
    seed : int
        Seed of the run.
    rows_per_second : int, optional
        Rows in a second; by default as many as the rig's logger records.
    period : float, optional
        Time from row to row [s] in place of ``rows_per_second``, e.g. 8e-6 with a ``kernel.step`` of 8 us for every row of the
        kernel, as of the NI-USB 6210.
    plant_states : tuple of str
        Signals of the state topics and of the controller's commands to take too, e.g. ("s1_torque", "gear_ordered"); a run with any
        of them takes twice as long.
    controller : Plug, optional
        A plug in place of the embedded Alfa46, as :func:`simulate` takes it; it is closed at the end.
    delay : int
        Number of samples after which the plug's answers act.

    Returns
    -------
    Run
        The recorded run.

    Raises
    ------
    RigError
        When the rows and the plant's steps do not fit.
    """
    if period is None:
        period = 1.0 / (rows_per_second or config.instruments.logger_rate)
    try:
        return _record(config, sequence, seed, period, plant_states, controller, delay)
    finally:
        if controller is not None:
            controller.close()


def _record(
    config: RigConfig,
    sequence: Sequence,
    seed: int,
    period: float,
    plant_states: tuple[str, ...],
    controller: Plug | None,
    delay: int,
) -> Run:
    rig = rig_for(config, seed, controller, delay)
    known = PlantStates(rig, plant_states) if plant_states else None
    listener = Listener(rig, signals_of(sequence), known, controller)
    runner = runner_on(rig, listener, config, sequence, controller)
    rows = Rows(rig, period)
    end = {"state": "ended", "reason": "the sequence ended"}
    listener.advance(TICK_SAMPLES)
    try:
        for _ in played(rig, listener, runner):
            rows.keep_up(rig.sample)
        if rig.status == RigStatus.TRIPPED:
            end = {"state": "tripped", "reason": rig.reason, "trip": rig.tripped_by}
            rows.take(rig.sample)
            listener.controller = None  # it is not asked any more
            listener.advance(AFTER_TRIP)
        rows.take(rig.sample)
    except SequenceFailed as failure:
        end = {"state": "failed", "reason": str(failure)}
        rows.take(rig.sample - TICK_SAMPLES)  # as simulate, which publishes nothing more at this tick
    channels = rows.channels()
    recording = (
        Recording(0.0, period, channels, listener.orders, config.transmission)
        if config.structure.gears
        else Logged(0.0, period, channels)
    )
    on_rows = known.on_rows(recording.rows, rows.per_sample) if known else {}
    return Run(recording, end, listener.events, on_rows, listener.at_orders)


def played(rig: Rig, listener: Listener, runner: SequenceRunner) -> Iterator[None]:
    """Move a rig through a sequence, to its end or until the rig trips.

    Parameters
    ----------
    rig : Rig
        The rig.
    listener : Listener
        Moves the rig and receives what is sent.
    runner : SequenceRunner
        The runner of the sequence.

    Yields
    ------
    None
        Before each part of at most CHUNK samples; the orders that are due have been given.

    Raises
    ------
    SequenceFailed
        When a step does not end in time.
    """
    while rig.status != RigStatus.TRIPPED and not runner.poll(rig.time):
        upto = next_poll(runner, rig, listener.period, listener.controller)
        while rig.sample < upto and rig.status != RigStatus.TRIPPED:
            yield
            listener.advance(min(upto - rig.sample, CHUNK))


def signals_of(sequence: Sequence) -> list[str]:
    """Return the signals that a sequence waits for."""
    return [step.condition.signal for step in sequence.steps if step.condition is not None]
