# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Cylinder S_z of the clutch bench with its disc springs; it presses a pack, a force transducer or nothing.

It is a part of the engine, with force over pressure (8.2), springs (8.1) and clamp force (8.3) of the thesis.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from ...base import INLINED, njit, param, switch
from ..friction.bench import SPRING_FORCE, SPRING_TRAVEL
from .oil_supply import supply_pressure
from .part import PRESS, Command, Part, Shown, Wire
from .proportional_valve import leak, orifice_speed

if TYPE_CHECKING:
    from ...base import Record
    from .shown_rig import ShownRig


@dataclass(frozen=True)
class PressCylinder:
    """Values of the cylinder, its springs and the distance and stiffness of the pressed object.

    (8.2) is taken as measured at a rising pressure: its constant is the friction of seals and guide rings (8.2.2). As the piston
    goes back, this friction is reversed and has another value. The spring force is (8.1); the testing machine is that of fig. 8.5.
    """

    force_linear: float = param("area", 1e-5, 1e-1, "Force on the piston per pressure")
    force_square: float = param(
        "force per pressure squared", 0.0, 1e-9, "Force on the piston per pressure squared, in addition to the linear part"
    )
    seal_friction: float = param("force", 0.0, 1e4, "Friction of seals and guide rings as the piston goes towards the plates")
    seal_friction_back: float = param("force", 0.0, 1e4, "Friction of seals and guide rings as the piston goes back")
    spring_share: float = param("ratio", 0.0, 10.0, "Share of the measured spring force that acts; without springs 0")
    contact_travel: float = param("length", 0.0, 5e-3, "Travel at which the piston meets what it presses")
    contact_rate: float = param("stiffness", 1e3, 1e10, "Stiffness of what the piston presses")
    piston_damping: float = param("damping", 1.0, 1e7, "Viscous damping of the piston")
    machine_speed: float = param("velocity", 1e-7, 1e-1, "Speed at which the testing machine moves the springs")
    testing_machine: bool = switch("Whether the springs stand in the testing machine, which moves them in the cylinder's place")


@njit(cache=True)
def spring_force(travel: float, cylinder: Record) -> tuple[float, float]:
    """Return (F_s [N], its slope [N/m]) at travel s [m] by (8.1), continued by its tangent beyond the 4 mm of the tests."""
    s = min(max(travel, 0.0), SPRING_TRAVEL) * 1e3
    force, slope = 0.0, 0.0
    for c in SPRING_FORCE:
        slope = slope * s + force
        force = force * s + c
    slope *= 1e3
    beyond = travel - s * 1e-3
    return cylinder.spring_share * (force + slope * beyond), cylinder.spring_share * slope


@njit(cache=True)
def contact_force(travel: float, late: float, waves: float, cylinder: Record) -> tuple[float, float]:
    """Return (force on the pressed object [N], its slope [N/m]): 0 before the contact, then linear.

    A pack with waves of a height w is soft at first: k x^2 / (x + w), which nears k (x - w) as they come to lie flat.

    Parameters
    ----------
    travel : float
        Travel of the piston [m].
    late : float
        Travel beyond ``contact_travel`` at which the piston meets the pack [m], below 0 for an early contact.
    waves : float
        Height of the waves [m].
    cylinder : Record
        Values of the cylinder.

    Returns
    -------
    tuple of float
        Force [N] and its slope [N/m].
    """
    squeeze = travel - (cylinder.contact_travel + late)
    if squeeze <= 0.0:
        return 0.0, 0.0
    share = squeeze / (squeeze + waves)
    return cylinder.contact_rate * squeeze * share, cylinder.contact_rate * share * (2.0 - share)


@njit(cache=True)
def machine_step(travel: float, target: float, h: float, cylinder: Record) -> float:
    """Return the travel [m] after h in the testing machine, which moves to its target at a constant speed."""
    change = cylinder.machine_speed * h
    return travel + min(max(target - travel, -change), change)


@njit(cache=True)
def piston_step(travel: float, pressure: float, late: float, waves: float, h: float, cylinder: Record) -> float:
    """Return the travel after h by an implicit step of the massless, damped piston.

    F_p(p) -+ seals = F_s(s) + contact + damping v; the piston stays at rest while the other forces differ by less than the seals'
    friction. At rest after a rise this is (8.3): F_a = F_p - F_s, with the constant of (8.2) in F_p.

    Parameters
    ----------
    travel : float
        Travel before the step [m].
    pressure : float
        Pressure in the chamber [Pa].
    late, waves : float
        As :func:`contact_force` takes them.
    h : float
        Length of the step [s].
    cylinder : Record
        Values of the cylinder.

    Returns
    -------
    float
        Travel [m].
    """
    push = (cylinder.force_linear + cylinder.force_square * pressure) * pressure
    rest = push - spring_force(travel, cylinder)[0] - contact_force(travel, late, waves, cylinder)[0]
    if rest > cylinder.seal_friction:
        drive = push - cylinder.seal_friction
    elif rest < -cylinder.seal_friction_back and travel > 0.0:
        drive = push + cylinder.seal_friction_back
    else:
        return travel
    rate = cylinder.piston_damping / h
    x = travel
    for _ in range(40):  # Newton's method; both forces are monotone except for a dip of 0.6 N at the start of the springs
        force, slope = spring_force(x, cylinder)
        contact, contact_slope = contact_force(x, late, waves, cylinder)
        stiff = rate + slope + contact_slope
        miss = rate * (x - travel) + force + contact - drive
        new = x - miss / stiff
        if abs(new - x) < 1e-13:
            x = new
            break
        x = new
    return max(0.0, x)


@njit(**INLINED)
def before(world: Record, k: int, h: float, t: float) -> None:
    """Move lever valve, chamber, piston and springs over the step, or the testing machine in their place."""
    me, my = world.parts.press_cylinder[k], world.values.press_cylinder[k]
    on, oil = me.enabled > 0.0 and world.safe == 0.0, world.values.oil_supply[my.oil]
    # a leak that would take all pressure with it lets out what the supply gives up to there
    me.flow = leak(my.leak_area, me.pressure, orifice_speed(oil.density), 1.0 / max(oil.relief_droop, 1.0))
    me.pressure = supply_pressure(me.pressure, me.setting, on, me.flow, h, oil)
    if my.testing_machine > 0.0:
        target = me.machine_target if me.machine_enabled > 0.0 and world.safe == 0.0 else 0.0
        me.travel = machine_step(me.travel, target, h, my)
        me.force = spring_force(me.travel, my)[0]
    else:
        me.travel = piston_step(me.travel, me.pressure, me.late, me.waves, h, my)
        me.force = me.clamp = contact_force(me.travel, me.late, me.waves, my)[0]


def shown_values(rig: ShownRig, name: str) -> tuple[float, ...]:
    """Return the fields of its OilState."""
    me = rig.device(name)
    temperature = getattr(rig.config, rig.wire(name, "oil")).temperature
    return (me["pressure"], me["setting"], me["flow"], temperature, me["enabled"] > 0.0)


# setting, enabled: setting of the pressure and its switch; machine_target, machine_enabled: travel of the testing machine and its
# switch; pressure: pressure in the chamber; flow: of its leak; force: force of the piston or the machine on the pressed object;
# clamp: force on a pack; late, waves: of a pack, which tells them, as contact_force takes them; leak_area: 0 for none
PART = Part(
    "press_cylinder",
    10,
    (PressCylinder,),
    state=(
        "setting",
        "enabled",
        "machine_target",
        "machine_enabled",
        "pressure",
        "flow",
        "travel",
        "force",
        "clamp",
        "late",
        "waves",
    ),
    derived=("leak_area",),
    wires=("oil",),
    stages={"before": before},
    role=PRESS,
    joined={"oil": Wire("oil", needed=False)},
    effects={"seal_friction": {"seal_friction": 0.0, "seal_friction_back": 0.0}},
    message="OilState",
    shown_values=shown_values,
    shows=(
        Shown(
            "setting",
            "pressure_setting",
            "pressure",
            0.0,
            1e7,
            "Setting of the relief valve before the cylinder, which gives its pressure.",
            "gauge",
        ),
    ),
    takes=(
        Command(
            "cylinder",
            {"pressure": "pressure"},
            "setting",
            "enabled",
            "pressure of the relief valve before the cylinder",
            "pressure",
        ),
        Command(
            "press",
            {"travel": "length"},
            "machine_target",
            "machine_enabled",
            "travel to which the testing machine moves",
            "length",
            "machine",
            "testing_machine",
        ),
    ),
)
