# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Largest errors of the laboratory's instruments by (7.1) (thesis tab. 7.1), carried over to the results computed from them.

The report shows them beside each metric, and comparisons with the laboratory use them. They need only the
results: a row of shift metrics, of a single engagement, or of a coast-down.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from ..base.clocks import ROW
from ..rig.transmission import Transmission, transmission_of
from .metrics import RPM, SETTLED_BAND, SETTLED_BAND_NM, TORQUE_SPEED_MEAN

STEEP_RISE = 45e-3  # s in which the steeper pressure of chapter 9, and with it the torque, rises from contact to its end
TORQUE_CLEAR = 10.0  # Nm, a change that is certainly a rise of torque


@dataclass(frozen=True)
class Instrument:
    """One instrument in SI: measuring range, accuracy class [% of the range], readability."""

    range: float
    accuracy_class: float
    readability: float = 0.0

    @property
    def error(self) -> float:
        """Largest error by (7.1): range * class / 100 + readability."""
        return self.range * self.accuracy_class / 100.0 + self.readability


READABILITY = {"torque": 0.01}  # Nm, tab. 7.1


def instruments_of(configuration: Mapping) -> dict[str, Instrument]:
    """Return the torque meter, the pressure transducers of the clutches and the encoder of a rig [SI].

    Range, class and the encoder's step are the rig's; the readability of 0.01 Nm is that of tab. 7.1. Where input and output
    have instruments of their own, that with the larger error counts. True values (effects.transducers off) have no error.

    Parameters
    ----------
    configuration : mapping
        Record of the rig with its structure, as its bag holds it.

    Returns
    -------
    dict of str to Instrument
        ``torque``, ``speed``, and the transducers by the signals of the pressures.
    """
    box = transmission_of(configuration)
    pressures = [clutch.pressure for clutch in box.clutches if clutch.pressure]
    if not configuration["effects"]["transducers"]:
        return dict.fromkeys(("torque", *pressures, "speed"), Instrument(0.0, 0.0))
    likes = {one["name"]: one["like"] for one in configuration["structure"]["transducers"]}
    fitted = configuration["instruments"]

    def analog(signal: str, readability: float = 0.0) -> Instrument:
        like = likes.get(signal, signal)
        return Instrument(float(fitted[f"{like}_range"]), 100.0 * float(fitted[f"{like}_class"]), readability)

    def encoder(signal: str) -> Instrument:
        like = likes.get(signal, signal)
        return Instrument(float(fitted[f"{like}_range"]), 0.0, float(fitted[f"{like}_step"]))

    torques = [analog(end.torque, READABILITY["torque"]) for end in (box.input, box.output)]
    speeds = [encoder(end.speed) for end in (box.input, box.output)]
    return {
        "torque": max(torques, key=lambda one: one.error),
        **{name: analog(name) for name in pressures},
        "speed": max(speeds, key=lambda one: one.error),
    }


def temperature_error(oil: float) -> float:
    """Return the largest error of the PT100 [K] at an oil temperature [degC], (7.2)."""
    return 0.3 + 0.005 * abs(oil)


def uncertainty(row: dict, instruments: dict[str, Instrument], transmission: Transmission, period: float = ROW) -> dict[str, float]:
    """Return the largest error of each metric of a row, under the metric's own key and in its unit.

    Metrics that are None have no error. The errors are bounds, not standard deviations: all errors are taken at their largest
    and added (first order). When several clutches are released, the largest error counts.

    * Input speed, output torque, lowest speed: the instrument's own. k: both speeds, relative errors added. Peak: the torque
      meter's error, plus the amount by which a mean over 2 ms, or a sample of a slower logger, lowers the peak of a torque that
      rises to it in 45 ms and then breaks down (this part only reads low); the highest and the lowest torque alike, from one to
      the other, or within t_p when that is shorter. The time of an extreme: the torque meter's error on that rise. A reversed
      torque is taken as half a sine.
    * Times: one sample period, half the filter (1 ms), and at each end the instrument's error divided by the slope of the signal
      that crosses a threshold there. Slip ends count both encoders' resolution divided by the slip's rate, which is the change of
      ratio over t_p. The releasing pressure falls as fitted in chapter 9; its error counts in full although a constant
      part of it would cancel. Overlap and kiss point: the transducer's error by the rates at which it passed the levels that
      decide them. t_c starts at the order, which is known. Torque decays exponentially from its peak into the settled band
      within t_o.
    * Energies: torques by w t, speeds by M t and J w at both ends, and the times' errors by the power that they cut off; the
      torque over the shift is taken as its peak, the output speed as its lowest.

    Parameters
    ----------
    row : dict
        Row of metrics.shift_metrics.
    instruments : dict of str to Instrument
        Torque, speed and each clutch's pressure (instruments_of).
    transmission : Transmission
        That of the rig.
    period : float
        Time between the logger's samples [s].

    Returns
    -------
    dict of str to float
        Largest error by key.
    """
    torque, speed = instruments["torque"].error, instruments["speed"].error
    found = {"input_speed_rpm": speed * RPM, "output_torque_nm": torque}
    found |= dict.fromkeys(("output_speed_min_rpm", "output_speed_low_rpm"), speed * RPM)
    if row["input_torque_max_nm"] is not None:
        found["input_torque_max_nm"] = torque + 0.5 * max(TORQUE_SPEED_MEAN, period) * abs(row["input_torque_max_nm"]) / STEEP_RISE
    w_in = None if row["input_speed_rpm"] is None else row["input_speed_rpm"] / RPM
    if row["k"] is not None:
        # not divided by the lowest speed, which may be 0
        ratio = transmission.slower_ratio(row["from_gear"], row["to_gear"])
        found["k"] = (
            ratio * speed * RPM / row["input_speed_rpm"] * (1.0 + abs(row["output_speed_min_rpm"]) / row["input_speed_rpm"])
        )
    if w_in:
        found |= _times(row, instruments, w_in, transmission, period) | _course(row, torque, period)
        found |= _energies(row, found, torque, speed, w_in, transmission)
    return {key: value for key, value in found.items() if row.get(key) is not None}


def _course(row: dict, torque: float, period: float) -> dict[str, float]:
    """Return the errors of the extremes of the input torque, of their times, and of the time in which it is reversed."""
    ends, found = period + 0.5 * TORQUE_SPEED_MEAN, {}
    high, low = row.get("input_torque_high_nm"), row.get("input_torque_low_nm")
    if high is None or low is None:
        return found
    swing, rise = max(high - low, torque), min(STEEP_RISE, row["t_p_s"] or STEEP_RISE)  # at low speed a shift is over sooner
    found |= dict.fromkeys(
        ("input_torque_high_nm", "input_torque_low_nm"), torque + 0.5 * max(TORQUE_SPEED_MEAN, period) * swing / rise
    )
    found["t_high_s"] = ends + torque * STEEP_RISE / swing  # the lowest may lie anywhere on a flat stretch
    if reversed_s := row.get("reversed_s"):
        found["reversed_s"] = 2.0 * (
            ends + torque * reversed_s / (math.pi * max(-low if row["output_torque_nm"] > 0.0 else high, torque))
        )
    return found


def _times(row: dict, use: dict[str, Instrument], w_in: float, box: Transmission, period: float) -> dict[str, float]:
    """Return the errors of the times; those whose inputs are missing are left out."""
    ends = period + 0.5 * TORQUE_SPEED_MEAN
    new, old = row["to_gear"], row["from_gear"]
    moved, found = box.shift(old, new), {}
    slip_end = None
    if row["t_p_s"]:
        # from neutral, the slip of the new gear goes from 1 to 0
        change = abs(1.0 - box.ratios[new] / box.ratios[old]) if old in box.ratios else 1.0
        resolution = use["speed"].error * (1.0 + abs(box.ratios[new])) / w_in
        slip_end = ends + resolution * row["t_p_s"] / change
        found["t_p_s"] = 2.0 * slip_end
        found["t_c_s"] = slip_end
        found["t_dt_s"] = (
            slip_end + ends + max(use[clutch.pressure].error / clutch.fall_rate for clutch in moved.releasing or moved.engaging)
        )
    if slip_end is not None and row["t_o_s"] is not None and row["input_torque_max_nm"]:
        found["t_o_s"] = slip_end + ends + _settling_error(row, use["torque"].error, box)
    pressure = max((use[clutch.pressure].error for clutch in (*moved.releasing, *moved.engaging)), default=0.0)
    if row.get("overlap_mpas"):
        found["overlap_s"] = 2.0 * ends + 1e-6 * pressure / row["overlap_mpas"]
    if row.get("kiss_mpas"):
        found["kiss_s"] = ends + 1e-6 * pressure / row["kiss_mpas"]
    if row.get("departure_s") is not None:
        change = abs(1.0 - box.ratios[new] / box.ratios[old]) if old in box.ratios else 1.0
        span = row["t_p_s"] or row.get("interrupted_s") or 0.0
        found["departure_s"] = ends + use["speed"].error * (1.0 + abs(box.ratios[new])) / w_in * span / change
        if row.get("interrupted_s"):
            found["interrupted_s"] = found["departure_s"] + found.get("kiss_s", 0.0)
    return found


def _settling_error(row: dict, torque: float, box: Transmission) -> float:
    """Return the torque meter's error over the slope with which the torque enters its settled band [s].

    A torque that decays as exp(-t/T) from an excess P into a band B within t_o = T ln(P/B) enters it with the slope B/T.
    """
    peak = row["input_torque_max_nm"]
    settled = abs(row["output_torque_nm"] or 0.0) / abs(box.ratios[row["to_gear"]])
    band = max(SETTLED_BAND * settled, SETTLED_BAND_NM)
    excess = max(peak - settled, math.e * band)  # a lower peak enters its band more steeply than this
    return torque * row["t_o_s"] / (band * math.log(excess / band))


def _energies(row: dict, errors: dict, torque: float, speed: float, w_in: float, box: Transmission) -> dict[str, float]:
    """Return the errors of both energy losses; empty when the row lacks their inputs."""
    needed = ("input_torque_max_nm", "t_dt_s", "output_torque_nm")
    if any(row[key] is None for key in needed) or "t_dt_s" not in errors:
        return {}
    w_out = w_in / abs(box.ratios[row["to_gear"]])
    rate = torque * (w_in + w_out) + speed * (row["input_torque_max_nm"] + abs(row["output_torque_nm"]))
    ends = 2.0 * speed * (box.inertias.driving * w_in + box.inertias.on_output * w_out)
    found = {}
    for key, span, error in (
        ("e_loss_j", row["t_dt_s"], errors["t_dt_s"]),
        ("e_loss_settled_j", row["t_dt_s"] + (row["t_o_s"] or 0.0), errors["t_dt_s"] + errors.get("t_o_s", 0.0)),
    ):
        if row[key] is not None and span > 0.0:
            # the error of the window cuts off the mean power of the loss
            found[key] = rate * span + ends + abs(row[key]) / span * error
    return found


def engagement_uncertainty(
    row: dict, instruments: dict[str, Instrument], transmission: Transmission, period: float = ROW
) -> dict[str, float]:
    """Return the largest errors of a row of engagement.engagement_metrics, as :func:`uncertainty` does.

    Only values that were found have an error. Pressures have the transducer's error. The kiss pressure also has the growth of the
    pressure while the torque rises by the torque meter's error; the torque rises by at least 10 Nm in the 20 ms
    after contact. Times have a sample and half a filter at each end; the engagement time also has the transducer's error divided
    by the fill's slope, and both encoders' resolution divided by the slip's rate.

    Parameters
    ----------
    row : dict
        Row of engagement.engagement_metrics.
    instruments, transmission, period
        As for :func:`uncertainty`.

    Returns
    -------
    dict of str to float
        Largest error by key.
    """
    torque, speed = instruments["torque"].error, instruments["speed"].error
    pressure = max(instruments[clutch.pressure].error for clutch in transmission.engaged(row["gear"]))
    ends = period + 0.5 * TORQUE_SPEED_MEAN
    found = {"input_torque_mean_nm": torque, "p_rest": pressure, "p_end": pressure, "hold_pressure": pressure, "p_kiss": pressure}
    if row["engagement_peak_nm"] is not None:
        found["engagement_peak_nm"] = torque + 0.5 * TORQUE_SPEED_MEAN * row["engagement_peak_nm"] / STEEP_RISE
    if row["growth_contact"] is not None:
        found["p_kiss"] += abs(row["growth_contact"]) * torque / TORQUE_CLEAR
    if row["engagement_s"] and row["fill_slope"]:
        resolution = speed * (1.0 + transmission.ratios[row["gear"]]) / row["input_speed_before"]
        found["engagement_s"] = 2.0 * ends + pressure / abs(row["fill_slope"]) + resolution * row["engagement_s"]
    if row["hold_s"]:
        found["hold_s"] = 2.0 * ends
    return {key: value for key, value in found.items() if row[key] is not None}


def coast_down_uncertainty(result: dict, instruments: dict[str, Instrument]) -> dict[str, float]:
    """Return the largest errors of coast_down.coast_down: torque, tangent time, inertia.

    The error of the tangent time is that of two encoder steps over its first second.
    """
    torque_error, speed_error = instruments["torque"].error, instruments["speed"].error
    torque, tangent = result["coast_down_torque_nm"], result["coast_down_tangent_s"]
    slope = -result["coefficients"][-2]
    found = {"coast_down_torque_nm": torque_error, "coast_down_tangent_s": tangent * 2.0 * speed_error / slope}
    share = torque_error / torque + found["coast_down_tangent_s"] / tangent
    return found | {"inertia": result["inertia"] * share}
