# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Faults of a proportional pressure-reducing valve: its spool, edges, spring and inlet, and the coil of its magnet."""

from __future__ import annotations

from math import sqrt
from typing import TYPE_CHECKING

from .fault import ABOVE, BELOW, FIRST_SPN, NEVER, OPEN, SHORT, STUCK, UNKNOWN, Fault, Size

if TYPE_CHECKING:
    from .fault import Target

VALVE, SPOOL, COIL = "proportional_valve", FIRST_SPN, FIRST_SPN + 32
COPPER = 3.93e-3  # 1/K: rise of copper's resistance (IEC 60028)


def stuck(valve: Target, _size: float) -> None:
    """Hold the spool where it is: its travel takes for ever."""
    valve["spool_time"] *= NEVER


def sticking(valve: Target, size: float) -> None:
    """Add Coulomb friction [Pa of port pressure] to that of the spool, as varnish and chips do."""
    valve["friction_pressure"] += size


def slow(valve: Target, size: float) -> None:
    """Lengthen the time constant of the spool by a multiple of it."""
    valve["spool_time"] *= 1.0 + size


def leaking(valve: Target, size: float) -> None:
    """Open a gap [m2] of worn edges between supply and port, beside the spool."""
    valve["leak_area"] += size


def dead_band(valve: Target, size: float) -> None:
    """Widen the overlap of worn or mismatched edges by a length [m]."""
    valve["spool_dead_band"] += size


def spring(valve: Target, size: float) -> None:
    """Take a share of the force of the spring against the magnet, so that the pressure begins to rise at less current."""
    valve["cracking_current"] *= 1.0 - size


def inlet(valve: Target, size: float) -> None:
    """Take a share of the area through which the supply reaches the port: a screen that is clogged.

    Edge a and bore b in a row have the area a b / sqrt(a^2 + b^2); a wide bore becomes the one that leaves the share of a.
    """
    left = 1.0 - size
    if valve["supply_bore_area"] > 0.0:
        valve["supply_bore_area"] *= left
    elif left < 1.0:
        valve["supply_bore_area"] = valve["orifice_area"] * left / sqrt(1.0 - left * left)


def coil_open(valve: Target, size: float) -> None:
    """Add a resistance [ohm] in a row with the coil: a connector that corrodes, or at its end a broken wire."""
    valve["coil_resistance"] += size


def coil_shorted(valve: Target, size: float) -> None:
    """Short a share of the coil's turns: resistance falls with it, inductance with its square, and so does force per current."""
    left = 1.0 - size
    valve["coil_resistance"] *= left
    valve["coil_inductance"] *= left * left
    valve["pressure_gain"] *= left
    valve["cracking_current"] /= left


def coil_hot(valve: Target, size: float) -> None:
    """Warm the winding by so many kelvins: the resistance of copper rises."""
    valve["coil_resistance"] *= 1.0 + COPPER * size


FAULTS = (
    Fault("stuck", VALVE, "spool", "The spool stays where it is.", "pressure no longer follows the current", stuck, SPOOL, STUCK),
    Fault(
        *("sticking", VALVE, "spool", "Varnish or a chip rubs on the spool."),
        *("pressure moves in steps and differs between rise and fall", sticking, SPOOL, STUCK),
        Size("pressure", 0.0, 2e6, 2e5, "friction, as half the band of port pressures"),
    ),
    Fault(
        *("slow", VALVE, "spool", "The spool moves slowly."),
        *("pressure lags behind the current and overshoots", slow, SPOOL, STUCK),
        Size("ratio", 0.0, 100.0, 4.0, "further time constants of the spool"),
    ),
    Fault(
        *("leaking", VALVE, "edges", "Worn edges leak from the supply to the port."),
        *("the clutch keeps pressure without current", leaking, SPOOL, ABOVE),
        Size("area", 0.0, 5e-6, 0.2e-6, "area of the gap"),
    ),
    Fault(
        *("dead_band", VALVE, "edges", "The overlap of the edges is too wide."),
        *("pressure holds while the current changes, and overshoots", dead_band, SPOOL, UNKNOWN),
        Size("length", 0.0, 1e-3, 0.1e-3, "further overlap"),
    ),
    Fault(
        *("spring", VALVE, "spring", "The spring against the magnet is weak or broken."),
        *("pressure is too high for the current", spring, SPOOL, ABOVE),
        Size("ratio", 0.0, 1.0, 0.5, "share of its force that is lost"),
    ),
    Fault(
        *("inlet", VALVE, "screen", "The screen at the inlet is clogged."),
        *("the clutch fills slowly", inlet, SPOOL, BELOW),
        Size("ratio", 0.0, 0.99, 0.6, "share of its area that is lost"),
    ),
    Fault(
        *("coil_open", VALVE, "coil", "A contact of the coil is corroded or broken."),
        *("current does not reach its setpoint, duty is at its limit", coil_open, COIL, OPEN),
        Size("resistance", 0.0, 1e9, 1e6, "resistance of the contact"),
        effect="current_loop",
    ),
    Fault(
        *("coil_shorted", VALVE, "coil", "Turns of the coil are shorted."),
        *("current follows at less duty, and pressure is too low for it", coil_shorted, COIL, SHORT),
        Size("ratio", 0.0, 0.9, 0.4, "share of the turns"),
    ),
    Fault(
        *("coil_hot", VALVE, "coil", "The winding is hot."),
        *("more duty for the same current", coil_hot, COIL, ABOVE),
        Size("temperature difference", 0.0, 200.0, 100.0, "temperature above that of its stated resistance"),
        effect="current_loop",
    ),
)
