# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The plots of any rig, a record each: its title, the signals that it shows, and on which pages it is.

view.pages takes them from here for the viewer, the curves of a whole run on the page of `rig report --html` and the layouts for
other tools. The figure of a shift has its own panels, in figure_of_shift.py.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from ..plant import part as parts

if TYPE_CHECKING:
    from ..rig import Device
    from .pages import Pages

# a shift, a valve's response at standstill and a coast-down of a rig with gears; both columns of its run; those of a rig without
SHIFT, VALVE, COAST, LEFT, RIGHT, BENCH_LEFT, BENCH_RIGHT = "shift", "valve", "coast", "left", "right", "bench left", "bench right"


@dataclass(frozen=True)
class Plot:
    """A plot of any rig; a page leaves out one of whose signals the rig has none.

    Attributes
    ----------
    title : str
        Its title; ``{called}`` stands for the device.
    places : tuple of str
        Where it is, in the order of the records.
    names : function
        names(pages), or names(pages, device), returns the signals, which have the same display unit.
    each : function, optional
        each(pages) returns the devices of which each has a plot of its own.
    """

    title: str
    places: tuple[str, ...]
    names: Callable[..., Iterable[str]]
    each: Callable[[Pages], Iterable[Device]] | None = None

    def drawn(self, pages: Pages) -> list[tuple[str, Iterable[str]]]:
        """Return title and signals of each plot on the pages of a rig."""
        if self.each is None:
            return [(self.title, self.names(pages))]
        return [(self.title.format(called=one.called.replace("_", " ")), self.names(pages, one)) for one in self.each(pages)]


def _currents(pages: Pages) -> list[str]:
    measured = pages.measured
    return [name for one in pages.structure.valves for name in (*measured(f"{one.name}.current"), f"I_set_{one.key}")]


def _supply(pages: Pages) -> list[str]:
    structure = pages.structure
    return [name for one in structure.of_role(parts.OIL) for name in pages.measured(f"{structure.line_of(one.name)}.pressure")]


def _setpoints(pages: Pages, *roles: str) -> list[str]:
    """Return setpoints of speed; that of an engine led by its throttle only follows the engine."""
    led = [one for one in pages.structure.of_role(*roles) if not pages.measured(f"{one.name}.throttle")]
    return [name for one in led for name in pages.setpoints(one)]


def _of_the_shaft(pages: Pages) -> list[str]:
    """Return the setpoints of what turns the input shaft; another source has a speed of its own, which is not the shaft's."""
    return [name for one in pages.structure.of_role(parts.SOURCE) if not pages.own(one, "speed") for name in pages.setpoints(one)]


def _torques(pages: Pages) -> list[str]:
    """Return the torques of sources and of loads on the output shaft; that of a load behind a further ratio has another scale."""
    loads = [one for one in pages.structure.of_role(parts.LOAD) if one.wires.get("body") == pages.box.output.body]
    return list(pages.each((*_sources(pages), *loads), "torque"))


def _of_role(*roles: str) -> Callable[[Pages], tuple[Device, ...]]:
    return lambda pages: pages.structure.of_role(*roles)


_sources, _turning, _pressing = (_of_role(*roles) for roles in ((parts.SOURCE,), (parts.SOURCE, parts.LOAD), (parts.PRESS,)))


def _devices(pages: Pages) -> tuple[Device, ...]:
    return pages.structure.devices


def _measured(what: str) -> Callable[[Pages, Device], tuple[str, ...]]:
    return lambda pages, one: pages.measured(at=one.name, types=(what,))


def _of_clutches(*what: str) -> Callable[[Pages], tuple[str, ...]]:
    return lambda pages: pages.each(pages.structure.clutches, *what)


def _of_valves(what: str) -> Callable[[Pages], tuple[str, ...]]:
    return lambda pages: pages.each(pages.structure.valves, what)


PLOTS = (
    Plot("Valve duty", (VALVE,), _of_valves("duty")),
    Plot("Coil current", (SHIFT, VALVE, LEFT), _currents),
    Plot("Clutch pressure", (SHIFT, VALVE), lambda pages: pages.pressures()),
    Plot("Clutch and supply pressure", (LEFT,), lambda pages: (*pages.pressures(), *_supply(pages))),
    Plot("Piston position", (VALVE, LEFT), _of_clutches("piston")),
    Plot("Oil flow to the clutches", (VALVE, LEFT), _of_valves("flow")),
    Plot("Speed", (COAST,), lambda pages: pages.shafts("speed")),
    Plot("Shaft torque", (SHIFT, COAST), lambda pages: pages.shafts("torque")),
    Plot("Clutch pressure", (COAST,), lambda pages: pages.pressures()),
    Plot("Shaft, motor and load torque", (RIGHT,), lambda pages: (*pages.shafts("torque"), *_torques(pages))),
    Plot(
        "Clutch torque",
        (SHIFT, RIGHT),
        lambda pages: (*_of_clutches("torque", "capacity")(pages), *pages.each(pages.structure.freewheels, "torque")),
    ),
    Plot("Speed", (SHIFT,), lambda pages: (*pages.shafts("speed"), *_of_clutches("slip")(pages))),
    Plot("Shaft speed", (RIGHT,), lambda pages: (*pages.shafts("speed"), *_of_the_shaft(pages))),
    Plot("Slip", (RIGHT,), _of_clutches("slip")),
    Plot("Heat in the clutches", (RIGHT,), _of_clutches("heat")),
    Plot("Measured torque at {called}", (BENCH_LEFT,), _measured("torque"), _devices),
    Plot("Torque of drive and load", (BENCH_LEFT,), lambda pages: pages.each(_turning(pages), "torque")),
    Plot("Clutch torque", (BENCH_LEFT,), _of_clutches("torque", "capacity")),
    Plot("Speed", (BENCH_LEFT,), lambda pages: (*pages.measured(types=("speed",)), *_setpoints(pages, parts.SOURCE, parts.LOAD))),
    Plot("Pressure at {called}", (BENCH_LEFT,), _measured("pressure"), _turning),
    Plot(
        "Pressure in the {called}",
        (BENCH_RIGHT,),
        lambda pages, one: (*pages.measured(f"{one.name}.pressure"), *pages.own(one, "setting")),
        _pressing,
    ),
    Plot("Travel of the {called}", (BENCH_RIGHT,), lambda pages, one: pages.measured(f"{one.name}.travel"), _pressing),
    Plot(
        "Clamp force of {called}",
        (BENCH_RIGHT,),
        lambda pages, one: pages.own(one, "clamp"),
        lambda pages: pages.structure.clutches,
    ),
    Plot("Force at {called}", (BENCH_RIGHT,), _measured("force"), _devices),
)
