# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""One shift cut out of a recording, on arrays: the samples that limit it by the laboratory's definitions (thesis 7.1.5, (6.85)).

The records of analysis.metrics take their values from it; it depends neither on bags nor on ROS.

All filters are symmetric in time:

* pressures: mean over 1 ms, as the laboratory did (10 samples of 10 kHz). A class 0.25 transducer of 40 MPa
  then scatters by about 0.015 MPa, which at the 13 MPa/s of an emptying clutch corresponds to 1 ms.
* pressures against the kiss pressure and the level of the overlap: mean over 5 ms. A released clutch empties slowly there, and
  scatter would lengthen the overlap by counting a pressure that is above the level by chance.
* torques and speeds: mean over 2 ms, the laboratory's 20 samples for torque. Lock-up leaves a corner in the
  speeds; 2 ms move the 0.05 % crossing of a 0.1 s speed change by less than 1 ms, and reduce scatter to less
  than a quarter.
* slip thresholds: the encoder resolves 0.017 rev/s, 0.07 % of 1500 rpm, which is more than the thresholds. So
  the slip that the instruments show for a locked clutch is added to the threshold. It is the largest of the 99th percentile
  of the old gear's filtered slip before the order, half a quantum of each encoder, and 2.6 standard deviations of the
  filtered noise, but no more than 0.3 %. In addition the mean slip of the next 20 ms must meet the
  threshold, so that a crossing by chance or in passing does not end a shift.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from ..bags import Recording
from ..rig import Clutch, Shift, Transmission
from .clipped import drop_clipped
from .clutch_pressures import Passed, kiss_of, overlap_of
from .course import Course, course_of
from .definitions import (
    BEFORE,
    DIP,
    DIP_SEARCH,
    HOLD,
    LONGEST,
    PRESSURE_MEAN,
    RPM,
    SETTLED_AFTER,
    SETTLED_BAND,
    SETTLED_BAND_NM,
    SETTLED_FOR,
    SLIP_DOWN,
    SLIP_INSTRUMENT_LIMIT,
    SLIP_OLD_GEAR,
    SLIP_UP,
    STANDSTILL,
    TORQUE_SPEED_MEAN,
    withhold,
)
from .edges import all_ahead, first_true, mean_ahead, odd_width, quantum, ramp_start, running_mean, white_noise
from .lacking import what_is_missing
from .metrics import DETAILS, every_metric, metric_keys


def shifts(recording: Recording) -> list[dict]:
    """Return one row of metrics for each order of a driving gear; an order of neutral only ends the shift before it.

    A gear that is engaged while the input shaft stands still is not a shift and gets no row.
    """
    return [shift_metrics(recording, order, end) for order, end in orders_of(recording)]


def orders_of(recording: Recording) -> list[tuple[tuple[float, int, int], float | None]]:
    """Return the orders that are shifts, each with the time of the order after it (None for the last)."""
    return [(order, end) for order, end in with_ends(recording.orders) if is_shift(recording, order)]


def with_ends(orders: Iterable[tuple[float, int, int]]) -> list[tuple[tuple[float, int, int], float | None]]:
    """Return the orders of another gear by time, each with the time of the order after it (None for the last)."""
    orders = sorted(order for order in orders if order[1] != order[2])
    return list(zip(orders, [order[0] for order in orders[1:]] + [None]))


def is_shift(recording: Recording, order: tuple[float, int, int]) -> bool:
    """Return True when the ordered gear drives and is not engaged from neutral without slip, at standstill or in step."""
    return order[2] in recording.transmission.ratios and not (order[1] == 0 and without_slip(recording, order))


def without_slip(recording: Recording, order: tuple[float, int, int]) -> bool:
    """Return True when the input shaft stands still at an order, or turns with the output in the ratio of the open gear ordered."""
    box, t = recording.transmission, order[0]
    if stands(recording, t):
        return True
    around = {name: recording.part(name, *_around(recording, t)) for name in box.channels}
    if order[2] not in box.ratios or not all(len(one) and np.all(np.isfinite(one)) for one in around.values()):
        return False
    mean = {name: float(np.mean(one)) for name, one in around.items()}
    slip = box.slip(order[2], max(mean[box.input.speed], STANDSTILL), mean[box.output.speed])
    opened = any(mean[clutch.pressure] <= clutch.kiss_pressure for clutch in box.engaged(order[2]))
    return opened and abs(slip) <= SLIP_OLD_GEAR


def _around(recording: Recording, t: float) -> tuple[int, int]:
    """Return the first row of 0.01 s before and the one after 0.01 s behind a time [s], at 10 kHz."""
    at = int((t - recording.t0) / recording.period)
    return at - 100, at + 100


def stands(recording: Recording, t: float) -> bool:
    """Return True when the input shaft stands still around a time [s]."""
    around = recording.part(recording.transmission.input.speed, *_around(recording, t))
    return len(around) > 0 and bool(np.nanmax(np.abs(around)) < STANDSTILL)


def shift_metrics(recording: Recording, order: tuple[float, int, int], next_order_time: float | None = None) -> dict:
    """Return the metrics of one shift under :func:`metrics.metric_keys`; a bad shift does not raise an error.

    A value that cannot be found is None, with its reason in ``why``; one that is not defined on this rig or in this shift is None
    with its reason by its key in ``undefined`` (analysis.definitions), which makes no shift invalid. ``valid`` is True when the
    shift was completed, everything was found and the output never stood still: a shift under load does not interrupt the drive, and
    k has no meaning for an output that stood still. A missing dip does not make a shift invalid; ``k`` shows it. An engagement from
    neutral releases no clutch: there t_dt starts with the rise of the engaging pressure, and k and overlap_s are None without a
    reason. When several clutches are released, the one whose pressure falls first begins the shift. A clutch that stays engaged is
    not considered.

    Parameters
    ----------
    recording : Recording
        The logger's channels.
    order : (float, int, int)
        Time [s], gear before, gear ordered.
    next_order_time : float, optional
        Time of the next order [s], where the search ends at the latest.

    Returns
    -------
    dict
        One value per key.
    """
    t_order, from_gear, to_gear = order
    row = dict.fromkeys((*metric_keys(), *DETAILS))
    row.update(from_gear=int(from_gear), to_gear=int(to_gear), t_order_s=float(t_order), valid=False, why=[])
    shift = CutShift.cut(recording, order, next_order_time, row["why"])
    if shift is not None:
        shift.find()
        row.update((metric.key, metric.formed(shift, row)) for metric in every_metric())
        row["fall_s"] = shift.seconds(shift.end, shift.deepest)
        if shift.course is not None:
            row.update(torques=shift.course.torques, in_gear=shift.old is None or shift.old_slip is not None)
        drop_clipped(shift, row)
    row["valid"] = not row["why"]
    withhold(row, recording.transmission, every_metric())
    return row


@dataclass
class CutShift:
    """One shift cut out of a recording; sample 0 lies BEFORE ahead of the order.

    Attributes
    ----------
    box, shift : Transmission, Shift
        The transmission and what is engaged and released.
    period : float
        Time between samples [s].
    order : int
        Sample of the order.
    raw, smooth : dict of str to (n,) array of float
        The channels [SI], as they are and filtered.
    over : str
        A sentence on what ends the search for the shift.
    why : list of str
        Reasons for what was not found, which make the shift invalid.
    last : int
        The last sample that was used, where :meth:`find` is done.
    old_slip : float or None
        Mean slip of the old gear before the order.
    overlap, kiss : Passed
        Overlap and kiss point by the pressures.
    start : float or None
        Start of the pressure's change that begins the shift [sample].
    departure : float or None
        Departure of the output speed from its old value [sample].
    end, settled : int or None
        End of the shift, and where the input torque has settled [sample].
    course : Course or None
        The course of the torque from the order on.
    """

    box: Transmission
    shift: Shift
    period: float
    order: int
    raw: dict[str, np.ndarray]
    smooth: dict[str, np.ndarray]
    over: str
    why: list[str]
    last: int = 0
    old_slip: float | None = None
    overlap: Passed = field(default_factory=Passed)
    kiss: Passed = field(default_factory=Passed)
    start: float | None = None
    departure: float | None = None
    end: int | None = None
    settled: int | None = None
    course: Course | None = None

    @classmethod
    def cut(
        cls, recording: Recording, order: tuple[float, int, int], next_order_time: float | None, why: list[str]
    ) -> CutShift | None:
        """Return the samples around an order, or None with the reason in ``why``."""
        t_order, from_gear, to_gear = order
        at = int(np.ceil((t_order - recording.t0) / recording.period - 1e-6))
        first = max(0, at - int(round(BEFORE / recording.period)))
        over = f"a shift is looked for {LONGEST:g} s long"
        until = t_order + LONGEST
        if next_order_time is not None and next_order_time < until:
            until, over = next_order_time, f"the next order came at {next_order_time:.3f} s"
        last = int((until - recording.t0) / recording.period) + 1
        if last > recording.rows:
            last, over = recording.rows, f"the recording ends at {recording.t0 + recording.period * recording.rows:.3f} s"
        hold = int(round(HOLD / recording.period))
        if until == next_order_time and last - at < 2 * hold:
            why.append(f"{over}, {next_order_time - t_order:.3f} s after this one")
            return None
        if at - first < hold or last - at < 2 * hold:
            why.append(f"the recording does not cover the order at {t_order:.3f} s and the time around it")
            return None
        box = recording.transmission
        raw = {name: recording.part(name, first, last) for name in box.channels}
        if missing := what_is_missing(raw, recording.t0 + first * recording.period, recording.period):
            why.append(missing)
            return None
        shift = cls(
            box,
            box.shift(int(from_gear), int(to_gear)),
            recording.period,
            at - first,
            raw,
            smoothed(box, raw, recording.period),
            over,
            why,
        )
        if shift.before(box.input.speed) < 1.0:
            why.append("the input shaft did not turn when the shift was ordered")
            return None
        return shift

    def before(self, name: str) -> float:
        """Return the mean of a channel before the order."""
        return float(np.mean(self.raw[name][: self.order]))

    def change_before(self, name: str) -> float:
        """Return by how much a channel changed in BEFORE ahead of the order, by the line through it."""
        rows = np.arange(self.order) - 0.5 * (self.order - 1)
        return float(np.dot(rows, self.raw[name][: self.order]) / np.dot(rows, rows)) * self.samples(BEFORE)

    def samples(self, seconds: float) -> int:
        """Return the number of samples in a time [s], at least one."""
        return max(1, int(round(seconds / self.period)))

    def slip(self, gear: int, source: dict[str, np.ndarray]) -> np.ndarray:
        """Return the slip of a gear (6.85) as a share of the input speed, not in percent."""
        return self.box.slip(gear, np.maximum(source[self.box.input.speed], 1.0), source[self.box.output.speed])

    @property
    def new(self) -> int:
        """The gear that is ordered."""
        return self.shift.to_gear

    @property
    def old(self) -> int | None:
        """The gear that drove before the order; None from neutral."""
        return self.shift.from_gear if self.shift.from_gear in self.box.ratios else None

    @property
    def down(self) -> bool:
        """True for a shift to a slower output."""
        return self.shift.to_gear < self.shift.from_gear

    @property
    def name(self) -> str:
        """Name of the gear that is ordered."""
        return self.box.names[self.new]

    @property
    def way(self) -> float:
        """1 where the output of the ordered gear turns forwards, -1 where it turns backwards."""
        return 1.0 if self.box.ratios[self.new] > 0.0 else -1.0

    @property
    def turns_round(self) -> bool:
        """True for a change of direction."""
        return self.box.turns_round(self.shift.from_gear, self.shift.to_gear)

    def lowest(self, part: slice) -> float:
        """Return the output speed that is lowest in the direction of the ordered gear, within some samples [rad/s]."""
        return self.way * float((self.way * self.smooth[self.box.output.speed][part]).min())

    def find(self) -> None:
        """Find the samples that limit the shift, each by those before it, and the reasons for missing ones."""
        self.last = self.raw[self.box.input.speed].size - 1
        if self.was_in():
            return
        self.old_slip = self.check_old_gear()
        self.overlap, self.kiss = overlap_of(self), kiss_of(self)
        self.start = self.pressure_start()
        end = self.slip_end(self.start)
        if end is not None and end < self.order:
            self.why.append(f"the speeds were those of gear {self.name} before it was ordered")
            return
        self.end, self.departure = end, self.speed_departure(self.old_slip)
        if self.departure is None and end is not None and (self.old is None or self.old_slip is not None):
            self.why.append(f"{self.box.output.speed} never left its old value")
        if end is not None:
            self.settled = None if self.box.drive_yields else self.settled_after(end)
            # one that never settled is judged as long as the settled torque is looked for
            self.last = min(self.last, end + self.samples(SETTLED_AFTER)) if self.settled is None else self.settled
        self.course = course_of(self)
        if end is None:
            self.check_slipping()
        elif self.window is not None and self.old is not None and not self.turns_round:
            self.check_standstill(self.window)

    @cached_property
    def window(self) -> slice | None:
        """Samples of the time t_d from the start of a pressure's change to the end of the shift; None without one of them."""
        return None if self.start is None or self.end is None else slice(int(round(self.start)), self.end + 1)

    @property
    def extremes(self) -> slice | None:
        """Samples in which the highest torque and the lowest speed are looked for; None without a window."""
        return None if self.window is None or self.deepest is None else slice(self.window.start, self.deepest + 1)

    @cached_property
    def deepest(self) -> int | None:
        """Last sample whose extremes count: the end of the slip, or in a downshift where the output then stops falling.

        7.1.5 ends t_dtr behind the lowest output speed, which comes after the end of the slip where a shaft swings on.
        """
        if self.end is None or not self.down or self.old is None or self.turns_round:
            return self.end
        name = self.box.output.speed
        speed = self.way * self.smooth[name][self.end : self.last + 1]
        noise = max(quantum(self.raw[name]), white_noise(self.raw[name][: self.order]))
        rises = first_true(speed > np.minimum.accumulate(speed) + noise)
        fall = speed[:rises]
        return self.end + int(fall.argmin()) if fall.min() < speed[0] - noise else self.end

    def seconds(self, first: float | None, last: float | None) -> float | None:
        """Return the time between two samples [s]; None without one of them."""
        return None if first is None or last is None else (last - first) * self.period

    @property
    def interrupted(self) -> float | None:
        """Time from the departure of the output speed to the kiss point, in which no clutch carries the load [s]."""
        if self.departure is None or self.old is None or not self.shift.engaging:
            return None
        kiss = self.seconds(self.order, self.raw[self.box.input.speed].size - 1) if self.kiss.value is None else self.kiss.value
        return max(0.0, kiss - (self.departure - self.order) * self.period)

    @property
    def lowest_speed(self) -> float | None:
        """Lowest output speed of the shift [rad/s]; None in a change of direction, where it passes standstill by intent."""
        return None if self.extremes is None or self.turns_round else self.lowest(self.extremes)

    @property
    def speed_ratio(self) -> float | None:
        """Lowest output speed over that of the slower gear at the nominal input speed, which is that before the order."""
        if (lowest := self.lowest_speed) is None or self.old is None:
            return None
        return self.way * lowest / self.before(self.box.input.speed) * self.box.slower_ratio(self.old, self.new)

    def was_in(self) -> bool:
        """Return True, and add a reason, when a gear was engaged although the order was given as one from neutral."""
        if self.old is not None:
            return False
        for gear in self.box.ratios:
            mean = abs(float(np.mean(self.slip(gear, self.raw)[: self.order])))
            # the output may coast at the ratio of a gear that is not ordered
            if mean <= SLIP_OLD_GEAR and (
                gear == self.new or all(self.before(clutch.pressure) > clutch.kiss_pressure for clutch in self.box.engaged(gear))
            ):
                self.why.append(
                    f"gear {self.box.names[gear]} was in when {self.name} was ordered from neutral (slip {100.0 * mean:.1f} %)"
                )
                return True
        return False

    def check_old_gear(self) -> float | None:
        """Return the mean slip of the old gear before the order; None, with the reason, when that gear was not engaged."""
        if self.old is None:
            return None
        mean = float(np.mean(self.slip(self.old, self.raw)[: self.order]))
        if abs(mean) <= SLIP_OLD_GEAR:
            return mean
        self.why.append(f"gear {self.box.names[self.old]} was not in when {self.name} was ordered (slip {100.0 * mean:.1f} %)")
        return None

    def pressure_start(self) -> float | None:
        """Return the start [sample] of the first releasing pressure's fall, or without one of the first engaging one's rise."""
        falling = bool(self.shift.releasing)
        starts = [self.start_of(clutch, falling) for clutch in (self.shift.releasing if falling else self.shift.engaging)]
        return None if None in starts else min(starts, default=None)

    def start_of(self, clutch: Clutch, falling: bool) -> float | None:
        """Return the start of a pressure's fall or rise [sample]; None, with the reason, when it has none.

        The fall starts at the last crossing of a level a little under the old pressure before half of it is reached,
        so that a short sag before does not count; the crossing is followed back along its slope to the old pressure. The
        laboratory required four falling means in a row and that the pressure has vanished 50 to 100 ms later. The
        intention is the same, but that rule depends on noise and on the pressures of that rig.
        """
        name, kiss = clutch.pressure, clutch.kiss_pressure
        sign = -1.0 if falling else 1.0
        raw, smooth = self.raw[name], self.smooth[name]
        rest = float(np.median(smooth[: self.order]))
        if falling and rest < 2.0 * kiss:
            self.why.append(f"{name} was not up before the order, so it could not fall")
            return None
        size = rest if falling else kiss
        # half of the fall; the kiss point for a rise
        distance = 0.5 * size if falling else max(kiss - rest, 0.0)
        far = first_true(sign * (smooth - rest) >= distance, self.order)
        if far is None:
            self.why.append(f"{name} did not {'fall' if falling else f'rise above {kiss / 1e6:.2f} MPa'}")
            return None
        if falling and first_true(smooth < kiss, far) is None:
            self.why.append(f"{name} did not fall below {kiss / 1e6:.2f} MPa")
        # the level may drift between order and fall, so it is taken up to the fall, which is short in comparison
        rest = float(np.median(smooth[max(0, self.order - self.samples(BEFORE)) : far]))
        rise, moved = sign * (raw - rest), sign * (smooth - rest)
        noise = float(np.std(smooth[: self.order]))
        level = min(max(4.0 * noise, 0.02 * size), 0.4 * size)
        below = np.flatnonzero(moved[:far] < level)
        at = int(below[-1]) + 1 if below.size else far
        return ramp_start(rise, moved, at, 0.1 * size, self.samples(20e-3))

    def threshold(self) -> tuple[float, float]:
        """Return the slip threshold of the definition and the slip that the instruments add to it (module docstring)."""
        n_in, n_out = self.box.input.speed, self.box.output.speed
        ratio, speed = abs(self.box.ratios[self.new]), self.before(n_in)
        half_steps = 0.5 * (quantum(self.raw[n_in]) + ratio * quantum(self.raw[n_out])) / speed
        width = odd_width(TORQUE_SPEED_MEAN, self.period)
        noise = (
            2.6
            * np.hypot(white_noise(self.raw[n_in][: self.order]), ratio * white_noise(self.raw[n_out][: self.order]))
            / speed
            / np.sqrt(width)
        )
        shown = 0.0
        if self.old is not None:
            shown = float(np.percentile(np.abs(self.slip(self.old, self.smooth)[: self.order]), 99.0))
        limit = SLIP_DOWN if self.down else SLIP_UP
        return limit, min(max(half_steps, noise, shown), SLIP_INSTRUMENT_LIMIT)

    def slip_end(self, start: float | None) -> int | None:
        """Return the end of the shift [sample], when the new gear's slip is below its threshold and stays there, or None.

        Upshifts: below +0.05 %. Downshifts: within +-0.1 %. When the output dips below 0.95 of the input speed over i of the
        new gear, only samples after the deepest point of the dip count. The dip is measured at the input speed of the moment, so
        that a slowing input is not a dip.
        """
        slip = self.slip(self.new, self.smooth)
        limit, shown = self.threshold()
        limit += shown
        met = (np.abs(slip) < limit) if self.down else (slip < limit)
        met &= np.abs(mean_ahead(slip, self.samples(HOLD))) < limit
        begin = self.order if start is None else int(round(start))
        if self.down:
            deep = slip[begin : begin + self.samples(DIP_SEARCH)]
            if deep.size and deep.max() > DIP:
                begin += int(deep.argmax())
        end = first_true(met, begin)
        if end is None:
            rest = np.abs(slip[begin:])
            best = f" (closest {100.0 * rest.min():.2f} %)" if rest.size else ""
            self.why.append(f"the output never settled on the ratio of gear {self.name}{best}; {self.over}")
        return end

    def check_standstill(self, part: slice) -> None:
        """Add a reason when the output stood still within some samples of the shift, because the drive was interrupted."""
        stood = self.way * self.smooth[self.box.output.speed][part] < STANDSTILL
        if stood.any():
            self.why.append(f"the output stood still for {np.count_nonzero(stood) * self.period:.3f} s, the drive was interrupted")

    def check_slipping(self) -> None:
        """Add a reason when the new gear's clutches are steadily pressed and slip: the torque they carry and the torque demanded.

        The clutches' torque follows from the torque meter at the output and the output's inertia: output torque + J dw/dt. The
        demanded torque is the one before the order.
        """
        tail = slice(-self.samples(SETTLED_FOR), None)
        mean = {name: float(np.mean(values[tail])) for name, values in self.raw.items()}
        w_in, w_out, torque = mean[self.box.input.speed], mean[self.box.output.speed], mean[self.box.output.torque]
        slip = w_in - self.box.ratios[self.new] * w_out
        if w_in < STANDSTILL or slip < SLIP_OLD_GEAR * w_in:
            return
        for clutch in self.shift.engaging:
            pressure, earlier = (self.raw[clutch.pressure][part] for part in (tail, slice(2 * tail.start, tail.start)))
            if pressure.mean() < clutch.kiss_pressure or abs(pressure.mean() - earlier.mean()) > 0.05 * pressure.mean():
                return  # the clutch is open, which clutch_pressures reports, or its pressure still moves
        speed = self.smooth[self.box.output.speed][tail]
        growth = float(speed[-1] - speed[0]) / ((speed.size - 1) * self.period)
        carried = torque + self.box.inertias.on_output * growth
        before = self.before(self.box.output.torque)
        asked = "" if self.old is None else f", {before:.0f} Nm were asked before the order"
        names, pressed = (
            [form(clutch) for clutch in self.shift.engaging]
            for form in (lambda clutch: clutch.name, lambda clutch: f"{mean[clutch.pressure] / 1e6:.2f}")
        )
        several = len(names) > 1
        what = f"clutches {' and '.join(names)} still slip" if several else f"clutch {names[0]} still slips"
        self.why.append(
            f"{what} at the end by {slip * RPM:.0f} rpm of the input: {'they carry' if several else 'it carries'} "
            f"{carried:.0f} Nm to the output at {' and '.join(pressed)} MPa{asked}"
        )

    def speed_departure(self, old_slip: float | None) -> float | None:
        """Return the first departure of the output speed from its old value [sample].

        The old value is the input speed of the moment over the old ratio: while the old clutch still holds, a tie-up
        slows input and output together and the speed change has not begun. The level of 0.2 % of speed (or 4
        standard deviations) must be held for 5 ms; the delay of this detection is corrected along the slope. From neutral it is
        the first turn of the output.
        """
        if self.old is not None:
            if old_slip is None:
                return None
            raw, smooth = (self.slip(self.old, s) - old_slip for s in (self.raw, self.smooth))
        else:
            raw, smooth = (1.0 - self.slip(self.new, s) for s in (self.raw, self.smooth))
            rest = float(np.mean(raw[: self.order]))
            raw, smooth = raw - rest, smooth - rest
        level = max(4.0 * float(np.std(smooth[: self.order])), 0.2e-2)
        at = first_true(all_ahead(np.abs(smooth) > level, self.samples(5e-3)), self.order)
        if at is None:
            return None
        sign = np.sign(smooth[at])
        return ramp_start(sign * raw, sign * smooth, at, 2e-2, self.samples(20e-3))

    def settled_after(self, end: int) -> int | None:
        """Return when the input torque has settled after the end of the shift [sample], or None with the reason.

        As in Annex A, the input speed must be back above 99 % (up) or below 101 % (down) of its value before the order. The settled
        torque is the mean over 0.1 s, 0.5 s after that (or the last 0.1 s of a shorter recording). The torque has settled when
        it stays in a band around this value for 0.1 s. The band of 5 %, at least 2 Nm, is this project's choice.
        """
        name = self.box.input.torque
        speed, torque = self.smooth[self.box.input.speed], self.smooth[name]
        nominal, span = self.before(self.box.input.speed), self.samples(SETTLED_FOR)
        back = speed < 1.01 * nominal if self.down else speed > 0.99 * nominal
        recovered = first_true(back, end)
        late = (end if recovered is None else recovered) + self.samples(SETTLED_AFTER)
        late = min(late, torque.size - span)
        if late < end:
            self.why.append(f"{name} had no time to settle: {self.over}")
            return None
        value = float(np.mean(self.raw[name][late : late + span]))
        band = max(SETTLED_BAND * abs(value), SETTLED_BAND_NM)
        settled = first_true(all_ahead(np.abs(torque - value) < band, span), end)
        if settled is None:
            self.why.append(f"{name} did not settle at {value:.1f} Nm")
        return settled

    def energy_loss(self, last: int | None) -> float | None:
        """Return (6.108): work in minus work out minus growth of kinetic energy from the window's first sample to one [J].

        The powers are integrated unfiltered, because an integral averages already; the speeds at both ends are filtered. None
        without a window or the last sample.
        """
        if self.window is None or last is None:
            return None
        first, into, out = self.window.start, self.box.input, self.box.output
        part = slice(first, last + 1)
        power = self.raw[into.torque][part] * self.raw[into.speed][part] - self.raw[out.torque][part] * self.raw[out.speed][part]
        work = float(np.sum(0.5 * (power[1:] + power[:-1])) * self.period)
        stored = [self.box.inertias.kinetic(self.smooth[into.speed][i], self.smooth[out.speed][i]) for i in (first, last)]
        return work - float(stored[1] - stored[0])


def smoothed(box: Transmission, raw: dict[str, np.ndarray], period: float) -> dict[str, np.ndarray]:
    """Return the channels of the shift metrics after their filters (module docstring).

    Parameters
    ----------
    box : Transmission
        Gives the role of each channel.
    raw : dict of str to (n,) array of float
        The channels.
    period : float
        Time between samples [s].
    """
    pressures = {clutch.pressure for clutch in box.clutches}
    lengths = {name: PRESSURE_MEAN if name in pressures else TORQUE_SPEED_MEAN for name in box.channels}
    return {name: running_mean(raw[name], odd_width(length, period)) for name, length in lengths.items()}
