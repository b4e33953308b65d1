# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The contents of a rig's view, derived from the rig's structure: plots (of view.plots), looks and widths of curves.

view.layout, view.curves, view.live, view.other_tools and the figures use it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import takewhile
from typing import TYPE_CHECKING

from ..bags import rig_record
from ..plant import part as parts
from ..rig import RATE, Catalogue, Device, OwnPlot, Signal, Structure, Transmission, catalogue, structure_of, transmission_of
from .palette import CLUTCHES, CURVES, INPUT, OTHER, OUTPUT, clutch_colour, rgb
from .plots import BENCH_LEFT, BENCH_RIGHT, COAST, LEFT, PLOTS, RIGHT, SHIFT, VALVE

if TYPE_CHECKING:
    from collections.abc import Iterable

Colour = tuple[int, int, int]
Plots = tuple[tuple[str, tuple[str, ...]], ...]  # title of a plot and its signals, which have the same display unit

# The colours of a clutch's states go from grey over yellow to the clutch's, which is also that of the gear at the same place.
IDLE, WAITING, ALARM = (0x55, 0x5B, 0x63), (0xA0, 0x8C, 0x14), (0xD6, 0x45, 0x50)
STATE_COLOURS = {
    "none": IDLE,
    "neutral": IDLE,
    "open": IDLE,
    "starting": IDLE,
    "slipping": WAITING,
    "ready": WAITING,
    "running": rgb(INPUT),
    "tripped": ALARM,
}
OWN = ("shifts", "run", "other")  # pages that every rig has by default and may replace
_OF_CLUTCH = ("torque", "slip", "clamp", "piston", "heat")  # quantities of clutches that are shown in the clutch's hue
_WORDS = {  # of titles, by those of quantities and signals
    "angular velocity": "speed",
    "ratio": "share",
    "clamp": "clamp force",
    "hold": "holding torque",
    "loss": "lost torque",
    "energy residual": "error of the energy balance",
}
_OF_VALVE = ("duty", "flow")


@dataclass(frozen=True)
class Look:
    """The look of a curve: the name of its colour, and whether it is of a demanded value: dashed, in the viewer pale."""

    colour: str = OTHER
    demanded: bool = False


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


def rates_of(known: Catalogue, structure: Structure) -> dict[str, tuple[Signal, str]]:
    """Return the time derivatives that a rig's plots show, by name: a signal that no topic carries, and whose derivative it is."""
    found: dict[str, tuple[Signal, str]] = {}
    for name in (name for plots in structure.view.values() for one in plots if one.over == RATE for name in one.signals):
        of = known.signal(name)
        unit = f"{of.unit.removesuffix('/s')}/s{'²' * of.unit.endswith('/s')}"
        signal = Signal(f"{name}_rate", of.quantity, unit, unit, 1.0, -1e9, 1e9, "", "", of.sign, f"Time derivative of {name}.")
        found[signal.name] = signal, name
    return found


def _over_time(plot: OwnPlot) -> OwnPlot:
    """Return a plot of time derivatives as one of the signals of :func:`rates_of`, and any other as it is."""
    return OwnPlot(plot.title, tuple(f"{name}_rate" for name in plot.signals)) if plot.over == RATE else plot


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
        self.rates: dict[str, tuple[Signal, str]] = rates_of(self.known, self.structure)
        self._view = {page: tuple(map(_over_time, plots)) for page, plots in self.structure.view.items()}
        self._own: dict[str, Plots] = {page: tuple((one.title, one.signals) for one in plots) for page, plots in self._view.items()}

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
        """Return a signal of the rig, a temperature of plates or a time derivative, by its name."""
        if name in self.plates:
            return self.plates[name].signal
        return self.rates[name][0] if name in self.rates else self.known.signal(name)

    def words(self, name: str) -> str:
        """Return what people call a signal: a device and its quantity, as ``shoe clutch torque``; others by their own name."""
        if name in self.rates:
            return f"d{self.rates[name][1]}/dt"
        if not name.islower() or any(one.name == name for one in self.structure.transducers):
            return name
        owners = [one for one in self.structure.devices if name.startswith(f"{one.key}_")]
        device = max(owners, key=lambda one: len(one.key), default=None)
        return (device.called + name[len(device.key) :] if device else name).replace("_", " ")

    def label(self, name: str) -> str:
        """Return the name of a curve in a legend: the signal with its unit."""
        return f"{self.words(name)} [{self.signal(name).display_unit}]"

    @cached_property
    def marked_plots(self) -> Plots:
        """The plots that have a vertical line at each order."""
        return tuple(dict.fromkeys(self.run_left + self.run_right + self._more + self.warm)) if self.box else ()

    @property
    def warm(self) -> Plots:
        """The plot of the temperatures of plates, which a recorded run has."""
        return (("Plate temperature", tuple(self.plates)),) if self.plates else ()

    @cached_property
    def more_pages(self) -> dict[str, Plots]:
        """The pages that the rig's folder adds, by name."""
        return {name: plots for name, plots in self._own.items() if name not in OWN}

    @cached_property
    def questions(self) -> dict[str, tuple[OwnPlot, ...]]:
        """The pages of a run by name, in the order in which they are looked at: those of the rig's folder, then the whole run."""
        own = {name: plots for name, plots in self._view.items() if name not in OWN}
        return {**own, "Run": tuple(OwnPlot(title, names) for title, names in (*self.run_left, *self.run_right))}

    @property
    def _more(self) -> Plots:
        return tuple(plot for plots in self.more_pages.values() for plot in plots)

    @cached_property
    def other_plots(self) -> list[tuple[str, list[str]]]:
        """Title and signals of the plots of all signals that the other pages do not show, by quantity and device."""
        if "other" in self._own:
            return [(title, list(names)) for title, names in self._own["other"]]
        shown = {name for _, names in self.shift_plots + self.run_left + self.run_right + self._more for name in names}
        groups: dict[tuple[str, str, str], list[Signal]] = {}
        for signal in self.known.signals.values():
            if signal.name not in shown and not signal.states:
                groups.setdefault((signal.quantity, self._role_of(signal), signal.display_unit), []).append(signal)
        return [(self._title(quantity, found), [one.name for one in found]) for (quantity, *_), found in sorted(groups.items())]

    def _device_of(self, signal: Signal) -> Device | None:
        node = self.known.topics[signal.topic].node if signal.topic in self.known.topics else ""
        return next((one for one in self.structure.devices if one.name == node), None)

    def _role_of(self, signal: Signal) -> str:
        """Return what a signal shares a plot by: the role of its device, else the name of its node."""
        device = self._device_of(signal)
        return device.role if device else signal.topic.strip("/").partition("/")[0]

    def _title(self, quantity: str, signals: Iterable[Signal]) -> str:
        """Return a title of what the signals are, or where they have no common word their quantity, and devices."""
        named, words = {}, []
        for one in signals:
            device, said = self._device_of(one), self.words(one.name)
            named[device.called if device else self._role_of(one)] = None
            shows = next((each.shows.rpartition(".")[2] for each in self.structure.transducers if each.name == one.name), "")
            words.append((shows.replace("_", " ") or said.removeprefix(device.called.replace("_", " ") if device else "")).split())
        what = " ".join(same[0] for same in takewhile(lambda same: len(set(same)) == 1, zip(*words))) or quantity
        what = _WORDS.get(what, what).capitalize()
        return what if " of " in what else f"{what} of {', '.join(named)}".replace("_", " ")

    def _there(self, names: Iterable[str]) -> tuple[str, ...]:
        return tuple(name for name in names if name in self.known.signals)

    def _shown(self, plots: Iterable[tuple[str, Iterable[str]]]) -> Plots:
        """Return the plots that have a signal, each with its existing signals."""
        found = ((title, self._there(names)) for title, names in plots)
        return tuple((title, names) for title, names in found if names)

    # ---- looks of curves

    @cached_property
    def looks(self) -> dict[str, Look]:
        """Look of each signal that has one: the colours belong to driving side, driven side, and each clutch."""
        structure, found = self.structure, {}

        def put(names: Iterable[str], colour: str, demanded: bool = False) -> None:
            found.update(dict.fromkeys(names, Look(colour, demanded)))

        put(self.measured(types=("force",)), CLUTCHES[1])
        for one in structure.of_role(parts.SOURCE):
            put((*self.measured(at=one.name), *self.own(one, "work", "speed")), INPUT)
            put((*self.own(one, "torque"), *self.setpoints(one)), INPUT, True)
        for one in structure.of_role(parts.LOAD):
            put((*self.measured(at=one.name), *self.own(one, "work")), OUTPUT)
            put(self.own(one, "torque", "relief_setting"), OUTPUT, True)
        if self.box:
            put((self.box.input.torque, self.box.input.speed, "loss_in"), INPUT)
            put((self.box.output.torque, self.box.output.speed, "loss_out"), OUTPUT)
        for one in structure.of_role(parts.OIL):
            put(self.measured(f"{structure.line_of(one.name)}.pressure", f"{one.name}.oil_temperature"), CLUTCHES[3])
        for place, clutch in enumerate(structure.clutches):
            colour, valve = clutch_colour(place), structure.valve_of(clutch.name)
            pressure = self.measured(f"{structure.line_of(clutch.name)}.pressure")
            put((*self.own(clutch, *_OF_CLUTCH), f"{clutch.key}_plates", *pressure), colour)
            put(self.own(clutch, "capacity"), colour, True)
            if valve is not None:
                put((*self.own(valve, *_OF_VALVE), *self.measured(f"{valve.name}.current")), colour)
                put((f"I_set_{valve.key}",), colour, True)
            if press := clutch.wires.get("press"):
                put(self.measured(at=press, types=("pressure", "travel")), colour)
                put(self.own(structure.device(press), "setting"), colour, True)
        return self._told_apart(found)

    def _told_apart(self, given: Mapping[str, Look]) -> dict[str, Look]:
        """Return the looks with others where two curves of a plot would be alike; the first one of them keeps its own."""
        plots = (self.shift_plots, self.valve_plots, self.coast_plots, self.run_left, self.run_right, self._more, self.other_plots)
        shown = [tuple(names) for group in plots for _, names in group]
        beside: dict[str, set[str]] = {}
        for names in shown:
            for name in names:
                beside.setdefault(name, set()).update(names)
        found: dict[str, Look] = {}
        for name in [*(one for one in beside if one in given), *(one for one in beside if one not in given)]:
            taken = {found[other] for other in beside[name] if other in found}
            wanted = given.get(name, Look())
            spare = [Look(colour, how) for how in (wanted.demanded, not wanted.demanded) for colour in (*CLUTCHES, *CURVES)]
            found[name] = wanted if wanted not in taken else next((one for one in spare if one not in taken), wanted)
        return {**given, **{name: look for name, look in found.items() if name in given or look != Look()}}

    @cached_property
    def _locked(self) -> dict[str, Colour]:
        return {
            name: rgb(clutch_colour(place))
            for place, clutch in enumerate(self.structure.clutches)
            for name in self.own(clutch, "mode")
        }

    @cached_property
    def _states(self) -> dict[str, Colour]:
        return STATE_COLOURS | {gear.name: rgb(clutch_colour(place)) for place, gear in enumerate(self.structure.gears)}

    @cached_property
    def _drives(self) -> tuple[set[str], set[str], set[str]]:
        """Torques of the driving devices, those measured on their shafts, and their setpoints."""
        sources = self.structure.of_role(parts.SOURCE)
        shafts = {name for one in sources for name in self.measured(at=one.name, types=("torque",))}
        shafts |= {self.box.input.torque} if self.box else set()
        return set(self.each(sources, "torque")), shafts, {name for one in sources for name in self.setpoints(one)}

    def colour(self, name: str) -> Colour:
        """Return the colour of a signal in the viewer, which is the same in every plot."""
        look = self.look(name)
        return rgb(look.colour, look.demanded)

    def look(self, name: str) -> Look:
        """Return the look of a signal, which is the same in every plot."""
        return self.looks.get(self.rates[name][1] if name in self.rates else name, Look())

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
        return 4.0 if self.look(name).demanded else 2.0

    def state_colour(self, name: str, label: str) -> Colour:
        """Return the colour of a state of a signal."""
        return self._locked[name] if label == "locked" else self._states.get(label, rgb(OTHER))
