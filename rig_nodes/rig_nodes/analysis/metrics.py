# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Shift metrics by the laboratory's definitions (thesis 7.1.5, (6.85), (6.108), (7.3), (7.4)), on arrays.

Used by analysis.report and by whoever wants the numbers of one shift; knows nothing of bags or ROS.

Filters, all symmetric in time:

* pressures: mean over 1 ms, as the laboratory did (10 samples of 10 kHz). A class 0.25 transducer of 40 MPa
  then scatters by about 0.015 MPa, which at the 13 MPa/s of an emptying clutch is 1 ms.
* pressures against the kiss pressure: mean over 5 ms. A released clutch empties slowly there, 0.5 MPa/s, and
  scatter would lengthen the overlap by counting a pressure that is above the kiss point by chance.
* torques and speeds: mean over 2 ms, the laboratory's 20 samples for torque. Lock-up leaves a corner in the
  speeds; 2 ms move the 0.05 % crossing of a 0.1 s speed change by less than 1 ms, and reduce scatter to less
  than a quarter.
* slip thresholds: the encoder resolves 0.017 rev/s, 0.07 % of 1500 rpm, which is more than the thresholds. So
  what the instruments show for a locked clutch is added to the threshold: the 99th percentile of the old
  gear's filtered slip before the order, or half a quantum of each encoder, or 2.6 standard deviations of the
  filtered noise, whichever is most, but no more than 0.3 %. And the mean slip of the next 20 ms must meet the
  threshold too, so that a crossing by chance or in passing does not end a shift.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import pi

import numpy as np

from .edges import (
    all_ahead, first_true, mean_ahead, odd_width, quantum, ramp_start, running_mean, white_noise,
)
from .logged import Logged

RATIO = {1: 47.0 / 34.0, 2: 41.0 / 40.0}  # w_wej / w_wyj, thesis tab. 3.1
ROMAN = {0: "neutral", 1: "I", 2: "II"}
PRESSURE = {1: "p1", 2: "p2"}
KISS = {1: 0.17e6, 2: 0.36e6}  # pressure where the clutch's torque begins to rise [Pa], thesis 7.3.2
NEEDED = ("M_wej", "n_wej", "M_wyj", "n_wyj", "p1", "p2")
KEYS = ("from_gear", "to_gear", "n_wej_rpm", "m_wyj_nm", "t_dt_s", "t_p_s", "t_c_s", "t_o_s", "m_wej_max_nm",
        "n_wyj_min_rpm", "k", "e_loss_j", "e_loss_settled_j", "overlap_s", "valid", "t_order_s", "why")
RPM = 30.0 / pi
STANDSTILL = 1.0  # rad/s below which a shaft counts as standing

BEFORE = 0.2  # s before the order that give the state the shift starts from
LONGEST = 3.0  # s after the order in which a shift is looked for; untuned ones took over 1 s
PRESSURE_MEAN = 1e-3  # s
KISS_MEAN = 5e-3  # s
TORQUE_SPEED_MEAN = 2e-3  # s
HOLD = 20e-3  # s for which the mean slip must stay within the threshold
SLIP_UP, SLIP_DOWN = 0.05e-2, 0.1e-2  # thesis 7.1.5
SLIP_INSTRUMENT_LIMIT = 0.3e-2
SLIP_OLD_GEAR = 1e-2  # above it a gear is taken as not engaged before an order
DIP = 0.05  # the minimum counts as a dip below 0.95 n_wej / i1 (Annex A)
DIP_SEARCH = 2.0  # s in which Annex A looks for the minimum of a downshift
# Annex A leaves its factor open; 2 Nm is twice the torque meter's largest error
SETTLED_BAND, SETTLED_BAND_NM = 0.05, 2.0
SETTLED_FOR = 0.1  # s; Annex A: 1000 samples
SETTLED_AFTER = 0.5  # s after the input speed has recovered, where Annex A takes the settled torque


@dataclass(frozen=True)
class Inertias:
    """Reduced inertias of the energy equation (6.108).

    driving: on w0, motor included [kg m2] (thesis 7.3.1); driven: on the z5 axis, load pump included [kg m2].
    The defaults are the thesis's, and so is the use of the whole inertias beside work that is measured at the
    torque meters: motor and load pump lie outside them, so while the input speed has not recovered this loss
    counts the motor's own kinetic energy too. The heat itself stands in the report's energy balance.
    """

    driving: float = 0.709
    driven: float = 0.1273

    def kinetic(self, w_wej, w_wyj):
        """Kinetic energy [J] at these speeds [rad/s]; reducing from z5 to wk multiplies by (41/40)^2."""
        return 0.5 * self.driving * w_wej**2 + 0.5 * self.driven * RATIO[2] ** 2 * w_wyj**2


@dataclass(frozen=True)
class Recording(Logged):
    """A logger's channels of one run of the gearbox with the gear orders given in it.

    As Logged (rad/s, Nm, Pa gauge, A); orders: (time [s], gear before, gear ordered), 0 is neutral. The
    order's time is when the controller accepted it, whichever valve is switched first. Raises RigError when a
    channel of the shift metrics is missing or the shapes do not fit.
    """

    orders: list[tuple[float, int, int]] = field(default_factory=list)

    needed = NEEDED
    use = "shift metrics"


def shifts(recording: Recording, inertias: Inertias = Inertias()) -> list[dict]:
    """One row of metrics for each order of gear I or II; neutral only ends the shift before it.

    A gear laid in while the input shaft stands still is no shift and gets no row.
    """
    return [shift_metrics(recording, order, end, inertias) for order, end in orders_of(recording)]


def orders_of(recording: Recording) -> list[tuple[tuple[float, int, int], float | None]]:
    """The orders that are shifts, each with the time of the order after it (None for the last)."""
    orders = sorted(order for order in recording.orders if order[1] != order[2])  # the same again is no shift
    ends = [order[0] for order in orders[1:]] + [None]
    return [(order, end) for order, end in zip(orders, ends)
            if order[2] in RATIO and not (order[1] == 0 and stands(recording, order[0]))]


def stands(recording: Recording, t: float) -> bool:
    """The input shaft stands still around a time [s]."""
    at = int((t - recording.t0) / recording.period)
    around = recording.channels["n_wej"][max(0, at - 100):at + 100]
    return len(around) > 0 and bool(np.nanmax(np.abs(around)) < STANDSTILL)


def shift_metrics(recording: Recording, order: tuple[float, int, int], next_order_time: float | None = None,
                  inertias: Inertias = Inertias()) -> dict:
    """The metrics of one shift; see :data:`KEYS`. Never raises for a bad shift.

    What cannot be found is None, with its reason in ``why``; ``valid`` says that the shift was completed, all was
    found and the output never stood still: a shift under load does not interrupt the drive, and k of an output that
    stood says nothing of it. A dip that is none leaves a shift valid, ``k`` shows it. An engagement from neutral
    releases no clutch: there t_dt starts with the rise of the engaging pressure, and k and overlap_s are None
    without a reason.
    """
    t_order, from_gear, to_gear = order
    row = dict.fromkeys(KEYS)
    row.update(from_gear=int(from_gear), to_gear=int(to_gear), t_order_s=float(t_order), valid=False, why=[])
    shift = _Shift.cut(recording, order, next_order_time, row["why"])
    if shift is not None:
        shift.fill(row, inertias)
    row["valid"] = not row["why"]
    return row


@dataclass
class _Shift:
    """One shift cut out of a recording: raw and filtered channels, sample 0 is BEFORE ahead of the order."""

    period: float
    order: int  # sample of the order
    from_gear: int
    to_gear: int
    raw: dict[str, np.ndarray]
    smooth: dict[str, np.ndarray]
    over: str  # what ends the time in which the shift is looked for, as a sentence
    why: list[str]

    @classmethod
    def cut(cls, recording, order, next_order_time, why):
        """The samples around an order, or None with the reason in ``why``."""
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
        raw = {name: np.asarray(recording.channels[name][first:last], dtype=float) for name in NEEDED}
        bad = [name for name in NEEDED if not np.all(np.isfinite(raw[name]))]
        if bad:
            why.append(f"{', '.join(bad)} has values that are no numbers")
            return None
        lengths = {name: PRESSURE_MEAN if name in PRESSURE.values() else TORQUE_SPEED_MEAN for name in NEEDED}
        widths = {name: odd_width(length, recording.period) for name, length in lengths.items()}
        smooth = {name: running_mean(raw[name], widths[name]) for name in NEEDED}
        shift = cls(recording.period, at - first, int(from_gear), int(to_gear), raw, smooth, over, why)
        if shift.before("n_wej") < 1.0:
            why.append("the input shaft did not turn when the shift was ordered")
            return None
        return shift

    def before(self, name: str) -> float:
        """Mean of a channel before the order."""
        return float(np.mean(self.raw[name][: self.order]))

    def samples(self, seconds: float) -> int:
        return max(1, int(round(seconds / self.period)))

    def slip(self, gear: int, source: dict[str, np.ndarray]) -> np.ndarray:
        """Slip of a gear (6.85) as a share of n_wej, not in percent."""
        return 1.0 - source["n_wyj"] * RATIO[gear] / np.maximum(source["n_wej"], 1.0)

    def fill(self, row: dict, inertias: Inertias) -> None:
        """Put every metric that can be found into ``row``, and a reason for every one that cannot."""
        row["n_wej_rpm"] = self.before("n_wej") * RPM
        row["m_wyj_nm"] = self.before("M_wyj")
        if self.was_in():
            return
        old_slip = self.check_old_gear()
        row["overlap_s"] = self.overlap()
        start = self.pressure_start()
        end = self.slip_end(start)
        if end is None:
            self.check_slipping(inertias)
            return
        if end < self.order:
            self.why.append(f"the speeds were those of gear {ROMAN[self.to_gear]} before it was ordered")
            return
        row["t_c_s"] = (end - self.order) * self.period
        departure = self.speed_departure(old_slip)
        if departure is not None:
            row["t_p_s"] = (end - departure) * self.period
        settled = self.settled(end)
        if settled is not None:
            row["t_o_s"] = (settled - end) * self.period
        if start is None:
            return
        row["t_dt_s"] = (end - start) * self.period
        first = int(round(start))
        row["m_wej_max_nm"] = float(self.smooth["M_wej"][first : end + 1].max())
        lowest = float(self.smooth["n_wyj"][first : end + 1].min())
        row["n_wyj_min_rpm"] = lowest * RPM
        if self.from_gear in RATIO:
            # (7.3) and (7.4) both use i1; n_wej is the one before the order, the laboratory's nominal one
            row["k"] = lowest / self.before("n_wej") * RATIO[1]
            self.check_standstill(first, end)
        row["e_loss_j"] = self.energy_loss(first, end, inertias)
        if settled is not None:
            row["e_loss_settled_j"] = self.energy_loss(first, settled, inertias)

    def was_in(self) -> bool:
        """A gear was in where one was ordered from neutral, which is a reason."""
        if self.from_gear in RATIO:
            return False
        for gear in RATIO:
            mean = abs(float(np.mean(self.slip(gear, self.raw)[: self.order])))
            # the output may coast at the ratio of the gear that is not ordered
            if mean <= SLIP_OLD_GEAR and (gear == self.to_gear or self.before(PRESSURE[gear]) > KISS[gear]):
                self.why.append(f"gear {ROMAN[gear]} was in when {ROMAN[self.to_gear]} was ordered from neutral "
                                f"(slip {100.0 * mean:.1f} %)")
                return True
        return False

    def check_old_gear(self) -> float | None:
        """Mean slip of the old gear before the order; None, with the reason, when that gear was not in."""
        if self.from_gear not in RATIO:
            return None
        mean = float(np.mean(self.slip(self.from_gear, self.raw)[: self.order]))
        if abs(mean) <= SLIP_OLD_GEAR:
            return mean
        self.why.append(f"gear {ROMAN[self.from_gear]} was not in when {ROMAN[self.to_gear]} was ordered "
                        f"(slip {100.0 * mean:.1f} %)")
        return None

    def pressure_start(self) -> float | None:
        """Start of the releasing pressure's fall, or from neutral of the engaging one's rise [sample].

        The fall is the last passing of a level a little under the old pressure before half of it is reached,
        so that a short sag before does not count, followed back along its slope to the old pressure. The
        laboratory asked for four falling means in a row and the pressure to be gone 50 to 100 ms later: the
        same intention, but dependent on noise and on the pressures of that rig.
        """
        falling = self.from_gear in RATIO
        name = PRESSURE[self.from_gear if falling else self.to_gear]
        kiss = KISS[self.from_gear if falling else self.to_gear]
        sign = -1.0 if falling else 1.0
        raw, smooth = self.raw[name], self.smooth[name]
        rest = float(np.median(smooth[: self.order]))
        if falling and rest < 2.0 * kiss:
            self.why.append(f"{name} was not up before the order, so it could not fall")
            return None
        size = rest if falling else kiss
        # half way down; the kiss point on the way up
        distance = 0.5 * size if falling else max(kiss - rest, 0.0)
        far = first_true(sign * (smooth - rest) >= distance, self.order)
        if far is None:
            self.why.append(f"{name} did not {'fall' if falling else f'rise above {kiss / 1e6:.2f} MPa'}")
            return None
        if falling and first_true(smooth < kiss, far) is None:
            self.why.append(f"{name} did not fall below {kiss / 1e6:.2f} MPa")
        # the level may drift between order and fall: take it up to the fall, which is short against that
        rest = float(np.median(smooth[max(0, self.order - self.samples(BEFORE)) : far]))
        rise, moved = sign * (raw - rest), sign * (smooth - rest)
        noise = float(np.std(smooth[: self.order]))
        level = min(max(4.0 * noise, 0.02 * size), 0.4 * size)
        below = np.flatnonzero(moved[:far] < level)
        at = int(below[-1]) + 1 if below.size else far
        return ramp_start(rise, moved, at, 0.1 * size, self.samples(20e-3))

    def threshold(self) -> tuple[float, float]:
        """Slip threshold of the definition and what the instruments add to it (module docstring)."""
        ratio, speed = RATIO[self.to_gear], self.before("n_wej")
        half_steps = 0.5 * (quantum(self.raw["n_wej"]) + ratio * quantum(self.raw["n_wyj"])) / speed
        width = odd_width(TORQUE_SPEED_MEAN, self.period)
        noise = 2.6 * np.hypot(white_noise(self.raw["n_wej"][: self.order]),
                               ratio * white_noise(self.raw["n_wyj"][: self.order])) / speed / np.sqrt(width)
        shown = 0.0
        if self.from_gear in RATIO:
            shown = float(np.percentile(np.abs(self.slip(self.from_gear, self.smooth)[: self.order]), 99.0))
        limit = SLIP_DOWN if self.to_gear < self.from_gear else SLIP_UP
        return limit, min(max(half_steps, noise, shown), SLIP_INSTRUMENT_LIMIT)

    def slip_end(self, start: float | None) -> int | None:
        """End of the shift: slip of the new gear below its threshold and staying there [sample], or None.

        Upshifts: below +0.05 %. Downshifts: within +-0.1 %, and if the output dips below 0.95 n_wej / i1
        (taken at the input speed of the moment, so that a slowing input is no dip) only after the deepest
        point of the dip.
        """
        slip = self.slip(self.to_gear, self.smooth)
        limit, shown = self.threshold()
        limit += shown
        down = self.to_gear < self.from_gear
        met = (np.abs(slip) < limit) if down else (slip < limit)
        met &= np.abs(mean_ahead(slip, self.samples(HOLD))) < limit
        begin = self.order if start is None else int(round(start))
        if down:
            deep = slip[begin : begin + self.samples(DIP_SEARCH)]
            if deep.size and deep.max() > DIP:
                begin += int(deep.argmax())
        end = first_true(met, begin)
        if end is None:
            rest = np.abs(slip[begin:])
            best = f" (closest {100.0 * rest.min():.2f} %)" if rest.size else ""
            self.why.append(f"the output never settled on the ratio of gear {ROMAN[self.to_gear]}{best}; {self.over}")
        return end

    def check_standstill(self, first: int, end: int) -> None:
        """A reason where the output stood still between two samples of the shift: the drive was interrupted."""
        stood = self.smooth["n_wyj"][first : end + 1] < STANDSTILL
        if stood.any():
            self.why.append(f"the output stood still for {np.count_nonzero(stood) * self.period:.3f} s, the drive was "
                            "interrupted")

    def check_slipping(self, inertias: Inertias) -> None:
        """A reason where the new gear's clutch is steadily pressed and slips: what it carries, and what was asked.

        Behind the clutch the torque meter at the output shows what it carries, and the output's inertia what of it
        the load did not get: M_wyj + J dw/dt. Asked is the M_wyj from before the order.
        """
        tail = slice(-self.samples(SETTLED_FOR), None)
        mean = {name: float(np.mean(values[tail])) for name, values in self.raw.items()}
        slip = mean["n_wej"] - RATIO[self.to_gear] * mean["n_wyj"]
        if mean["n_wej"] < STANDSTILL or slip < SLIP_OLD_GEAR * mean["n_wej"]:
            return
        pressure, earlier = (self.raw[PRESSURE[self.to_gear]][part] for part in (tail, slice(2 * tail.start, tail.start)))
        if pressure.mean() < KISS[self.to_gear] or abs(pressure.mean() - earlier.mean()) > 0.05 * pressure.mean():
            return  # it is open, and overlap() says so, or its pressure still moves
        speed = self.smooth["n_wyj"][tail]
        growth = float(speed[-1] - speed[0]) / ((speed.size - 1) * self.period)
        carried = mean["M_wyj"] + inertias.driven * RATIO[2] ** 2 * growth
        asked = f", {self.before('M_wyj'):.0f} Nm were asked before the order" if self.from_gear in RATIO else ""
        self.why.append(f"clutch S{self.to_gear} still slips at the end by {slip * RPM:.0f} rpm of the input: it carries "
                        f"{carried:.0f} Nm to the output at {pressure.mean() / 1e6:.2f} MPa{asked}")

    def speed_departure(self, old_slip: float | None) -> float | None:
        """First departure of n_wyj from its old value [sample].

        The old value is n_wej of the moment over the old ratio: while the old clutch still holds, a tie-up
        slows input and output together and the speed change has not begun. The level of 0.2 % of speed (or 4
        standard deviations) must be held for 5 ms; its lateness is taken back along the slope. From neutral:
        the first turn of the output.
        """
        if self.from_gear in RATIO:
            if old_slip is None:
                return None
            raw, smooth = (self.slip(self.from_gear, s) - old_slip for s in (self.raw, self.smooth))
        else:
            raw, smooth = (1.0 - self.slip(self.to_gear, s) for s in (self.raw, self.smooth))
            rest = float(np.mean(raw[: self.order]))
            raw, smooth = raw - rest, smooth - rest
        level = max(4.0 * float(np.std(smooth[: self.order])), 0.2e-2)
        at = first_true(all_ahead(np.abs(smooth) > level, self.samples(5e-3)), self.order)
        if at is None:
            self.why.append("n_wyj never left its old value")
            return None
        sign = np.sign(smooth[at])
        return ramp_start(sign * raw, sign * smooth, at, 2e-2, self.samples(20e-3))

    def settled(self, end: int) -> int | None:
        """When M_wej has settled after the end of the shift [sample], or None with the reason.

        As Annex A: n_wej back above 99 % (up) or below 101 % (down) of its value before the order, settled
        torque = mean over 0.1 s, 0.5 s after that (or the last 0.1 s there is, if there is less); settled is
        where the torque stays in a band around it for 0.1 s. The band of 5 %, at least 2 Nm, is ours.
        """
        speed, torque = self.smooth["n_wej"], self.smooth["M_wej"]
        nominal, span = self.before("n_wej"), self.samples(SETTLED_FOR)
        back = speed > 0.99 * nominal if self.to_gear > self.from_gear else speed < 1.01 * nominal
        recovered = first_true(back, end)
        late = (end if recovered is None else recovered) + self.samples(SETTLED_AFTER)
        late = min(late, torque.size - span)
        if late < end:
            self.why.append(f"M_wej had no time to settle: {self.over}")
            return None
        value = float(np.mean(self.raw["M_wej"][late : late + span]))
        band = max(SETTLED_BAND * abs(value), SETTLED_BAND_NM)
        settled = first_true(all_ahead(np.abs(torque - value) < band, span), end)
        if settled is None:
            self.why.append(f"M_wej did not settle at {value:.1f} Nm")
        return settled

    def energy_loss(self, first: int, last: int, inertias: Inertias) -> float:
        """(6.108): work in minus work out minus growth of kinetic energy between two samples [J].

        The powers are integrated unfiltered (the integral is a mean already); the speeds at both ends are
        filtered.
        """
        part = slice(first, last + 1)
        m_wej, n_wej, m_wyj, n_wyj = (self.raw[name][part] for name in ("M_wej", "n_wej", "M_wyj", "n_wyj"))
        power = m_wej * n_wej - m_wyj * n_wyj
        work = float(np.sum(0.5 * (power[1:] + power[:-1])) * self.period)
        stored = [inertias.kinetic(self.smooth["n_wej"][i], self.smooth["n_wyj"][i]) for i in (first, last)]
        return work - float(stored[1] - stored[0])

    def pressed(self, gear: int) -> np.ndarray:
        """Where the clutch of a gear carries more than its kiss pressure, from the order on."""
        pressure = running_mean(self.raw[PRESSURE[gear]], odd_width(KISS_MEAN, self.period))
        return pressure[self.order :] > KISS[gear]

    def overlap(self) -> float | None:
        """Time in which both clutches carry more than their kiss pressure [s]; negative: in which neither
        does.
        """
        up = self.pressed(self.to_gear)
        if not up.any():
            self.why.append(f"{PRESSURE[self.to_gear]} never rose above {KISS[self.to_gear] / 1e6:.2f} MPa")
            return None
        if self.from_gear not in RATIO:
            return None
        old = self.pressed(self.from_gear)
        both, neither = np.count_nonzero(up & old), np.count_nonzero(~up & ~old)
        return float((both if both else -neither) * self.period)
