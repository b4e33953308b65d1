# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""What is read of a rig's state: now (runs.rig.Rig), at a tick (runs.moments.Present), or at several (Moments).

All of them compute it here, so that a value is the same, bit for bit, whether it is sent at once or written later.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ..driveline import algebra as driveline_algebra
from ..driveline import stored_energy
from ..plant import part as parts
from ..rig import owns_shaft, shaft_of

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from ..driveline import System
    from ..plant import World
    from ..rig import RigConfig


@dataclass(frozen=True)
class Facts:
    """What does not change while a rig runs and is needed to read its state.

    Attributes
    ----------
    world : World
        What the engine moves; only places in it and its plan are used.
    system : System
        The true driveline, without the inertia that a constant input speed adds.
    place : mapping of str to int
        Number of each friction element of the driveline.
    slip : list of list of (int, float)
        For each friction element the driveline's speeds that make its slip, with their weights.
    kinetic : list of (int, int, float)
        Pairs of the driveline's speeds, with the weight of their product in the energy of motion [kg m2].
    heavy, put_on : int, float
        Speed to whose inertia a constant input speed adds, and how much that is [kg m2].
    loads, losses, rubbing : tuple of str
        Names of the loads, of the losses, and of drives and couplings with friction of their own.
    clutches : tuple of str
        Names of the clutches.
    heats : mapping of str to str
        Name of each clutch's heat among the energies.
    elements : tuple of str
        Friction elements that are not devices.
    stores : list of (str, str, str)
        Devices that store energy, each with the names of its work and of what it stores.
    accounts : mapping of str to str
        Devices that push bodies and do not drive the rig, each with the name of the work that it has taken.
    owned : list of (int, str)
        Shafts that devices own, and whose energy these devices compute.
    held_by : mapping of int to int
        Number of the gear of each set of locked clutches; bit k of the set is clutch k, and without one there is no gear.
    other : int
        Number for locked clutches that make no gear.
    fed : mapping of str to int
        Place of the pressure at which each valve feeds its clutch.
    drawing : mapping of str to tuple of str
        Valves that each oil supply feeds.
    """

    world: World
    system: System
    place: Mapping[str, int]
    slip: list[list[tuple[int, float]]]
    kinetic: list[tuple[int, int, float]]
    heavy: int
    put_on: float
    loads: tuple[str, ...]
    losses: tuple[str, ...]
    rubbing: tuple[str, ...]
    clutches: tuple[str, ...]
    heats: Mapping[str, str]
    elements: tuple[str, ...]
    stores: list[tuple[str, str, str]]
    accounts: Mapping[str, str]
    owned: list[tuple[int, str]]
    held_by: Mapping[int, int]
    other: int
    fed: Mapping[str, int]
    drawing: Mapping[str, tuple[str, ...]]


def facts_of(config: RigConfig, world: World, true: System) -> Facts:
    """Return what does not change of a rig with a configuration and its true driveline."""
    structure, system = config.structure, world.plan.system
    place = {name: f for f, name in enumerate(system.elements)}
    added = system.mass - true.mass
    heavy = int(np.abs(added).diagonal().argmax())
    clutches = tuple(one.name for one in structure.clutches)
    roles = (parts.LOAD, parts.SOURCE, parts.COUPLING, parts.LOSS)
    names = {role: tuple(one.name for one in structure.of_role(role)) for role in roles}
    own = {one.name: parts.part(one.part) for one in structure.devices}
    speeds = range(len(true.mass))
    return Facts(
        world=world,
        system=true,
        place=place,
        slip=[[(k, float(weight)) for k, weight in enumerate(row) if weight] for row in world.line["w"]],
        kinetic=[(i, k, float(true.mass[i, k]) * (0.5 if i == k else 1.0)) for i in speeds for k in speeds[i:] if true.mass[i, k]],
        heavy=heavy,
        put_on=float(added[heavy, heavy]),
        loads=names[parts.LOAD],
        losses=names[parts.LOSS],
        rubbing=tuple(name for name in (*names[parts.SOURCE], *names[parts.COUPLING]) if name in place),
        clutches=clutches,
        heats={name: f"heat_{structure.device(name).key}" for name in clutches},
        elements=tuple(name for name in system.elements if name not in own),
        stores=[(name, *part.stores) for name, part in own.items() if part.stores],
        accounts={name: part.account for name, part in own.items() if part.account},
        owned=[(system.shafts.index(shaft_of(one)), one.name) for one in structure.devices if owns_shaft(one)],
        held_by={sum(1 << clutches.index(name) for name in gear.clutches): k for k, gear in enumerate(structure.gears, 1)} | {0: 0},
        other=len(structure.gears) + 1,
        fed={valve.name: world.number(f"{valve.wires['feeds']}.port") for valve in structure.valves},
        drawing={
            one.name: tuple(valve.name for valve in structure.valves if structure.oil_of(valve, "supply") == one.name)
            for one in structure.of_role(parts.OIL)
        },
    )


class ShownState(ABC):
    """Readings of a rig's state; at several moments each of them is an array (moments,).

    Attributes
    ----------
    config : RigConfig
        The rig's configuration.
    facts : Facts
        What does not change.
    stored_first : float
        Energy that was stored at time 0 [J].
    """

    config: RigConfig
    facts: Facts
    stored_first = 0.0

    @abstractmethod
    def device(self, name: str) -> Any:
        """Return the states of a device by its name [SI]."""

    @abstractmethod
    def number(self, place: int) -> Any:
        """Return a number of the plant by its place in the world."""

    @abstractmethod
    def entries(self, array: str, row: int | None = None) -> Sequence[Any]:
        """Return the numbers of an array of the driveline's record, or of one of its rows."""

    @abstractmethod
    def each(self, function: Callable[[np.void], float]) -> Any:
        """Return the value that a function takes of the driveline's record."""

    def holds(self, name: str) -> Any:
        """Return whether a clutch or free-wheel, given by its name, does not slip."""
        mode = self.entries("mode")[self.facts.place[name]]
        return (mode >= 2) | (mode <= -2)

    def clutch_mode(self, name: str) -> Any:
        """Return 0 for a clutch that is open, 1 for one that slips, 2 for one that is locked, as in rig_msgs/ClutchState."""
        return (self.device(name)["static"] > 0.0) * (1 + self.holds(name))

    def friction_torque(self, name: str) -> Any:
        """Return the friction torque of a device [Nm]; positive when a clutch drives its driven side, or when a brake brakes."""
        return self.entries("el", driveline_algebra.LAM)[self.facts.place[name]]

    def capacity(self, name: str) -> Any:
        """Return the friction torque that a device could carry while it slips [Nm]."""
        return self.entries("cap", driveline_algebra.KIN1)[self.facts.place[name]]

    def slip(self, name: str) -> Any:
        """Return the speed of the driving side of a clutch minus that of its driven side [rad/s]."""
        speeds, slip = self.entries("v"), 0.0
        for k, weight in self.facts.slip[self.facts.place[name]]:
            slip = slip + weight * speeds[k]
        return slip

    def speed_at(self, name: str) -> Any:
        """Return the speed of the body on which a device sits [rad/s]."""
        return self.number(self.facts.world.number(f"{self.wire(name, 'body')}.speed"))

    def wire(self, name: str, key: str) -> str:
        """Return the name of what a device is joined to by a key of its description."""
        device = self.config.structure.device(name)
        return self.config.structure.oil_of(device) if key == "oil" else str(device.wires[key])

    def fed_pressure(self, valve: str) -> Any:
        """Return the pressure of the port at which a valve feeds its clutch [Pa, gauge]."""
        return self.number(self.facts.fed[valve])

    def oil_drawn(self, name: str) -> Any:
        """Return the flow that the valves now take from an oil supply [m3/s]."""
        flow = _sum([self.device(valve)["flow"] for valve in self.facts.drawing[name]])
        return 0.5 * (flow + abs(flow))  # 0 where it flows back

    def locked_gear(self) -> Any:
        """Return the number of the gear whose clutches are locked.

        Returns
        -------
        int, or (moments,) array of int
            0 when no clutch is locked; one more than the highest gear when the locked clutches make no gear.
        """
        locked = sum([(self.clutch_mode(name) == 2) * (1 << k) for k, name in enumerate(self.facts.clutches)])
        held_by, other = self.facts.held_by, self.facts.other
        if isinstance(locked, np.ndarray):
            return np.array([held_by.get(one, other) for one in locked.tolist()])
        return held_by.get(int(locked), other)

    def heat_of(self, name: str) -> str:
        """Return the name of a clutch's heat among the energies."""
        return self.facts.heats[name]

    def energy(self) -> dict[str, Any]:
        """Return the energies since time 0 by name [J]; each is computed from its own torque and slip, and none as a difference."""
        facts = self.facts
        fric, visc = self.entries("el", driveline_algebra.E_FRIC), self.entries("el", driveline_algebra.E_VISC)
        place, driven, outside = facts.place, facts.world.plan.driven, _sum(self.entries("e_in"))
        motor = self.entries("part_work")[0] if driven else outside
        if facts.put_on:  # the energy of the added inertia is not work of the motor
            speed = self.entries("v")[facts.heavy]
            motor = motor - 0.5 * facts.put_on * (speed * speed)
        for name, work, _ in facts.stores:  # what stores energy pushes its body, as a motor does
            motor = motor - self.device(name)[work]
        taken = {name: self.device(name)[state] for name, state in facts.accounts.items()}
        for work in taken.values():  # what pushes from outside do is the work of the motor less what these devices take
            motor = motor + work
        out = {"motor": motor}
        if facts.loads:
            out["load"] = _sum([fric[place[name]] + taken.pop(name, 0.0) for name in facts.loads])
        out |= taken
        for name in facts.clutches:
            out[facts.heats[name]] = fric[place[name]] + visc[place[name]]
        for name in facts.losses:
            out[name] = fric[place[name]]
        if facts.rubbing:
            out["friction"] = _sum([fric[place[name]] for name in facts.rubbing])
        if driven:  # work taken by torques, motions and inputs of the description
            out["torques"] = self.entries("part_work")[0] - outside - self.entries("law_work")[0]
            speeds, system = self.entries("v"), facts.system
            for j in np.flatnonzero(system.state_speeds).tolist():  # the work for what states hold is no energy of the driveline
                out["torques"] = out["torques"] + 0.5 * system.mass[j, j] * (speeds[j] * speeds[j] - system.v_start[j] ** 2)
        if facts.elements:
            out["elements"] = _sum([fric[place[name]] + visc[place[name]] for name in facts.elements])
        if count := len(facts.system.shafts):
            out["shafts"] = _sum(self.entries("shaft", driveline_algebra.E_SHAFT)[:count])
        out["stored"] = self.stored() - self.stored_first
        used = _sum([value for name, value in out.items() if name != "motor"])
        out["residual"] = motor - used
        return out

    def stored(self) -> Any:
        """Return the energy that is stored now in motion, shafts, springs and devices [J]."""
        facts = self.facts
        held = _sum([self.device(name)[energy] for name, _, energy in facts.stores])
        if facts.world.plan.driven:
            return held + self.each(self._stored_in_driven) + self._stored_by_devices()
        speeds, twist = self.entries("v"), self.entries("twist")
        held = held + _sum([weight * (speeds[i] * speeds[k]) for i, k, weight in facts.kinetic])
        held = held + _sum([0.5 * stiffness * (twist[k] * twist[k]) for k, stiffness in enumerate(facts.system.kc[0].tolist())])
        return held + self._stored_by_devices()

    def _stored_in_driven(self, line: np.void) -> float:
        rows = line["v"], line["twist"][: len(self.facts.system.shafts)], line["law_torque"], line["spring"]
        return float(stored_energy(self.facts.system, *(row[None] for row in rows))[0])

    def _stored_by_devices(self) -> Any:
        """Energy in the shafts that devices own, less what it would be by their first stiffness and their twist alone [J]."""
        twist, stiffness = self.entries("twist"), self.facts.system.kc[0]
        return _sum(
            [self.device(name)["stored"] - 0.5 * (float(stiffness[k]) * (twist[k] * twist[k])) for k, name in self.facts.owned]
        )


def _sum(values: Sequence[Any]) -> Any:
    """Add from left to right: sum() of Python rounds differently from 3.12 on, and a bag must be the same with every version."""
    total = 0.0
    for value in values:
        total = total + value
    return total
