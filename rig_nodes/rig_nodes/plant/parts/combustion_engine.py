# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Combustion engine on a shaft: torque curve, drag, throttle or speed setpoint, and the unevenness of its combustion.

It is a part of the (compiled) engine. Its torque is that on its shaft, as a dynamometer measures it at a steady speed: the gas
torque of the air that the throttle lets in, less the engine's own drag. The torque at full throttle is given by three points, the
middle one of which is the largest torque, and by two parabolas with their vertex there. A table would need more points than most
sources state: the largest torque and the torque at the largest power.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, exp
from typing import TYPE_CHECKING

from ...base import INLINED, njit, param
from .cycles import TURN, normal_of, uniform_of
from .part import SOURCE, Command, Part, Shown, Wire, not_in_order, not_whole

if TYPE_CHECKING:
    from ...base import Record
    from .shown_rig import ShownRig

SCATTER, MISFIRES = 0, 2  # channels of plant.parts.cycles for the irregularity and for firings that fail; 1 is that of a saw chain
STANDS = 2.0  # rad/s up to which the drag rises from 0 to its full size, so that it cannot drive an engine at rest
AT_REST = 1e-9  # rad/s below which no drag acts: an endless decay would reach denormal numbers, which are slow
OFF, STARTING, FIRING, STALLED = 0.0, 1.0, 2.0, 3.0  # states of "runs"


@dataclass(frozen=True)
class EngineConfig:
    """Values of the engine; all torques are positive, all speeds those of its shaft."""

    torque_low: float = param("torque", 0.0, 1e5, "Torque at full throttle at the lowest speed of the curve and below")
    speed_low: float = param("angular velocity", 0.0, 1e4, "Lowest speed of the torque curve, which is flat below it")
    torque_peak: float = param("torque", 0.1, 1e5, "Largest torque at full throttle")
    speed_peak: float = param("angular velocity", 1.0, 1e4, "Speed of the largest torque")
    torque_high: float = param("torque", 0.0, 1e5, "Torque at full throttle at the highest speed of the curve")
    speed_high: float = param("angular velocity", 1.0, 1e4, "Highest speed of the torque curve; the parabola goes on beyond it")
    drag: float = param("torque", 0.0, 1e4, "Torque that turns the engine without combustion, as far as it is constant")
    drag_by_speed: float = param("torque per speed", 0.0, 100.0, "Growth of the engine's drag with its speed")
    throttle_time: float = param("time", 1e-4, 10.0, "Time in which the throttle moves from closed to open")
    manifold_time: float = param("time", 1e-5, 10.0, "Time constant with which the charge of the cylinders follows the throttle")
    ramp: float = param("angular acceleration", 0.1, 1e6, "Rate at which the speed setpoint moves to the ordered speed")
    governor_band: float = param(
        "angular velocity", 0.1, 1e4, "Speed error at which the governor's proportional part opens the throttle fully"
    )
    governor_time: float = param(
        "time", 1e-3, 1e3, "Integral time of the governor: in it a constant speed error adds the proportional part once more"
    )
    idle_speed: float = param("angular velocity", 0.0, 1e4, "Speed that the governor holds with the throttle closed")
    starter_torque: float = param("torque", 0.0, 1e4, "Torque of the starter, from switching on until the engine fires")
    firing_speed: float = param("angular velocity", 0.1, 1e4, "Speed at which a turned engine begins to fire")
    stall_speed: float = param(
        "angular velocity",
        0.0,
        1e4,
        "Speed below which the engine stalls until it is switched off and on again; less than firing_speed",
    )
    cut_speed: float = param("angular velocity", 1.0, 1e5, "Speed above which the ignition leaves out the next firing")
    firings: float = param(
        "ratio", 0.125, 24.0, "Firings per revolution: 1 for a two-stroke cylinder, 2 for four cylinders of a four-stroke engine"
    )
    irregularity: float = param(
        "ratio", 0.0, 0.5, "Irregularity: (largest - mean) / mean speed in a firing cycle, with the stated inertia"
    )
    irregularity_scatter: float = param("ratio", 0.0, 0.5, "Standard deviation of the irregularity from cycle to cycle")
    irregularity_inertia: float = param("inertia", 0.0, 1e4, "Inertia for which the irregularity is stated")
    irregularity_speed: float = param("angular velocity", 0.1, 1e4, "Speed at which the irregularity is stated")
    irregularity_growth: float = param(
        "ratio", -1.0, 10.0, "Relative change of the irregularity with a relative change of the speed"
    )
    seed: float = param("ratio", 0.0, 1e9, "Number that chooses the cycles; the same number gives the same cycles")


def contradiction(engine: EngineConfig) -> tuple[str, str] | None:
    """Return the name of a value and the rest of a sentence where the curve or the speeds are out of order, otherwise None."""
    for name in ("torque_low", "torque_high"):
        if getattr(engine, name) > engine.torque_peak:
            return name, f"is {getattr(engine, name):g} Nm, expected at most the {engine.torque_peak:g} Nm of torque_peak"
    return (
        not_in_order(engine, "speed_low", "speed_peak", "speed_high")
        or not_in_order(engine, "stall_speed", "firing_speed")
        or not_in_order(engine, "idle_speed", "cut_speed")
        or not_whole(engine, "seed")
    )


@njit(cache=True, error_model="numpy", forceinline=True)
def full_torque(speed: float, engine: Record) -> float:
    """Return the torque [Nm] on the shaft at full throttle and a steady speed [rad/s]; never below zero.

    T = T_peak - (T_peak - T_end) ((w - w_peak) / (w_end - w_peak))^2 with the curve's lower end below w_peak, its upper one above;
    flat below the lower end.
    """
    if speed < engine.speed_peak:
        share = (max(speed, engine.speed_low) - engine.speed_peak) / (engine.speed_low - engine.speed_peak)
        return max(0.0, engine.torque_peak - (engine.torque_peak - engine.torque_low) * share * share)
    share = (speed - engine.speed_peak) / (engine.speed_high - engine.speed_peak)
    return max(0.0, engine.torque_peak - (engine.torque_peak - engine.torque_high) * share * share)


@njit(cache=True, error_model="numpy", forceinline=True)
def drag_torque(speed: float, engine: Record) -> float:
    """Return the torque [Nm] that brakes the engine without combustion at a speed [rad/s]; it has the sign of the speed."""
    if abs(speed) < AT_REST:
        return 0.0
    size = engine.drag + engine.drag_by_speed * abs(speed)
    return size * min(max(speed / STANDS, -1.0), 1.0)


@njit(cache=True, error_model="numpy", forceinline=True)
def ripple_torque(irregularity: float, speed: float, phase: float, engine: Record) -> float:
    """Return the torque [Nm] that varies the speed of the stated inertia in a firing cycle; its mean over the cycle is zero.

    A speed w = w_m (1 + d sin(N a)) of an inertia J needs the torque J dw/dt = N d J w_m^2 cos(N a), with N firings per revolution.

    Parameters
    ----------
    irregularity : float
        Irregularity d of the cycle at the speed at which it is stated.
    speed : float
        Speed of the engine [rad/s].
    phase : float
        Angle N a since the firing began [rad].
    engine : Record
        Values of the engine.

    Returns
    -------
    float
        Torque [Nm].
    """
    grown = irregularity * max(0.0, 1.0 + engine.irregularity_growth * (speed / engine.irregularity_speed - 1.0))
    return engine.firings * grown * engine.irregularity_inertia * speed * speed * cos(phase)


@njit(cache=True, error_model="numpy")
def cycle_irregularity(cycle: float, engine: Record) -> float:
    """Return the irregularity of a firing cycle by its number: normally distributed about its mean, never below zero."""
    return max(0.0, engine.irregularity + engine.irregularity_scatter * normal_of(engine.seed, SCATTER, cycle))


@njit(cache=True, error_model="numpy", forceinline=True)
def shaft_torque(me: Record, speed: float, phase: float, charge: float, engine: Record) -> float:
    """Return the torque [Nm] on the shaft at a speed [rad/s], a phase of the cycle [rad] and a charge, 0 to 1."""
    drag = drag_torque(speed, engine)
    if me.runs == FIRING:
        gas = 0.0 if me.cut > 0.0 else charge * (full_torque(speed, engine) + drag)
        return gas - drag + (ripple_torque(me.uneven, speed, phase, engine) if me.cut == 0.0 else 0.0)
    return (engine.starter_torque if me.runs == STARTING else 0.0) - drag


@njit(cache=True, error_model="numpy", forceinline=True)
def next_state(runs: float, on: bool, speed: float, engine: Record) -> float:
    """Return the next state of the engine at a speed [rad/s]: off, turned by the starter, firing, or stalled."""
    if not on:
        return OFF
    if runs == OFF or runs == STARTING:
        return FIRING if speed >= engine.firing_speed else STARTING
    # a stall speed above that of firing would stall the engine as it begins to fire
    return STALLED if runs == FIRING and speed < min(engine.stall_speed, engine.firing_speed) else runs


@njit(cache=True, error_model="numpy", forceinline=True)
def governed(integral: float, setpoint: float, speed: float, h: float, engine: Record) -> tuple[float, float]:
    """Return (opening that the governor asks for, its integral part after h), both 0 to 1.

    Parameters
    ----------
    integral : float
        Integral part before the step.
    setpoint, speed : float
        Speed that is to be held, and speed [rad/s].
    h : float
        Length of the step [s].
    engine : Record
        Values of the engine.

    Returns
    -------
    tuple of float
        Opening and integral part.
    """
    miss = (setpoint - speed) / engine.governor_band
    after = min(max(integral + miss * h / engine.governor_time, 0.0), 1.0)
    return min(max(miss + 0.5 * (integral + after), 0.0), 1.0), after


@njit(**INLINED)
def fill(world: Record, k: int, h: float) -> None:
    """Compute the share of a change of charge that is still to come after a step."""
    world.values.combustion_engine[k].decay = exp(-h / world.values.combustion_engine[k].manifold_time)


@njit(**INLINED)
def before(world: Record, k: int, h: float, t: float) -> None:
    """Move governor, throttle and charge, and set the torque at both ends of the step by the angle that is expected at its end."""
    me, my, line = world.parts.combustion_engine[k], world.values.combustion_engine[k], world.driveline
    speed, middle = line.speed[my.body], line.middle[my.body]
    runs = me.runs
    me.runs = next_state(runs, me.enabled > 0.0 and world.safe == 0.0, speed, my)
    if runs != FIRING and me.runs == FIRING:
        me.uneven = cycle_irregularity(me.cycle, my)
    by_speed = me.target > 0.0 and me.runs != OFF
    change = my.ramp * h
    me.setpoint = me.setpoint + min(max(me.target - me.setpoint, -change), change) if by_speed else speed
    opening, integral = governed(me.integral, max(me.setpoint, my.idle_speed) if by_speed else my.idle_speed, middle, h, my)
    if me.runs == FIRING or me.runs == STARTING:
        me.integral = integral
        opening = opening if by_speed else max(opening, min(me.lever, 1.0))
    else:
        me.integral = opening = 0.0
    way = h / my.throttle_time
    me.throttle += min(max(opening - me.throttle, -way), way)
    start = me.charge
    me.charge = me.throttle + (me.charge - me.throttle) * my.decay
    line.push[0, my.body] += shaft_torque(me, speed, me.phase, start, my)
    me.torque = shaft_torque(me, 2.0 * middle - speed, me.phase + my.firings * h * middle, me.charge, my)
    line.push[1, my.body] += me.torque


@njit(**INLINED)
def after(world: Record, k: int, h: float) -> None:
    """Turn the crank by the step's motion; at the end of a firing cycle begin the next one."""
    me, my, line = world.parts.combustion_engine[k], world.values.combustion_engine[k], world.driveline
    speed = line.speed[my.body]
    me.phase += my.firings * h * (speed - 0.5 * line.gained[my.body])
    if me.phase >= TURN or me.phase < 0.0:
        way = 1.0 if me.phase > 0.0 else -1.0
        me.phase -= way * TURN
        me.cycle += way
        me.uneven = cycle_irregularity(me.cycle, my)
        fails = my.misfires > 0.0 and uniform_of(my.seed, MISFIRES, me.cycle) < my.misfires
        me.cut = 1.0 if fails or speed > my.cut_speed else 0.0


def shown_values(rig: ShownRig, name: str) -> tuple[float, ...]:
    """Return the fields of its MotorState."""
    me = rig.device(name)
    runs = (me["runs"] == FIRING) | (me["runs"] == STARTING)
    return (rig.speed_at(name), me["setpoint"], me["torque"], rig.energies["motor"], runs)


# target, lever, enabled: speed setpoint, setpoint of the throttle, and switch; with a speed setpoint above 0 the governor sets the
# throttle, otherwise the throttle's own setpoint and the idle speed do; runs: off, starting, firing or stalled; setpoint: after its
# ramp; integral: of the governor; throttle, charge: opening of the throttle, and the charge of the cylinders that follows it;
# phase: angle of the firing cycle; cycle: its number; uneven: irregularity of the cycle; cut: 1 in a cycle without ignition;
# torque: on the shaft at the step's end; misfires: share of the firings that fail
PART = Part(
    "combustion_engine",
    30,
    (EngineConfig,),
    state=(
        "target",
        "lever",
        "enabled",
        "runs",
        "setpoint",
        "integral",
        "throttle",
        "charge",
        "phase",
        "cycle",
        "uneven",
        "cut",
        "torque",
    ),
    derived=("decay", "misfires"),
    wires=("body",),
    stages={"fill": fill, "before": before, "after": after},
    role=SOURCE,
    joined={"body": Wire("body")},
    message="MotorState",
    shown_values=shown_values,
    shows=(
        Shown(
            "torque",
            "torque",
            "torque",
            -1000.0,
            1000.0,
            "Torque of {called} on its shaft, with the unevenness of its combustion.",
            "positive drives {body}",
        ),
        Shown(
            "speed_setpoint",
            "speed_setpoint",
            "speed",
            0.0,
            1600.0,
            "Speed that the governor of {called} is to hold, after its ramp; without an order the speed itself.",
            "positive in the driving direction",
        ),
        Shown("work", "work", "energy", -1e9, 1e9, "Work of {called} since time 0.", "positive delivered to the shaft"),
        Shown(
            "runs",
            "enabled",
            "state",
            0.0,
            1.0,
            "Whether {called} runs: it fires or its starter turns it.",
            "none",
            {0: "no", 1: "yes"},
        ),
    ),
    check=contradiction,
    takes=(
        Command("motor", {"speed": "angular velocity"}, "target", "enabled", "speed of the engine", "speed"),
        Command("engine", {"throttle": "ratio"}, "lever", "enabled", "opening of the throttle", "ratio", node="throttle"),
    ),
)
