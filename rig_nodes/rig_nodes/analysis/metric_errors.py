# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Largest errors of the metrics of a shift: those of the instruments, carried over to what is computed from their signals.

The records of analysis.metrics name these functions; analysis.measured_error calls them. They need only the row of a shift.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

from .course import asked_of_input
from .definitions import RPM, SETTLED_BAND, SETTLED_BAND_NM, TORQUE_SPEED_MEAN

if TYPE_CHECKING:
    from ..rig import Transmission
    from .measured_error import Instrument

STEEP_RISE = 45e-3  # s in which the steeper pressure of chapter 9, and with it the torque, rises from contact to its end


@dataclass
class ErrorBasis:
    """What the errors of a row's metrics are computed from.

    Attributes
    ----------
    row : mapping
        Row of shift.shift_metrics.
    instruments : mapping of str to Instrument
        ``torque``, ``speed`` and each clutch's pressure (uncertainty.instruments_of).
    box : Transmission
        The transmission.
    period : float
        Time between the logger's samples [s].
    found : dict of str to float
        The errors of the metrics before this one.
    """

    row: Mapping
    instruments: Mapping[str, Instrument]
    box: Transmission
    period: float
    found: dict[str, float] = field(default_factory=dict)

    @property
    def torque(self) -> float:
        """Largest error of the torque meters [Nm]."""
        return self.instruments["torque"].error

    @property
    def speed(self) -> float:
        """Largest error of the encoders [rad/s]."""
        return self.instruments["speed"].error

    @property
    def w_in(self) -> float:
        """Input speed before the order [rad/s]; 0 where it is not known or the input stood still."""
        return (self.row["input_speed_rpm"] or 0.0) / RPM

    @property
    def ends(self) -> float:
        """A sample and half a filter [s], which every end of a time has."""
        return self.period + 0.5 * TORQUE_SPEED_MEAN

    def slip_in(self, span: float) -> float:
        """Return the time [s] that both encoders' resolution makes of a slip which vanishes in ``span`` [s].

        From neutral, the slip of the new gear goes from 1 to 0.
        """
        new, old, ratios = self.row["to_gear"], self.row["from_gear"], self.box.ratios
        change = abs(1.0 - ratios[new] / ratios[old]) if old in ratios else 1.0
        return self.speed * (1.0 + abs(ratios[new])) / self.w_in * span / change

    @cached_property
    def slip_end(self) -> float | None:
        """Error of the end of the slip [s]; None without the rate of the slip."""
        return self.ends + self.slip_in(self.row["t_p_s"]) if self.row["t_p_s"] and self.w_in else None

    def pressure(self) -> float:
        """Return the largest error of the transducers of the clutches that move [MPa]."""
        moved = self.box.shift(self.row["from_gear"], self.row["to_gear"])
        errors = (self.instruments[clutch.pressure].error for clutch in (*moved.releasing, *moved.engaging))
        return 1e-6 * max(errors, default=0.0)

    def peak(self, torque: float, rise: float = STEEP_RISE) -> float:
        """Return the error of an extreme that a torque [Nm] reaches within a time [s]: a mean or a slow logger lowers it."""
        return self.torque + 0.5 * max(TORQUE_SPEED_MEAN, self.period) * torque / rise

    @property
    def swing(self) -> float | None:
        """From the lowest to the highest input torque, at least the torque meter's error [Nm]; None without them."""
        high, low = self.row.get("input_torque_high_nm"), self.row.get("input_torque_low_nm")
        return None if high is None or low is None or not self.w_in else max(high - low, self.torque)

    def loss(self, key: str, longer: str = "") -> float | None:
        """Return the error of an energy loss over t_d [J], or over t_d and the time of another key."""
        row = self.row
        if any(row[one] is None for one in ("input_torque_max_nm", "t_dt_s", "output_torque_nm")) or "t_dt_s" not in self.found:
            return None
        span = row["t_dt_s"] + ((row[longer] or 0.0) if longer else 0.0)
        if span <= 0.0:
            return None
        w_out = self.w_in / abs(self.box.ratios[row["to_gear"]])
        rate = self.torque * (self.w_in + w_out) + self.speed * (row["input_torque_max_nm"] + abs(row["output_torque_nm"]))
        ends = 2.0 * self.speed * (self.box.inertias.driving * self.w_in + self.box.inertias.on_output * w_out)
        # the error of the window cuts off the mean power of the loss
        return rate * span + ends + abs(row[key]) / span * (self.found["t_dt_s"] + self.found.get(longer, 0.0))


def peak(basis: ErrorBasis) -> float:
    """Return the error of the highest input torque [Nm].

    Where a shaft swings on behind lock-up, the torque still rises as t_d ends, so that the error of this end counts by the
    steepest slope of a swing that reaches its highest torque at that torque's time.
    """
    row = basis.row
    found, high, at = row["input_torque_max_nm"], row.get("input_torque_high_nm"), row.get("t_high_s")
    own = basis.peak(abs(found))
    if basis.slip_end is None or None in (high, at, row["t_c_s"]) or at <= row["t_c_s"] or high <= found:
        return own
    return own + 0.5 * math.pi * (high - found) / (at - row["t_c_s"]) * basis.slip_end


def speed_ratio(basis: ErrorBasis) -> float:
    """Return the error of k; it is not divided by the lowest speed, which may be 0."""
    row = basis.row
    ratio = basis.box.slower_ratio(row["from_gear"], row["to_gear"]) * basis.speed * RPM / row["input_speed_rpm"]
    return ratio * (1.0 + abs(row["output_speed_min_rpm"]) / row["input_speed_rpm"])


def window(basis: ErrorBasis) -> float | None:
    """Return the error of t_d [s]: that of the slip's end, and the transducer's over the rate at which the pressure falls."""
    if basis.slip_end is None:
        return None
    moved = basis.box.shift(basis.row["from_gear"], basis.row["to_gear"])
    falls = (basis.instruments[clutch.pressure].error / clutch.fall_rate for clutch in moved.releasing or moved.engaging)
    return basis.slip_end + basis.ends + max(falls)


def settling(basis: ErrorBasis) -> float | None:
    """Return the error of t_o [s]: that of the slip's end, and the torque meter's over the slope into the settled band.

    A torque that decays as exp(-t/T) from an excess P into a band B within t_o = T ln(P/B) enters it with the slope B/T.
    """
    row = basis.row
    if basis.slip_end is None or not row["input_torque_max_nm"]:
        return None
    level = abs(row["output_torque_nm"] or 0.0) / abs(basis.box.ratios[row["to_gear"]])
    band = max(SETTLED_BAND * level, SETTLED_BAND_NM)
    excess = max(row["input_torque_max_nm"] - level, math.e * band)  # a lower peak enters its band more steeply than this
    return basis.slip_end + basis.ends + basis.torque * row["t_o_s"] / (band * math.log(excess / band))


def overlap(basis: ErrorBasis) -> float | None:
    """Return the error of the overlap [s]: the transducer's by the rates at which the pressures pass their levels."""
    rate = basis.row.get("overlap_mpas")
    return 2.0 * basis.ends + basis.pressure() / rate if rate and basis.w_in else None


def kiss(basis: ErrorBasis) -> float | None:
    """Return the error of the kiss point [s]."""
    rate = basis.row.get("kiss_mpas")
    return basis.ends + basis.pressure() / rate if rate and basis.w_in else None


def departure(basis: ErrorBasis) -> float | None:
    """Return the error of the departure of the output speed [s]."""
    span = basis.row["t_p_s"] or basis.row.get("interrupted_s") or 0.0
    return basis.ends + basis.slip_in(span) if basis.w_in else None


def interruption(basis: ErrorBasis) -> float | None:
    """Return the error of an interruption [s]; none has no error."""
    if not basis.row["interrupted_s"] or "departure_s" not in basis.found:
        return None
    return basis.found["departure_s"] + basis.found.get("kiss_s", 0.0)


def extreme(basis: ErrorBasis) -> float | None:
    """Return the error of the highest or the lowest input torque of the course [Nm]; at low speed a shift is over sooner."""
    return None if basis.swing is None else basis.peak(basis.swing, min(STEEP_RISE, basis.row["t_p_s"] or STEEP_RISE))


def time_of_extreme(basis: ErrorBasis) -> float | None:
    """Return the error of the time of the highest input torque [s]: the torque meter's on its rise."""
    return None if basis.swing is None else basis.ends + basis.torque * STEEP_RISE / basis.swing


def reversal(basis: ErrorBasis) -> float | None:
    """Return the error of the time of a reversed torque [s], which is taken as half a sine; none has no error."""
    row, asked = basis.row, asked_of_input(basis.row, basis.box)
    if basis.swing is None or asked is None or not (span := row["reversed_s"]):
        return None
    against = -row["input_torque_low_nm"] if asked > 0.0 else row["input_torque_high_nm"]
    return 2.0 * (basis.ends + basis.torque * span / (math.pi * max(against, basis.torque)))
