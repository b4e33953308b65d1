# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The recipe of the laboratory's own program (thesis Annex A) for one shift, for comparison with the definitions of metrics.

`rig report --annex-a` uses it. Thresholds, search windows, factors and 3.14 are as printed,
including the misprints that change a result; docs/background/analysis.md lists them.
"""

from __future__ import annotations

import numpy as np

from ..bags import Recording
from ..base import RigError
from .definitions import RPM, withhold
from .edges import first_true
from .lacking import what_is_missing
from .metrics import every_metric, metric_keys
from .shift import orders_of

PERIOD = 1e-4  # s; the program counts samples of 10 kHz
BLOCK = 10  # samples in the mean of a pressure
BAR = 1e5
PI = 3.14  # as printed
# Inputs of the program: bands of the torque after a down- and an upshift, and the rise of pressure [bar] that counts as
# the valve's reaction. The laboratory's inputs are not printed; 1.05 is the band of definitions.SETTLED_BAND.
FACTOR_A, FACTOR_B, RISE_C = 1.05, 1.05, 0.5
UP_FROM, UP_BELOW, UP_FALLS, UP_LATER = 20.0, 20.0, 4, 50  # bar, bar, successive means, means later
DOWN_FROM, DOWN_BELOW, DOWN_FALLS, DOWN_LATER = 22.0, 15.0, 3, 100
SLIP_UP, SLIP_DOWN = 0.05, 0.1  # %
SPEED_UP, SPEED_DOWN = 0.99, 1.01  # shares of the set speed at which the input counts as recovered
DIP = 0.95
MINIMUM_SEARCH = 20000  # samples after the start, downshift
SETTLED_AFTER, SETTLED_FOR = 5000, 1000  # samples
CLAMPED = 20.0  # bar, least pressure of the engaging clutch when the torque counts as settled
AROUND = 1.2, 60.0  # s before and behind an order that are looked at: the rest begins 1 s before the start
REST_BEFORE, REST_FOR, OPEN = 10000, 2000, 3.0  # samples, samples, bar
VALVE_DELAY_UP, VALVE_DELAY_DOWN = 0.330576, 0.19516  # s added to t_c for the engaging valve


def shifts_annex_a(recording: Recording, **factors: float) -> list[dict]:
    """Return one row of :func:`shift_metrics_annex_a` for each row of :func:`shift.shifts`, in the same order.

    Parameters
    ----------
    recording : Recording
        The logger's channels.
    **factors : float
        ``a``, ``b`` and ``c`` of :func:`shift_metrics_annex_a`.
    """
    return [shift_metrics_annex_a(recording, order, end, **factors) for order, end in orders_of(recording)]


def shift_metrics_annex_a(
    recording: Recording,
    order: tuple[float, int, int],
    next_order_time: float | None = None,
    set_speed: float | None = None,
    a: float = FACTOR_A,
    b: float = FACTOR_B,
    c: float = RISE_C,
) -> dict:
    """Return the metrics of one shift by Annex A, under the keys of :func:`metrics.metric_keys`.

    A value that the recipe does not give is None, with its reason in ``why``; overlap_s is not part of it and has no reason. The
    recipe does not cover engagements from neutral.

    Parameters
    ----------
    recording : Recording
        As in shift.shift_metrics, of a transmission of two gears that share no clutch.
    order : (float, int, int)
        As in shift.shift_metrics.
    next_order_time : float, optional
        Time of the next order [s]; samples after it are not read.
    set_speed : float, optional
        The set input speed that the program asks for [rad/s]; by default the mean of 0.2 s before the order.
    a, b : float
        Factors of the torque bands after the downshift and the upshift.
    c : float
        Rise of the engaging pressure over its rest [bar].

    Returns
    -------
    dict
        One value per key.

    Raises
    ------
    RigError
        When the recording is not sampled at 10 kHz, or a factor is not above 1.
    """
    if abs(recording.period - PERIOD) > 1e-9:
        raise RigError(f"Annex A counts samples of 10 kHz; this recording has one every {recording.period * 1e3:g} ms")
    for name, factor in (("a", a), ("b", b)):
        if not factor > 1.0:
            raise RigError(f"Annex A's factor {name} is {factor:g}; it is the upper edge of a band, e.g. 1.05")
    t_order, from_gear, to_gear = order
    row = dict.fromkeys(metric_keys())
    row.update(from_gear=int(from_gear), to_gear=int(to_gear), t_order_s=float(t_order), valid=False, why=[])
    box = recording.transmission
    moved = box.shift(from_gear, to_gear)
    if set(box.ratios) != {from_gear, to_gear} or len(moved.releasing) != 1 or len(moved.engaging) != 1:
        row["why"].append(f"Annex A covers only changes between {' and '.join(map(box.names.get, sorted(box.ratios)))}")
    else:
        _Program(recording, order, next_order_time, set_speed, row).run(a if to_gear < from_gear else b, c)
    row["valid"] = not row["why"]
    withhold(row, box, every_metric())
    return row


class _Program:
    """The channels in the program's units (bar, rpm, Nm); indices count from the first row held."""

    def __init__(
        self, recording: Recording, order: tuple[float, int, int], next_order_time: float | None, set_speed: float | None, row: dict
    ) -> None:
        until = (
            recording.rows
            if next_order_time is None
            else min(recording.rows, int(np.ceil((next_order_time - recording.t0) / PERIOD)))
        )
        self.order = int(np.ceil((order[0] - recording.t0) / PERIOD - 1e-6)) - recording.begin
        self.box, self.up, self.row, self.why = recording.transmission, order[2] > order[1], row, row["why"]
        # the program's two gears, and the pressures of their clutches
        self.first, self.second = sorted(self.box.ratios)
        moved = self.box.shift(order[1], order[2])
        self.old_name, self.new_name = moved.releasing[0].pressure, moved.engaging[0].pressure
        cut = {name: recording.part(name, recording.begin, until) for name in self.box.channels}
        self.missing = what_is_missing({name: cut[name] for name in self.box.channels}, recording.t0, recording.period)
        into, output = self.box.input, self.box.output
        self.old_p, self.new_p = cut[self.old_name] / BAR, cut[self.new_name] / BAR
        self.torque_in, self.torque_out = cut[into.torque], cut[output.torque]
        self.n_in, self.n_out = cut[into.speed] * RPM, cut[output.speed] * RPM
        self.set_speed = None if set_speed is None else set_speed * RPM

    def run(self, factor: float, c: float) -> None:
        """Fill the row in the program's order of steps; each step needs the result of the one before."""
        row = self.row
        before = slice(max(0, self.order - REST_FOR), max(0, self.order))
        if self.order <= 0 or self.order >= self.n_in.size:
            self.why.append(f"the recording does not cover the order at {row['t_order_s']:.3f} s")
            return
        if self.missing:
            self.why.append(self.missing)
            return
        row["input_speed_rpm"], row["output_torque_nm"] = float(np.mean(self.n_in[before])), float(np.mean(self.torque_out[before]))
        if self.set_speed is None:
            self.set_speed = row["input_speed_rpm"]
        if self.set_speed < 10.0:
            self.why.append("the input shaft did not turn when the shift was ordered")
            return
        start = self.start()
        if start is None:
            return
        lowest_down = self.lowest_down(start)
        end = self.slip_end(start, lowest_down)
        if end is None:
            return
        row["t_dt_s"] = (end - start) * PERIOD
        row["t_c_s"] = self.total(start, end, c)
        row["t_p_s"] = self.speed_change(start, end)
        row["e_loss_j"] = self.energy(start, end)
        recovered = self.recovered(end)
        if recovered is None:
            return
        lowest = float(self.n_out[start : recovered + 1].min()) if self.up else lowest_down[0]
        row["output_speed_min_rpm"], row["k"] = lowest, lowest / self.set_speed * self.box.ratios[self.first]
        settled = self.settled(end, recovered, factor)
        if settled is None:
            return
        row["t_o_s"] = (settled - end) * PERIOD
        # the unaveraged torque, to the end of t_o; the program computes means of 20 samples but does not use them
        row["input_torque_max_nm"] = float(self.torque_in[start : settled + 1].max())
        # this sum increments its index before it reads a sample, so it begins one sample later than the other sum
        row["e_loss_settled_j"] = self.energy(start + 1, settled + 1)

    def start(self) -> int | None:
        """Return the last sample of the first mean from which the releasing pressure falls by the printed rule."""
        falls = UP_FALLS if self.up else DOWN_FALLS
        high, low, later = (UP_FROM, UP_BELOW, UP_LATER) if self.up else (DOWN_FROM, DOWN_BELOW, DOWN_LATER)
        means = self.old_p[: self.old_p.size // BLOCK * BLOCK].reshape(-1, BLOCK).mean(axis=1)
        count = means.size - later
        if count > 0:
            met = (means[:count] > high) & (means[later : later + count] < low)
            for i in range(falls):
                met &= means[i : i + count] > means[i + 1 : i + 1 + count]
            at = first_true(met, -(-self.order // BLOCK))
            if at is not None:
                return at * BLOCK + BLOCK - 1
        self.why.append(
            f"{self.old_name} has no {falls} falling means in a row from above {high:g} bar to below {low:g} bar {later} ms later"
        )
        return None

    def slip(self, gear: int) -> np.ndarray:
        """Return (6.85) of a gear in percent."""
        ideal = np.maximum(self.n_in, 1e-3) / self.box.ratios[gear]
        return (ideal - self.n_out) * 100.0 / ideal

    def lowest_down(self, start: int) -> tuple[float, int]:
        """Return the lowest output speed in the 2 s of a downshift, and the sample after the one that first reached it."""
        part = self.n_out[start : start + MINIMUM_SEARCH + 1]
        at = int(part.argmin())
        return float(part[at]), start + at + (1 if at else 0)

    def slip_end(self, start: int, lowest: tuple[float, int]) -> int | None:
        """Return the sample at which the slip has vanished; None with the reason in ``why``."""
        if self.up:
            end = first_true(self.slip(self.second) <= SLIP_UP, start)
        else:
            begin = lowest[1] if lowest[0] < DIP * self.set_speed / self.box.ratios[self.first] else start
            end = first_true((np.abs(self.slip(self.first)) <= SLIP_DOWN) & (self.n_out != lowest[0]), begin)
        if end is None:
            self.why.append(f"the unfiltered slip never came within {SLIP_UP if self.up else SLIP_DOWN:g} %")
        return end

    def recovered(self, end: int) -> int | None:
        """Return the sample at which the mean over 10 samples of the input speed is back at the set speed."""
        # movmean of an even window uses one sample more before than after the centre
        total = np.concatenate(([0.0], np.cumsum(self.n_in)))
        index = np.arange(self.n_in.size)
        low, high = np.maximum(index - 5, 0), np.minimum(index + 5, self.n_in.size)
        mean = (total[high] - total[low]) / (high - low)
        back = mean > SPEED_UP * self.set_speed if self.up else mean < SPEED_DOWN * self.set_speed
        at = first_true(back, end)
        if at is None:
            self.why.append(f"{self.box.input.speed} did not come back to its set speed")
        return at

    def settled(self, end: int, recovered: int, factor: float) -> int | None:
        """Return the first sample after which 999 samples of torque lie in the band with the engaging clutch above 20 bar."""
        late = recovered + SETTLED_AFTER
        if late + SETTLED_FOR >= self.torque_in.size:
            self.why.append(
                "the recording ends, or the next order comes, before the 0.6 s that Annex A takes for the settled torque"
            )
            return None
        # 1001 samples divided by 1000, as printed
        value = float(np.sum(self.torque_in[late : late + SETTLED_FOR + 1])) / SETTLED_FOR
        inside = (self.torque_in < factor * value) & (self.torque_in > (2.0 - factor) * value)
        outside = np.concatenate(([0], np.cumsum(~inside)))
        at = np.arange(end, late + 1)
        last = np.minimum(at + SETTLED_FOR, self.torque_in.size)
        met = (outside[last] - outside[at + 1] == 0) & (self.new_p[at] > CLAMPED) & (at + SETTLED_FOR <= self.torque_in.size)
        hit = first_true(met)
        if hit is None:
            self.why.append(f"{self.box.input.torque} did not stay within {factor:g} of {value:.1f} Nm for 999 samples")
            return None
        return int(at[hit])

    def total(self, start: int, end: int, c: float) -> float | None:
        """Return t_c: from the reaction of the engaging pressure to the slip end, plus the valve's response time."""
        if start < REST_BEFORE:
            self.why.append("t_c needs 1 s of recording before the releasing pressure falls")
            return None
        rise = self.rise_up(start, end, c) if self.up else self.rise_down(start)
        return None if rise is None else (end - rise) * PERIOD + (VALVE_DELAY_UP if self.up else VALVE_DELAY_DOWN)

    def rise_up(self, start: int, end: int, c: float) -> int | None:
        """Return the reaction of the engaging pressure of an upshift.

        The search goes backwards from the slip end: below 3 bar, then five successive samples that are at most c above rest.
        """
        pressure = self.new_p
        rest = float(np.mean(pressure[start - REST_BEFORE + 1 : start - REST_BEFORE + 1 + REST_FOR]))
        low = np.flatnonzero(pressure[: end + 1] <= OPEN)
        if low.size:
            calm = np.convolve(pressure[: low[-1] + 1] > rest + c, np.ones(5), "valid") < 0.5
            hits = np.flatnonzero(calm)
            if hits.size:
                return int(hits[-1]) + 4 - 5
        self.why.append(f"{self.new_name} was not at rest before it rose")
        return None

    def rise_down(self, start: int) -> int | None:
        """Return the reaction of the engaging pressure of a downshift.

        It is the first of three successive samples that are not exactly zero, searched from 1 s before the start on.
        """
        first = start - REST_BEFORE
        zero = self.new_p[first : start + 1] == 0.0
        near = zero[:-2] | zero[1:-1] | zero[2:]
        at = first_true(~near)
        if at is None or at == 0:
            self.why.append(
                f"t_c is counted from where {self.new_name} leaves exactly zero, and {self.new_name} "
                + ("never left it" if at is None else f"was not at zero 1 s before {self.old_name} fell")
            )
            return None
        return first + at

    def speed_change(self, start: int, end: int) -> float | None:
        """Return t_p: from the departure of the output speed by the printed rules to the slip end."""
        n, i = self.n_out, np.arange(start, end + 1)

        def at(later: int) -> np.ndarray:
            return n[np.minimum(i + later, n.size - 1)]

        if self.up:
            old = self.set_speed / self.box.ratios[self.first]
            grown = 1.025 * old
            rising = (at(0) <= at(1)) & (at(1) <= at(2)) & (at(2) <= at(3)) & (at(3) <= at(4))
            falling = (at(0) >= at(1)) & (at(1) >= at(2)) & (at(2) >= at(3)) & (at(3) >= at(4))
            met = (at(0) > old) & rising & (at(50) > grown) & (at(100) > grown)
            met |= (at(0) < old) & falling & (at(800) > grown) & (at(1000) > grown)
        else:
            old = self.set_speed / self.box.ratios[self.second]
            met = (at(0) < old) & (at(10) <= at(0)) & (at(1) > at(2)) & (at(100) <= 0.95 * old)
        departure = first_true(met)
        if departure is None:
            self.why.append(f"{self.box.output.speed} has no departure by Annex A's rule")
            return None
        return (end - int(i[departure])) * PERIOD

    def energy(self, first: int, last: int) -> float:
        """Return the program's sum from ``first`` to ``last`` [J]: J_od is divided by (41/40)^2, pi is 3.14."""
        last = min(last, self.torque_in.size - 1)
        part, rate = slice(first, last + 1), 2.0 * PI / 60.0
        work = rate * PERIOD * float(np.sum(self.torque_in[part] * self.n_in[part] - self.torque_out[part] * self.n_out[part]))
        # the differences of squares from sample to sample add up to the difference between the ends
        grown_in, grown_out = (float(n[last] ** 2 - n[first - 1] ** 2) for n in (self.n_in, self.n_out))
        inertias = self.box.inertias
        stored = 0.5 * rate**2 * (inertias.driving * grown_in + inertias.driven / inertias.reduction**2 * grown_out)
        return work - stored
