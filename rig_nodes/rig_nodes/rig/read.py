# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""From a rig's file to its structure: every name is known, and every wire leads to something that exists.

rig.configuration uses it. An error states file, line, what is wrong and what would be right. base.schema reads the
values of the devices.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ..base import List, Map, RigError, brief, check_keys, file_of, meant, quantity, where_of
from ..plant import part as parts
from .quantities import QUANTITIES
from .read_elements import GROUND, GROUPS, inputs_read, is_name, read_elements, read_inputs, read_table
from .read_wheels import MASSLESS, read_meshes, read_planetary_sets
from .signals import TORQUES
from .structure import MOST_OUTPUTS, RATE, Device, End, GearHeld, OwnPlot, Points, Shaft, Structure, Transducer
from .transducer_types import TRANSDUCER_TYPES

if TYPE_CHECKING:
    from pathlib import Path

CLUTCHES = "clutches"
# keys of a rig's file from which structure is read here, and those whose values are read elsewhere
KEYS = (*GROUPS, "meshes", "inputs", "input", "output", "gears", "parts", "transducers", "signals", "names", "view")
DEVICE_KEYS = ("part", "called", "release_rate", "source")
RESERVED = ("kernel", "alfa46", "instruments", "effects", "cut", "wiring", "trips", GROUND)  # names with which other settings begin
# keys of the input and the output of the transmission
_END_KEYS = ("body", "speed", "torque")


def read_structure(node: Map, path: str | Path) -> Structure:
    """Return the structure of a whole rig, with its bases merged into it; RigError with file and line when it is not right."""
    return _Reader(node, path).structure()


class _Reader:
    """Reads one file; ``at`` returns the place of a key."""

    def __init__(self, node: Map, path: str | Path) -> None:
        self.node, self.path = node, path

    def at(self, node: object, key: object = None) -> str:
        """Return ``file:line`` of a key or an item, or of the map or list itself."""
        return where_of(self.path, node, key)

    def wrong(self, node: object, key: object, text: str) -> RigError:
        """Return the error on what stands under a key, or on the map or list itself for the key None; it begins with the place."""
        return RigError(f"{self.at(node, key)}: {text}")

    def hint(self, node: Map, what: str, key: str, known: list[str]) -> str:
        """Return which transducer could be meant; in a variant of another rig, also where its name is to be written."""
        if not known or file_of(self.path, node, what) == self.path:
            return meant(node[what], known)
        nodes = self.map_of("transducers")
        added = [one for one in known if file_of(self.path, nodes, one) == self.path]
        return f"write in {self.path} {key}: {{{what}: {(added or known)[0]}}}, because this line is its base's"

    def map_of(self, key: str) -> Map:
        """Return the map under a key of the file; an empty map when there is none."""
        value = self.node.get(key)
        if value is None:
            return Map(self.node.line)
        if not isinstance(value, Map):
            raise self.wrong(self.node, key, f"{key} must be a map of names, found {brief(value)}")
        for name in value:
            if key == "gears" and isinstance(name, int) and not isinstance(name, bool):
                continue  # a gear may have its number as name
            if not is_name(name):
                raise self.wrong(value, name, f"{key}: the name {brief(name)} has other characters than letters, digits and _")
        return value

    def structure(self) -> Structure:
        """Return the structure of the file; RigError with file and line when it is not right."""
        bodies = self.map_of("bodies")
        if not bodies:
            raise self.wrong(self.node, "bodies" if "bodies" in self.node else None, "the rig has no bodies; at least one turns")
        devices = self.map_of("parts")
        self.bodies, self.shaft_names = list(bodies), list(self.map_of("shafts"))
        self.names: dict[str, str] = {}
        for what in (*GROUPS, "parts"):
            for name in self.map_of(what):
                self.new_name(name, what, self.map_of(what))
        self.element_names = [name for what in ("clutches", "brakes", "torques", "motions") for name in self.map_of(what)]
        massless = []
        for name, body in bodies.items():
            if body == MASSLESS:
                massless.append(name)
            elif not isinstance(body, Map):
                raise self.wrong(bodies, name, f"bodies.{name} is {brief(body)}, expected a map with its inertia, or {MASSLESS}")
        self.part_of_device = {name: self.part_of(name, device, devices) for name, device in devices.items()}
        read = tuple(self.device(name, device) for name, device in devices.items())
        meshes, sets, elements = read_meshes(self), read_planetary_sets(self), read_elements(self)
        transducers = self.transducers(read)
        self.check_pairs(read, devices)
        structure = Structure(
            tuple(bodies),
            tuple(massless),
            meshes,
            sets,
            self.shafts(),
            read,
            self.gears(),
            self.end("input", transducers),
            self.end("output", transducers),
            transducers,
            self.signal_names(),
            self.view(),
            elements,
            read_inputs(self, elements),
            self.extra_signals(),
        )
        self.check_whole(structure)
        return structure

    def new_name(self, name: str, what: str, node: Map, key: str | None = None) -> None:
        """Refuse a name that exists already, because settings and signals are found by it; ``key`` is its place in the file."""
        at = self.at(node, key or name)
        if name in RESERVED:
            raise RigError(f"{at}: {what}.{name}: the name '{name}' is taken by the rig itself; choose another")
        if name in self.names:
            raise RigError(
                f"{at}: {what}.{name}: there is '{name}' among the {self.names[name]} already; each name may be used once"
            )
        self.names[name] = what

    # ---- the driveline

    def body(self, name: Any, where: str, what: str, ground: bool = False) -> str:
        """Return the name of a body; RigError when it does not exist."""
        known = [*self.bodies, GROUND] if ground else self.bodies
        if name not in known:
            raise RigError(f"{where}: {what} names the body {brief(name)}; {meant(name, known)}")
        return name

    def two_bodies(self, value: object, where: str, what: str, ground: bool = False) -> tuple[str, str]:
        """Return two different bodies."""
        if not isinstance(value, List) or len(value) != 2:
            raise RigError(f"{where}: {what} must be a list of two bodies, found {brief(value)}")
        a, b = (self.body(name, where, what, ground) for name in value)
        if a == b:
            raise RigError(f"{where}: {what} joins '{a}' with itself; two bodies are needed")
        return a, b

    def source(self, node: Map, what: str) -> None:
        """Check that the source of the numbers is given."""
        if not isinstance(node["source"], str) or not node["source"].strip():
            raise self.wrong(node, "source", f"{what}.source must state the source of the teeth, found {brief(node['source'])}")

    def shafts(self) -> tuple[Shaft, ...]:
        """Return the compliant shafts; their values are read elsewhere."""
        nodes, out = self.map_of("shafts"), []
        for name, node in nodes.items():
            what = f"shafts.{name}"
            if not isinstance(node, Map) or "joins" not in node:
                raise self.wrong(nodes, name, f"{what} must be a map with the key 'joins', found {brief(node)}")
            if ("stiffness" in node) == ("table" in node):
                raise self.wrong(
                    nodes, name, f"{what} must have one of the keys stiffness, and table for one that is no straight line"
                )
            table = read_table(self, node, "table", f"{what}.table", ("angle", "torque")) if "table" in node else ()
            out.append(
                Shaft(
                    name,
                    self.two_bodies(node["joins"], self.at(node, "joins"), f"{what}.joins"),
                    table,
                    self.hysteresis(node, what),
                )
            )
        return tuple(out)

    def hysteresis(self, node: Map, what: str) -> Points:
        """Return the springs beside a shaft: the stiffness of each [Nm/rad], and the torque at which it slides [Nm]."""
        if "hysteresis" not in node:
            return ()
        where, springs = self.at(node, "hysteresis"), node["hysteresis"]
        if (
            not isinstance(springs, List)
            or len(springs) != 2
            or not isinstance(springs[0], List)
            or not isinstance(springs[1], str)
        ):
            raise RigError(f'{where}: {what}.hysteresis must be [[[stiffness, torque], ...], "its source"], found {brief(springs)}')
        for spring in springs[0]:
            if not isinstance(spring, List) or len(spring) != 2:
                raise RigError(
                    f"{where}: {what}.hysteresis: a spring is [stiffness, torque], each with its unit; found {brief(spring)}"
                )
        return tuple(
            (
                quantity(spring[0], "torque per angle", f"{where}: {what}.hysteresis"),
                quantity(spring[1], "torque", f"{where}: {what}.hysteresis"),
            )
            for spring in springs[0]
        )

    # ---- devices

    def part_of(self, name: str, node: object, devices: Map) -> parts.Part:
        """Return the part of a device."""
        if not isinstance(node, Map):
            raise self.wrong(devices, name, f"parts.{name} must be a map with the key 'part', found {brief(node)}")
        if "part" not in node:
            of_base = [
                other
                for other, device in devices.items()
                if isinstance(device, Map) and "part" in device and file_of(self.path, device, "part") != self.path
            ]
            hint = (
                f", and its base has no such device; {meant(name, of_base)}"
                if of_base
                else f"; known are {', '.join(parts.parts())}"
            )
            raise self.wrong(devices, name, f"parts.{name} lacks the key 'part'{hint}")
        if not parts.is_part(node["part"]):
            raise self.wrong(
                node, "part", f"parts.{name}.part: there is no part {brief(node['part'])}; {meant(node['part'], parts.parts())}"
            )
        return parts.part(node["part"])

    def device(self, name: str, node: Map) -> Device:
        """Return a device with its wires."""
        part, what, wires = self.part_of_device[name], f"parts.{name}", {}
        called = node.get("called", name)
        if not isinstance(called, str) or not called.strip() or not called.isprintable() or len(called) > 40:
            raise self.wrong(node, "called", f"{what}.called is {brief(called)}, expected a short name for people")
        for key, wire in part.joined.items():
            if key in node:
                wires[key] = self.wire(node[key], wire.to, self.at(node, key), f"{what}.{key}")
            elif wire.needed:
                raise self.wrong(node, None, f"{what} lacks the key '{key}', {meaning(wire.to)}")
        if part.role == parts.CLUTCH and ("joins" in node) == ("brakes" in node):
            raise self.wrong(
                node,
                None,
                f"{what} must have one of the keys joins, for a clutch between two bodies, and brakes, for a brake of one",
            )
        if part.role == parts.METER and ("source" in node) == ("load" in node):
            raise self.wrong(node, None, f"{what} must name one of source and load, whose torque it measures")
        rate = 0.0
        if "release_rate" in node:
            value = node["release_rate"]
            where = f"{self.at(node, 'release_rate')}: {what}.release_rate"
            if not isinstance(value, List) or len(value) != 2 or not isinstance(value[1], str):
                raise RigError(f'{where} must be [value with unit, "its source"], found {brief(value)}')
            rate = quantity(value[0], "pressure rate", where)
        return Device(name, node["part"], called, wires, rate)

    def wire(self, value: Any, to: str, where: str, what: str) -> Any:
        """Return what a key names; RigError when it does not exist."""
        if to == parts.BODY:
            return self.body(value, where, what)
        if to == parts.BODIES:
            return list(self.two_bodies(value, where, what))
        if to == parts.ONE_WAY:
            return list(self.two_bodies(value, where, what, ground=True))
        if to == parts.OUTPUT:
            if not isinstance(value, int) or isinstance(value, bool) or not 1 <= value <= MOST_OUTPUTS:
                raise RigError(f"{where}: {what} is {brief(value)}, expected output 1 to {MOST_OUTPUTS} of the controller")
            return value
        if to == parts.INPUT:
            return str(value)  # check_whole knows which there are
        if to == parts.LINE:
            if not isinstance(value, str) or not value.isidentifier():
                raise RigError(f"{where}: {what} is {brief(value)}, expected a name for the oil line")
            return value
        if to == parts.TRANSDUCER:
            known = list(self.map_of("transducers"))
        elif to == parts.DRIVES:
            known = [name for name, part in self.part_of_device.items() if part.role in (parts.SOURCE, parts.COUPLING)]
        elif to == parts.TORQUE:
            known = [CLUTCHES, *(name for name, part in self.part_of_device.items() if part.role == parts.METER)]
        else:
            known = [name for name, part in self.part_of_device.items() if part.role == to]
        if value not in known:
            raise RigError(f"{where}: {what} names {brief(value)}, expected {meaning(to)}; {meant(value, known)}")
        return value

    def check_pairs(self, devices: tuple[Device, ...], nodes: Map) -> None:
        """Refuse a clutch or an output with two valves, and a device that needs an oil supply and has none."""
        for key, what in (("feeds", "clutch"), ("output", "output of the controller")):
            taken: dict[object, str] = {}
            for device in devices:
                value = device.wires.get(key)
                if value is None:
                    continue
                if value in taken:
                    raise self.wrong(
                        nodes[device.name],
                        key,
                        f"parts.{device.name}.{key}: the {what} {value} has the valve {taken[value]} already; each takes one",
                    )
                taken[value] = device.name
        fed = {device.wires.get("feeds") for device in devices}
        oil = [device for device in devices if device.role == parts.OIL]
        for device in devices:
            needs = "oil" in parts.part(device.part).joined or device.role == parts.VALVE
            if needs and not oil:
                raise self.wrong(nodes, device.name, f"parts.{device.name} needs an oil_supply, and the rig has none")
            if device.part == "wet_clutch" and device.name not in fed:
                raise self.wrong(
                    nodes,
                    device.name,
                    f"parts.{device.name}: no valve feeds it; give one of the proportional_valve the key feeds: {device.name}",
                )

    # ---- what is measured, and what it is called

    def transducers(self, devices: tuple[Device, ...]) -> tuple[Transducer, ...]:
        """Return everything that is measured: the logger's columns in the order of the file, then what is not logged."""
        nodes, out = self.map_of("transducers"), []
        hosts = [device.name for device in devices if device.role not in (parts.VALUES, parts.METER, parts.LOSS)]
        for name, node in nodes.items():
            what = f"transducers.{name}"
            check_keys(
                self.path,
                node,
                ("type", "like", "shows", "at", "range", "text", "sign", "topic", "logged"),
                ("type", "shows", "at", "range", "text"),
                what,
                self.at(nodes, name),
            )
            if not isinstance(node["type"], str) or node["type"] not in TRANSDUCER_TYPES:
                raise self.wrong(
                    node, "type", f"{what}.type is {brief(node['type'])}, expected one of {', '.join(TRANSDUCER_TYPES)}"
                )
            if node["at"] not in hosts:
                raise self.wrong(
                    node,
                    "at",
                    f"{what}.at names {brief(node['at'])}, expected the device whose node publishes it; {meant(node['at'], hosts)}",
                )
            type_of = TRANSDUCER_TYPES[node["type"]]
            where = f"{self.at(node, 'range')}: {what}.range"
            ends = node["range"]
            if not isinstance(ends, List) or len(ends) != 2:
                raise RigError(f"{where} must be [lowest, highest], each with its unit, found {brief(ends)}")
            low, high = (quantity(end, type_of.dimension, where) for end in ends)
            if not low < high:
                raise RigError(f"{where} is {brief(list(ends))}; give the lowest value first")
            for key in ("text", "sign", "like", "topic"):
                if key in node and (not isinstance(node[key], str) or not node[key].strip() or not node[key].isprintable()):
                    raise self.wrong(node, key, f"{what}.{key} is {brief(node[key])}, expected words")
            like = node.get("like", node["type"])
            if other := next((one for one in out if one.like == like and one.type != node["type"]), None):
                raise self.wrong(
                    node,
                    "like" if "like" in node else "type",
                    f"{what} has the errors of '{like}', which are those of "
                    f"{other.name}, a transducer of type {other.type}; give it another name under like",
                )
            logged = node.get("logged", True)
            if logged not in (True, False, "yes", "no"):
                raise self.wrong(node, "logged", f"{what}.logged is {brief(logged)}, expected yes or no")
            out.append(
                Transducer(
                    name,
                    node["type"],
                    like,
                    self.shown(node, what, devices),
                    node["at"],
                    low,
                    high,
                    node["text"],
                    node.get("sign", QUANTITIES[type_of.quantity].sign),
                    node.get("topic", name.lower()),
                    logged in (True, "yes"),
                )
            )
        # logged ones first: a variant can add a column though its base ends with transducers that have none
        return tuple(sorted(out, key=lambda one: not one.logged))

    def shown(self, node: Map, what: str, devices: tuple[Device, ...]) -> str:
        """Return what a transducer shows; RigError when it does not exist."""
        shows = str(node["shows"])
        where, (owner, dot, _) = f"{self.at(node, 'shows')}: {what}.shows", shows.partition(".")
        meters = [device.name for device in devices if device.role == parts.METER]
        lines = {str(device.wires.get("line", device.name)) for device in devices if device.role in (parts.OIL, parts.CLUTCH)}
        by_name = {device.name: device for device in devices}
        known = [
            *meters,
            *(f"{body}.speed" for body in self.bodies),
            *(f"{line}.pressure" for line in sorted(lines)),
            *(f"{name}.torque" for name in (*self.shaft_names, *self.element_names)),
            *(f"{name}.temperature" for name in self.map_of("states")),
            *(f"{name}.{one}" for name, device in by_name.items() for one in parts.part(device.part).state),
        ]
        if shows not in known:
            if dot and owner in by_name:
                known = [one for one in known if one == owner or one.startswith(f"{owner}.")]
                if not known:
                    kind = by_name[owner].part
                    raise RigError(f"{where} is {brief(shows)}; nothing of {owner} can be shown: a {kind} has no state of its own")
            raise RigError(f"{where} is {brief(shows)}; {meant(shows, known)}")
        return shows

    def end(self, key: str, transducers: tuple[Transducer, ...]) -> End | None:
        """Return the input or output of the transmission."""
        if key not in self.node:
            return None
        node = self.node[key]
        check_keys(self.path, node, _END_KEYS, _END_KEYS, key, self.at(self.node, key))
        self.body(node["body"], self.at(node, "body"), f"{key}.body")
        for what in ("speed", "torque"):
            known = [one.name for one in transducers if one.type == what]
            if node[what] not in known:
                raise self.wrong(
                    node,
                    what,
                    f"{key}.{what} names {brief(node[what])}, expected a transducer of type "
                    f"{what}; {self.hint(node, what, key, known)}",
                )
        return End(*(node[one] for one in _END_KEYS))

    def gears(self) -> tuple[GearHeld, ...]:
        """Return the table of gears."""
        nodes, out = self.map_of("gears"), []
        clutches, freewheels = (
            [name for name, part in self.part_of_device.items() if part.role == role] for role in (parts.CLUTCH, parts.FREEWHEEL)
        )
        elements = [*self.map_of("clutches"), *self.map_of("brakes")]
        known = [*clutches, *freewheels, *elements]
        for number, (key, held) in enumerate(nodes.items(), 1):
            name = str(key)
            where, what = self.at(nodes, key), f"gears.{name}"
            if name.lower() in ("neutral", "n") or (name.isdecimal() and name != str(number)):
                raise RigError(
                    f"{where}: {what}: '{name}' is no name for the gear of number {number}; gears count from the top, and "
                    "neutral is there in any rig"
                )
            if not isinstance(held, List) or not held:
                raise RigError(f"{where}: {what} must be a list of the clutches that hold it, found {brief(held)}")
            for one in held:
                if one not in known:
                    raise RigError(f"{where}: {what} names the clutch {brief(one)}; {meant(one, known)}")
            if len(set(held)) < len(held):
                raise RigError(f"{where}: {what} names a clutch twice")
            ordered = tuple(one for one in held if one in clutches)
            if not ordered:
                raise RigError(
                    f"{where}: {what} is held by {'elements' if set(held) & set(elements) else 'free-wheels'} alone; a gear is "
                    "ordered by a clutch of the parts, so name one too"
                )
            same = next((gear.name for gear in out if set(gear.clutches) == set(ordered)), None)
            if same:
                raise RigError(f"{where}: {what} is held by the same clutches as {same}; each gear has its own")
            others = (tuple(one for one in held if one in names) for names in (freewheels, elements))
            out.append(GearHeld(name, ordered, *others))
        return tuple(out)

    def signal_names(self) -> dict[str, str]:
        """Return the other names of signals; rig.signals.unnamed finds those whose signal does not exist."""
        nodes = self.map_of("names")
        for old, new in nodes.items():
            if not isinstance(new, str) or not new.isidentifier():
                raise self.wrong(nodes, old, f"names.{old} is {brief(new)}, expected a name for the signal")
        return dict(nodes)

    def extra_signals(self) -> tuple[str, ...]:
        """Return the groups of signals in addition to those of every rig."""
        nodes = self.node.get("signals", List(self.node.line))
        if not isinstance(nodes, List) or any(one != TORQUES for one in nodes):
            raise self.wrong(
                self.node,
                "signals",
                f"signals is {brief(nodes)}, expected [{TORQUES}], which records the torques of all elements between bodies",
            )
        return tuple(dict.fromkeys(nodes))

    def view(self) -> dict[str, tuple[OwnPlot, ...]]:
        """Return the pages of the view; the catalogue checks later whether their signals exist."""
        nodes = self.node.get("view", Map(self.node.line))
        pages: dict[str, tuple[OwnPlot, ...]] = {}
        if not isinstance(nodes, Map):
            raise self.wrong(self.node, "view", f"view must be a map of pages, found {brief(nodes)}")
        for page, plots in nodes.items():
            if not isinstance(page, str) or not page.isprintable() or not isinstance(plots, Map) or not plots:
                raise self.wrong(nodes, page, f"view.{page} must be a map of plots, each a title and the list of its signals")
            pages[page] = tuple(self._plot(plots, page, title) for title in plots)
        return pages

    def _plot(self, plots: Map, page: str, title: object) -> OwnPlot:
        """Return a plot of a page: a list of signals, or a map of such a list and what it is drawn over."""
        node, over = plots[title], ""
        if isinstance(node, Map):
            if set(node) == {"rate"}:
                node, over = node["rate"], RATE
            elif set(node) == {"show", "turn"} and isinstance(node["turn"], str):
                node, over = node["show"], node["turn"]
        if not isinstance(node, List) or not node or not all(isinstance(name, str) for name in node):
            expected = "a list of signals, {rate: LIST} or {show: LIST, turn: SPEED}"
            raise self.wrong(plots, title, f"view.{page}.{title} must be {expected}, found {brief(node)}")
        return OwnPlot(str(title), tuple(node), over)

    def check_whole(self, structure: Structure) -> None:
        """Check that a rig with gears has what it needs, and that a lever moves what nothing else moves."""
        ends = [key for key in ("input", "output") if key in self.node]
        if structure.gears and len(ends) < 2:
            raise self.wrong(
                self.node, "gears", f"a rig with gears needs the keys input and output, found {', '.join(ends) or 'neither'}"
            )
        if structure.gears and not structure.of_role(parts.SOURCE):
            raise self.wrong(self.node, "gears", "a rig with gears needs a motor among its parts, e.g. part: dc_motor")
        self.check_measured(structure)
        known = [*inputs_read(structure.elements), *(one.name for one in structure.of_kind("torque", "variator"))]
        moved = dict.fromkeys(structure.inputs, "the table over time under inputs")
        for device in structure.of_role(parts.LEVER):
            what, to, node = f"parts.{device.name}.moves", device.wires["moves"], self.map_of("parts")[device.name]
            if to not in known:
                raise self.wrong(node, "moves", f"{what} names {brief(to)}, expected {meaning(parts.INPUT)}; {meant(to, known)}")
            if to in moved:
                raise self.wrong(node, "moves", f"{what} names '{to}', which follows {moved[to]} already; one is possible")
            moved[to] = device.name

    def check_measured(self, structure: Structure) -> None:
        """Refuse what a controller does not see: the coil current of a valve and, with gears, the pressure of a clutch."""
        shown, nodes = {one.shows for one in structure.transducers}, self.map_of("parts")
        lines = [(one.name, structure.line_of(one.name)) for one in (structure.clutches if structure.shifts else ())]
        needed = [(valve.name, "current", f"{valve.name}.current") for valve in structure.valves]
        for name, kind, shows in (*needed, *((name, "pressure", f"{line}.pressure") for name, line in lines)):
            if shows not in shown:
                raise self.wrong(
                    nodes,
                    name,
                    f"parts.{name}: nothing measures its {kind}, which a controller needs; give transducers one with "
                    f"type: {kind}, shows: {shows}",
                )


def meaning(to: str) -> str:
    """Return a text for people on what a wire leads to."""
    return {
        parts.BODY: "a body",
        parts.BODIES: "two bodies",
        parts.ONE_WAY: f"two bodies, one of which may be '{GROUND}'",
        parts.DRIVES: "a source or a coupling",
        parts.TORQUE: f"a torque meter or '{CLUTCHES}'",
        parts.TRANSDUCER: "a transducer",
        parts.OUTPUT: "an output of the controller",
        parts.LINE: "a name",
        parts.INPUT: "an input over which a table is, a torque or a variator",
        parts.VALUES: "a part whose values it shares",
        parts.OIL: "an oil supply",
    }.get(to, f"a {to}")
