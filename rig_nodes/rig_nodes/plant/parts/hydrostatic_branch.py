# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Hydrostatic drive in a closed circuit between two shafts: a pump and a motor whose displacements are set, two lines, valves.

It is a part of the engine: the pump P and the motor S_h of the HydmAG (thesis 3.1 and fig. 3.2), with a boost supply through check
valves, relief valves between the lines and a flushing valve. It acts on both shafts by torques and has no inertia of its own.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import tanh
from typing import TYPE_CHECKING

from ...base import INLINED, njit, param
from .part import SOURCE, Command, Part, Shown, Wire

if TYPE_CHECKING:
    from ...base import Record
    from .shown_rig import ShownRig

EMPTY = -101325.0  # Pa, gauge: pressure of an empty line, which is vacuum
TURNS = 1.0  # rad/s: speed at which three quarters of the constant friction act
LEAST = 0.05  # swivel of the motor below which no speed setpoint is computed
ROUNDS = 6  # most iterations over the set of open valves in a step


@dataclass(frozen=True)
class HydrostaticConfig:
    """Values of pump, motor, lines and valves; a swivel of 100 % is the whole displacement."""

    pump_displacement: float = param("displacement", 1e-8, 1e-3, "Displacement of the pump at its whole swivel")
    motor_displacement: float = param("displacement", 1e-8, 1e-3, "Displacement of the motor at its whole swivel")
    pump_time: float = param("time", 1e-3, 10.0, "Time in which the pump's swivel goes from 0 to 100 %")
    motor_time: float = param("time", 1e-3, 10.0, "Time in which the motor's swivel goes from 0 to 100 %")
    line_volume: float = param("volume", 1e-6, 1e-1, "Volume of the oil in each of the two lines")
    bulk_modulus: float = param("pressure", 1e7, 3e9, "Bulk modulus of the oil, with the compliance of the hoses")
    leak_across: float = param(
        "hydraulic resistance", 1e6, 1e16, "Pressure between the lines over the flow that leaks between them"
    )
    leak_out: float = param("hydraulic resistance", 1e6, 1e16, "Pressure of a line over its flow into the housings")
    relief_pressure: float = param("pressure", 1e5, 1e8, "Difference of the lines' pressures at which a relief valve opens")
    relief_droop: float = param("hydraulic resistance", 1e6, 1e12, "Rise of that difference with the flow of the relief valve")
    boost_pressure: float = param("pressure", 0.0, 1e7, "Pressure of the boost supply while the pump's shaft turns fast enough")
    boost_speed: float = param("angular velocity", 0.1, 1e3, "Speed of the pump's shaft from which on the boost supply is full")
    boost_resistance: float = param("hydraulic resistance", 1e6, 1e12, "Fall of pressure at a check valve with the flow through it")
    flushing_pressure: float = param("pressure", 0.0, 1e7, "Pressure of the lower line above which the flushing valve lets off oil")
    flushing_resistance: float = param("hydraulic resistance", 1e6, 1e16, "Pressure over the flow of the flushing valve")
    boost_displacement: float = param("displacement", 0.0, 1e-3, "Displacement of the boost pump on the pump's shaft")
    friction: float = param("torque", 0.0, 100.0, "Friction of each machine at any speed and pressure")
    friction_speed: float = param("torque per speed", 0.0, 10.0, "Friction of each machine per speed")
    friction_share: float = param("ratio", 0.0, 0.5, "Friction of each machine as a share of its displacement times the pressure")


@njit(cache=True, error_model="numpy", forceinline=True)
def moved(swivel: float, target: float, low: float, h: float, time: float) -> float:
    """Return a swivel after h: it moves towards a target between ``low`` and 1, by 1 in a time [s]."""
    change = h / time
    return swivel + min(max(min(max(target, low), 1.0) - swivel, -change), change)


@njit(cache=True, error_model="numpy", forceinline=True)
def line_pressures(
    high: float, low: float, pumped: float, taken: float, boost: float, h: float, branch: Record
) -> tuple[float, float, float, float, float, float]:
    """Return pressures of both lines after a step, implicitly, and the flows of the valves.

    V/K dp/dt is the sum of the flows into a line. The flows of leaks and open valves are linear in the pressures at the end of the
    step. Which valves are open is assumed first and corrected until it agrees with these pressures. A line whose pressure would
    fall below vacuum is empty: it has the pressure of vacuum, and its void is filled first when oil flows in again.

    Parameters
    ----------
    high, low : float
        Pressures of the lines before the step, gauge [Pa]: of that into which a positive swivel pumps, and of the other one.
    pumped, taken : float
        Flow of the pump from the second line into the first, and of the motor back [m3/s].
    boost : float
        Pressure of the boost supply [Pa].
    h : float
        Length of the step [s].
    branch : Record
        Values of the branch.

    Returns
    -------
    tuple of float
        Both pressures [Pa]; flows of the boost supply into each line, of the relief valves from the first line into the second,
        and of the flushing valve out of the lower one [m3/s].
    """
    c = branch.line_volume / branch.bulk_modulus / h
    across, out = 1.0 / branch.leak_across, 1.0 / branch.leak_out
    relief, check, flush = 1.0 / branch.relief_droop, 1.0 / branch.boost_resistance, 1.0 / branch.flushing_resistance
    a, b = high, low
    # first assumption: check and relief valves stay as they are
    feed_a, feed_b = int(a < boost), int(b < boost)
    over = 1 if a - b > branch.relief_pressure else -1 if b - a > branch.relief_pressure else 0
    flushed = 0
    for _ in range(ROUNDS):
        # rows of the equations of both lines: (aa, ab | ra), (ab, bb | rb)
        aa = bb = c + across + out
        ab = -across
        ra, rb = c * high + pumped - taken, c * low - pumped + taken
        if feed_a:
            aa += check
            ra += check * boost
        if feed_b:
            bb += check
            rb += check * boost
        if over:
            aa += relief
            bb += relief
            ab -= relief
            ra += over * relief * branch.relief_pressure
            rb -= over * relief * branch.relief_pressure
        if flushed == 1:
            aa += flush
            ra += flush * branch.flushing_pressure
        elif flushed == 2:
            bb += flush
            rb += flush * branch.flushing_pressure
        scale = 1.0 / (aa * bb - ab * ab)
        a, b = (ra * bb - ab * rb) * scale, (aa * rb - ab * ra) * scale
        # the flushing valve opens to the line of lower pressure; while both pressures are nearly equal it keeps its position
        lower = 1 if a < b else 2
        now = lower if min(a, b) > branch.flushing_pressure else 0
        lets = 1 if a - b > branch.relief_pressure else -1 if b - a > branch.relief_pressure else 0
        fed_a, fed_b = int(a < boost), int(b < boost)
        if fed_a == feed_a and fed_b == feed_b and lets == over and now == flushed:
            break
        feed_a, feed_b, over, flushed = fed_a, fed_b, lets, now
    into_a = check * (boost - a) if feed_a else 0.0
    into_b = check * (boost - b) if feed_b else 0.0
    through = relief * (a - b - over * branch.relief_pressure) if over else 0.0
    off = flush * ((a if flushed == 1 else b) - branch.flushing_pressure) if flushed else 0.0
    return max(a, EMPTY), max(b, EMPTY), into_a, into_b, through, off


@njit(**INLINED)
def before(world: Record, k: int, h: float, t: float) -> None:
    """Move swivels and pressures over the step by the speeds in the middle of it, and set the torques on both shafts."""
    me, my, line = world.parts.hydrostatic_branch[k], world.values.hydrostatic_branch[k], world.driveline
    safe = world.safe > 0.0
    pump, motor = line.middle[my.driving], line.middle[my.driven]
    me.swivel_pump = moved(me.swivel_pump, me.pump if me.pump_on > 0.0 and not safe else 0.0, -1.0, h, my.pump_time)
    me.swivel_motor = moved(me.swivel_motor, me.motor if me.motor_on > 0.0 and not safe else 0.0, 0.0, h, my.motor_time)
    volume_pump, volume_motor = me.swivel_pump * my.pump_displacement, me.swivel_motor * my.motor_displacement
    high, low = me.high, me.low
    boost = my.boost_pressure * min(1.0, abs(pump) / my.boost_speed)
    me.high, me.low, into_high, into_low, through, off = line_pressures(
        high, low, volume_pump * pump, volume_motor * motor, boost, h, my
    )
    # work of the oil in the step is that of the mean pressures
    mean_high, mean_low = 0.5 * (high + me.high), 0.5 * (low + me.low)
    between = mean_high - mean_low
    steady = abs(between) * my.friction_share
    pump_turns = tanh(pump / TURNS)
    rubs_pump = (my.friction + steady * abs(volume_pump)) * pump_turns + my.friction_speed * pump
    rubs_motor = (my.friction + steady * abs(volume_motor)) * tanh(motor / TURNS) + my.friction_speed * motor
    boosts = my.boost_displacement * boost * pump_turns
    me.torque_pump = volume_pump * between + rubs_pump + boosts
    me.torque_motor = volume_motor * between - rubs_motor
    line.push[0, my.driving] -= me.torque_pump
    line.push[1, my.driving] -= me.torque_pump
    line.push[0, my.driven] += me.torque_motor
    line.push[1, my.driven] += me.torque_motor
    me.flow = volume_motor * motor
    me.asked = volume_pump * pump / volume_motor if me.swivel_motor > LEAST else 0.0
    me.let_off = through
    leak = (me.high - me.low) * between / my.leak_across + (me.high * mean_high + me.low * mean_low) / my.leak_out
    me.heat_leak += h * leak
    me.heat_relief += h * through * between
    lower = mean_high if me.high < me.low else mean_low
    # the boost pump's work, less what its oil brings into the lines, is lost at its valves
    me.heat_boost += h * (boosts * pump - into_high * mean_high - into_low * mean_low + off * lower)
    me.heat_friction += h * (rubs_pump * pump + rubs_motor * motor)


@njit(**INLINED)
def after(world: Record, k: int, h: float) -> None:
    """Count the work of both shafts on the branch, and keep the motor's speed."""
    me, my, line = world.parts.hydrostatic_branch[k], world.values.hydrostatic_branch[k], world.driveline
    by_pump = h * me.torque_pump * (line.speed[my.driving] - 0.5 * line.gained[my.driving])
    by_motor = h * me.torque_motor * (line.speed[my.driven] - 0.5 * line.gained[my.driven])
    me.taken += by_pump - by_motor
    me.given += by_motor
    me.motor_speed = line.speed[my.driven]


def shown_values(rig: ShownRig, name: str) -> tuple[float, ...]:
    """Return the fields of its MotorState."""
    me = rig.device(name)
    return (me["motor_speed"], me["asked"], me["torque_motor"], me["given"], me["pump_on"] > 0.0)


# pump, pump_on, motor, motor_on: setpoints of the swivels and their switches; swivel_*: present swivels; high, low: pressures of
# the lines; torque_pump, torque_motor: torque that the pump takes and torque that the motor delivers; flow: through the motor;
# asked: speed at which the motor would take all of the pump's flow; let_off: flow of the relief valves; taken: work of both shafts
# on it; given: work of the motor; heat_*: losses by their places [J]
PART = Part(
    "hydrostatic_branch",
    35,
    (HydrostaticConfig,),
    state=(
        "pump",
        "pump_on",
        "motor",
        "motor_on",
        "swivel_pump",
        "swivel_motor",
        "high",
        "low",
        "torque_pump",
        "torque_motor",
        "flow",
        "asked",
        "let_off",
        "motor_speed",
        "taken",
        "given",
        "heat_leak",
        "heat_relief",
        "heat_boost",
        "heat_friction",
    ),
    wires=("driving", "driven"),
    stages={"before": before, "after": after},
    role=SOURCE,
    joined={"driving": Wire("body"), "driven": Wire("body")},
    message="MotorState",
    shown_values=shown_values,
    shows=(
        Shown(
            "torque",
            "torque",
            "torque",
            -2000.0,
            2000.0,
            "Torque of the hydraulic motor on its shaft.",
            "positive drives the shaft",
        ),
        Shown(
            "speed", "speed", "speed", -1000.0, 1000.0, "True speed of the hydraulic motor.", "positive in the driving direction"
        ),
        Shown(
            "speed_setpoint",
            "speed_setpoint",
            "speed",
            -1000.0,
            1000.0,
            "Speed at which the hydraulic motor takes all oil of the pump, without leaks.",
            "positive in the driving direction",
        ),
        Shown("work", "work", "energy", -1e9, 1e9, "Work of the hydraulic motor since time 0.", "positive delivered to the shaft"),
    ),
    takes=(
        Command("pump", {"swivel": "ratio"}, "pump", "pump_on", "swivel of the pump", "ratio"),
        Command(
            "hydraulic_motor", {"swivel": "ratio"}, "motor", "motor_on", "swivel of the hydraulic motor", "ratio", node="motor"
        ),
    ),
    account="taken",
)
