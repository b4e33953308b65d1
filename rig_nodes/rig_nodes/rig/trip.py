# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a trip is: a quantity, its limit, and the conditions under which it is watched.

rig.trips and rig.trips_of_transducers make them from a rig; runs.watch turns them into the arrays that the engine evaluates.
"""

from __future__ import annotations

from dataclasses import dataclass

from ..base import shown_in
from .quantities import QUANTITIES
from .transducer_types import TRANSDUCER_TYPES

SAFE_WITHIN = 0.15  # s in which all of the safe state is reached
REACTION = (
    "safe state, from the next step on at once: coils without current, drive torque off, load relief open; "
    f"reached within {SAFE_WITHIN * 1e3:g} ms"
)
RESET = "by hand (rig reset)"
HYSTERESIS = 0.02  # assumed: share of a limit by which a value must fall below it before its time begins anew
NEAR = 0.9  # assumed: share of a limit at which a warning is given
# failure mode identifiers of SAE J1939-73 that no fault has
TOO_HIGH, TOO_LOW, ABOVE_RANGE, THERE = 0, 1, 3, 31
FIRST_SPN = 520_192  # of the suspect parameters that SAE J1939 leaves to a manufacturer, 520 192 to 524 287
GEAR, SHIFTING = "gear", "shifting"  # what the controller reports
_UNSIGNED = " without its sign"  # of a magnitude
MEASURED, STAYED = "@", "="  # before the name of a transducer: what it shows, and for how many samples this has been the same


@dataclass(frozen=True)
class Sum:
    """A weighted sum of numbers of a rig that runs.

    Parameters
    ----------
    text : str
        What it is, for people.
    terms : tuple of (str, float)
        Names of numbers with their weights: those of ``Plan.channels``, "NAME.slip" of a clutch, GEAR, SHIFTING, and the name of a
        transducer behind MEASURED or, as the only term, behind STAYED.
    magnitude : bool
        True when its sign does not count.
    """

    text: str
    terms: tuple[tuple[str, float], ...]
    magnitude: bool = False


@dataclass(frozen=True)
class Condition:
    """What must be true for a trip to be watched: a sum above a threshold [SI], or below it."""

    sum: Sum
    above: bool
    threshold: float
    text: str


def summary_row(name: str, criteria: dict[str, str], spn: int, fmi: int, source: str) -> dict[str, str]:
    """Return a row of the summary table of an on-board diagnosis; ``criteria`` are its columns from the quantity to the warning."""
    ends = {"reaction": REACTION, "reset": RESET, "SPN": str(spn), "FMI": str(fmi), "source": source}
    return {"trip": name, **criteria, **ends}


@dataclass(frozen=True)
class Trip:
    """One trip, as in the summary table of an on-board diagnosis.

    Parameters
    ----------
    name : str
        Its name.
    quantity : Sum
        What is watched.
    dimension : str
        Dimension of base.units.
    limit : float
        Threshold [SI].
    source : str
        Source of the threshold.
    fmi : int
        Failure mode identifier of SAE J1939-73.
    delay : float
        Time for which the criterion must hold [s].
    above : bool
        True when it trips above the limit, False when below it.
    enabled : tuple of Condition
        It is watched while all of them hold.
    rises : bool
        True when the quantity counts from the moment at which all conditions became true.
    there : bool
        False where a setting has taken away what it would watch; it keeps its number.
    spn : int
        Suspect parameter number.
    """

    name: str
    quantity: Sum
    dimension: str
    limit: float
    source: str
    fmi: int
    delay: float
    above: bool = True
    enabled: tuple[Condition, ...] = ()
    rises: bool = False
    there: bool = True
    spn: int = 0

    @property
    def warning(self) -> float | None:
        """The value at which a warning is given [SI]; None for a trip of what is right or wrong and does not approach a limit."""
        return _short_of(self.limit, 1.0 - NEAR) if self.fmi == TOO_HIGH else None

    @property
    def warning_over(self) -> float | None:
        """The value at which a warning is over [SI]; None where there is none."""
        return None if self.warning is None else _short_of(self.warning, HYSTERESIS)

    @property
    def clear(self) -> float:
        """The value at which the time of the criterion begins anew [SI]."""
        return _short_of(self.limit, HYSTERESIS if self.above else -HYSTERESIS)

    def written(self, value: float) -> str:
        """Return a value of its quantity [SI] as people read it."""
        unit, factor = _shown(self.dimension)
        return f"{value * factor:.5g} {unit}"

    def sentence(self, value: float, when: float) -> str:
        """Return the reason of the trip by the value furthest past the limit [SI] and the time [s] at which it tripped."""
        way, back, furthest = ("above", "below", "highest") if self.above else ("below", "above", "lowest")
        passed = f"{way} its limit of {self.written(self.limit)}"
        is_ = f"trip {self.name}: {self._is(value)}"
        if not self.delay:
            return f"{is_}, {passed}, at {when:.3f} s"
        held = f"for {self.delay * 1e3:g} ms not {back} {self.written(self.clear)} again"
        return f"{is_} at its {furthest}, {passed} and {held}, at {when:.3f} s"

    def warns(self, value: float, when: float) -> str:
        """Return the sentence of the warning by the value [SI] and the time [s] at which it was passed."""
        near = f"near its limit of {self.written(self.limit)}, at {when:.3f} s"
        return f"warning {self.name}: {self._is(value)}, {near}"

    def _is(self, value: float) -> str:
        return f"the {self.quantity.text} is {self.written(value)}{_UNSIGNED if self.quantity.magnitude else ''}"

    def row(self) -> dict[str, str]:
        """Return the row of the summary table."""
        warning = self.warning
        criteria = {
            "quantity": self.quantity.text,
            "criterion": f"{'above' if self.above else 'below'}{',' + _UNSIGNED if self.quantity.magnitude else ''}",
            "threshold": self.written(self.limit),
            "enabled while": " and ".join(dict.fromkeys(one.text for one in self.enabled)) or "always",
            "delay": f"{self.delay * 1e3:g} ms",
            "hysteresis": f"{HYSTERESIS * 100.0:g} %",
            "warning": "none" if warning is None else self.written(warning),
        }
        return summary_row(self.name, criteria, self.spn, self.fmi, self.source)


def _short_of(value: float, share: float) -> float:
    """Return a value less a share of its size: below 0 it is further from 0, as a limit is neared from below there too."""
    return value * (1.0 - share if value >= 0.0 else 1.0 + share)


def _shown(dimension: str) -> tuple[str, float]:
    """The unit that people read of a dimension, and the factor to it from SI."""
    of = next((one.quantity for one in TRANSDUCER_TYPES.values() if one.dimension == dimension), dimension)
    if of in QUANTITIES:
        return QUANTITIES[of].display, QUANTITIES[of].scale
    unit, factor = shown_in(dimension)
    return unit, 1.0 / factor
