# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Shifts at operating points, fast: a rig is brought to each point once and put aside; a shift then costs about 1 s.

Used by tune.search and tune.judge in their worker processes. The plant is the rig's own, the channels show the truth
(no transducers), the metrics are those of analysis.metrics.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import pi

import numpy as np

from ..alfa46.settings import Alfa46Config
from ..analysis.edges import odd_width, running_mean
from ..analysis.metrics import BEFORE, TORQUE_SPEED_MEAN, Recording, shift_metrics
from ..clocks import ROW, SAMPLE
from ..errors import RigError
from ..parts import part as parts
from ..parts.load_pump import relief_setting_for
from ..testbench.configuration import RigConfig
from ..testbench.rig import Rig
from ..testbench.rig_base import Tripped
from ..transmission import NEUTRAL, Transmission

RPM = pi / 30.0
OIL = 4e6  # Pa, as in all of the laboratory's tests
LEAD = 0.25  # s at rest before the order
AFTER = 0.25  # s recorded after the last point of both profiles
LEAST_WINDOW, WINDOW = 0.9, 1.75  # s after the order; the longer one where the shift has not ended by then
JERK_MEAN = 20e-3  # s over which the output's speed is averaged before its second derivative is taken
LOAD_WITHIN = 1.0  # Nm within which the output's torque is brought to the operating point's
SPEED_WITHIN = 8.0 * RPM  # as in the sequence grid_point
OPEN = 1.0  # of its kiss pressure: a released clutch has less when the shift is over
# t_o is no objective, and a dip down to standstill is one
NO_MATTER = ("did not settle at", "had no time to settle", "the output stood still")


@dataclass(frozen=True)
class Point:
    """An operating point before a shift: way (Transmission.ways), speed of the input [rad/s], torque at the
    output [Nm].
    """

    way: str
    speed: float
    output_torque: float

    def text(self) -> str:
        """As people read it, e.g. ``I-II 1500 rpm 100 Nm``."""
        return f"{self.way} {self.speed / RPM:.0f} rpm {self.output_torque:.0f} Nm"


@dataclass(frozen=True)
class Shift:
    """What one shift gave, SI; missing numbers are None where it did not come to its end (``why`` says why).

    peak: highest torque of the input from the order to the end of the window; time: t_c, from the order to the new gear; t_dt: from
    the fall of the old pressure; dip: how far k lies below 1; heat: of both clutches; jerk: largest change of the
    output's acceleration [rad/s3]; before: torque in the input before the order; tripped: the rig went into its safe state.
    """

    peak: float | None
    time: float | None
    t_dt: float | None
    dip: float | None
    heat: float | None
    jerk: float | None
    before: float
    why: str = ""
    tripped: bool = False

    @property
    def valid(self) -> bool:
        """True of a shift that came to its end."""
        return not self.why


class NotHeld(RigError):
    """The rig does not come to rest in an operating point."""


def no_shift(why: RigError) -> Shift:
    """What is noted of a shift that could not be made."""
    return Shift(None, None, None, None, None, None, 0.0, str(why), isinstance(why, Tripped))


class Bench:
    """One rig with its operating points, each put aside when it was first needed."""

    def __init__(self, config: RigConfig) -> None:
        self.config = config.replaced(effects=replace(config.effects, transducers=False))
        self.transmission = self.config.transmission
        source, load = (self.config.structure.of_role(role)[0].name for role in (parts.SOURCE, parts.LOAD))
        self._source, self._load = self.config.values(source), self.config.values(load)
        self.gears = self.transmission.ways()
        self._rig = Rig(self.config)
        self._new = self._rig.snapshot()
        self._standing: dict[int, tuple] = {}  # gear -> at standstill, oil on
        self._points: dict[Point, tuple | NotHeld | Tripped] = {}

    def check_held(self, point: Point) -> None:
        """NotHeld when the rig does not come to rest in this point, Tripped when it trips on the way."""
        found = self._at(point)
        if isinstance(found, RigError):
            raise found

    def shift(self, point: Point, settings: Alfa46Config) -> Shift:
        """One shift with these settings of the controller from an operating point; their currents of P3, which hold the
        gear before the shift, must be those of the rig's own controller.
        """
        found = self._at(point)
        if isinstance(found, RigError):
            return no_shift(found)
        try:
            return self._shift(point, settings, *found)
        except Tripped as trip:
            return no_shift(trip)

    def _shift(self, point: Point, settings: Alfa46Config, snapshot: tuple, before: np.ndarray) -> Shift:
        rig = self._rig
        rig.restore(snapshot)
        rig.set_controller(settings)
        heat, ordered = self._heat(), rig.time
        rig.order_gear(self.gears[point.way][1])
        self._go(SAMPLE)  # the order is taken, and says how long the profiles run
        window = min(max(rig.shift_end * SAMPLE - ordered + AFTER, LEAST_WINDOW), WINDOW)
        for until in (round(window, 3), WINDOW):  # what has not come to its end by then may still do
            self._go(until - (rig.time - ordered))
            count = round((rig.time - ordered) / ROW)
            rows = np.vstack((before, rig.rows_at(ROW, round(ordered / ROW), count)))
            channels = {name: np.ascontiguousarray(rows[:, rig.channels.index(name)]) for name in self.transmission.channels}
            shift = _measured(self.transmission, self.gears[point.way], channels, self._heat() - heat)
            if shift.valid or until == WINDOW:
                break
        return shift

    def _go(self, seconds: float) -> None:
        """Move on; Tripped where the rig does."""
        self._rig.advance(seconds)
        self._rig.check_runs()

    def _heat(self) -> float:
        energy = self._rig.energy()
        return sum(energy[clutch.heat] for clutch in self.transmission.clutches)

    def _at(self, point: Point) -> tuple | NotHeld | Tripped:
        """The rig at rest in a point with its rows of the last BEFORE, or why it does not get there."""
        if point not in self._points:
            try:
                self._points[point] = self._bring(point)
            except (NotHeld, Tripped) as why:
                self._points[point] = why
        return self._points[point]

    def _standing_in(self, gear: int) -> tuple:
        """Gear in, motor off; pistons have moved before, as in the measuring procedures."""
        if gear not in self._standing:
            rig = self._rig
            rig.restore(self._new)
            rig.set_controller(self.config.alfa46)
            rig.set("oil", OIL, True)
            self._go(0.5)
            first = next(other for other in self.transmission.ratios if other != gear)
            for order in (first, NEUTRAL, gear):
                rig.order_gear(order)
                self._go(1.5)
                while rig.shifting:
                    self._go(0.1)
            self._standing[gear] = rig.snapshot()
        return self._standing[gear]

    def _bring(self, point: Point) -> tuple:
        rig, torque = self._rig, point.output_torque
        rig.restore(self._standing_in(self.gears[point.way][0]))
        rig.set_controller(self.config.alfa46)
        rig.set("motor", point.speed, True)
        self._go(round(point.speed / self._source.ramp + 1.0, 1))
        for _ in range(4):  # the load's torque depends on the speed, which it changes a little
            setting = relief_setting_for(torque, rig.measurement(self.transmission.output.speed), self._load)
            rig.set("load", min(setting, self._load.pressure_limit), True)
            self._go(1.5)
            speed = rig.measurement(self.transmission.input.speed)
            miss = point.output_torque - rig.measurement(self.transmission.output.torque)
            if abs(miss) < LOAD_WITHIN and abs(speed - point.speed) < SPEED_WITHIN:
                self._go(LEAD)
                before = round(BEFORE / ROW)
                return rig.snapshot(), rig.rows_at(ROW, round(rig.time / ROW) - before, before)
            torque += miss
        raise NotHeld(f"the rig does not hold {point.text()}: {speed / RPM:.0f} rpm, {point.output_torque - miss:.0f} Nm")


def _measured(box: Transmission, gears: tuple[int, int], channels: dict[str, np.ndarray], heat: float) -> Shift:
    start = round(BEFORE / ROW)
    row = shift_metrics(Recording(0.0, ROW, channels, transmission=box), (BEFORE, *gears))
    torque = channels[box.input.torque]
    peak = float(running_mean(torque, odd_width(TORQUE_SPEED_MEAN, ROW))[start:].max())
    before = float(torque[:start].mean())
    slow = 10 * ROW
    speed = running_mean(channels[box.output.speed][::10], odd_width(JERK_MEAN, slow))
    edge = round(JERK_MEAN / slow)  # where the mean is taken over less
    jerk = float(np.abs(np.diff(speed, 2)[start // 10 : -edge]).max() / slow**2)
    why = "; ".join(reason for reason in row["why"] if not any(part in reason for part in NO_MATTER))
    for clutch in box.shift(*gears).releasing:
        left = channels[clutch.pressure][-500:].mean()
        if not why and left > OPEN * clutch.kiss_pressure:
            why = f"{clutch.pressure} is still at {left / 1e6:.2f} MPa at the end"
    dip = None if row["k"] is None else max(0.0, 1.0 - row["k"])
    if not why and None in (row["t_c_s"], row["t_dt_s"], dip):
        why = "the shift has no end"
    return Shift(peak, row["t_c_s"], row["t_dt_s"], dip, float(heat), jerk, before, why)
