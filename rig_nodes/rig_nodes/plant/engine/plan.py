# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a rig consists of, in the form that the engine needs, and the world's record that is filled from it.

runs.plan makes a plan from a rig's configuration; runs.rig_base moves the record.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from ...base import RigError, fill
from ...driveline import MOTION, ON, OWN, TORQUE, State, System, Table, driven_arrays, layout_of
from ..parts.part import BODY, NOWHERE, Part, part
from .world import Sizes, places, world_dtype


@dataclass(frozen=True)
class Instance:
    """A device of a rig: its name, its part, and the contents of its record.

    Parameters
    ----------
    name : str
        Name of the device.
    part : str
        Name of its part.
    configs : tuple
        Configurations, as the part declares them.
    derived : mapping of str to float
        Derived numbers of the part.
    wires : mapping of str to str or int
        Name of what it is joined to, or number of an output or of a loss; see :class:`Plan`.
    start : mapping of str to float
        Values of its states at the start.
    tables : mapping of str to array
        Tables of the part.
    """

    name: str
    part: str
    configs: tuple = ()
    derived: Mapping[str, float] = field(default_factory=dict)
    wires: Mapping[str, str | int] = field(default_factory=dict)
    start: Mapping[str, float] = field(default_factory=dict)
    tables: Mapping[str, np.ndarray] = field(default_factory=dict)


@dataclass(frozen=True)
class Meter:
    """Torque between bodies, as a weighted sum.

    Parameters
    ----------
    name : str
        Name of the meter.
    friction : mapping of str to float
        Weights of friction torques, by element.
    shaft : mapping of str to float
        Weights of the torques of compliant shafts, by shaft.
    push : mapping of str to float
        Weights of pushes, by body.
    rate : mapping of str to float
        Weights of accelerations, by body.
    """

    name: str
    friction: Mapping[str, float] = field(default_factory=dict)
    push: Mapping[str, float] = field(default_factory=dict)
    rate: Mapping[str, float] = field(default_factory=dict)
    shaft: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Plan:
    """A rig in the form that the engine needs.

    The wires of an instance have keys: "body", "braked", "driving", "driven" and those that a part joins to a body name one of
    ``bodies``, "element" one of the driveline's friction elements, "shaft" one of its shafts, "line" and "supply" one of
    ``oil_lines``, "beside" a channel, "valve" and "oil" another instance; other wires are numbers.

    Parameters
    ----------
    system : System
        The driveline.
    bodies : tuple of str
        Bodies with a port.
    oil_lines : tuple of str
        Names of the oil lines.
    instances : tuple of Instance
        The devices.
    meters : tuple of Meter
        Meters of the torque between bodies.
    losses : array of float
        Losses by torque, one row each.
    channels : mapping of str to str
        By column of the logger the place of its true value: "<instance>.<state>", "<body>.speed", "<oil line>.pressure", the
        name of a meter, or "<name>.torque" of a shaft, a friction element, or a torque or motion among the system's laws.
    encoders : tuple of str
        Channels that are encoders.
    outputs : int
        Number of outputs of the controller.
    currents : mapping of str to str
        By instance the channel with the current of its coil.
    untouched : int
        Number of the last channels, which no transducer shows.
    inputs : mapping of str to Table
        Inputs over time, as those of a driveline.run.Run, each a table.
    """

    system: System
    bodies: tuple[str, ...]
    oil_lines: tuple[str, ...]
    instances: tuple[Instance, ...]
    meters: tuple[Meter, ...]
    losses: np.ndarray
    channels: Mapping[str, str]
    encoders: tuple[str, ...]
    outputs: int
    currents: Mapping[str, str] = field(default_factory=dict)
    untouched: int = 0
    inputs: Mapping[str, Table] = field(default_factory=dict)

    @property
    def driven(self) -> bool:
        """True where the driveline has laws, meshes with losses or inputs over time."""
        return bool(self.system.laws or self.system.meshes or self.inputs)


class World:
    """The record of a plan, and the places of everything in it.

    Parameters
    ----------
    plan : Plan
        The rig.

    Attributes
    ----------
    record : (1,) record array
        The world.
    numbers, moved : arrays of float64 and of int64
        The beginning of the record, as two types.
    names : list of str
        Names of these numbers for messages.
    finite : int
        How many of the first numbers must be finite.
    kept : (2, count) array of int64
        Room for two copies of what a step leaves to the next one.

    Raises
    ------
    RigError
        When a loss by torque does not have a friction element of its own.
    """

    def __init__(self, plan: Plan) -> None:
        self.plan = plan
        self._by_part: dict[str, list[Instance]] = {}
        self._views: dict[tuple[str, str], np.void] = {}
        for instance in plan.instances:
            self._by_part.setdefault(instance.part, []).append(instance)
        system, shapes = plan.system, {}
        for instance in plan.instances:
            shapes.update({name: table.shape for name, table in instance.tables.items()})
        start = system.state(recorded=plan.driven)
        self.losses = np.concatenate([plan.losses, system.losses()])
        owned = tuple(int(element) for element in self.losses[:, OWN])
        if len(set(owned)) < len(owned) or not set(self.losses[:, ON]) <= set(owned):
            raise RigError("each loss by torque needs a friction element of its own, and brakes one that a loss owns")
        driven = driven_arrays(system, plan.inputs) if plan.driven else {}
        self.sizes = sizes = Sizes(
            speeds=len(system.speeds),
            elements=len(system.elements),
            shafts=len(system.slots),
            losses=len(self.losses),
            owned=owned,
            bodies=len(plan.bodies),
            meters=len(plan.meters),
            oil_lines=len(plan.oil_lines),
            outputs=plan.outputs,
            driven={name: array.shape for name, array in driven.items()},
        )
        dtype = world_dtype({name: len(group) for name, group in self._by_part.items()}, sizes, shapes)
        self.record = np.zeros(1, dtype)
        self.line = self.record["driveline"][0]
        every = places(dtype)
        self.finite = every.index("driveline.mode[0]") if "driveline.mode[0]" in every else every.index("driveline.minv[0, 0]")
        count = self.finite + sizes.elements
        self._places = {place: number for number, place in enumerate(every[: self.finite])}
        self._numbers: dict[str, int] = {}  # indices of the numbers that have been looked up
        self._count = count
        self.numbers, self.moved = self.record.view(np.float64)[: self.finite], self.record.view(np.int64)[:count]
        self.kept = np.zeros((2, count), np.int64)
        self._fill_driveline(system, start)
        for name, array in driven.items():
            self.line[name] = array
        if driven:
            self.line["layout"] = layout_of(self.line.dtype)
        for instance in plan.instances:
            self._fill_instance(instance)
        self.record["channel"] = NOWHERE
        channels = list(plan.channels)
        for name, channel in plan.currents.items():
            self.record["channel"][0, self.values(name)["output"]] = channels.index(channel)
        self.source = np.array([self.number(what) for what in plan.channels.values()], np.int64)

    @cached_property
    def names(self) -> list[str]:
        """Names, for messages, of the numbers that a step leaves to the next one; made only when one of them is wrong."""
        return [self._label(place) for place in places(self.record.dtype)[: self._count]]

    def state(self, name: str) -> np.void:
        """Return the states of an instance, which may be read and written."""
        return self._of("parts", name)

    def values(self, name: str) -> np.void:
        """Return the configuration, derived numbers and wires of an instance, which may be read and written."""
        return self._of("values", name)

    def states_at(self, name: str) -> dict[str, int]:
        """Return the place of each state of an instance among the numbers."""
        kind, k = self._where(name)
        return {state: self._places[f"parts.{kind}[{k}].{state}"] for state in self.record.dtype["parts"][kind].base.names or ()}

    def entries_at(self, array: str, row: int | None = None) -> slice | None:
        """Return the places of an array of the driveline's record, or of one of its rows, among the numbers; None if elsewhere."""
        first = self._places.get(f"driveline.{array}[0]" if row is None else f"driveline.{array}[{row}, 0]")
        return None if first is None else slice(first, first + self.line[array].shape[-1])

    def states_in(self, records: np.ndarray, name: str) -> np.ndarray:
        """Return the states of an instance in other records (n,) that begin as the world's does."""
        kind, k = self._where(name)
        return records["parts"][kind][:, k]

    def _of(self, where: str, name: str) -> np.void:
        # the record never moves in memory, and every message reads its device
        if (where, name) not in self._views:
            kind, k = self._where(name)
            self._views[where, name] = self.record[where][kind][0, k]
        return self._views[where, name]

    def _where(self, name: str) -> tuple[str, int]:
        for kind, group in self._by_part.items():
            for k, instance in enumerate(group):
                if instance.name == name:
                    return kind, k
        raise RigError(f"the rig has no device '{name}'; known are " + ", ".join(instance.name for instance in self.plan.instances))

    def place(self, what: str) -> str:
        """Return the place of a number in the record.

        Parameters
        ----------
        what : str
            Its name in the rig, as in ``Plan.channels``.

        Returns
        -------
        str
            The place.

        Raises
        ------
        RigError
            When there is no such number.
        """
        plan = self.plan
        owner, _, name = what.partition(".")
        if not name and what in (meters := [meter.name for meter in plan.meters]):
            return f"driveline.meter[{meters.index(what)}]"
        if name == "speed" and owner in plan.bodies:
            return f"driveline.speed[{plan.bodies.index(owner)}]"
        if name == "temperature" and owner in plan.system.states:
            return f"driveline.v[{plan.system.speeds.index(owner)}]"
        if name in ("pressure", "port") and owner in plan.oil_lines:
            return f"oil[{plan.oil_lines.index(owner)}].{name}"
        if name == "torque" and all(owner != instance.name for instance in plan.instances):
            laws = [law.name if law.kind in (TORQUE, MOTION) else "" for law in plan.system.laws]
            for names, place in (
                (plan.system.shafts, "shaft[0, {}]"),
                (laws, "law_torque[{}]"),
                (plan.system.elements, "el[0, {}]"),
            ):
                if owner in names:
                    return f"driveline.{place.format(names.index(owner))}"
        kind, k = self._where(owner)
        place = f"parts.{kind}[{k}].{name}"
        if place not in self._places:
            raise RigError(f"'{owner}' has no state '{name}'; known are {', '.join(part(kind).state)}")
        return place

    def number(self, what: str) -> int:
        """Return the index in ``numbers`` of a number by its name in the rig; raise RigError when there is none."""
        if what not in self._numbers:
            self._numbers[what] = self._places[self.place(what)]
        return self._numbers[what]

    def _label(self, place: str) -> str:
        """Return the name, for messages, of a number of the record."""
        plan, system = self.plan, self.plan.system
        for kind, group in self._by_part.items():
            for k, instance in enumerate(group):
                place = place.replace(f"parts.{kind}[{k}].", f"{instance.name}: ")
        for k, name in enumerate(plan.oil_lines):
            place = place.replace(f"oil[{k}].", f"{name}: ")
        for k, name in enumerate(system.speeds):
            place = (
                place.replace(f"driveline.v[{k}]", f"speed of {name}")
                .replace(f"driveline.e_in[{k}]", f"work on {name}")
                .replace(f"driveline.gain[{k}]", f"change of speed of {name}")
            )
        for k, name in enumerate(plan.bodies):
            for field_, what in (("speed", "speed"), ("gained", "change of speed"), ("rate", "acceleration")):
                place = place.replace(f"driveline.{field_}[{k}]", f"{what} of {name}")
        for k, meter in enumerate(plan.meters):
            place = place.replace(f"driveline.meter[{k}]", meter.name)
        for row, what in enumerate(("friction torque", "impulse", "heat of friction", "heat of drag")):
            for k, name in enumerate(system.elements):
                place = place.replace(f"driveline.el[{row}, {k}]", f"{name}: {what}")
        return place

    def _fill_driveline(self, system: System, start: State) -> None:
        plan, line = self.plan, self.line
        line["minv"], line["w"], line["sh"], line["kc"] = system.structure
        line["v"], line["twist"], line["mode"] = start.v, start.twist, start.mode
        line["cap"], line["loss"] = system.limits(), self.losses
        rows = np.array([system.bodies_from_speeds[system.bodies.index(name)] for name in plan.bodies])
        line["bodies"] = rows.reshape(line["bodies"].shape)
        line["speed"] = rows @ start.v if len(rows) else 0.0
        for k, meter in enumerate(plan.meters):
            weights = line["meter_of"][k]
            m, b, s = len(system.elements), len(plan.bodies), len(system.slots)
            for name, weight in meter.friction.items():
                weights[system.elements.index(name)] = weight
            for name, weight in meter.push.items():
                weights[m + plan.bodies.index(name)] = weight
            for name, weight in meter.shaft.items():
                weights[m + b + system.shafts.index(name)] = weight
            for name, weight in meter.rate.items():
                weights[m + b + s :] += weight * system.bodies_from_speeds[system.bodies.index(name)]

    def _fill_instance(self, instance: Instance) -> None:
        values, state = self.values(instance.name), self.state(instance.name)
        fill(values, *instance.configs)
        for name, number in instance.derived.items():
            values[name] = number
        for name, table in instance.tables.items():
            values[name] = table
        for name in part(instance.part).wires:
            values[name] = self._wire(part(instance.part), name, instance.wires.get(name, NOWHERE))
        for name, number in instance.start.items():
            state[name] = number

    def _wire(self, kind: Part, key: str, to: str | int) -> int:
        if isinstance(to, int):
            return to
        plan, joined = self.plan, kind.joined.get(key)
        if key in ("body", "braked", "driving", "driven") or (joined and joined.to == BODY):
            return plan.bodies.index(to)
        if key == "element":
            return plan.system.elements.index(to)
        if key == "shaft":
            return plan.system.shafts.index(to)
        if key in ("line", "supply"):
            return plan.oil_lines.index(to)
        if key == "beside":
            return list(plan.channels).index(to)
        return self._where(to)[1]
