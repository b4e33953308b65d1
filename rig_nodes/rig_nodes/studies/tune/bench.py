# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Fast shifts at operating points: a rig is brought to each point once and stored there; a shift then costs about 1 s.

Used by studies.tune.search and studies.tune.judge in their worker processes. The plant is the rig's own, the channels show the true
values (without transducers), the metrics are those of analysis.metrics.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import pi

import numpy as np

from ...analysis import BEFORE, K_MOST, TORQUE_SPEED_MEAN, Moment, odd_width, put_known, running_mean, shift_metrics
from ...bags import Recording
from ...base import ROW, SAMPLE, RigError
from ...plant import part as parts
from ...plant import relief_setting_for
from ...rig import NEUTRAL, Alfa46Config, RigConfig, Transmission
from ...runs import Rig, Snapshot, Tripped, moment_of

RPM = pi / 30.0
OIL = 4e6  # Pa, as in all of the laboratory's tests
LEAD = 0.25  # s at rest before the order
RETURN = 8.0  # s between two shifts, as in the sequences of chapter 7, in which the piston of the open clutch returns
AFTER = 0.25  # s recorded after the last point of both profiles
LEAST_WINDOW, WINDOW = 0.9, 1.75  # s after the order; the longer one is used when the shift has not ended within the shorter one
JERK_MEAN = 20e-3  # s over which the output's speed is averaged before its second derivative is taken
LOAD_WITHIN = 1.0  # Nm within which the output's torque is brought to the operating point's
SPEED_WITHIN = 8.0 * RPM  # as in the sequence grid_point
OPEN = 1.0  # times its kiss pressure: a released clutch has less than this when the shift is over
# reasons that do not make a shift invalid: t_o is no objective, and a dip down to standstill counts in the objective dip
NO_MATTER = ("did not settle at", "had no time to settle", "the output stood still")


@dataclass(frozen=True)
class Point:
    """An operating point before a shift.

    Parameters
    ----------
    way : str
        Name of the shift, from Transmission.ways.
    speed : float
        Speed of the input [rad/s].
    output_torque : float
        Torque at the output [Nm].
    """

    way: str
    speed: float
    output_torque: float

    def text(self) -> str:
        """Return the point for people, e.g. ``I-II 1500 rpm 100 Nm``."""
        return f"{self.way} {self.speed / RPM:.0f} rpm {self.output_torque:.0f} Nm"


@dataclass(frozen=True)
class Shift:
    """Result of one shift, in SI units; numbers are None where the shift did not come to its end.

    Parameters
    ----------
    peak : float or None
        Highest torque of the input from the order to the end of the window [Nm].
    time : float or None
        t_c, from the order to the new gear [s].
    t_dt : float or None
        Time from the fall of the old pressure [s].
    dip : float or None
        How far k lies below 1.
    heat : float or None
        Heat of both clutches [J].
    jerk : float or None
        Largest change of the output's acceleration [rad/s3].
    before : float
        Torque in the input before the order [Nm].
    why : str
        Why the shift did not come to its end; empty when it did.
    tripped : bool
        True when the rig went into its safe state.
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
        """True for a shift that came to its end."""
        return not self.why

    def number(self, name: str) -> float:
        """Return a number of a shift that came to its end, by the name of its field."""
        value = getattr(self, name)
        if value is None:
            raise ValueError(f"{name} of a shift that did not come to its end")
        return value


class NotHeld(RigError):
    """The rig does not come to rest in an operating point."""


def no_shift(why: RigError) -> Shift:
    """Return what is noted of a shift that could not be made, with the error as the reason."""
    return Shift(None, None, None, None, None, None, 0.0, str(why), isinstance(why, Tripped))


class Bench:
    """One rig with its operating points, each of which is stored when it is first needed.

    Parameters
    ----------
    config : RigConfig
        The rig's configuration; its transducers and trips are switched off here.
    """

    def __init__(self, config: RigConfig) -> None:
        self.config = config.replaced(effects=replace(config.effects, transducers=False), trips_watched=False)
        self.transmission = self.config.transmission
        source, load = (self.config.structure.of_role(role)[0].name for role in (parts.SOURCE, parts.LOAD))
        self._source, self._load = self.config.values(source), self.config.values(load)
        self.gears = self.transmission.ways()
        self._rig = Rig(self.config)
        self._new = self._rig.snapshot()
        self._standing: dict[int, Snapshot] = {}  # gear -> snapshot at standstill with the oil on
        self._points: dict[Point, tuple | NotHeld | Tripped] = {}
        self._starts: dict[Point, Moment] = {}

    def check_held(self, point: Point) -> None:
        """Check that the rig comes to rest in an operating point.

        Raises
        ------
        NotHeld
            When the rig does not come to rest there.
        Tripped
            When the rig trips on the way.
        """
        found = self._at(point)
        if isinstance(found, RigError):
            raise found

    def started(self, point: Point) -> dict:
        """Return gears and state of the rig before the order in a point that it holds, as a row of metrics has them."""
        before, after = self.gears[point.way]
        row = {"from_gear": before, "to_gear": after, "t_order_s": 0.0}
        put_known(self.config.as_dict(), self.transmission, [row], {0.0: self._starts[point]})
        return row

    def shift(self, point: Point, settings: Alfa46Config) -> Shift:
        """Make one shift from an operating point.

        Parameters
        ----------
        point : Point
            The operating point.
        settings : Alfa46Config
            Settings of the controller. Their currents of P3, which hold the gear before the shift, must be those of the rig's
            own controller.

        Returns
        -------
        Shift
            The result, also of a shift that could not be made.
        """
        found = self._at(point)
        if isinstance(found, RigError):
            return no_shift(found)
        try:
            return self._shift(point, settings, *found)
        except Tripped as trip:
            return no_shift(trip)

    def _shift(self, point: Point, settings: Alfa46Config, snapshot: Snapshot, before: np.ndarray) -> Shift:
        rig = self._rig
        rig.restore(snapshot)
        rig.set_controller(settings)
        heat, ordered = self._heat(), rig.time
        rig.order_gear(self.gears[point.way][1])
        self._go(SAMPLE)  # the controller takes the order, and then it is known how long the profiles run
        window = min(max(rig.shift_end * SAMPLE - ordered + AFTER, LEAST_WINDOW), WINDOW)
        for until in (round(window, 3), WINDOW):  # a shift that has not ended by the first time may still end by the second
            self._go(until - (rig.time - ordered))
            count = round((rig.time - ordered) / ROW)
            rows = np.vstack((before, rig.rows_at(ROW, round(ordered / ROW), count)))
            channels = {name: np.ascontiguousarray(rows[:, rig.channels.index(name)]) for name in self.transmission.channels}
            shift = _measured(self.transmission, self.gears[point.way], channels, self._heat() - heat)
            if shift.valid or until == WINDOW:
                break
        return shift

    def _go(self, seconds: float) -> None:
        """Advance the rig by some seconds; raise Tripped when it trips."""
        self._rig.advance(seconds)
        self._rig.check_runs()

    def _heat(self) -> float:
        energy = self._rig.energy()
        return sum(energy[clutch.heat] for clutch in self.transmission.clutches)

    def _at(self, point: Point) -> tuple | NotHeld | Tripped:
        """Return the rig at rest in a point with its rows of the last BEFORE seconds, or the reason why it does not get there."""
        if point not in self._points:
            try:
                self._points[point] = self._bring(point)
            except (NotHeld, Tripped) as why:
                self._points[point] = why
        return self._points[point]

    def _standing_in(self, gear: int) -> Snapshot:
        """Return the rig at standstill in a gear, motor off; its pistons have moved before, as in the measuring procedures."""
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
            self._go(RETURN)
            self._standing[gear] = rig.snapshot()
        return self._standing[gear]

    def _bring(self, point: Point) -> tuple:
        rig, torque = self._rig, point.output_torque
        rig.restore(self._standing_in(self.gears[point.way][0]))
        rig.set_controller(self.config.alfa46)
        rig.set("motor", point.speed, True)
        self._go(round(point.speed / self._source.ramp + 1.0, 1))
        for _ in range(4):  # the load's torque depends on the speed, which in turn changes a little with the load
            setting = relief_setting_for(torque, rig.measurement(self.transmission.output.speed), self._load)
            rig.set("load", min(setting, self._load.pressure_limit), True)
            self._go(1.5)
            speed = rig.measurement(self.transmission.input.speed)
            miss = point.output_torque - rig.measurement(self.transmission.output.torque)
            if abs(miss) < LOAD_WITHIN and abs(speed - point.speed) < SPEED_WITHIN:
                self._go(LEAD)
                before = round(BEFORE / ROW)
                self._starts[point] = moment_of(rig)
                return rig.snapshot(), rig.rows_at(ROW, round(rig.time / ROW) - before, before)
            torque += miss
        raise NotHeld(f"the rig does not hold {point.text()}: {speed / RPM:.0f} rpm, {point.output_torque - miss:.0f} Nm")


def _measured(box: Transmission, gears: tuple[int, int], channels: dict[str, np.ndarray], heat: float) -> Shift:
    start = round(BEFORE / ROW)
    row = shift_metrics(Recording(0.0, ROW, channels, [], box), (BEFORE, *gears))
    torque = channels[box.input.torque]
    peak = float(running_mean(torque, odd_width(TORQUE_SPEED_MEAN, ROW))[start:].max())
    before = float(torque[:start].mean())
    slow = 10 * ROW
    speed = running_mean(channels[box.output.speed][::10], odd_width(JERK_MEAN, slow))
    edge = round(JERK_MEAN / slow)  # at the ends the mean is taken over fewer rows
    jerk = float(np.abs(np.diff(speed, 2)[start // 10 : -edge]).max() / slow**2)
    why = "; ".join(reason for reason in row["why"] if not any(part in reason for part in NO_MATTER))
    for clutch in box.shift(*gears).releasing:
        left = channels[clutch.pressure][-500:].mean()
        if not why and left > OPEN * clutch.kiss_pressure:
            why = f"{clutch.pressure} is still at {left / 1e6:.2f} MPa at the end"
    k = K_MOST if "k" in row["undefined"] else row["k"]  # without a dip the input may have turned faster
    dip = None if k is None else max(0.0, 1.0 - k)
    if not why and None in (row["t_c_s"], row["t_dt_s"], dip):
        why = "the shift has no end"
    return Shift(peak, row["t_c_s"], row["t_dt_s"], dip, float(heat), jerk, before, why)
