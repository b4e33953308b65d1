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
from ..analysis.metrics import BEFORE, KISS, NEEDED, PRESSURE, TORQUE_SPEED_MEAN, Recording, shift_metrics
from ..errors import RigError
from ..plant import kernel
from ..plant.load_pump import relief_setting_for
from ..testbench.configuration import RigConfig
from ..testbench.rig import Rig
from ..testbench.timed import Tripped

RPM = pi / 30.0
OIL = 4e6  # Pa, as in all of the laboratory's tests
LEAD = 0.25  # s at rest before the order
AFTER = 0.25  # s recorded after the last point of both profiles
LEAST_WINDOW, WINDOW = 0.9, 1.75  # s after the order; the longer one where the shift has not ended by then
PERIOD = 1e-4  # s
GEARS = {"I-II": (1, 2), "II-I": (2, 1)}
JERK_MEAN = 20e-3  # s over which the output's speed is averaged before its second derivative is taken
LOAD_WITHIN = 1.0  # Nm within which M_wyj is brought to the operating point's
SPEED_WITHIN = 8.0 * RPM  # as in the sequence grid_point
OPEN = 1.0  # of its kiss pressure: a released clutch has less when the shift is over
# t_o is no objective, and a dip down to standstill is one
NO_MATTER = ("M_wej did not settle", "M_wej had no time to settle", "the output stood still")


@dataclass(frozen=True)
class Point:
    """An operating point before a shift: way (I-II or II-I), speed of the input [rad/s], torque at the output [Nm]."""

    way: str
    n_wej: float
    m_wyj: float

    def text(self) -> str:
        return f"{self.way} {self.n_wej / RPM:.0f} rpm {self.m_wyj:.0f} Nm"


@dataclass(frozen=True)
class Shift:
    """What one shift gave, SI; missing numbers are None where it did not come to its end (``why`` says why).

    peak: highest M_wej from the order to the end of the window; time: t_c, from the order to the new gear; t_dt: from
    the fall of the old pressure; dip: how far k lies below 1; heat: of both clutches; jerk: largest change of the
    output's acceleration [rad/s3]; before: M_wej before the order; tripped: the rig went into its safe state.
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
        return not self.why


class NotHeld(RigError):
    """The rig does not come to rest in an operating point."""


def no_shift(why: RigError) -> Shift:
    """What is noted of a shift that could not be made."""
    return Shift(None, None, None, None, None, None, 0.0, str(why), isinstance(why, Tripped))


class Bench:
    """One rig with its operating points, each put aside when it was first needed."""

    def __init__(self, config: RigConfig):
        self.config = replace(config, effects=replace(config.effects, transducers=False))
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
        rig.order_gear(GEARS[point.way][1])
        self._go(0.001)  # the order is taken, and says how long the profiles run
        window = min(max(rig.shift_end / 1000.0 - ordered + AFTER, LEAST_WINDOW), WINDOW)
        for until in (round(window, 3), WINDOW):  # what has not come to its end by then may still do
            self._go(until - (rig.time - ordered))
            count = round((rig.time - ordered) / PERIOD)
            rows = np.vstack((before, rig.rows_at(PERIOD, round(ordered / PERIOD), count)))
            channels = {name: np.ascontiguousarray(rows[:, kernel.CHANNELS.index(name)]) for name in NEEDED}
            shift = _measured(point, channels, self._heat() - heat)
            if shift.valid or until == WINDOW:
                break
        return shift

    def _go(self, seconds: float) -> None:
        """Move on; Tripped where the rig does."""
        self._rig.advance(seconds)
        self._rig.check_runs()

    def _heat(self) -> float:
        energy = self._rig.energy()
        return energy["heat_s1"] + energy["heat_s2"]

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
            rig.set_oil(OIL, True)
            self._go(0.5)
            for order in (2, 0, 1) if gear == 1 else (1, 0, 2):
                rig.order_gear(order)
                self._go(1.5)
                while rig.shifting:
                    self._go(0.1)
            self._standing[gear] = rig.snapshot()
        return self._standing[gear]

    def _bring(self, point: Point) -> tuple:
        rig, torque = self._rig, point.m_wyj
        rig.restore(self._standing_in(GEARS[point.way][0]))
        rig.set_controller(self.config.alfa46)
        rig.set_motor(point.n_wej, True)
        self._go(round(point.n_wej / self.config.motor.ramp + 1.0, 1))
        for _ in range(4):  # the load's torque depends on the speed, which it changes a little
            setting = relief_setting_for(torque, rig.measurement("n_wyj"), self.config.load_pump)
            rig.set_load(min(setting, self.config.load_pump.pressure_limit), True)
            self._go(1.5)
            speed, miss = rig.measurement("n_wej"), point.m_wyj - rig.measurement("M_wyj")
            if abs(miss) < LOAD_WITHIN and abs(speed - point.n_wej) < SPEED_WITHIN:
                self._go(LEAD)
                before = round(BEFORE / PERIOD)
                return rig.snapshot(), rig.rows_at(PERIOD, round(rig.time / PERIOD) - before, before)
            torque += miss
        raise NotHeld(f"the rig does not hold {point.text()}: {speed / RPM:.0f} rpm, {point.m_wyj - miss:.0f} Nm")


def _measured(point: Point, channels: dict[str, np.ndarray], heat: float) -> Shift:
    start = round(BEFORE / PERIOD)
    old, new = GEARS[point.way]
    row = shift_metrics(Recording(0.0, PERIOD, channels), (BEFORE, old, new))
    peak = float(running_mean(channels["M_wej"], odd_width(TORQUE_SPEED_MEAN, PERIOD))[start:].max())
    before = float(channels["M_wej"][:start].mean())
    slow = 10 * PERIOD
    speed = running_mean(channels["n_wyj"][::10], odd_width(JERK_MEAN, slow))
    edge = round(JERK_MEAN / slow)  # where the mean is taken over less
    jerk = float(np.abs(np.diff(speed, 2)[start // 10:-edge]).max() / slow**2)
    why = "; ".join(reason for reason in row["why"] if not reason.startswith(NO_MATTER))
    left = channels[PRESSURE[old]][-500:].mean()
    if not why and left > OPEN * KISS[old]:
        why = f"{PRESSURE[old]} is still at {left / 1e6:.2f} MPa at the end"
    dip = None if row["k"] is None else max(0.0, 1.0 - row["k"])
    if not why and None in (row["t_c_s"], row["t_dt_s"], dip):
        why = "the shift has no end"
    return Shift(peak, row["t_c_s"], row["t_dt_s"], dip, float(heat), jerk, before, why)
