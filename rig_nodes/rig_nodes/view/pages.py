# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The contents of a rig's view, derived from the rig's structure: plots (of view.plots), colours and widths of curves.

view.layout, view.curves, view.live and view.other_tools use it. Colours belong to roles: driving side, driven side, each
clutch, oil.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

from ..bags import rig_record
from ..plant import part as parts
from ..rig import Catalogue, Device, Signal, Structure, Transmission, catalogue, structure_of, transmission_of
from .plots import BENCH_LEFT, BENCH_RIGHT, COAST, LEFT, PLOTS, RIGHT, SHIFT, VALVE

if TYPE_CHECKING:
    from collections.abc import Iterable

Colour = tuple[int, int, int]
Plots = tuple[tuple[str, tuple[str, ...]], ...]  # title of a plot and its signals, which have the same display unit

# One hue per place of measurement, distinct for the colour-blind and on dark and light backgrounds:
# input shaft green, output shaft pink, first clutch blue, second orange, third violet. Bright colours show measured values,
# pale colours show demanded values or the torque that could be transmitted.
INPUT, OUTPUT = (0x12, 0xB8, 0x86), (0xE0, 0x7A, 0xC0)
FIRST, SECOND, THIRD = (0x2F, 0x95, 0xF5), (0xF5, 0x84, 0x1F), (0x8E, 0x6B, 0xE8)
INPUT_PALE, OUTPUT_PALE = (0x8C, 0xD9, 0xC0), (0xEF, 0xBE, 0xE0)
# (bright, pale) of clutches and of gears, each in their order
HUES = ((FIRST, (0x9B, 0xCB, 0xF8)), (SECOND, (0xF8, 0xC4, 0x94)), (THIRD, (0xC9, 0xB8, 0xF4)))
PALE = (INPUT_PALE, OUTPUT_PALE, *(pale for _, pale in HUES))
SUPPLY, OTHER = (0xD8, 0xD0, 0x48), (0x9A, 0xA0, 0xA8)
# The colours of a clutch's states go from grey over yellow to the clutch's hue, which is also that of the gear at the same place.
IDLE, WAITING, ALARM = (0x55, 0x5B, 0x63), (0xA0, 0x8C, 0x14), (0xD6, 0x45, 0x50)
STATE_COLOURS = {
    "none": IDLE,
    "neutral": IDLE,
    "open": IDLE,
    "starting": IDLE,
    "slipping": WAITING,
    "ready": WAITING,
    "running": INPUT,
    "tripped": ALARM,
}
# for two curves of one plot that would have the same colour
SPARE = (
    *(bright for bright, _ in HUES),
    OUTPUT,
    INPUT,
    SUPPLY,
    (0x3F, 0xC1, 0xD6),
    (0xE5, 0x57, 0x62),
    (0xB6, 0xD9, 0x4C),
    (0xB0, 0x7D, 0x54),
    OTHER,
    *PALE,
)
OWN = ("shifts", "run", "other")  # pages that every rig has by default and may replace
_OF_CLUTCH = ("torque", "slip", "clamp", "piston", "heat")  # quantities of clutches that are shown in the clutch's hue
_OF_VALVE = ("duty", "flow")


def hues(place: int) -> tuple[Colour, Colour]:
    """Return the bright and the pale hue of the clutch or gear at a place; further places begin again with the first hue."""
    return HUES[place % len(HUES)]


@dataclass(frozen=True)
class Plates:
    """Plates of a clutch, whose temperature follows from the recorded heat.

    Parameters
    ----------
    signal : Signal
        The temperature, which no topic carries.
    heat : str
        Signal of the heat since time 0.
    capacity, cooling : float
        Heat capacity [J/K], and heat flow to the oil per kelvin of difference [W/K].
    oil : float
        Temperature of the oil at time 0 [degC].
    """

    signal: Signal
    heat: str
    capacity: float
    cooling: float
    oil: float


def with_heat(known: Catalogue, structure: Structure) -> Catalogue:
    """Return the catalogue with one more signal for each clutch whose messages carry its heat."""
    more = {}
    for one in structure.clutches:
        name, topic = f"{one.key}_heat", f"/{one.name}/state"
        if name not in known.signals and topic in known.topics and known.topics[topic].type == "ClutchState":
            text = f"Heat of friction and drag in clutch {one.called} since time 0."
            more[name] = Signal(name, "energy", "J", "kJ", 1e-3, 0.0, 1e9, topic, "heat", "positive", text)
    return replace(known, signals={**known.signals, **more})


def plates_of(record: Mapping, structure: Structure) -> dict[str, Plates]:
    """Return the plates of a rig's clutches by the names of their temperatures.

    A rig without the effect of the plates' heat has none.
    """
    found: dict[str, Plates] = {}
    if not (record.get("effects") or {}).get("plate_heat"):
        return found
    oils = [float(record[one.name]["temperature"]) for one in structure.of_role(parts.OIL) if "temperature" in record[one.name]]
    for one in structure.clutches:
        pack = record.get(str(one.wires.get("plates")), {})
        if "heat_capacity" in pack and "cooling" in pack and oils:
            name, text = f"{one.key}_plates", f"Temperature of the plates of {one.called}, by their heat."
            signal = Signal(name, "temperature", "degC", "degC", 1.0, -50.0, 1000.0, "", "", "Celsius", text)
            found[name] = Plates(signal, f"{one.key}_heat", float(pack["heat_capacity"]), float(pack["cooling"]), oils[0])
    return found


class Pages:
    """The pages of one rig.

    ``box`` is its transmission, None for a rig without gears; ``known`` holds its signals.
    """

    def __init__(self, record: Mapping) -> None:
        """Derive the pages from a rig's record.

        Parameters
        ----------
        record : mapping
            Record of the rig (RigConfig.as_dict), of any age.
        """
        record = rig_record(record)
        self.structure: Structure = structure_of(record["structure"])
        self.known: Catalogue = with_heat(catalogue(record), self.structure)
        self.plates: dict[str, Plates] = plates_of(record, self.structure)
        self.box: Transmission | None = transmission_of(record) if self.structure.gears else None
        self._own = self.structure.view

    # ---- names of signals

    def own(self, device: Device, *what: str) -> tuple[str, ...]:
        """Return the signals of these quantities that a device has."""
        names = (f"{device.key}_{one}" for one in what)
        return tuple(name for name in (self.structure.names.get(name, name) for name in names) if name in self.known.signals)

    def each(self, devices: Iterable[Device], *what: str) -> tuple[str, ...]:
        """Return the signals of these quantities that the devices have, device after device."""
        return tuple(name for device in devices for name in self.own(device, *what))

    def measured(self, *shows: str, at: str = "", types: tuple[str, ...] = ()) -> tuple[str, ...]:
        """Return the transducers of some quantities, optionally only those at a device or of some types."""
        return tuple(
            one.name
            for one in self.structure.transducers
            if (not shows or one.shows in shows) and (not at or one.at == at) and (not types or one.type in types)
        )

    def pressures(self) -> tuple[str, ...]:
        """Return the transducers of the clutches' oil."""
        return self.measured(*(f"{self.structure.line_of(one.name)}.pressure" for one in self.structure.clutches))

    def shafts(self, what: str) -> tuple[str, str]:
        """Return the speeds or the torques of the input and the output shaft of a rig with gears."""
        assert self.box is not None
        return getattr(self.box.input, what), getattr(self.box.output, what)

    def setpoints(self, source: Device) -> tuple[str, ...]:
        """Return the setpoints of a source."""
        return self.own(source, "speed_setpoint", "setpoint")

    # ---- plots

    @cached_property
    def states(self) -> tuple[str, ...]:
        """Lanes of states of a whole run."""
        return self._there(("rig_state", "gear_ordered", "gear", *self._modes))

    @property
    def _modes(self) -> tuple[str, ...]:
        return self.each((*self.structure.clutches, *self.structure.freewheels), "mode")

    @cached_property
    def shift_states(self) -> tuple[str, ...]:
        """Lanes of states of a shift."""
        return self._there(("gear", *self._modes))

    def _at(self, place: str) -> Plots:
        """Return the plots of a place."""
        return self._shown(drawn for plot in PLOTS if place in plot.places for drawn in plot.drawn(self))

    @cached_property
    def shift_plots(self) -> Plots:
        """Plots of a shift; empty for a rig without gears."""
        return (self._own.get("shifts") or self._at(SHIFT)) if self.box else ()

    @cached_property
    def valve_plots(self) -> Plots:
        """Plots of a valve's response at standstill; empty for a rig without gears."""
        return self._at(VALVE) if self.box else ()

    @cached_property
    def coast_plots(self) -> Plots:
        """Plots of a coast-down, the speed with its fit first; empty for a rig without gears."""
        return self._at(COAST) if self.box else ()

    @cached_property
    def run_left(self) -> Plots:
        """Left plots of a whole run: oil, and for a rig without gears the rotating parts."""
        return self._own["run"][::2] if "run" in self._own else self._at(LEFT if self.box else BENCH_LEFT)

    @cached_property
    def run_right(self) -> Plots:
        """Right plots of a whole run: the rotating parts, and for a rig without gears the clamping parts."""
        return self._own["run"][1::2] if "run" in self._own else self._at(RIGHT if self.box else BENCH_RIGHT)

    def signal(self, name: str) -> Signal:
        """Return a signal of the rig, or a temperature of plates, by its name."""
        return self.plates[name].signal if name in self.plates else self.known.signal(name)

    def label(self, name: str) -> str:
        """Return the name of a curve in a legend: the signal's name with its unit."""
        return f"{name} [{self.signal(name).display_unit}]"

    @cached_property
    def marked_plots(self) -> Plots:
        """The plots that have a vertical line at each order."""
        return tuple(dict.fromkeys(self.run_left + self.run_right + self._more)) if self.box else ()

    @cached_property
    def more_pages(self) -> dict[str, Plots]:
        """The pages that the rig's folder adds, by name."""
        return {name: plots for name, plots in self._own.items() if name not in OWN}

    @property
    def opens_with_own(self) -> bool:
        """True when the view opens with a page of the rig's folder: without shifts, that of the run says least about the rig."""
        return self.box is None and bool(self.more_pages)

    @property
    def _more(self) -> Plots:
        return tuple(plot for plots in self.more_pages.values() for plot in plots)

    @cached_property
    def other_plots(self) -> list[tuple[str, list[str]]]:
        """Title and signals of the plots of all signals that the other pages do not show, by quantity."""
        if "other" in self._own:
            return [(title, list(names)) for title, names in self._own["other"]]
        shown = {name for _, names in self.shift_plots + self.run_left + self.run_right + self._more for name in names}
        groups: dict[str, list[str]] = {}
        for signal in self.known.signals.values():
            if signal.name not in shown and not signal.states:
                groups.setdefault(signal.quantity, []).append(signal.name)
        plots: dict[str, list[str]] = {}
        for quantity, names in groups.items():
            special = {title: [name for name in names if name in of] for title, of in self._kinds.items()}
            rest = [name for name in names if not any(name in of for of in special.values())]
            for title, of in (*special.items(), (quantity.capitalize(), rest)):
                plots.setdefault(title, []).extend(of)
        order = [*(title for title in self._kinds if plots.get(title)), *(title for title in plots if plots[title])]
        return [(title, plots[title]) for title in dict.fromkeys(order)]

    @cached_property
    def _kinds(self) -> dict[str, set[str]]:
        """Signals of the devices that give a plot of other signals its title; all others are named by their quantity."""
        structure = self.structure
        sources, loads = structure.of_role(parts.SOURCE), structure.of_role(parts.LOAD)
        lost = {one.name for one in self.known.signals.values() if one.topic == "/gearbox/state" and one.quantity == "torque"}
        return {
            "Load pressure": {*(name for one in loads for name in self.measured(at=one.name, types=("pressure",)))}
            | set(self.each(loads, "relief_setting", "setting")),
            "Oil temperature": {
                name for one in structure.of_role(parts.OIL) for name in self.measured(at=one.name, types=("temperature",))
            },
            "Work since time 0": {*self.each((*sources, *loads), "work")},
            "Gearbox losses": lost,
            "Clamp force": {*self.each(structure.clutches, "clamp")},
            "Valve duty": {*self.each(structure.valves, "duty")},
        }

    def _there(self, names: Iterable[str]) -> tuple[str, ...]:
        return tuple(name for name in names if name in self.known.signals)

    def _shown(self, plots: Iterable[tuple[str, Iterable[str]]]) -> Plots:
        """Return the plots that have a signal, each with its existing signals."""
        found = ((title, self._there(names)) for title, names in plots)
        return tuple((title, names) for title, names in found if names)

    # ---- colours and widths of curves

    @cached_property
    def colours(self) -> dict[str, Colour]:
        """Colour of each signal that has one."""
        structure, found = self.structure, {}
        for one in structure.of_role(parts.SOURCE):
            found |= dict.fromkeys(self.measured(at=one.name), INPUT) | dict.fromkeys(self.own(one, "work", "speed"), INPUT)
            found |= dict.fromkeys((*self.own(one, "torque"), *self.setpoints(one)), INPUT_PALE)
        for one in structure.of_role(parts.LOAD):
            found |= dict.fromkeys(self.measured(at=one.name), OUTPUT) | dict.fromkeys(self.own(one, "work"), OUTPUT)
            found |= dict.fromkeys(self.own(one, "torque", "relief_setting"), OUTPUT_PALE)
        if self.box:
            found |= dict.fromkeys((self.box.input.torque, self.box.input.speed, "loss_in"), INPUT)
            found |= dict.fromkeys((self.box.output.torque, self.box.output.speed, "loss_out"), OUTPUT)
        for one in structure.of_role(parts.OIL):
            found |= dict.fromkeys(self.measured(f"{structure.line_of(one.name)}.pressure", f"{one.name}.oil_temperature"), SUPPLY)
        for place, clutch in enumerate(structure.clutches):
            bright, pale = hues(place)
            valve = structure.valve_of(clutch.name)
            names = [
                *self.own(clutch, *_OF_CLUTCH),
                f"{clutch.key}_plates",
                *self.measured(f"{structure.line_of(clutch.name)}.pressure"),
            ]
            asked = [*self.own(clutch, "capacity")]
            if valve is not None:
                names += [*self.own(valve, *_OF_VALVE), *self.measured(f"{valve.name}.current")]
                asked.append(f"I_set_{valve.key}")
            if press := clutch.wires.get("press"):
                names += self.measured(at=press, types=("pressure", "travel"))
                asked += self.own(structure.device(press), "setting")
            found |= dict.fromkeys(names, bright) | dict.fromkeys(asked, pale)
        return self._told_apart(found | dict.fromkeys(self.measured(types=("force",)), SECOND))

    def _told_apart(self, given: Mapping[str, Colour]) -> dict[str, Colour]:
        """Return the colours with others where two curves of a plot would be alike; the first one of them keeps its own."""
        plots = (self.shift_plots, self.valve_plots, self.coast_plots, self.run_left, self.run_right, self._more, self.other_plots)
        shown = [tuple(names) for group in plots for _, names in group]
        beside: dict[str, set[str]] = {}
        for names in shown:
            for name in names:
                beside.setdefault(name, set()).update(names)
        found: dict[str, Colour] = {}
        for name in [*(one for one in beside if one in given), *(one for one in beside if one not in given)]:
            taken = {found[other] for other in beside[name] if other in found}
            wanted = given.get(name, OTHER)
            spare = (*PALE, *SPARE) if wanted in PALE else SPARE  # wide curves stay pale
            found[name] = wanted if wanted not in taken else next((one for one in spare if one not in taken), wanted)
        return {**given, **{name: colour for name, colour in found.items() if name in given or colour != OTHER}}

    @cached_property
    def _locked(self) -> dict[str, Colour]:
        return {name: hues(place)[0] for place, clutch in enumerate(self.structure.clutches) for name in self.own(clutch, "mode")}

    @cached_property
    def _states(self) -> dict[str, Colour]:
        return STATE_COLOURS | {gear.name: hues(place)[0] for place, gear in enumerate(self.structure.gears)}

    @cached_property
    def _drives(self) -> tuple[set[str], set[str], set[str]]:
        """Torques of the driving devices, those measured on their shafts, and their setpoints."""
        sources = self.structure.of_role(parts.SOURCE)
        shafts = {name for one in sources for name in self.measured(at=one.name, types=("torque",))}
        shafts |= {self.box.input.torque} if self.box else set()
        return set(self.each(sources, "torque")), shafts, {name for one in sources for name in self.setpoints(one)}

    def colour(self, name: str) -> Colour:
        """Return the colour of a signal, which is the same in every plot."""
        return self.colours.get(name, OTHER)

    def width(self, name: str) -> float:
        """Return the width of a curve in pixels; a setpoint is wider, so that it shows on both sides of the measured curve.

        The viewer draws in the order of names, in which a motor's torque would hide the shaft's; so its curve is thin and the
        shaft's is wide. When a drive holds its speed within a step of the encoder, only the edges of its setpoint remain visible.
        """
        torques, shafts, setpoints = self._drives
        if name in torques:
            return 1.0
        if name in shafts:
            return 3.0
        if name in setpoints:
            return 6.0
        return 4.0 if self.colour(name) in PALE else 2.0

    def state_colour(self, name: str, label: str) -> Colour:
        """Return the colour of a state of a signal."""
        return self._locked[name] if label == "locked" else self._states.get(label, OTHER)
