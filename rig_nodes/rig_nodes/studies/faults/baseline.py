# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The project's own detector: what readings contradict each other by the rig's own equations, judged by healthy runs.

A residual is a difference that is small in a healthy rig: current and setpoint, duty and current, pressure and current, speeds and
ratio, torques before and behind the gearbox, load torque and its pressure, supply and setting, the time to a gear, and the scatter
of each reading. Residuals with thresholds from healthy runs, and a fault known by the direction of its residuals, are the usual
diagnosis by a model (Isermann, Fault-Diagnosis Systems, 2006, chapters 10 and 16).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from ...plant import part as parts
from .cases import PERIOD

if TYPE_CHECKING:
    from collections.abc import Iterable

    from ...base import Floats
    from .cases import Course

MEAN = 0.2  # s: over which residuals are averaged
SHIFTING = 1.5  # s after an order in which a gear is not expected
STARTED = 2.4  # s: until then the rig is brought to its speed
MARGIN = 2.0  # largest residual of the healthy runs that were learned, times this, is the threshold
HELD = 3  # rows for which a residual must be beyond it
FLOOR = 1e-12


@dataclass(frozen=True)
class Alarm:
    """What a detector says of a run that it takes for ill: when [s], and the names of faults, the likeliest first."""

    t: float
    faults: tuple[str, ...] = ()


def averaged(values: Floats, seconds: float = MEAN) -> Floats:
    """Return the mean of values (n,) over the time [s] that ends at each row."""
    width = max(1, round(seconds / PERIOD))
    sums = np.cumsum(np.concatenate([np.zeros(1), np.nan_to_num(values)]))
    start = np.maximum(0, np.arange(1, len(sums)) - width)
    return (sums[1:] - sums[start]) / (np.arange(1, len(sums)) - start)


def residuals(course: Course) -> dict[str, Floats]:
    """Return the residuals of a run (n,) by name; NaN where one says nothing."""
    config, got, t = course.config, course.signals, course.t
    structure, box = config.structure, config.transmission
    changed = np.concatenate([[True], np.diff(course.gear) != 0])
    since = t - t[np.maximum.accumulate(np.where(changed, np.arange(len(t)), 0))]  # an order
    steady = (since > SHIFTING) & (t > STARTED)
    shows = {one.shows: one.name for one in structure.transducers}
    out: dict[str, Floats] = {}
    for valve, output in zip(structure.valves, config.wiring):
        values, number = config.values(valve.name), output + 1
        current, setpoint, duty = got[shows[f"{valve.name}.current"]], got[f"setpoint_{number}"], got[f"duty_{number}"]
        out[f"{valve.name}: current"] = averaged(current - setpoint)
        out[f"{valve.name}: duty"] = averaged(duty - current * values.coil_resistance / values.coil_voltage)
        pressure = shows.get(f"{valve.wires['feeds']}.pressure")
        if pressure:
            asked = np.clip(values.pressure_gain * (averaged(setpoint, 0.05) - values.cracking_current), 0.0, values.pressure_limit)
            still = averaged(np.abs(np.gradient(asked)), 0.3) < 2e-3 * values.pressure_limit
            out[f"{valve.name}: pressure"] = np.where(still & (t > STARTED), averaged(got[pressure] - asked), np.nan)
    ends = structure.input, structure.output
    turns, torques = [got[end.speed] for end in ends], [got[end.torque] for end in ends]
    ratio = np.array([box.ratios.get(int(gear), np.nan) for gear in course.gear])
    slip = turns[0] - ratio * turns[1]
    out["ratio"] = np.where(steady, averaged(slip), np.nan)
    out["torques"] = np.where(steady, averaged(torques[0] * ratio - torques[1]), np.nan)
    out["engagement"] = _engagements(np.abs(slip) / np.maximum(np.abs(turns[0]), 1.0), since, course)
    before = (t > STARTED - MEAN) & (t <= STARTED)
    out["drive"] = np.where(t > STARTED, averaged(turns[0] - turns[0][before].mean()), np.nan)
    for load in structure.of_role(parts.LOAD):
        if (pressure := shows.get(f"{load.name}.pressure")) and hasattr(values := config.values(load.name), "displacement"):
            expected = values.displacement * got[pressure] + values.mechanical_loss
            out[f"{load.name}: torque"] = np.where(steady & (np.abs(turns[1]) > 5.0), averaged(torques[1] - expected), np.nan)
    for oil in structure.of_role(parts.OIL):
        if supply := shows.get(f"{structure.line_of(oil.name)}.pressure"):
            out[f"{oil.name}: pressure"] = np.where(
                t > STARTED, averaged(got[supply] - np.median(got[supply][t < STARTED]), 0.05), np.nan
            )
        if warm := shows.get(f"{oil.name}.oil_temperature"):
            out[f"{oil.name}: temperature"] = averaged(got[warm] - np.median(got[warm][t < STARTED]))
    for one in structure.transducers:
        bend = np.diff(got[one.name], 2, prepend=got[one.name][:1], append=got[one.name][-1:])
        scatter = np.sqrt(averaged(bend**2))
        out[f"{one.name}: scatter"] = np.where(steady, np.log10(scatter / max(abs(one.high), FLOOR) + 1e-7), np.nan)
    return out


def _engagements(slip: Floats, since: Floats, course: Course) -> Floats:
    """Return the slip of the new gear over the time since its order [s], and NaN while a shift lasts or before the second gear."""
    out, total = np.full(len(slip), np.nan), 0.0
    orders = np.flatnonzero(np.diff(course.gear) != 0) + 1
    for begin in orders[1:]:  # the first one engages at standstill
        inside = np.arange(begin, min(begin + round(SHIFTING / PERIOD), len(slip)))
        total = float(np.nansum(slip[inside])) * PERIOD
        out[inside[-1] :] = total
    return out


@dataclass
class Baseline:
    """The detector; it learns from healthy and ill runs, and is called with a run.

    Attributes
    ----------
    middle, most : dict of str to float
        Of each residual of the healthy runs the mean, and the largest distance from it.
    patterns : dict of str to (residuals,) array of float
        Direction of the residuals of each fault.
    """

    middle: dict[str, float] = field(default_factory=dict)
    most: dict[str, float] = field(default_factory=dict)
    patterns: dict[str, Floats] = field(default_factory=dict)

    def learn_healthy(self, found: Iterable[dict[str, Floats]]) -> None:
        """Learn the thresholds from the residuals of healthy runs."""
        every: dict[str, list[Floats]] = {}
        for one in found:
            for name, values in one.items():
                every.setdefault(name, []).append(values[np.isfinite(values)])
        for name, parts_ in every.items():
            joined = np.concatenate(parts_)
            if not len(joined):
                continue
            self.middle[name] = float(joined.mean())
            self.most[name] = max(float(np.abs(joined - joined.mean()).max()), FLOOR)

    def learn_ill(self, found: Iterable[tuple[str, dict[str, Floats]]]) -> None:
        """Learn the direction of each fault from the residuals of runs with it."""
        sums: dict[str, list[Floats]] = {}
        for fault, one in found:
            sums.setdefault(fault, []).append(self._direction(self._over(one)))
        self.patterns = {fault: np.mean(rows, axis=0) for fault, rows in sums.items()}

    def _over(self, found: dict[str, Floats]) -> Floats:
        """Return the residuals over their thresholds (residuals, n), with their signs; 0 where one says nothing."""
        rows = [(found[name] - self.middle[name]) / (MARGIN * self.most[name]) for name in self.middle]
        return np.nan_to_num(np.array(rows))

    @staticmethod
    def _direction(over: Floats) -> Floats:
        furthest = np.abs(over).argmax(axis=1)
        signed = over[np.arange(len(over)), furthest]
        bent = np.sign(signed) * np.log1p(np.abs(signed) ** 2)
        return bent / max(float(np.linalg.norm(bent)), FLOOR)

    def __call__(self, course: Course) -> Alarm | None:
        """Return the alarm on a run, None for a healthy one."""
        return self.judged(residuals(course), course.t)

    def judged(self, found: dict[str, Floats], t: Floats) -> Alarm | None:
        """Return the alarm on the residuals of a run at its times [s]."""
        over = self._over(found)
        beyond = (np.abs(over) > 1.0).any(axis=0)
        held = np.convolve(beyond, np.ones(HELD), "valid") == HELD
        if not held.any():
            return None
        direction = self._direction(over)
        near = sorted(self.patterns, key=lambda fault: -float(self.patterns[fault] @ direction))
        return Alarm(float(t[int(held.argmax()) + HELD - 1]), tuple(near[:5]))
