# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The base of every rig that is moved sample by sample: the engine's world, simulated time, the ring of rows and the status.

runs.rig derives from it; only this module calls the engine.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from enum import IntEnum
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from ..base import SAMPLE, SAMPLE_NS, TICK_SAMPLES, RigError, brief, meant
from ..driveline import ANGLE, KIN1, LAM, WORST
from ..plant import (
    BY_DUTY,
    NOISE,
    NONE,
    NOT_SETTLED,
    TRIPPED,
    WARNED,
    WHOLE,
    GaugeArrays,
    Law,
    Plan,
    Plant,
    Rings,
    World,
    addresses,
    advance,
    compiling_in_parallel,
    shown_dtype,
)
from ..plant import alfa46_law as law
from ..rig import NO_NUMBER, RED_BUTTON, UNSETTLED, Catalogue, Trip
from .gauges import Gauges
from .trips import Tripped, not_finite, not_settled
from .watch import Watched

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

LOG_SAMPLES = 2_000  # rings of rows, of the embedded controller's commands and of the state at each tick: 2 s


class RigStatus(IntEnum):
    """The states of a rig, as in rig_msgs/RigState."""

    STARTING = 0
    READY = 1
    RUNNING = 2
    TRIPPED = 3


class RigBase(ABC):
    """A rig that is moved sample by sample; it calls :meth:`count_steps` and :meth:`build` before time passes.

    Attributes
    ----------
    channels : tuple of str
        Names of the columns of a row, those of the logger first.
    sample : int
        Number of controller samples since time 0.
    row_period : float
        Time from row to row of the logger [s].
    rows_per_sample : int
        Number of the logger's rows in a controller sample.
    reason : str
        Reason of a trip.
    tripped_by : str
        Name of the trip; empty when there is none.
    warnings : list of (int, str, float)
        Warnings that nobody has taken yet: simulated time [ns], sentence, value [SI].
    world : World
        What the engine moves.
    drive : str
        Name of the device that drives the rig.
    """

    channels: tuple[str, ...]
    drive = "motor"

    def count_steps(self, step: float, rate: float, catalogue: Catalogue) -> None:
        """Compute how many of the plant's steps and of the logger's rows make a controller sample.

        Parameters
        ----------
        step : float
            Time by which the plant moves at once [s], checked by rig.cross_checks, as the next one.
        rate : float
            Rows per second of the logger [1/s].
        catalogue : Catalogue
            The rig's catalogue; the columns of its logger are the first of ``channels``.
        """
        self.step_ns, self.step, self.sample = SAMPLE_NS, step, 0
        self._steps_per_sample = round(SAMPLE / step)
        self.row_period, self.rows_per_sample = 1.0 / rate, round(rate * SAMPLE)
        self._drained = 0  # logger rows handed out
        self.reason, self.tripped_by, self.stopped_by_person = "", "", False
        self.warnings: list[tuple[int, str, float]] = []
        self.logger_names = [s.name for s in catalogue.logger_channels()]

    def build(self, plan: Plan, gauges: Gauges, trips: Sequence[Trip] = ()) -> None:
        """Make the world and the first row.

        Parameters
        ----------
        plan : Plan
            The rig's plan.
        gauges : Gauges
            The transducers of the plan's channels.
        trips : sequence of Trip
            What is watched.

        Raises
        ------
        RigError
            When the first channels are not the columns of the logger.
        """
        self.world, self.gauges, self.channels = World(plan), gauges, tuple(plan.channels)
        if self.logger_names != list(self.channels[: len(self.logger_names)]):
            raise RigError(f"the logger's columns {self.logger_names} are not those of the rig, {self.channels}")
        self._safe = memoryview(self.world.record["safe"])
        self._enabled = self.device(self.drive)
        self.v, self.mode = self.world.line["v"], self.world.line["mode"]
        self._by = BY_DUTY
        self._law_config, self._law_profiles = np.zeros(1, law.LAW_CONFIG), np.zeros((law.OUTPUTS, 6, 2))
        self._law_outputs, self._law_state = np.zeros(plan.outputs, law.LAW_OUTPUT), np.zeros(1, law.LAW_STATE)
        self._commands = np.zeros((LOG_SAMPLES, 2 + 2 * plan.outputs))
        self._moments = np.zeros((LOG_SAMPLES // TICK_SAMPLES, len(self.world.moved)), np.int64)
        self._capacities = np.zeros((len(self._moments), len(plan.system.elements)))
        self._log = np.zeros((LOG_SAMPLES * self._steps_per_sample, len(self.channels)), order="F")
        count = len(self.channels) - plan.untouched
        self._shown = np.zeros(1, shown_dtype(count, plan.untouched, len(plan.encoders)))
        self._shown["present"], self._shown["source"] = gauges.present, self.world.source[:count]
        self._shown["untouched_source"] = self.world.source[count:]
        self._shown["encoder"] = [self.channels.index(name) for name in plan.encoders]
        world, steps = self.world, self._steps_per_sample
        self._plant = Plant(world.record, world.numbers, world.moved, world.finite, world.kept, self.step, steps, NONE)
        self._gauges = GaugeArrays(self._shown, *gauges.arrays)
        self._law = Law(self._law_config, self._law_profiles, self._law_outputs, self._law_state)
        self.watched = Watched(trips, world, gauges.table[NOISE])
        self._rings = Rings(self._log, self._commands, self._moments, self._capacities)
        with compiling_in_parallel(plan.driven):
            self.sample = -1
            self.sample, _ = self._advance(1)
        self._plant = self._plant._replace(addresses=addresses(plan.driven))

    def move(self, samples: int) -> bool:
        """Move by a number of samples; False when the plant trips the rig. A tripped rig moves on as far as it can."""
        end, world = self.sample + samples, self.world
        while self.sample < end:
            self.sample, how = self._advance(end - self.sample)
            if how == WARNED:
                self._warn()
            elif how != WHOLE and self.status != RigStatus.TRIPPED:
                self.trip_for(how, world.names, world.kept[1, : world.finite].view(float))
                return False
        return True

    @cached_property
    def _compiled(self) -> Callable[..., tuple[int, int]]:
        return advance.entry_for(0, self.sample, self._by, self._plant, self._gauges, self._law, self._rings, self.watched.arrays)

    def _advance(self, samples: int) -> tuple[int, int]:
        return self._compiled(
            samples, self.sample, self._by, self._plant, self._gauges, self._law, self._rings, self.watched.arrays
        )

    def device(self, name: str) -> np.void:
        """Return the states of a device by its name [SI], which can be read and set."""
        return self.world.state(name)

    def true(self, what: str) -> float:
        """Return a true number of the plant by its name in the rig's plan: "M_wyj", "wk.speed", "clutch_s1.pressure"."""
        return float(self.world.numbers[self.world.number(what)])

    def shown_truly(self, channel: str) -> float:
        """Return the true number that a channel shows [SI]."""
        return float(self.world.numbers[self.world.source[self.channels.index(channel)]])

    @property
    def safe(self) -> bool:
        """True in the safe state."""
        return self._safe[0] > 0.0

    @property
    @abstractmethod
    def status(self) -> RigStatus:
        """The rig's present state, as in rig_msgs/RigState."""

    def trip(self, reason: str, name: str) -> None:
        """Go into the safe state: no coil has current, the drive no torque, and the load's relief valve is open.

        All three begin with the next step. The first reason stays until the reset.

        Parameters
        ----------
        reason : str
            The sentence for people.
        name : str
            Name of the trip, of the rig's trips or of runs.trips.
        """
        if self.status != RigStatus.TRIPPED:
            self.reason, self.tripped_by = reason, name
        self._safe[0] = 1.0
        self._enabled["enabled"] = 0.0

    def trip_for(self, how: int, names: list[str], values: np.ndarray) -> None:
        """Trip for a sample in which a trip fired, or over which the plant could not be moved.

        Parameters
        ----------
        how : int
            The outcome of the step, of plant.engine.outcome and not WHOLE.
        names : list of str
            Names of the values.
        values : (n,) array of float
            The values that resulted.
        """
        when = f"between {self.time - SAMPLE:.3f} s and {self.time:.3f} s"
        if how == TRIPPED:
            self._warn()
            self.trip(*self.watched.reason(self.time))
        elif how == NOT_SETTLED:
            self.trip(not_settled(when, self.world.plan.driven, self._worst()), UNSETTLED)
        else:
            self.trip(not_finite(when, names, values), NO_NUMBER)

    def _worst(self) -> str:
        """Return the element that settled least and its values, in words; empty where none stands out."""
        line, system, worst = self.world.line, self.world.plan.system, int(self.world.line["count"][WORST])
        if worst < 0:
            return ""
        if worst < len(system.elements):
            slip, torque = float(system.w[worst] @ line["v"]), float(line["el"][LAM, worst])
            return f"'{system.elements[worst]}' with a slip of {slip:.4g} rad/s and {torque:.4g} Nm"
        k = worst - len(system.elements)
        law = system.laws[k]
        at = f"{line['at'][k]:.4g} rad" if law.by == ANGLE else f"{float(law.of @ line['v']):.4g} rad/s"
        return f"'{law.name}' at {at}"

    def _warn(self) -> None:
        """Keep the warnings of this sample until they are taken."""
        self.warnings += [(self.time_ns, sentence, value) for sentence, value in self.watched.warnings(self.time)]

    def e_stop(self) -> None:
        """Press the red button: go into the safe state, which only ``reset`` ends."""
        self.stopped_by_person = True
        self._safe[0] = 0.0  # a person's stop replaces whatever tripped before
        self.trip("emergency stop", RED_BUTTON)

    def check_runs(self) -> None:
        """Raise Tripped when the rig is in its safe state."""
        if self.status == RigStatus.TRIPPED:
            raise Tripped(f"the rig tripped: {self.reason}")

    def check_tripped(self) -> None:
        """Raise RigError when the rig is not in its safe state."""
        if self.status != RigStatus.TRIPPED:
            raise RigError("the rig is not in its safe state; nothing done")

    @abstractmethod
    def advance_samples(self, samples: int = 1) -> None:
        """Move by a number of controller samples."""

    @property
    def time_ns(self) -> int:
        """Simulated time since the start [ns]."""
        return self.sample * SAMPLE_NS

    @property
    def time(self) -> float:
        """Simulated time since the start [s]."""
        return self.sample * SAMPLE

    def advance(self, seconds: float) -> None:
        """Advance by a time [s] that is a whole number of controller samples (1 ms); RigError for any other time."""
        self.advance_samples(self.samples_in(seconds))

    @staticmethod
    def samples_in(seconds: float) -> int:
        """Return the number of controller samples in a time [s]; RigError for one that is not a whole number of them."""
        samples = seconds / SAMPLE
        if not (math.isfinite(samples) and abs(samples - round(samples)) <= 1e-6 and samples >= 0):
            raise RigError(f"cannot advance by {seconds} s: expected a whole number of milliseconds")
        return round(samples)

    def row(self) -> np.ndarray:
        """Return the newest logger row (channels,), with the columns of ``channels`` [SI]."""
        return self.row_of(self.sample)

    def row_of(self, sample: int) -> np.ndarray:
        """Return the row (channels,) of a controller sample of the last two seconds [SI]."""
        return self._log[(sample * self._steps_per_sample) % len(self._log)]

    def law_commands(self, first: int, count: int) -> np.ndarray:
        """Return the commands of the embedded controller that answer samples of the last two seconds.

        Parameters
        ----------
        first : int
            The first sample.
        count : int
            Number of samples.

        Returns
        -------
        (count, 2 + 2 outputs) array of float
            Gear, 1 while it shifts, duty of each output, setpoint of each output [A].
        """
        return self._commands[(first + np.arange(count)) % LOG_SAMPLES]

    def keep_moment(self) -> None:
        """Keep the present state, at a tick, once more: setpoints and settings have changed it since the step."""
        place = (self.sample // TICK_SAMPLES) % len(self._moments)
        self._moments[place], self._capacities[place] = self.world.moved, self.world.line["cap"][KIN1]

    def moments(self, first: int, count: int) -> tuple[np.ndarray, np.ndarray]:
        """Return the states at ticks of the last two seconds.

        Parameters
        ----------
        first : int
            The first tick.
        count : int
            Number of ticks.

        Returns
        -------
        kept : (count, size) array of int64
            What a step leaves to the next one, as ``World.moved``.
        capacities : (count, elements) array of float
            Friction torque that each element of the driveline could carry while it slips [Nm].
        """
        places = (first + np.arange(count)) % len(self._moments)
        return self._moments[places], self._capacities[places]

    def measurement(self, name: str) -> float:
        """Return the newest value of a transducer, as the wire carries it [SI]; RigError for a name without a transducer."""
        try:
            return float(self.row()[self.channels.index(name)])
        except ValueError:
            raise RigError(f"{brief(name)} is not a transducer; {meant(name, self.channels)}") from None

    def take_rows(self, rows: int) -> tuple[int, np.ndarray]:
        """Take the next rows of the logger, each of them once.

        Parameters
        ----------
        rows : int
            Number of rows.

        Returns
        -------
        first : int
            Index of the first row since time 0.
        values : (rows, columns) array of float
            The logger's columns [SI].

        Raises
        ------
        RigError
            When the ring does not hold these rows.
        """
        first = self._drained
        values = self.rows_in_ring(self.row_period, first, rows)[:, : len(self.logger_names)].copy()
        self._drained += rows
        return first, values

    def rows_at(self, period: float, first: int, rows: int) -> np.ndarray:
        """Return a copy of rows of the ring, with all channels.

        Parameters
        ----------
        period : float
            Time from row to row [s], counted from time 0.
        first : int
            Index of the first row.
        rows : int
            Number of rows.

        Returns
        -------
        (rows, channels) array of float
            Rows ``first`` to ``first + rows - 1`` [SI].

        Raises
        ------
        RigError
            When the ring does not hold these rows, or the period is not a whole number of steps.
        """
        return self.rows_in_ring(period, first, rows).copy()

    def rows_in_ring(self, period: float, first: int, rows: int) -> np.ndarray:
        """Return the rows of :meth:`rows_at` from the ring itself, which is overwritten: the caller copies them at once.

        Parameters
        ----------
        period : float
            Time from row to row [s], counted from time 0.
        first : int
            Index of the first row.
        rows : int
            Number of rows.

        Returns
        -------
        (rows, channels) array of float
            Rows ``first`` to ``first + rows - 1`` [SI].

        Raises
        ------
        RigError
            When the ring does not hold these rows, or the period is not a whole number of steps.
        """
        steps = period / self.step
        stride = round(steps)
        if abs(steps - stride) > 1e-9 or stride < 1:
            raise RigError(f"the plant's step of {self.step * 1e6:g} us does not divide the {period * 1e6:g} us between two rows")
        begin, last, now = first * stride, (first + rows - 1) * stride, self.sample * self._steps_per_sample
        if rows and (last > now or now - begin >= len(self._log)):
            raise RigError(f"rows {first} to {first + rows - 1} are not in the ring at {self.time:g} s")
        place = begin % len(self._log)
        if place + last - begin < len(self._log):
            return self._log[place : place + rows * stride : stride]
        return self._log[(begin + stride * np.arange(rows)) % len(self._log)]
