# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Largest errors of the laboratory's instruments by (7.1) (thesis tab. 7.1), carried over to the results computed from them.

The report shows them beside each metric, and comparisons with the laboratory use them. They need only the
results: a row of shift metrics, of a single engagement, or of a coast-down.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from ..base import ROW
from ..rig import Transmission, transmission_of
from .definitions import TORQUE_SPEED_MEAN
from .metric_errors import STEEP_RISE, ErrorBasis
from .metrics import every_metric

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


def uncertainty(
    row: Mapping, instruments: dict[str, Instrument], transmission: Transmission, period: float = ROW
) -> dict[str, float]:
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
    row : mapping
        Row of shift.shift_metrics.
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
    basis = ErrorBasis(row, instruments, transmission, period)
    for metric in every_metric():
        if row.get(metric.key) is not None and metric.error is not None and (error := metric.error(basis)) is not None:
            basis.found[metric.key] = error
    return basis.found


def engagement_uncertainty(row: dict, instruments: dict[str, Instrument], transmission: Transmission) -> dict[str, float]:
    """Return the largest errors of a row of engagement.engagement_metrics, as :func:`uncertainty` does.

    Only values that were found have an error. Pressures have the transducer's error. The kiss pressure also has the growth of the
    pressure while the torque rises by the torque meter's error; the torque rises by at least 10 Nm in the 20 ms
    after contact. Times have a sample and half a filter at each end; the engagement time also has the transducer's error divided
    by the fill's slope, and both encoders' resolution divided by the slip's rate.

    Parameters
    ----------
    row : dict
        Row of engagement.engagement_metrics.
    instruments, transmission
        As for :func:`uncertainty`.

    Returns
    -------
    dict of str to float
        Largest error by key.
    """
    torque, speed = instruments["torque"].error, instruments["speed"].error
    pressure = max(instruments[clutch.pressure].error for clutch in transmission.engaged(row["gear"]))
    ends = ROW + 0.5 * TORQUE_SPEED_MEAN
    found = {"input_torque_mean_nm": torque, "p_rest": pressure, "p_end": pressure, "hold_pressure": pressure, "p_kiss": pressure}
    if row["engagement_peak_nm"] is not None:
        found["engagement_peak_nm"] = torque + 0.5 * TORQUE_SPEED_MEAN * row["engagement_peak_nm"] / STEEP_RISE
    if row["growth_contact"] is not None:
        found["p_kiss"] += abs(row["growth_contact"]) * torque / TORQUE_CLEAR
    if row["engagement_s"] and row["fill_slope"]:
        resolution = speed * (1.0 + abs(transmission.ratios[row["gear"]])) / row["input_speed_before"]
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
