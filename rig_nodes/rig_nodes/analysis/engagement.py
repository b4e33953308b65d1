# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Evaluation of one engagement of one clutch from neutral, as in the profile series (thesis 7.1.3.3, 7.1.4, 7.3.2), on arrays.

The validation uses it on the 37 + 10 series for time, peak torque, kiss pressure and the shape of the rising pressure.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..bags import Recording
from ..rig import Clutch, Transmission
from .definitions import BEFORE, HOLD, TORQUE_SPEED_MEAN
from .edges import first_true, mean_ahead, odd_width, quantum, ramp_start, running_mean, white_noise
from .hum import QUIET, without_hum
from .lacking import what_is_missing
from .measured_error import TORQUE_CLEAR, Instrument
from .shift import smoothed

LONGEST = 3.0  # s after the order in which an engagement is searched
SLIP = 0.01e-2  # thesis 7.3.2
SLIP_INSTRUMENT_LIMIT = 0.5e-2  # largest allowance for the encoders: half a step of each is 0.24 % at 500 rpm
CLOSED_AFTER, CLOSED_FOR = 0.2, 0.3  # s: the closed clutch, after the lock-up has rung out
TORQUE_ERROR = 1.01  # Nm, largest error of the torque meter of tab. 7.1
PRESSURE_ERROR = 0.1e6  # Pa, largest error of the larger pressure transducer; used when the fitted transducer is not known
CONTACT = 20e-3  # s before and after contact over which the growths of pressure are compared
SHAPE_MEAN = 5e-3  # s: whole periods of a PWM of 200 Hz and more, and of a 2 ms hum to half a period
GRID = 1e-3  # s between the values in which level stretches are searched

# Limits of a level stretch (docs/background/analysis.md); shares are of the whole rise, from rest to end pressure.
LEVEL_SLOPE = 0.1  # its slope is at most this share of the mean slope of the rise
LEVEL_SWING = 0.02  # it swings by at most this share, or by the swing of the noise
LEVEL_BELOW = 0.8  # it lies below this share, with a regulation after it, and exceeds the rest by more than the
# transducer's largest error, with a fill before it
HOLD_SHORTEST = 20e-3  # s, one period of the mains hum, from which a shorter hold cannot be distinguished on the traces
RISEN, RISE_LEVEL = 0.05, 0.004  # shares at which the pressure has certainly risen, and at which it has left its rest
REACHED = 0.95  # share at which the end pressure counts as reached
RISE_REACH = 30e-3  # s, longest time that the first rise is followed back
NOISE_SWINGS, DIP_LEAST = 1.5, 0.005  # a dip must exceed this many swings of the quiet pressure and this share

# keys of a row of engagement_metrics; times in s after the order, values in SI
KEYS = (
    "gear",
    "t_order_s",
    "input_speed_before",
    "p_rest",
    "p_end",
    "rise_start_s",
    "rise_end_s",
    "slip_end_s",
    "engagement_s",
    "engagement_peak_nm",
    "input_torque_mean_nm",
    "p_kiss",
    "kiss_s",
    "fill_start_s",
    "fill_end_s",
    "fill_r2",
    "fill_slope",
    "growth_fill",
    "growth_contact",
    "hold",
    "hold_s",
    "hold_start_s",
    "hold_end_s",
    "hold_pressure",
    "level_s",
    "pressure_rise",
    "dip",
    "disturbance_start_s",
    "disturbance_end_s",
    "disturbed",
    "valid",
    "why",
)


def engagement_metrics(
    recording: Recording, order: tuple[float, int, int], instruments: dict[str, Instrument], next_order_time: float | None = None
) -> dict:
    """Return the metrics of the engagement of one clutch by one order from neutral; a bad engagement does not raise an error.

    A value that cannot be found is None, with its reason in ``why``. Values are SI (rad/s, Pa, Nm); times count from the order.

    * engagement_s: from the first rise of the clutch's pressure to slip (6.85) below 0.01 % (7.3.2), to which the slip that the
      encoders show for the closed clutch is added (docs/background/analysis.md).
    * engagement_peak_nm: highest input torque (mean over 2 ms) in that time. input_torque_mean_nm: its mean from 0.2 to 0.5 s
      after that time, or as far as recorded.
    * p_kiss: pressure at which the output torque (or the input torque when that does not grow) begins to rise clearly.
    * fill: from the first rise to contact or to the hold phase, whichever is first; fill_r2: of the straight line through it.
    * growth_fill, growth_contact: growth of pressure [Pa] in the 20 ms before and after contact.
    * hold: "hold" or "no hold"; hold_s is 0 without one. level_s: length of the longest level stretch, even when it is too short
      for a hold; averages over repeats should use it. pressure_rise: "three phases" or "no hold".
    * dip: largest fall of the pressure between first rise and the end pressure [Pa], from disturbance_start_s to
      disturbance_end_s; disturbed: "dips" or "monotone".

    Parameters
    ----------
    recording : Recording
        The logger's channels.
    order : (float, int, int)
        (time [s], 0, gear), as in Recording.orders.
    instruments : dict of str to Instrument
        Instruments of the rig by signal (uncertainty.instruments_of).
    next_order_time : float, optional
        Time at which the engagement ends at the latest [s]; 3 s after the order by default.

    Returns
    -------
    dict
        One value per key of :data:`KEYS`.
    """
    row = dict.fromkeys(KEYS)
    row.update(gear=int(order[2]), t_order_s=float(order[0]), valid=False, why=[])
    engagement = _Engagement.cut(recording, order, next_order_time, row["why"], instruments)
    if engagement is not None:
        engagement.fill_row(row)
    row["valid"] = not row["why"]
    return row


def engagement_ranks(rows: list[dict]) -> list[str | None]:
    """Return "dominated" or "not dominated" for each series of a valve (7.3.2), or None without all three values.

    A series is dominated when another series with a hold phase is better in peak torque (by more than 1.01 Nm, the torque
    meter's largest error), engagement time and length of the hold (each shorter by more than 0.01 s). A hold was
    requested, so a missing hold (hold_s 0) is worse than any.

    Parameters
    ----------
    rows : list of dict
        Rows of :func:`engagement_metrics`, or any with engagement_peak_nm, engagement_s, hold_s.

    Returns
    -------
    list of (str or None)
        One rank per row.
    """
    ranks: list[str | None] = []
    for row in rows:
        own = [row[key] for key in ("engagement_peak_nm", "engagement_s", "hold_s")]
        if None in own:
            ranks.append(None)
            continue
        better = any(
            other["hold_s"]
            and None not in (other["engagement_peak_nm"], other["engagement_s"])
            and own[0] - other["engagement_peak_nm"] > TORQUE_ERROR
            and own[1] - other["engagement_s"] > 0.01
            and (own[2] or np.inf) - other["hold_s"] > 0.01
            for other in rows
        )
        ranks.append("dominated" if better else "not dominated")
    return ranks


@dataclass
class _Engagement:
    """Channels around one order; sample 0 lies up to BEFORE ahead of it."""

    box: Transmission
    clutch: Clutch
    gear: int
    period: float
    order: int
    raw: dict[str, np.ndarray]
    smooth: dict[str, np.ndarray]
    why: list[str]
    pressure_error: float  # Pa, largest error of the clutch's transducer

    @classmethod
    def cut(
        cls,
        recording: Recording,
        order: tuple[float, int, int],
        next_order_time: float | None,
        why: list[str],
        instruments: dict[str, Instrument],
    ) -> _Engagement | None:
        """Return the samples around the order, or None with the reason in ``why``."""
        t_order, from_gear, gear = order
        box = recording.transmission
        if from_gear in box.ratios or gear not in box.ratios:
            driving = " or ".join(map(str, box.ratios))
            why.append(f"an engagement goes from neutral (0) to gear {driving}, not from {from_gear} to {gear}")
            return None
        engaging = box.shift(from_gear, gear).engaging
        if len(engaging) != 1:
            names = " and ".join(clutch.name for clutch in engaging)
            why.append(f"gear {box.names[gear]} engages {names}, and this is about an engagement of one clutch")
            return None
        pressure = engaging[0].pressure
        at = int(np.ceil((t_order - recording.t0) / recording.period - 1e-6))
        first = max(0, at - int(round(BEFORE / recording.period)))
        until = t_order + LONGEST if next_order_time is None else min(next_order_time, t_order + LONGEST)
        last = min(recording.rows, int((until - recording.t0) / recording.period) + 1)
        if (at - first) * recording.period < 0.05 or (last - at) * recording.period < 0.2:
            why.append(f"the recording does not cover the order at {t_order:.3f} s and the time around it")
            return None
        raw = {name: recording.part(name, first, last) for name in box.channels}
        if missing := what_is_missing(raw, recording.t0 + first * recording.period, recording.period):
            why.append(missing)
            return None
        if (at - first) * recording.period >= QUIET - 1e-9:
            # removed as for the valves' response, because hum would hide a level stretch
            t = recording.period * np.arange(last - first)
            raw[pressure] = without_hum(t, raw[pressure], at - first)[0]
        smooth = smoothed(box, raw, recording.period)
        error = instruments[pressure].error if pressure in instruments else 0.0
        return cls(box, engaging[0], int(gear), recording.period, at - first, raw, smooth, why, error or PRESSURE_ERROR)

    def samples(self, seconds: float) -> int:
        """Return the number of samples in a time [s], at least one."""
        return max(1, int(round(seconds / self.period)))

    def since(self, sample: float) -> float:
        """Return the seconds from the order to a sample."""
        return float((sample - self.order) * self.period)

    def fill_row(self, row: dict) -> None:
        """Put every value that can be found into the row, and a reason for every other one."""
        row["input_speed_before"] = float(np.mean(self.raw[self.box.input.speed][: self.order]))
        if row["input_speed_before"] < 1.0:
            self.why.append("the input shaft did not turn when the engagement was ordered")
            return
        name = self.clutch.pressure
        p = running_mean(self.raw[name], odd_width(SHAPE_MEAN, self.period))
        rest, end = self.levels(p)
        row["p_rest"], row["p_end"] = rest, end
        start = self.first_rise(name, p, rest, end)
        if start is None:
            return
        reached = first_true(p >= rest + REACHED * (end - rest), int(start))
        row["rise_start_s"], row["rise_end_s"] = self.since(start), self.since(reached)
        self.locking(row, start)
        kiss = self.kiss(row, start)
        level = self.level_stretch(p, rest, end, int(start), reached)
        row["level_s"] = 0.0 if level is None else max(0.0, (level[1] - level[0]) * self.period)
        hold = level if row["level_s"] >= HOLD_SHORTEST else None
        row["hold_s"] = 0.0 if hold is None else row["level_s"]
        row["hold"] = "no hold" if hold is None else "hold"
        row["pressure_rise"] = "no hold" if hold is None else "three phases"
        if hold is not None:
            row["hold_start_s"], row["hold_end_s"] = self.since(hold[0]), self.since(hold[1])
            row["hold_pressure"] = hold[2]
        self.filling(row, start, kiss, hold)
        self.dip(row, p, int(start), reached)

    def levels(self, p: np.ndarray) -> tuple[float, float]:
        """Return the pressure at rest before the order, and the end pressure, which the last tenth of the samples keeps."""
        return float(np.median(p[: self.order])), float(np.median(p[-max(1, (p.size - self.order) // 10) :]))

    def first_rise(self, name: str, p: np.ndarray, rest: float, end: float) -> float | None:
        """Return the first rise of the pressure as a fractional sample.

        It is the last crossing of a level just above the rest before 5 % of the rise are reached, so that an earlier sag or
        spike does not count; the crossing is followed back along its slope.
        """
        size, noise = end - rest, float(np.std(p[: self.order]))
        if size < max(20.0 * noise, 1e5):
            self.why.append(f"{name} did not rise: {rest / 1e6:.2f} MPa before the order, {end / 1e6:.2f} MPa at the end")
            return None
        moved = p - rest
        clear = first_true(moved >= RISEN * size, self.order)
        level = min(max(4.0 * noise, RISE_LEVEL * size), RISEN * size)
        below = np.flatnonzero(moved[:clear] < level)
        at = int(below[-1]) + 1 if below.size else clear
        start = ramp_start(self.raw[name] - rest, moved, at, RISEN * size, self.samples(RISE_REACH))
        return max(float(self.order), start)

    def locking(self, row: dict, start: float) -> None:
        """Determine slip end, engagement time, peak torque and the torque of the closed clutch."""
        n_in, n_out, torque = self.box.input.speed, self.box.output.speed, self.box.input.torque
        ratio = abs(self.box.ratios[self.gear])
        slip = self.box.slip(self.gear, np.maximum(self.smooth[n_in], 1.0), self.smooth[n_out])
        # the slip that the instruments show for the closed clutch, at the end of the recording
        tail = slip[-self.samples(BEFORE) :]
        speed = row["input_speed_before"]
        half_steps = 0.5 * (quantum(self.raw[n_in]) + ratio * quantum(self.raw[n_out])) / speed
        noise = (
            2.6
            * np.hypot(white_noise(self.raw[n_in][: self.order]), ratio * white_noise(self.raw[n_out][: self.order]))
            / speed
            / np.sqrt(odd_width(TORQUE_SPEED_MEAN, self.period))
        )
        shown = max(half_steps, noise, float(np.percentile(np.abs(tail), 99.0)))
        limit = SLIP + min(shown, SLIP_INSTRUMENT_LIMIT)
        end = first_true((slip < limit) & (np.abs(mean_ahead(slip, self.samples(HOLD))) < limit), int(start))
        if end is None:
            self.why.append(f"the clutch never closed (least slip {100.0 * float(slip[int(start) :].min()):.2f} %)")
            return
        row["slip_end_s"], row["engagement_s"] = self.since(end), float((end - start) * self.period)
        row["engagement_peak_nm"] = float(self.smooth[torque][int(start) : end + 1].max())
        first = end + self.samples(CLOSED_AFTER)
        closed = self.raw[torque][first : first + self.samples(CLOSED_FOR)]
        if closed.size < self.samples(0.1):
            self.why.append("the recording ends too early after the clutch has closed to determine its torque")
        else:
            row["input_torque_mean_nm"] = float(np.mean(closed))

    def kiss(self, row: dict, start: float) -> int | None:
        """Return the sample at which the transmitted torque begins to rise clearly, and put its pressure into the row.

        It is the last crossing, before 10 Nm are added, of a level above the torque before; the distance of the level is the torque
        meter's largest error (or 4 standard deviations). The crossing is followed back along its slope. Drag of the open pack grows
        slowly and does not count.
        """
        output, into = self.box.output.torque, self.box.input.torque
        way = 1.0 if self.box.ratios[self.gear] > 0.0 else -1.0  # in which the output torque of a driving gear grows
        for name, grows in ((output, way), (into, 1.0)):
            before = self.smooth[name][: self.order]
            # the torque may drift until the clutch fills, so the level is taken at the first rise
            near = self.smooth[name][max(0, int(start) - self.samples(20e-3)) : int(start) + 1]
            grown = grows * (self.smooth[name] - float(np.mean(near)))
            clear = first_true(grown >= TORQUE_CLEAR, int(start))
            if clear is None:
                continue
            level = min(max(TORQUE_ERROR, 4.0 * float(np.std(before))), TORQUE_CLEAR)
            below = np.flatnonzero(grown[int(start) : clear] < level)
            at = int(start) + (int(below[-1]) + 1 if below.size else 0)
            raw = grows * (self.raw[name] - float(np.mean(near)))
            at = int(round(max(start, ramp_start(raw, grown, at, 0.5 * TORQUE_CLEAR, self.samples(20e-3)))))
            row["kiss_s"], row["p_kiss"] = self.since(at), float(self.smooth[self.clutch.pressure][at])
            return at
        self.why.append(f"neither {output} nor {into} rose by {TORQUE_CLEAR:g} Nm")
        return None

    def level_stretch(self, p: np.ndarray, rest: float, end: float, start: int, reached: int) -> tuple[float, float, float] | None:
        """Return (start, end, pressure) of the longest level stretch of the rise, or None without one.

        In a level stretch, swing and slope are within their limits. It lies between fill and regulation: neither near the rest nor
        near the end pressure. Its ends are where the pressure leaves the level, followed back along the slopes.
        """
        size, step = end - rest, self.samples(GRID)
        limit = LEVEL_SLOPE * size / max((reached - start) * self.period, GRID)
        swing = max(LEVEL_SWING * size, self.quiet_swing(p))
        grid = p[start : reached + 1 : step]
        above = self.pressure_error
        middle = (grid > rest + above) & (grid < rest + LEVEL_BELOW * size)
        found = _longest_level(grid, middle, swing, limit * step * self.period)
        if found is None:
            return None
        first, last = (start + i * step for i in found)
        part = p[first : last + 1]
        level = float(np.median(part))
        reach, span = self.samples(20e-3), 2.0 * swing
        # the rise from the level is searched forwards, the fall below it backwards
        up = ramp_start(p - level, p - level, self.leaving(p - level, last, swing), span, reach)
        turned = level - p[::-1]
        down = p.size - 1 - ramp_start(turned, turned, self.leaving(turned, p.size - 1 - first, swing), span, reach)
        return max(down, float(start)), up, level

    @staticmethod
    def leaving(rise: np.ndarray, near: int, swing: float) -> int:
        """Return the first sample beyond the swing around a level, counted from inside the level."""
        at = first_true(rise > 0.5 * swing, near - 1)
        return near if at is None else at

    def quiet_swing(self, p: np.ndarray) -> float:
        """Return the largest swing of the filtered pressure while the clutch is at rest: before the order and at the end."""
        tail = p[-self.samples(BEFORE) :]
        return max(float(np.ptp(part)) for part in (p[: self.order], tail))

    def filling(self, row: dict, start: float, kiss: int | None, hold: tuple[float, float, float] | None) -> None:
        """Determine the fill phase with its straight line, and the growth of pressure around contact."""
        p = self.smooth[self.clutch.pressure]
        ends = [e for e in (kiss, None if hold is None else int(hold[0])) if e is not None]
        first = int(round(start))
        if ends and min(ends) - first >= self.samples(5e-3):
            part = np.arange(first, min(ends) + 1)
            slope, offset = np.polyfit((part - first) * self.period, p[part], 1)
            rest = p[part] - offset - slope * (part - first) * self.period
            row["fill_start_s"], row["fill_end_s"] = self.since(start), self.since(min(ends))
            row["fill_slope"] = float(slope)
            row["fill_r2"] = float(1.0 - np.sum(rest**2) / np.sum((p[part] - np.mean(p[part])) ** 2))
        else:
            self.why.append("the fill phase cannot be distinguished from what follows")
        if kiss is not None and kiss - self.samples(CONTACT) >= 0 and kiss + self.samples(CONTACT) < p.size:
            row["growth_fill"] = float(p[kiss] - p[kiss - self.samples(CONTACT)])
            row["growth_contact"] = float(p[kiss + self.samples(CONTACT)] - p[kiss])

    def dip(self, row: dict, p: np.ndarray, start: int, reached: int) -> None:
        """Determine the largest fall of the pressure from a peak after the first rise, and when the pressure has recovered from it.

        The search ends 0.2 s after the end pressure is reached, because an overshoot may come down only then.
        """
        part = p[start : reached + self.samples(BEFORE)]
        highest = np.maximum.accumulate(part)
        low = int(np.argmax(highest - part))
        row["dip"] = float(highest[low] - part[low])
        least = max(NOISE_SWINGS * self.quiet_swing(p), DIP_LEAST * (row["p_end"] - row["p_rest"]))
        row["disturbed"] = "dips" if row["dip"] > least else "monotone"
        if row["disturbed"] == "dips":
            peak = int(np.argmax(part[: low + 1]))
            again = first_true(part >= highest[low], low)
            row["disturbance_start_s"] = self.since(start + peak)
            row["disturbance_end_s"] = self.since(start + (part.size - 1 if again is None else again))


def _longest_level(grid: np.ndarray, middle: np.ndarray, swing: float, slope: float) -> tuple[int, int] | None:
    """Return the first and last index of the longest level stretch inside ``middle``.

    It swings by at most ``swing``, and its fitted slope is at most ``slope`` per step. The result is None when not even three
    successive values are level.
    """
    from scipy.ndimage import maximum_filter1d, minimum_filter1d  # imported here: it takes 0.1 s that most reports do not need

    index, away = np.arange(grid.size), grid - grid[0]
    total, moment = (np.concatenate(([0.0], np.cumsum(x))) for x in (away, index * away))
    outside = np.concatenate(([0], np.cumsum(~middle)))
    runs = np.diff(np.flatnonzero(np.diff(np.concatenate(([0], middle.astype(int), [0])))))[::2]
    for length in range(int(runs.max()) if runs.size else 0, 2, -1):
        shift, count = length // 2, grid.size - length + 1
        # the filter's values are shifted so that value i belongs to the stretch that begins at i
        highest = maximum_filter1d(grid, length)[shift : shift + count]
        lowest = minimum_filter1d(grid, length)[shift : shift + count]
        first, last = index[:count], index[:count] + length
        # least squares over each stretch, from running sums
        centred = moment[last] - moment[first] - (first + 0.5 * (length - 1)) * (total[last] - total[first])
        fitted = centred / (length * (length**2 - 1) / 12.0)
        hit = first_true((highest - lowest <= swing) & (outside[last] == outside[first]) & (np.abs(fitted) <= slope))
        if hit is not None:
            return hit, hit + length - 1
    return None
