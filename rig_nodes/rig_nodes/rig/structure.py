# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a rig is made of, without its values: bodies, wheels, devices, gears, transducers, by name.

rig.read makes it from a rig's folder, and :func:`structure_of` from a bag's record of its rig. The plan, the
transmission and the signal catalogue are made from it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from functools import cached_property
from typing import Any

from ..base import RigError
from ..plant import part as parts

LEAST_OUTPUTS = 3  # a record has no fewer, so that frames, headers and bags of rigs with one or two valves stay as they are
RATE = "time"  # of a plot of the view that shows the time derivative of its signals
MOST_OUTPUTS = 8  # the flags of rig_msgs/ValveCommand and of the CAN frames have a bit for each


def key_of(called: str) -> str:
    """Return the beginning of the names of signals of something with a name for people: "ZR-P1" gives zr_p1."""
    return called.lower().replace("-", "_").replace(" ", "_")


Points = tuple[tuple[float, ...], ...]  # points of a table: its one or two arguments, and the value [SI]


@dataclass(frozen=True)
class Mesh:
    """Toothed wheels on two bodies.

    Parameters
    ----------
    bodies : (2,) tuple of str
        The two bodies.
    teeth : (2,) tuple of int
        Teeth of their wheels.
    reversed : bool
        True when the speeds of the two bodies have opposite signs.
    name : str
        Name of the mesh; empty when it has none.
    lossy : bool
        True when its efficiency, and that of the way back, are settings under its name.
    table, back_table : tuple of (float, float) or (float, float, float)
        Speeds [rad/s] and efficiencies, or speeds, torques [Nm] and efficiencies, in place of these.
    """

    bodies: tuple[str, str]
    teeth: tuple[int, int]
    reversed: bool = False
    name: str = ""
    lossy: bool = False
    table: Points = ()
    back_table: Points = ()

    @property
    def ratio(self) -> float:
        """Speed of the second body divided by that of the first."""
        return (-1.0 if self.reversed else 1.0) * self.teeth[0] / self.teeth[1]


@dataclass(frozen=True)
class OwnPlot:
    """A plot of a page that a rig has itself.

    Parameters
    ----------
    title : str
        Its title.
    signals : tuple of str
        Its signals, which have the same display unit.
    over : str
        "" for a plot over time, RATE for the time derivative of its signals, else a speed, over whose angle of turn the signals are
        drawn.
    """

    title: str
    signals: tuple[str, ...]
    over: str = ""

    def plain(self) -> list:
        """Return plain values for JSON; :func:`structure_of` reads them."""
        return [self.title, list(self.signals), *([self.over] if self.over else [])]


@dataclass(frozen=True)
class PlanetarySet:
    """A simple planetary set: z_sun w_sun + z_ring w_ring = (z_sun + z_ring) w_carrier (Willis), which may lose as a mesh."""

    name: str
    sun: str
    ring: str
    carrier: str
    teeth: tuple[int, int]  # of sun and ring
    lossy: bool = False
    table: Points = ()
    back_table: Points = ()

    @property
    def ratio(self) -> float:
        """Teeth of the ring divided by those of the sun."""
        return self.teeth[1] / self.teeth[0]


@dataclass(frozen=True)
class Shaft:
    """A compliant shaft between two bodies; its stiffness, damping and backlash are settings under its name.

    Parameters
    ----------
    name : str
        Name of the shaft.
    bodies : (2,) tuple of str
        The two bodies.
    table : tuple of (float, float)
        Twists [rad] and torques [Nm] in place of a stiffness.
    hysteresis : tuple of (float, float)
        Springs beside the shaft, each with its stiffness [Nm/rad] and the torque at which it slides [Nm].
    """

    name: str
    bodies: tuple[str, str]
    table: Points = ()
    hysteresis: Points = ()


@dataclass(frozen=True)
class Follows:
    """A table over the "speed" or "angle" of what ``of`` names, or over two quantities; all are those of driveline.builder."""

    table: Points
    by: str | tuple[str, str] = "speed"
    of: str | tuple[str | tuple[str, str], ...] = ""
    period: float = 0.0
    angle: float = 0.0


@dataclass(frozen=True)
class Element:
    """What joins bodies or acts on them and is not a device.

    Its numbers are settings under its name, with the names of driveline.builder.

    Parameters
    ----------
    name : str
        Name of the element.
    kind : str
        "relation", "clutch", "brake", "torque", "varying_inertia", "slider_crank", "motion", "variator" or "state".
    bodies : tuple of str
        The bodies that it joins or acts on.
    coefficients : tuple of float
        Of a relation, one for each body.
    follows : Follows or None
        Table of the torque, of the inertia, of the ratio, or of the capacity of a clutch or brake.
    friction : tuple of (float, float)
        Slips [rad/s] and factors of the capacity.
    heat : tuple of (str, float)
        Of a state what loses power into it, and the share of this.
    """

    name: str
    kind: str
    bodies: tuple[str, ...]
    coefficients: tuple[float, ...] = ()
    follows: Follows | None = None
    friction: Points = ()
    heat: tuple[tuple[str, float], ...] = ()


@dataclass(frozen=True)
class Device:
    """An instance of a part.

    Parameters
    ----------
    name : str
        Name of the device.
    part : str
        Name of its part.
    called : str
        Its name for people.
    wires : mapping of str to str, list of str or int
        What it is joined to, by the keys of the part's ``joined``; the type of its value depends on the key.
    release_rate : float
        Rate at which the pressure of a clutch falls when it is released [Pa/s].
    """

    name: str
    part: str
    called: str
    wires: Mapping[str, Any] = field(default_factory=dict)
    release_rate: float = 0.0  # Pa/s: rate at which a clutch's pressure falls when it is released

    @property
    def key(self) -> str:
        """Beginning of the names of its signals."""
        return key_of(self.called)

    @property
    def role(self) -> str:
        """Role of its part in a rig."""
        return parts.part(self.part).role


@dataclass(frozen=True)
class GearHeld:
    """A gear with what holds it: clutches, free-wheels under a driving torque, and elements such as dog clutches.

    An element is a clutch or brake of the sections of this name: its capacity is set from outside, and no valve fills it.
    """

    name: str
    clutches: tuple[str, ...]
    freewheels: tuple[str, ...] = ()
    elements: tuple[str, ...] = ()

    @property
    def held(self) -> tuple[str, ...]:
        """All clutches, free-wheels and elements that hold it."""
        return (*self.clutches, *self.freewheels, *self.elements)


@dataclass(frozen=True)
class End:
    """The input or the output of a transmission: a body, and the signals of its speed and of the torque in it."""

    body: str
    speed: str
    torque: str


@dataclass(frozen=True)
class Transducer:
    """A measured signal; ``shows`` and the other fields have the meaning of the keys in a rig's file."""

    name: str
    type: str
    like: str
    shows: str
    at: str
    low: float
    high: float
    text: str
    sign: str
    topic: str
    logged: bool = True


@dataclass(frozen=True)
class Structure:
    """All of a rig except its values.

    Parameters
    ----------
    bodies : tuple of str
        Names of all bodies.
    massless : tuple of str
        Bodies without an inertia of their own.
    meshes, planetary_sets, shafts, devices, gears, elements : tuple
        The parts of the driveline, the devices and the gears, in the order of the file.
    input, output : End or None
        The ends of the transmission.
    transducers : tuple of Transducer
        What is measured, in the order of the logger's columns.
    names : mapping of str to str
        Names of signals that replace those made from the structure.
    view : mapping of str to tuple
        Pages of the view that the rig has itself, each with its plots.
    inputs : mapping of str to tuple of (float, float)
        Tables over time, by what they are applied to, as those of driveline.run.Run.
    signals : tuple of str
        Groups of signals in addition to those of every rig.
    """

    bodies: tuple[str, ...] = ()
    massless: tuple[str, ...] = ()
    meshes: tuple[Mesh, ...] = ()
    planetary_sets: tuple[PlanetarySet, ...] = ()
    shafts: tuple[Shaft, ...] = ()
    devices: tuple[Device, ...] = ()
    gears: tuple[GearHeld, ...] = ()
    input: End | None = None
    output: End | None = None
    transducers: tuple[Transducer, ...] = ()
    names: Mapping[str, str] = field(default_factory=dict)
    view: Mapping[str, tuple[OwnPlot, ...]] = field(default_factory=dict)
    elements: tuple[Element, ...] = ()
    inputs: Mapping[str, Points] = field(default_factory=dict)
    signals: tuple[str, ...] = ()

    def of_kind(self, *kinds: str) -> tuple[Element, ...]:
        """Return the elements of these kinds, in the order of the file."""
        return tuple(one for one in self.elements if one.kind in kinds)

    def of_role(self, *roles: str) -> tuple[Device, ...]:
        """Return the devices with one of these roles, in the order of the file."""
        if roles not in self._by_roles:  # kept, because it is needed in every tick
            self._by_roles[roles] = tuple(device for device in self.devices if device.role in roles)
        return self._by_roles[roles]

    @cached_property
    def _by_roles(self) -> dict[tuple[str, ...], tuple[Device, ...]]:
        return {}

    @cached_property
    def _by_name(self) -> dict[str, Device]:
        return {device.name: device for device in self.devices}

    def device(self, name: str) -> Device:
        """Return a device by its name; RigError when there is none."""
        if name not in self._by_name:
            from ..base import unknown  # here, because that module is imported before the parts

            raise RigError(unknown("device", name, self._by_name))
        return self._by_name[name]

    @cached_property
    def mesh_names(self) -> tuple[str, ...]:
        """Name of each mesh: that of the file, or else of its bodies, with a number where they have several meshes."""
        out: list[str] = []
        for mesh in self.meshes:
            name = mesh.name or "-".join(mesh.bodies)
            out.append(
                name if name not in out else f"{name}-{sum(one.bodies == mesh.bodies for one in self.meshes[: len(out)]) + 1}"
            )
        return tuple(out)

    @cached_property
    def clutches(self) -> tuple[Device, ...]:
        """Clutches and brakes."""
        return self.of_role(parts.CLUTCH)

    @cached_property
    def freewheels(self) -> tuple[Device, ...]:
        """One-way clutches, which are not actuated."""
        return self.of_role(parts.FREEWHEEL)

    @cached_property
    def valves(self) -> tuple[Device, ...]:
        """Valves that a controller drives."""
        return self.of_role(parts.VALVE)

    @cached_property
    def outputs(self) -> int:
        """Number of the controller's outputs: the highest that has a valve, and LEAST_OUTPUTS where that is lower."""
        return max([LEAST_OUTPUTS, *(valve.wires["output"] for valve in self.valves)])

    @property
    def shifts(self) -> bool:
        """True when there are gears, and valves with which a shift controller fills their clutches."""
        return bool(self.gears and self.valves)

    def valve_of(self, clutch: str) -> Device | None:
        """Return the valve that fills a clutch; None when there is none."""
        return next((valve for valve in self.valves if valve.wires["feeds"] == clutch), None)

    def speed_of_load(self, load: str) -> str:
        """Return the transducer of the speed at which a load brakes: the output's or, on a rig without one, that of its own body.

        Raises
        ------
        RigError
            When nothing measures that speed.
        """
        if self.output is not None:
            return self.output.speed
        shows = f"{self.device(load).wires['body']}.speed"
        if not (found := [one.name for one in self.transducers if one.shows == shows]):
            raise RigError(
                f"a torque of {load} needs the speed of its body, which nothing measures; set its pressure, or give "
                f"transducers one with type: speed, shows: {shows}"
            )
        return found[0]

    def oil_of(self, device: Device, key: str = "oil") -> str:
        """Return the name of a device's oil supply: the one that the device names, or the first of the rig."""
        return device.wires.get(key) or self.of_role(parts.OIL)[0].name

    def line_of(self, name: str) -> str:
        """Return the name of the oil line that begins at an oil supply or a clutch."""
        return str(self.device(name).wires.get("line", name))

    def plain(self) -> dict:
        """Return plain values for JSON, with lists in place of tuples, for a run's record; :func:`structure_of` reads them."""
        out = _listed(asdict(self))
        out["view"] = {page: [one.plain() for one in plots] for page, plots in self.view.items()}
        for name in ("view", "elements", "inputs", "signals"):
            if not out[name]:
                del out[name]
        for one in (*out["meshes"], *out["planetary_sets"], *out["shafts"], *out["gears"]):  # older bags and most rigs lack these
            for name in ("name", "lossy", "table", "back_table", "hysteresis", "freewheels", "elements"):
                if name in one and not one[name]:
                    del one[name]
        for one in out.get("elements", ()):
            if not one["heat"]:
                del one["heat"]
        return out


def _listed(value: object) -> Any:
    """The same value with lists in place of tuples."""
    if isinstance(value, dict):
        return {name: _listed(one) for name, one in value.items()}
    return [_listed(one) for one in value] if isinstance(value, (list, tuple)) else value


def structure_of(plain: Mapping) -> Structure:
    """Return the structure from the result of :meth:`Structure.plain`.

    Raises
    ------
    KeyError, TypeError, ValueError
        When the map describes no structure.
    """

    def made(cls: type, entry: Mapping | None) -> Any:
        if entry is None:
            return None
        return cls(**{name: _tupled(value) for name, value in entry.items()})

    classes = {
        "meshes": Mesh,
        "planetary_sets": PlanetarySet,
        "shafts": Shaft,
        "devices": Device,
        "gears": GearHeld,
        "transducers": Transducer,
    }
    out = {}
    for one in fields(Structure):
        if one.name == "view":
            out["view"] = {
                page: tuple(OwnPlot(title, tuple(names), *over) for title, names, *over in plots)
                for page, plots in plain.get("view", {}).items()
            }
            continue
        if one.name == "elements":
            out["elements"] = tuple(
                made(Element, {**entry, "follows": made(Follows, entry["follows"])}) for entry in plain.get("elements", ())
            )
            continue
        if one.name == "inputs":
            out["inputs"] = {name: _tupled(points) for name, points in plain.get("inputs", {}).items()}
            continue
        value = plain[one.name] if one.name != "signals" else plain.get("signals", ())
        if one.name in classes:
            out[one.name] = tuple(made(classes[one.name], entry) for entry in value)
        elif one.name in ("input", "output"):
            out[one.name] = made(End, value)
        else:
            out[one.name] = dict(value) if one.name == "names" else tuple(value)
    return Structure(**out)


def _tupled(value: object) -> Any:
    """The same value with tuples in place of lists, as before :func:`_listed`."""
    return tuple(map(_tupled, value)) if isinstance(value, list) else value
