# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The metrics of a shift, a record each: how it is found, its name and unit, its error, and where it is shown.

The report, comparisons, sweeps, validation, the view and ``rig list metrics`` take the metrics from here. Another package adds one
by an entry point of the group ``rig_nodes.metrics``.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from ..base import Group
from . import metric_errors
from .definitions import K_MOST, RPM
from .display import in_unit, shown

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

    from ..rig import Transmission
    from .metric_errors import ErrorBasis
    from .shift import CutShift

ADDED = Group("metrics", "metric")
UNITS = {"s": "s", "nm": "Nm", "rpm": "rpm", "j": "J", "mpas": "MPa/s"}  # unit of a key by its last word; any other key has no unit
# where a metric is shown beside the places that have them all: the table of shifts, or that of their course from order to settled
# torque; the results by Annex A; the short tables of sweeps and of many runs; the plots of a campaign
TABLE, COURSE, ANNEX, SHORT, PLOTS = "table", "course", "annex", "short", "plots"
# the channels that decide a metric, which has no value where one of them is at the end of its range: at any time in the shift, or
# in the state before the order or after the shift
SPEEDS, TORQUE_IN, TORQUE_OUT, PRESSURES = "speeds", "input torque", "output torque", "pressures"
SPEED_BEFORE, TORQUE_AFTER, LOAD_BEFORE = "input speed before", "input torque after", "output torque before"
# keys of a row beside its metrics, in front of them and behind them
GEARS, ENDS = ("from_gear", "to_gear"), ("valid", "t_order_s", "why", "undefined")
# keys of a row that no report has as a result: course.course_of, peak.parts_of_peak, clipped.drop_clipped, and whether the old
# gear was in
DETAILS = ("torques", "peak", "clipped", "in_gear", "fall_s")


@dataclass(frozen=True)
class Metric:
    """A metric of a shift.

    Attributes
    ----------
    key : str
        Its key in rows and reports; it ends with the unit, one of :data:`UNITS`, unless the metric has none.
    text : str
        What it is.
    of : function
        of(shift) returns the value of a cut shift, None where it was not found.
    name : str
        Its name in tables, without unit, with ``{speed_in}, {torque_in}, {speed_out}, {torque_out}`` for signals of both shafts;
        empty for a metric that only files and validation rows have.
    digits : int
        Digits behind the decimal point that are shown.
    error : function, optional
        error(basis) returns its largest error in its unit, None where that is not known.
    places : tuple of str
        Where it is shown.
    decided_by : tuple of str
        The channels that decide it.
    held_input : bool
        True when it is only defined where a drive holds the input's speed.
    absurd : function, optional
        absurd(value, transmission) returns why a value is no result, or None.
    package : str
        The package that adds it; empty for ours.
    """

    key: str
    text: str
    of: Callable[[CutShift], float | None]
    name: str = ""
    digits: int = 0
    error: Callable[[ErrorBasis], float | None] | None = None
    places: tuple[str, ...] = (TABLE,)
    decided_by: tuple[str, ...] = (SPEEDS, TORQUE_IN, TORQUE_OUT, PRESSURES)
    held_input: bool = False
    absurd: Callable[[float, Transmission], str | None] | None = None
    package: str = ""

    @property
    def unit(self) -> str:
        """Unit of its values in rows and reports; ``-`` without one."""
        return UNITS.get(self.key.rpartition("_")[2], "-")

    @property
    def shown_unit(self) -> str:
        """Unit in which people read it."""
        return "ms" if self.unit == "s" else self.unit

    @property
    def factor(self) -> float:
        """Factor from its unit to the one in which people read it."""
        return 1e3 if self.unit == "s" else 1.0

    def named(self, box: Transmission) -> str:
        """Return its name on a transmission, without unit."""
        return self.name.format(
            speed_in=box.input.speed, torque_in=box.input.torque, speed_out=box.output.speed, torque_out=box.output.torque
        )

    def heading(self, box: Transmission) -> str:
        """Return its name on a transmission with the unit in which people read it."""
        return self.named(box) if self.unit == "-" else f"{self.named(box)} {self.shown_unit}"

    def cell(self, row: Mapping, errors: Mapping) -> str:
        """Return its value in a row as text, beside the errors of the row."""
        return shown(*in_unit(row.get(self.key), errors.get(self.key), self.factor), self.digits)

    def formed(self, shift: CutShift, row: dict) -> float | None:
        """Return its value of a shift; None, with the reason in ``row``, where the function of another package fails."""
        if not self.package:
            return self.of(shift)
        try:
            found = self.of(shift)
            if found is None or math.isfinite(found):
                return None if found is None else float(found)
            why = f"its value is {found}"
        except Exception as error:  # what another package's code raises
            why = f"{type(error).__name__}: {error}"
        row["undefined"] = {**(row["undefined"] or {}), self.key: f"the package {self.package} failed ({why})"}
        return None


def _no_loss(value: float, _box: Transmission) -> str | None:
    """Return why a loss is no result."""
    return f"it came out at {value:.0f} J, and no loss is negative" if value < 0.0 else None


def _too_fast(value: float, box: Transmission) -> str | None:
    """Return why a lowest speed is no share of that of the slower gear."""
    if value <= K_MOST:
        return None
    faster = f"{box.input.speed} rose: at its lowest {box.output.speed} was {value:.2f} times that of the slower gear"
    return f"defined for an input whose speed is held; {faster} at the old speed"


OWN = (
    Metric(
        "input_speed_rpm",
        "input speed, mean of 0.2 s before the order",
        lambda shift: shift.before(shift.box.input.speed) * RPM,
        "{speed_in}",
        error=lambda basis: basis.speed * RPM,
        places=(TABLE, ANNEX),
        decided_by=(SPEED_BEFORE,),
    ),
    Metric(
        "input_speed_change_rpm",
        "by how much the input speed changed in 0.2 s before the order",
        lambda shift: shift.change_before(shift.box.input.speed) * RPM,
        decided_by=(SPEEDS,),
    ),
    Metric(
        "output_torque_nm",
        "output torque, mean of 0.2 s before the order",
        lambda shift: shift.before(shift.box.output.torque),
        "{torque_out}",
        1,
        error=lambda basis: basis.torque,
        places=(TABLE, ANNEX),
        decided_by=(LOAD_BEFORE,),
    ),
    Metric(
        "t_dt_s",
        "from the first change of a clutch's pressure to the end of the slip",
        lambda shift: shift.seconds(shift.start, shift.end),
        "t_d",
        error=metric_errors.window,
        places=(TABLE, ANNEX, SHORT, PLOTS),
        decided_by=(SPEEDS, PRESSURES),
    ),
    Metric(
        "t_p_s",
        "from the departure of the output speed to the end of the slip",
        lambda shift: shift.seconds(shift.departure, shift.end),
        "t_p",
        error=lambda basis: None if basis.slip_end is None else 2.0 * basis.slip_end,
        places=(TABLE, ANNEX, PLOTS),
        decided_by=(SPEEDS,),
    ),
    Metric(
        "t_c_s",
        "from the order to the end of the slip",
        lambda shift: shift.seconds(shift.order, shift.end),
        "t_c",
        error=lambda basis: basis.slip_end,
        places=(TABLE, ANNEX, SHORT, PLOTS),
        decided_by=(SPEEDS,),
    ),
    Metric(
        "t_o_s",
        "from the end of the slip until the input torque has settled",
        lambda shift: shift.seconds(shift.end, shift.settled),
        "t_o",
        error=metric_errors.settling,
        places=(TABLE, ANNEX, PLOTS),
        decided_by=(SPEEDS, TORQUE_AFTER),
        held_input=True,
    ),
    Metric(
        "input_torque_max_nm",
        "highest input torque during t_d, in a downshift until the output is slowest",
        lambda shift: None if shift.extremes is None else float(shift.smooth[shift.box.input.torque][shift.extremes].max()),
        "{torque_in} max",
        1,
        error=metric_errors.peak,
        places=(TABLE, ANNEX, SHORT, PLOTS),
        decided_by=(SPEEDS, TORQUE_IN, PRESSURES),
    ),
    Metric(
        "output_speed_min_rpm",
        "lowest output speed during t_d, or behind a downshift's",
        lambda shift: None if shift.lowest_speed is None else shift.lowest_speed * RPM,
        "{speed_out} min",
        error=lambda basis: basis.speed * RPM,
        places=(TABLE, ANNEX),
        decided_by=(SPEEDS, PRESSURES),
    ),
    Metric(
        "k",
        "lowest output speed during t_d as a share of that of the slower gear",
        lambda shift: shift.speed_ratio,
        "k",
        3,
        error=metric_errors.speed_ratio,
        places=(TABLE, ANNEX, SHORT, PLOTS),
        decided_by=(SPEEDS, PRESSURES),
        held_input=True,
        absurd=_too_fast,
    ),
    Metric(
        "e_loss_j",
        "energy lost during t_d",
        lambda shift: shift.energy_loss(shift.end),
        "E_loss",
        error=lambda basis: basis.loss("e_loss_j"),
        places=(TABLE, ANNEX, SHORT, PLOTS),
        held_input=True,
        absurd=_no_loss,
    ),
    Metric(
        "e_loss_settled_j",
        "energy lost from the beginning of t_d until the input torque has settled",
        lambda shift: shift.energy_loss(shift.settled),
        "settled",
        error=lambda basis: basis.loss("e_loss_settled_j", "t_o_s"),
        places=(TABLE, ANNEX),
        held_input=True,
        absurd=_no_loss,
    ),
    Metric(
        "overlap_s",
        "time in which both the releasing and the engaging clutches have capacity; negative: in which neither have it",
        lambda shift: shift.overlap.value,
        "overlap",
        error=metric_errors.overlap,
        places=(TABLE, PLOTS),
        decided_by=(PRESSURES,),
    ),
    Metric("overlap_mpas", "rate of the pressures at the ends of the overlap", lambda shift: shift.overlap.rate, decided_by=()),
    Metric(
        "kiss_s",
        "from the order until all engaging clutches have their kiss pressure",
        lambda shift: shift.kiss.value,
        "fill",
        error=metric_errors.kiss,
        places=(COURSE,),
        decided_by=(),
    ),
    Metric("kiss_mpas", "rate of the pressure at the kiss point", lambda shift: shift.kiss.rate, decided_by=()),
    Metric(
        "departure_s",
        "from the order to the departure of the output speed",
        lambda shift: shift.seconds(shift.order, shift.departure),
        error=metric_errors.departure,
        decided_by=(SPEEDS,),
    ),
    Metric(
        "input_torque_high_nm",
        "highest input torque from the order until it has settled",
        lambda shift: shift.course and shift.course.extremes["high"],
        "{torque_in} high",
        1,
        error=metric_errors.extreme,
        places=(COURSE,),
        decided_by=(SPEEDS, TORQUE_IN),
    ),
    Metric(
        "t_high_s",
        "from the order to the highest input torque",
        lambda shift: shift.course and shift.course.times.get("high"),
        "t_high",
        error=metric_errors.time_of_extreme,
        places=(COURSE,),
        decided_by=(SPEEDS, TORQUE_IN),
    ),
    Metric(
        "input_torque_low_nm",
        "lowest input torque from the order until it has settled",
        lambda shift: shift.course and shift.course.extremes["low"],
        "{torque_in} low",
        1,
        error=metric_errors.extreme,
        places=(COURSE,),
        decided_by=(SPEEDS, TORQUE_IN),
    ),
    Metric(
        "t_low_s",
        "from the order to the lowest input torque",  # which may lie anywhere on a flat stretch, so that it has no error
        lambda shift: shift.course and shift.course.times.get("low"),
        "t_low",
        places=(COURSE,),
        decided_by=(SPEEDS, TORQUE_IN),
    ),
    Metric(
        "reversed_s",
        "time in which the input torque acts against the load",
        lambda shift: shift.course and shift.course.reversed,
        "reversed",
        error=metric_errors.reversal,
        places=(COURSE,),
        decided_by=(SPEEDS, TORQUE_IN, LOAD_BEFORE),
    ),
    Metric(
        "output_speed_low_rpm",
        "lowest output speed from the order until the input torque has settled",
        lambda shift: shift.course and shift.course.lowest,
        "{speed_out} low",
        error=lambda basis: basis.speed * RPM,
        places=(COURSE,),
        decided_by=(SPEEDS,),
    ),
    Metric(
        "interrupted_s",
        "from the departure of the output speed to the kiss point",
        lambda shift: shift.interrupted,
        "interrupted",
        error=metric_errors.interruption,
        places=(COURSE,),
        decided_by=(SPEEDS,),
    ),
    Metric(
        "input_torque_at_least_nm",
        "end of the torque meter's range, where the input torque went beyond it",
        lambda _: None,  # clipped.drop_clipped puts it in
        decided_by=(),
    ),
    Metric(
        "course_s",
        "from the order until the input torque has settled, or where its search ends",
        lambda shift: shift.seconds(shift.order, shift.last) if shift.course else None,
        decided_by=(SPEEDS,),
    ),
)


@cache
def every_metric() -> tuple[Metric, ...]:
    """Return all metrics in the order in which reports have them, ours first.

    Raises
    ------
    RigError
        When a package that adds a metric is at fault.
    """
    found = {metric.key: metric for metric in OWN}
    for point in ADDED.added().values() if _some_are_added() else ():
        metric = _of_package(point)
        if metric.key in (*found, *GEARS, *ENDS, *DETAILS):
            raise ADDED.refused(point, f"has the key '{metric.key}', which is taken")
        found[metric.key] = metric
    return tuple(found.values())


def _some_are_added() -> bool:
    """Return whether a package may add a metric; to load importlib.metadata, which knows, would cost each report 30 ms."""
    folders, group = (Path(place or ".") for place in sys.path), ADDED.group.encode()
    return any(group in path.read_bytes() for one in folders for path in one.glob("*-info/entry_points.txt"))


def _of_package(point: EntryPoint) -> Metric:
    """Return the metric of another package."""
    found = ADDED.load(point, Metric)
    if not found.key.isidentifier() or not callable(found.of):
        raise ADDED.refused(point, "has no key of letters, digits and _, or no function 'of'")
    try:
        found.name.format(speed_in="", torque_in="", speed_out="", torque_out="")
    except (KeyError, ValueError, IndexError):
        raise ADDED.refused(
            point, f"has the name '{found.name}', expected only {{speed_in}}, {{torque_in}}, {{speed_out}}, {{torque_out}}"
        ) from None
    return replace(found, package=point.dist.name if point.dist else point.module)


def metric_keys() -> tuple[str, ...]:
    """Return the keys of a row of a report: its gears, its metrics, and whether, when and why."""
    return (*GEARS, *(metric.key for metric in every_metric()), *ENDS)


def named_metrics(place: str = "") -> list[Metric]:
    """Return the metrics that tables show, all or those of one place."""
    return [metric for metric in every_metric() if metric.name and (not place or place in metric.places)]
