# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a rig is made of, without its values: bodies, wheels, devices, gears, transducers, by name.

Made by description.read from a rig's folder, or from what a bag says of its rig (:func:`structure_of`); the plan, the
transmission and the signal catalogue are made from it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from functools import cached_property
from typing import Any

from ..errors import RigError
from ..parts import part as parts


def key_of(called: str) -> str:
    """How the names of signals begin that belong to what people call so: "ZR-P1" gives zr_p1."""
    return called.lower().replace("-", "_").replace(" ", "_")


Points = tuple[tuple[float, float], ...]  # of a table: where, and the value there, SI


@dataclass(frozen=True)
class Mesh:
    """Toothed wheels on two bodies; reversed: one body's speed is counted against the other one's sense.

    lossy: its efficiency, and that of the way back, are settings under its name.
    """

    bodies: tuple[str, str]
    teeth: tuple[int, int]
    reversed: bool = False
    name: str = ""
    lossy: bool = False

    @property
    def ratio(self) -> float:
        """Speed of the second body by that of the first."""
        return (-1.0 if self.reversed else 1.0) * self.teeth[0] / self.teeth[1]


@dataclass(frozen=True)
class PlanetarySet:
    """A simple planetary set: z_sun w_sun + z_ring w_ring = (z_sun + z_ring) w_carrier (Willis)."""

    name: str
    sun: str
    ring: str
    carrier: str
    teeth: tuple[int, int]  # of sun and ring

    @property
    def ratio(self) -> float:
        """Teeth of the ring over those of the sun."""
        return self.teeth[1] / self.teeth[0]


@dataclass(frozen=True)
class Shaft:
    """A compliant shaft between two bodies; its stiffness, damping and backlash are settings under its name.

    table: twists and torques in place of a stiffness; hysteresis: springs beside it, each a stiffness and the torque at which it
    slides.
    """

    name: str
    bodies: tuple[str, str]
    table: Points = ()
    hysteresis: Points = ()


@dataclass(frozen=True)
class Follows:
    """What follows a table of the motion: by "speed" or "angle", of what `of` names; period, angle as in plant.driveline."""

    table: Points
    by: str = "speed"
    of: str = ""
    period: float = 0.0
    angle: float = 0.0


@dataclass(frozen=True)
class Element:
    """What joins bodies or acts on them and is no device; its numbers are settings under its name, as plant.driveline names them.

    kind: "relation", "clutch", "brake", "torque", "varying_inertia", "slider_crank" or "motion". coefficients: of a relation, one
    for each body. follows: the torque, the inertia, or the capacity of a clutch or brake; friction: factors of that over its
    slip.
    """

    name: str
    kind: str
    bodies: tuple[str, ...]
    coefficients: tuple[float, ...] = ()
    follows: Follows | None = None
    friction: Points = ()


@dataclass(frozen=True)
class Device:
    """An instance of a part; called: its name for people; wires: what it is joined to, by key of the part's ``joined``."""

    name: str
    part: str
    called: str
    wires: Mapping[str, object] = field(default_factory=dict)
    release_rate: float = 0.0  # Pa/s: how fast a clutch's pressure falls when it is let go

    @property
    def key(self) -> str:
        """How the names of its signals begin."""
        return key_of(self.called)

    @property
    def role(self) -> str:
        """What a rig asks it for."""
        return parts.part(self.part).role


@dataclass(frozen=True)
class GearHeld:
    """A gear and the clutches that hold it, with the free-wheels that hold it under a driving torque."""

    name: str
    clutches: tuple[str, ...]
    freewheels: tuple[str, ...] = ()

    @property
    def held(self) -> tuple[str, ...]:
        """All that hold it."""
        return (*self.clutches, *self.freewheels)


@dataclass(frozen=True)
class End:
    """The input or the output of a transmission: a body, and the signals of its speed and of the torque in it."""

    body: str
    speed: str
    torque: str


@dataclass(frozen=True)
class Transducer:
    """A measured signal; ``shows`` and the others as in a rig's file."""

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
    """All of a rig but its values. bodies: of all names, massless: those without an inertia of their own; names: of
    signals, made name -> name; view: pages of the view that the rig has itself, each of plots with their title and signals;
    inputs: tables over time, by what they are put into, as those of plant.driveline_run.Run; signals: what is told beside what
    every rig tells.
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
    view: Mapping[str, tuple[tuple[str, tuple[str, ...]], ...]] = field(default_factory=dict)
    elements: tuple[Element, ...] = ()
    inputs: Mapping[str, Points] = field(default_factory=dict)
    signals: tuple[str, ...] = ()

    def of_kind(self, *kinds: str) -> tuple[Element, ...]:
        """The elements of these kinds, in the order of the file."""
        return tuple(one for one in self.elements if one.kind in kinds)

    def of_role(self, *roles: str) -> tuple[Device, ...]:
        """The devices with one of these roles, in the order of the file."""
        if roles not in self._by_roles:  # asked for in every tick
            self._by_roles[roles] = tuple(device for device in self.devices if device.role in roles)
        return self._by_roles[roles]

    @cached_property
    def _by_roles(self) -> dict[tuple[str, ...], tuple[Device, ...]]:
        return {}

    @cached_property
    def _by_name(self) -> dict[str, Device]:
        return {device.name: device for device in self.devices}

    def device(self, name: str) -> Device:
        """One device; RigError when there is none."""
        if name not in self._by_name:
            from ..config.names import unknown  # here, as that module is read before the parts

            raise RigError(unknown("device", name, self._by_name))
        return self._by_name[name]

    @cached_property
    def mesh_names(self) -> tuple[str, ...]:
        """What each mesh is called: as the file has it, else by its bodies, and by a number where they have several."""
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
        """One-way clutches, which nobody actuates."""
        return self.of_role(parts.FREEWHEEL)

    @cached_property
    def valves(self) -> tuple[Device, ...]:
        """Valves that a controller drives."""
        return self.of_role(parts.VALVE)

    @property
    def shifts(self) -> bool:
        """True when there are gears, and valves that a shift controller fills their clutches with."""
        return bool(self.gears and self.valves)

    def valve_of(self, clutch: str) -> Device | None:
        """The valve that fills a clutch."""
        return next((valve for valve in self.valves if valve.wires["feeds"] == clutch), None)

    def oil_of(self, device: Device, key: str = "oil") -> str:
        """The oil supply of a device: the one that it names, or the first that there is."""
        return device.wires.get(key) or self.of_role(parts.OIL)[0].name

    def line_of(self, name: str) -> str:
        """Name of the oil line that begins at an oil supply or a clutch."""
        return str(self.device(name).wires.get("line", name))

    def plain(self) -> dict:
        """What JSON can hold, with lists as it gives them back, for the run's record; :func:`structure_of` reads it."""
        out = _listed(asdict(self))
        for name in ("view", "elements", "inputs", "signals"):
            if not out[name]:
                del out[name]
        for one in (*out["meshes"], *out["shafts"], *out["gears"]):  # what older bags do not have, and most rigs neither
            for name in ("name", "lossy", "table", "hysteresis", "freewheels"):
                if name in one and not one[name]:
                    del one[name]
        return out


def _listed(value: object) -> Any:
    """The same with lists in place of tuples."""
    if isinstance(value, dict):
        return {name: _listed(one) for name, one in value.items()}
    return [_listed(one) for one in value] if isinstance(value, (list, tuple)) else value


def structure_of(plain: Mapping) -> Structure:
    """A structure from :meth:`Structure.plain`; KeyError, TypeError or ValueError for what is none."""

    def made(cls: type, entry: Mapping | None) -> Any:
        if entry is None:
            return None
        return cls(**{name: _tupled(value) for name, value in entry.items()})

    kinds = {
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
                page: tuple((title, tuple(names)) for title, names in plots) for page, plots in plain.get("view", {}).items()
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
        if one.name in kinds:
            out[one.name] = tuple(made(kinds[one.name], entry) for entry in value)
        elif one.name in ("input", "output"):
            out[one.name] = made(End, value)
        else:
            out[one.name] = dict(value) if one.name == "names" else tuple(value)
    return Structure(**out)


def _tupled(value: object) -> Any:
    """The same with tuples in place of lists, as it was."""
    return tuple(map(_tupled, value)) if isinstance(value, list) else value
