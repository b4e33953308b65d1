# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Vehicle on its wheels as the load of a gearbox: tyres with compliance and slip, mass, rolling resistance, air drag, grade, brake.

It is a part of the engine, on the body of its wheels. Rolling resistance and brake act on the wheels as friction, so they can
hold but never drive. The tyres push the wheels; mass and tyre move in the part's own step.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt
from typing import TYPE_CHECKING

from ...base import INLINED, njit, param
from ...driveline import HI0, HI1, KIN0, KIN1, LO0, LO1
from .part import LOAD, Command, Part, Shown, Wire

if TYPE_CHECKING:
    from ...base import Record
    from .shown_rig import ShownRig

GRAVITY = 9.80665  # m/s2, standard gravity


@dataclass(frozen=True)
class VehicleConfig:
    """Values of the vehicle and its tyres; the inertia of the wheels is that of their body.

    All tyres are one, a spring in series with the slip (Pacejka, Tyre and Vehicle Dynamics, the model of a single contact point):
    du/dt = r w - v - |v| u / relaxation_length and F = (slip_stiffness / relaxation_length) u + tyre_damping du/dt, so that in
    steady state F = slip_stiffness (r w - v) / |v|.
    """

    mass: float = param("mass", 1.0, 1e6, "Mass of the vehicle")
    wheel_radius: float = param("length", 0.01, 5.0, "Radius on which the driven wheels roll")
    slip_stiffness: float = param("force", 1e2, 1e8, "Force of all driven tyres per slip, where the slip is small")
    relaxation_length: float = param(
        "length",
        1e-3,
        10.0,
        "Distance in which the force of a tyre follows its slip; slip_stiffness over it is the stiffness at rest",
    )
    tyre_damping: float = param("damping", 0.0, 1e7, "Damping of the tyres' deflection")
    adhesion: float = param("ratio", 0.01, 2.0, "Largest force of the driven tyres over the weight of the vehicle")
    rolling_resistance: float = param("ratio", 0.0, 0.5, "Rolling resistance over the force on the road")
    drag_area: float = param("area", 0.0, 100.0, "Drag coefficient times the frontal area")
    air_density: float = param("density", 0.0, 10.0, "Density of the air")
    brake_limit: float = param("force", 0.0, 1e7, "Largest force of the brakes at the wheels' radius")


def weight_along(mass: float, grade: float) -> float:
    """Return the force [N] that pulls a mass [kg] down a road whose grade is its rise over the horizontal distance."""
    return mass * GRAVITY * grade / sqrt(1.0 + grade * grade)


def road_force(speed: float, grade: float, vehicle: VehicleConfig) -> float:
    """Return the force that the vehicle needs at its wheels at a constant speed, without the tyres' losses.

    Parameters
    ----------
    speed : float
        Speed of the vehicle, forwards [m/s].
    grade : float
        Rise of the road over the horizontal distance.
    vehicle : VehicleConfig
        Values of the vehicle.

    Returns
    -------
    float
        Rolling resistance, weight along the road and air drag [N].
    """
    pressed = vehicle.mass * GRAVITY / sqrt(1.0 + grade * grade)
    air = 0.5 * vehicle.air_density * vehicle.drag_area * speed * abs(speed)
    return vehicle.rolling_resistance * pressed + weight_along(vehicle.mass, grade) + air


@njit(cache=True, error_model="numpy", forceinline=True)
def tyre_step(speed: float, deflection: float, surface: float, pull: float, h: float, car: Record) -> tuple[float, float, float]:
    """Return (mean force of the tyres [N], speed [m/s], deflection [m]) after a step, by the implicit midpoint rule.

    The factors |v| of slip and air drag are those at the beginning of the step. Where the force of the tyres would exceed their
    adhesion, they slide at that limit.

    Parameters
    ----------
    speed, deflection : float
        Speed of the vehicle [m/s] and deflection of the tyres [m] before the step.
    surface : float
        Speed of the tyres' surface in the middle of the step [m/s].
    pull : float
        Force that pulls the vehicle back, without air drag [N].
    h : float
        Length of the step [s].
    car : Record
        Values of the vehicle.
    """
    stiffness = car.slip_stiffness / car.relaxation_length
    forgets = 0.5 * h * abs(speed) / car.relaxation_length
    drag = 0.5 * car.air_density * car.drag_area * abs(speed)
    # mean force F = k (u + du / 2) + d du / h, with du (1 + forgets) = h (surface - v - dv / 2) - 2 forgets u
    per = 0.5 * stiffness + car.tyre_damping / h
    free = (h * (surface - speed) - 2.0 * forgets * deflection) / (1.0 + forgets)
    by_gain = -0.5 * h / (1.0 + forgets)
    held = stiffness * deflection + per * free - drag * speed - pull
    gain = h * held / (car.mass + 0.5 * h * drag - h * per * by_gain)
    change = free + by_gain * gain
    force = stiffness * deflection + per * change
    most = car.adhesion * car.mass * GRAVITY
    if abs(force) > most:
        force = most if force > 0.0 else -most
        gain = h * (force - drag * speed - pull) / (car.mass + 0.5 * h * drag)
        change = force / stiffness - deflection  # the tyres slide with the deflection that belongs to this force
    return force, speed + gain, deflection + change


@njit(**INLINED)
def before(world: Record, k: int, h: float, t: float) -> None:
    """Move vehicle and tyres by the speed of the wheels in the middle of the step; set torque and friction on the wheels."""
    me, my, line = world.parts.vehicle[k], world.values.vehicle[k], world.driveline
    cap, f = line.cap, my.element
    me.slope = me.grade if me.on_road > 0.0 else 0.0
    along = 1.0 / sqrt(1.0 + me.slope * me.slope)
    weight = my.mass * GRAVITY * along
    me.braking = min(max(me.brake, 0.0), my.brake_limit) if me.brake_on > 0.0 else 0.0
    capacity = (my.rolling_resistance * weight + me.braking) * my.wheel_radius
    before = cap[KIN1, f]
    cap[KIN0, f], cap[HI0, f], cap[LO0, f] = before, before, -before
    cap[KIN1, f], cap[HI1, f], cap[LO1, f] = capacity, capacity, -capacity
    old, deflection = me.speed, me.deflection
    me.force, me.speed, me.deflection = tyre_step(old, deflection, my.wheel_radius * line.middle[my.body], weight * me.slope, h, my)
    me.torque = my.wheel_radius * me.force
    line.push[0, my.body] -= me.torque
    line.push[1, my.body] -= me.torque
    way = 0.5 * h * (old + me.speed)
    me.way += way
    me.lifted += weight * me.slope * way
    me.air += 0.5 * my.air_density * my.drag_area * abs(old) * 0.5 * (old + me.speed) * way
    stiffness = my.slip_stiffness / my.relaxation_length
    me.tyre += me.force * h * my.wheel_radius * line.middle[my.body] - me.force * way
    me.tyre -= 0.5 * stiffness * (me.deflection * me.deflection - deflection * deflection)


@njit(**INLINED)
def after(world: Record, k: int, h: float) -> None:
    """Count the work that the tyres have taken from the wheels."""
    me, my, line = world.parts.vehicle[k], world.values.vehicle[k], world.driveline
    me.taken += h * me.torque * (line.speed[my.body] - 0.5 * line.gained[my.body])


def shown_values(rig: ShownRig, name: str) -> tuple[float, ...]:
    """Return the fields of its LoadState; it has no pressure line."""
    me = rig.device(name)
    return (rig.friction_torque(name) + me["torque"], rig.capacity(name), 0.0, 0.0, rig.energies["load"])


# grade, on_road: grade of the road and its switch; brake, brake_on: force of the brakes and its switch; slope, braking: present
# grade and force; speed, way, deflection, force: of the vehicle and its tyres; torque: torque that the tyres take from the wheels;
# taken: its work, divided into motion, lifted (against the weight), air, and tyre (losses by slip and damping) [J]
PART = Part(
    "vehicle",
    40,
    (VehicleConfig,),
    state=(
        "grade",
        "on_road",
        "brake",
        "brake_on",
        "slope",
        "braking",
        "speed",
        "way",
        "deflection",
        "force",
        "torque",
        "taken",
        "lifted",
        "air",
        "tyre",
    ),
    wires=("body", "element"),
    stages={"before": before, "after": after},
    role=LOAD,
    joined={"body": Wire("body")},
    message="LoadState",
    shown_values=shown_values,
    shows=(
        Shown(
            "torque",
            "torque",
            "torque",
            -50000.0,
            50000.0,
            "Torque of tyres, rolling resistance and brakes.",
            "positive brakes {body}",
        ),
        Shown(
            "hold", "capacity", "torque", 0.0, 50000.0, "Torque that rolling resistance and brakes hold.", "positive brakes {body}"
        ),
        Shown("work", "work", "energy", -1e9, 1e9, "Work taken by the vehicle since time 0.", "positive taken from {body}"),
    ),
    takes=(
        Command("road", {"grade": "ratio"}, "grade", "on_road", "grade of the road, rise over horizontal distance", "ratio"),
        Command(
            "brake", {"force": "force"}, "brake", "brake_on", "force of the brakes at the wheels' radius", "force", node="brake"
        ),
    ),
    account="taken",
)
