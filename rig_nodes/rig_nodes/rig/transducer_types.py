# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The types of transducers: what each measures, and which errors a rig's ``instruments`` can give it.

rig.read, the signal catalogue, the settings, the reference page and runs.gauges use this one table.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import Field, dataclass
from typing import Any

from ..base import param, switch

_NOISE, _RANGE, _CLASS, _HUM = (
    "Standard deviation of its noise",
    "End of its range",
    "Largest error as a share of the range, its class",
    "Amplitude of the mains' hum in it",
)


@dataclass(frozen=True)
class TransducerType:
    """One type of transducers.

    Parameters
    ----------
    quantity : str
        What it measures, a key of quantities.QUANTITIES.
    dimension : str
        Dimension of its range in base.units.
    errors : callable
        It returns the fields of its errors by name, new ones with each call, because a field belongs to one dataclass. ``range``
        is required; ``noise``, ``class`` (7.1), ``hum``, ``pickup``, ``offset`` with ``gain`` (7.2), and ``step`` with ``gate`` of
        an encoder act where they are named. runs.gauges reads them.
    signed : bool
        True when it measures both signs, whatever range a rig gives it.
    filtered : bool
        True when its channel has the logger's analog low pass.
    """

    quantity: str
    dimension: str
    errors: Callable[[], dict[str, Field]]
    signed: bool = False
    filtered: bool = False


def measures_both_signs(kind: str, low: float) -> bool:
    """Return whether a transducer of a type measures both signs: each one of a signed type, and one whose range begins below 0."""
    return TRANSDUCER_TYPES[kind].signed or low < 0.0


def measured_range(kind: str, low: float, high: float, largest: float) -> tuple[float, float]:
    """Return the ends of what a transducer can show.

    Parameters
    ----------
    kind : str
        Its type, a key of TRANSDUCER_TYPES.
    low : float
        Lower end of the range that the rig gives it; below 0 it measures both signs.
    high : float
        End of its range, as the rig's instruments give it.
    largest : float
        Its class, a share of the range.
    """
    # one that does not measure both signs shows its error below zero too
    return (-high if measures_both_signs(kind, low) else -largest * high), high


def _class() -> Any:
    return param("ratio", 0.0, 0.1, _CLASS, 0.0)


TRANSDUCER_TYPES = {
    "torque": TransducerType(
        "torque",
        "torque",
        lambda: {
            "noise": param("torque", 0.0, 100.0, _NOISE, 0.0),
            "range": param("torque", 1.0, 1e5, _RANGE),
            "class": _class(),
            "hum": param("torque", 0.0, 100.0, _HUM, 0.0),
        },
        signed=True,
        filtered=True,
    ),
    "speed": TransducerType(
        "speed",
        "angular velocity",
        lambda: {
            "noise": param("angular velocity", 0.0, 100.0, "Standard deviation of the unevenness of the encoder's pulses", 0.0),
            "range": param("angular velocity", 0.1, 1e5, _RANGE),
            "step": param("angular velocity", 0.0, 10.0, "What the encoder resolves; at 0 everything", 0.0),
            "gate": param("time", 1e-6, 0.1, "Time in which the encoder's pulses are counted"),
        },
    ),
    "pressure": TransducerType(
        "pressure",
        "pressure",
        lambda: {
            "noise": param("pressure", 0.0, 1e7, _NOISE, 0.0),
            "range": param("pressure", 1e5, 1e9, _RANGE),
            "class": _class(),
            "hum": param("pressure", 0.0, 1e6, _HUM, 0.0),
            "pickup": param("pressure", 0.0, 1e6, "Height of the coil pulses that a valve's wire induces in it", 0.0),
        },
        filtered=True,
    ),
    "current": TransducerType(
        "current",
        "current",
        lambda: {"noise": param("current", 0.0, 0.1, _NOISE, 0.0), "range": param("current", 0.1, 100.0, _RANGE)},
    ),
    "temperature": TransducerType(
        "temperature",
        "temperature",
        lambda: {
            "range": param("temperature", 1.0, 1e3, _RANGE),
            "offset": param("temperature", 0.0, 10.0, "Largest error at 0 degC", 0.0),
            "gain": param("ratio", 0.0, 0.1, "Largest error as a share of the temperature, in addition to the offset", 0.0),
        },
    ),
    "travel": TransducerType(
        "length",
        "length",
        lambda: {"noise": param("length", 0.0, 1e-3, _NOISE, 0.0), "range": param("length", 1e-4, 1.0, _RANGE), "class": _class()},
        filtered=True,
    ),
    "force": TransducerType(
        "force",
        "force",
        lambda: {
            "noise": param("force", 0.0, 1e4, _NOISE, 0.0),
            "range": param("force", 1.0, 1e6, _RANGE),
            "class": _class(),
            "fitted": switch("Whether there is such a transducer; off: its channel shows nothing", True),
        },
        filtered=True,
    ),
    "velocity": TransducerType(
        "velocity",
        "velocity",
        lambda: {
            "noise": param("velocity", 0.0, 10.0, _NOISE, 0.0),
            "range": param("velocity", 0.01, 1e3, _RANGE),
            "class": _class(),
        },
        filtered=True,
    ),
    "ratio": TransducerType(
        "ratio",
        "ratio",
        lambda: {"noise": param("ratio", 0.0, 1.0, _NOISE, 0.0), "range": param("ratio", 1e-3, 100.0, _RANGE), "class": _class()},
        filtered=True,
    ),
}
