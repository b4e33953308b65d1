# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""What every rig that is moved sample by sample has: simulated time, the ring of its logger's rows, its status.

Base of testbench.rig (the gearbox) and testbench.clutch_bench.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from ..catalogue import Catalogue, Signal
from ..clocks import ROW, SAMPLE, SAMPLE_NS
from ..config.schema import param
from ..errors import RigError
from ..plant.outcome import NOT_SETTLED

LOG_ROWS = 20_000  # ring of logger rows, 2 s at 10 kHz


@dataclass(frozen=True)
class KernelConfig:
    """How time is cut: the step of the plant."""

    step: float = param("time", 1e-6, 1e-4)


class Tripped(RigError):
    """A rig went into its safe state where nothing can be measured then; the reason names what went wrong and when."""

    exit_code = 1


class RigStatus(IntEnum):
    """As in rig_msgs/RigState."""

    STARTING = 0
    READY = 1
    RUNNING = 2
    TRIPPED = 3


def check_range(name: str, value: float, signal: Signal) -> None:
    """RigError when a setpoint [SI] is not finite or outside the range of its signal."""
    if not (math.isfinite(value) and signal.low <= value <= signal.high):
        raise RigError(f"{name} of {value:g} {signal.unit} refused; expected {signal.low:g} to {signal.high:g} "
                       f"{signal.unit}")


def places(dtype: np.dtype, name: str = "") -> list[str]:
    """Name of each number of 8 bytes in a record, e.g. "cylinders[1].temperature"."""
    if dtype.subdtype:
        base, shape = dtype.subdtype
        return [place for index in np.ndindex(shape) for place in places(base, f"{name}{list(index)}")]
    if dtype.names is None:
        return [name]
    return [place for field in dtype.names
            for place in places(dtype[field], f"{name}.{field}" if name else field)]


class Timed(ABC):
    """``channels``: names of the columns of a row, those of the logger first; ``sample``: controller samples since 0;
    ``settings``: record of what people and sequences set, with ``motor_on`` and ``safe``; ``reason``: of a trip.

    A rig calls :meth:`count_steps` and takes its ring of rows from :meth:`ring` before time passes.
    """

    channels: tuple[str, ...]
    settings: np.ndarray

    def count_steps(self, step: float, catalogue: Catalogue) -> None:
        """Note how many steps [s] of the plant make a sample and a row; RigError when they do not fit.

        catalogue: of this kind of rig; its logger's columns are the first of ``channels``.
        """
        self.step_ns, self.step, self.sample = SAMPLE_NS, step, 0
        steps = SAMPLE / step
        if abs(steps - round(steps)) > 1e-9:
            raise RigError(f"the plant's step of {step * 1e6:g} us does not divide the controller's "
                           "sample of 1000 us; choose e.g. 100 us or 50 us")
        self._steps_per_sample = round(steps)
        self._logger_stride = round(ROW / step)
        self._drained = 0  # logger rows handed out
        self.reason, self.stopped_by_person = "", False
        self.logger_names = [s.name for s in catalogue.logger_channels()]
        if self.logger_names != list(self.channels[:len(self.logger_names)]):
            raise RigError(f"signals.yaml: the logger's columns {self.logger_names} are not the kernel's "
                           f"{self.channels}")

    @property
    @abstractmethod
    def status(self) -> RigStatus:
        """What the rig is doing."""

    def trip(self, reason: str) -> None:
        """Safe state: no drive torque, no clutch clamped; the first reason stays until reset."""
        if self.status != RigStatus.TRIPPED:
            self.reason = reason
        self.settings["safe"] = 1.0
        self.settings["motor_on"] = 0.0

    def trip_for(self, how: int, names: list[str], values: np.ndarray) -> None:
        """Trip for a sample that the plant could not be moved over: ``how`` of plant.outcome, not WHOLE.

        values: those that came out, of which the first that is no finite number is named by its place in ``names``.
        """
        when = f"between {self.time - SAMPLE:.3f} s and {self.time:.3f} s"
        if how == NOT_SETTLED:
            self.trip(f"{when} the friction of clutches and brakes did not settle within a step; a value of the rig is "
                      "far from any real one, or its step too long")
            return
        first = int(np.flatnonzero(~np.isfinite(values))[0])
        self.trip(f"{names[first]} became {values[first]} {when}, which is no finite number; the plant stays where it was "
                  "before, and a value of the rig is far from any real one")

    def e_stop(self) -> None:
        """The red button: safe state that only ``reset`` ends."""
        self.stopped_by_person = True
        self.settings["safe"] = 0.0  # a person's stop replaces whatever tripped before
        self.trip("emergency stop")

    def check_runs(self) -> None:
        """Tripped when the rig is in its safe state."""
        if self.status == RigStatus.TRIPPED:
            raise Tripped(f"the rig tripped: {self.reason}")

    def check_tripped(self) -> None:
        """RigError when there is no safe state that could be left."""
        if self.status != RigStatus.TRIPPED:
            raise RigError("the rig is not in its safe state; nothing done")

    def ring(self) -> np.ndarray:
        """An empty ring of rows."""
        # a channel's values lie side by side: whoever keeps rows copies whole channels
        self._log = np.zeros((LOG_ROWS * self._logger_stride, len(self.channels)), order="F")
        return self._log

    @abstractmethod
    def advance_samples(self, samples: int = 1) -> None:
        """Move by so many controller samples."""

    @property
    def time_ns(self) -> int:
        """Simulated time since the start [ns]."""
        return self.sample * SAMPLE_NS

    @property
    def time(self) -> float:
        """Simulated time since the start [s]."""
        return self.sample * SAMPLE

    def advance(self, seconds: float) -> None:
        """Advance by a whole number of controller samples (1 ms); RigError otherwise."""
        samples = seconds / SAMPLE
        if abs(samples - round(samples)) > 1e-6 or samples < 0:
            raise RigError(f"cannot advance by {seconds} s: expected a whole number of milliseconds")
        self.advance_samples(round(samples))

    def row(self) -> np.ndarray:
        """The newest logger row, columns as ``channels``, SI."""
        return self.row_of(self.sample)

    def row_of(self, sample: int) -> np.ndarray:
        """The row of a controller sample of the last two seconds."""
        return self._log[(sample * self._steps_per_sample) % len(self._log)]

    def measurement(self, name: str) -> float:
        """Newest value of a transducer, as the wire carries it; RigError for a name without one."""
        try:
            return float(self.row()[self.channels.index(name)])
        except ValueError:
            raise RigError(f"'{name}' is not a transducer; known are {', '.join(self.channels)}") from None

    def take_rows(self, rows: int) -> tuple[int, np.ndarray]:
        """(index of the first, the next ``rows`` 10 kHz logger rows); RigError when they are not there any more."""
        first = self._drained
        values = self.rows_at(ROW, first, rows)[:, :len(self.logger_names)]
        self._drained += rows
        return first, values

    def rows_at(self, period: float, first: int, rows: int) -> np.ndarray:
        """Rows (rows, channels) ``first`` to ``first + rows - 1``, one every ``period`` [s] from time 0, of all
        channels; RigError when they are not there any more or the period is no whole number of steps.
        """
        return self.rows_in_ring(period, first, rows).copy()

    def rows_in_ring(self, period: float, first: int, rows: int) -> np.ndarray:
        """As :meth:`rows_at`, for who copies them at once: they lie in the ring itself, which is overwritten."""
        steps = period / self.step
        stride = round(steps)
        if abs(steps - stride) > 1e-9 or stride < 1:
            raise RigError(f"the plant's step of {self.step * 1e6:g} us does not divide the "
                           f"{period * 1e6:g} us between two rows")
        begin, last, now = first * stride, (first + rows - 1) * stride, self.sample * self._steps_per_sample
        if rows and (last > now or now - begin >= len(self._log)):
            raise RigError(f"rows {first} to {first + rows - 1} are not in the ring at {self.time:g} s")
        place = begin % len(self._log)
        if place + last - begin < len(self._log):
            return self._log[place:place + rows * stride:stride]
        return self._log[(begin + stride * np.arange(rows)) % len(self._log)]
