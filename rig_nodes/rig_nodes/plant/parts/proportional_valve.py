# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Proportional pressure-reducing valve: coil, spool with friction and overlap, its edges, and the bore before them.

It is a part of the engine, for ZR-P1 and ZR-P2 (type 3WZCDE6, thesis tab. 3.4); no pressure is prescribed here.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import exp, pi, sqrt
from typing import TYPE_CHECKING

import numpy as np

from ...base import INLINED, njit, param
from .lag import lagged
from .part import NOWHERE, VALVE, Part, Shown, Wire

if TYPE_CHECKING:
    from ...base import Record
    from .shown_rig import ShownRig

DISCHARGE, TURBULENT_FROM = 0.61, 9.3  # discharge coefficient of sharp edges, and Reynolds number from which it holds
STEEPEST = 2.0e3  # Pa: below this drop the flow is linear in any case, so that its slope stays finite

# source of the coils' duty: a controller outside, the embedded law, or the plant's power stage with setpoints from outside
BY_DUTY, BY_LAW, BY_SETPOINT = range(3)


@dataclass(frozen=True)
class ValveConfig:
    """Values of one valve; its regulated pressure settles where spool force and port pressure balance."""

    coil_voltage: float = param("voltage", 1.0, 100.0, "Supply voltage of the coil")
    coil_resistance: float = param("resistance", 1.0, 200.0, "Resistance of the coil")
    coil_inductance: float = param("inductance", 1e-3, 5.0, "Inductance of the coil")
    cracking_current: float = param("current", 0.0, 0.5, "Current at which the regulated pressure begins to rise")
    pressure_gain: float = param("pressure per current", 1e5, 2e7, "Rise of the regulated pressure with the current")
    pressure_limit: float = param("pressure", 1e5, 1e7, "Pressure above which the valve drains oil, whatever the current")
    hysteresis: float = param(
        "ratio", 0.0, 0.2, "Share of the magnet's force that iron and armature retain as the current reverses its course"
    )
    friction_pressure: float = param(
        "pressure", 0.0, 1e6, "Friction of the spool without dither, as half the band of port pressures in which it stays"
    )
    spool_stroke: float = param("length", 1e-5, 1e-2, "Travel of the spool from the edge of the reducing side to its stop")
    spool_dead_band: float = param("length", 0.0, 5e-3, "Overlap of the spool between its reducing and its relieving edge")
    full_opening_pressure: float = param("pressure", 1e3, 5e6, "Error of the port pressure at which the spool opens fully")
    spool_time: float = param(
        "time", 1e-4, 1.0, "Time constant of the spool's travel, damped by oil in its gaps, at the oil's reference temperature"
    )
    orifice_area: float = param("area", 1e-9, 1e-3, "Area of the fully opened edge from supply to port")
    drain_area: float = param("area", 1e-9, 1e-3, "Area of the fully opened edge from port to tank")
    supply_bore_area: float = param(
        "area", 0.0, 1e-3, "Area of the bore between supply and spool, which limits the flow of an open edge; 0 for a wide one", 0.0
    )
    drain_bore_area: float = param(
        "area", 0.0, 1e-3, "Area of the bore between spool and tank, which limits the flow of an open edge; 0 for a wide one", 0.0
    )


@njit(cache=True, error_model="numpy", forceinline=True)
def coil_current(current: float, duty: float, h: float, valve: Record) -> float:
    """Return the coil current after a step at an averaged PWM duty.

    It is the exact solution of L di/dt + R i = duty U; the diode keeps i >= 0.

    Parameters
    ----------
    current : float
        Coil current before the step [A].
    duty : float
        Share of the supply voltage on the coil, 0 to 1.
    h : float
        Length of the step [s].
    valve : Record
        Values of the valve.

    Returns
    -------
    float
        Coil current [A].
    """
    return coil_after(current, duty, coil_decay(h, valve), valve)


@njit(cache=True, error_model="numpy", forceinline=True)
def coil_decay(h: float, valve: Record) -> float:
    """Return the share of a change of the coil's current that is still to come after h [s]."""
    return exp(-h * valve.coil_resistance / valve.coil_inductance)


@njit(cache=True, error_model="numpy", forceinline=True)
def coil_after(current: float, duty: float, decay: float, valve: Record) -> float:
    """Return :func:`coil_current` after a time whose ``decay`` is known."""
    steady = duty * valve.coil_voltage / valve.coil_resistance
    return lagged(current, steady, decay)


@njit(cache=True, error_model="numpy", forceinline=True)
def on_share(t: float, h: float, duty: float, frequency: float) -> float:
    """Return the share of the time from t to t + h in which a PWM is on; it is on from the start of each period.

    Parameters
    ----------
    t, h : float
        Start and length of the time [s].
    duty : float
        Share of a period in which it is on.
    frequency : float
        Frequency of the PWM [Hz].

    Returns
    -------
    float
        Share of the time.
    """
    first, last = t * frequency, (t + h) * frequency
    turns = np.floor(first)  # a float, so that it is not converted to a whole number and back
    on = 0.0
    while turns < last:
        on += max(0.0, min(last, turns + duty) - max(first, turns))
        turns += 1.0
    return min(1.0, on / (h * frequency))


@njit(cache=True, error_model="numpy", forceinline=True)
def magnet_pressure(before: float, current: float, valve: Record) -> float:
    """Return the force of the magnet [Pa of port pressure]: g i with hysteresis, the share that iron and armature keep.

    It rises along (1 - share) g i, stays while the current reverses its course, and falls along (1 + share) g i. ``before`` is the
    force in the last step.
    """
    force = valve.pressure_gain * current
    return min(max(before, (1.0 - valve.hysteresis) * force), (1.0 + valve.hysteresis) * force)


@njit(cache=True, error_model="numpy", forceinline=True)
def held_pressures(magnet: float, friction: float, valve: Record) -> tuple[float, float]:
    """Return (lowest, highest) port pressure [Pa, gauge] at which the spool stays where it is, by the magnet's force [Pa].

    The magnet acts against port pressure and spring; ``friction`` [Pa] holds the spool within a band around their balance. The
    valve regulates no pressure above ``pressure_limit``: it lets off more oil, whatever the force of the magnet.
    """
    middle = magnet - valve.pressure_gain * valve.cracking_current
    return min(middle - friction, valve.pressure_limit), min(middle + friction, valve.pressure_limit)


@njit(cache=True, error_model="numpy", forceinline=True)
def friction_left(duty: float, frequency: float, valve: Record) -> float:
    """Return the friction [Pa] of the spool under a pulsed coil, where the plant averages the pulses.

    The current swings by U D (1 - D) / (L f) from pulse to pulse (D: duty, f: frequency), and the magnet's force with it. The swing
    moves the spool where it exceeds the friction, so half of it is subtracted from the friction.
    """
    return friction_under(duty, shaken_off(frequency, valve), valve)


@njit(cache=True, error_model="numpy", forceinline=True)
def shaken_off(frequency: float, valve: Record) -> float:
    """Return the reduction of friction [Pa] per D (1 - D) in :func:`friction_left`; 0 without pulses."""
    if frequency == 0.0:
        return 0.0
    return 0.5 * valve.pressure_gain * valve.coil_voltage / (valve.coil_inductance * frequency)


@njit(cache=True, error_model="numpy", forceinline=True)
def friction_under(duty: float, shaken: float, valve: Record) -> float:
    """Return :func:`friction_left` from the result of :func:`shaken_off`."""
    return max(0.0, valve.friction_pressure - shaken * duty * (1.0 - duty))


@njit(cache=True, error_model="numpy", forceinline=True)
def spool_position(
    spool: float, magnet: float, port_pressure: float, h: float, thickness: float, friction: float, valve: Record
) -> float:
    """Return the spool position after a step: first-order towards the band in which friction holds it, between its stops.

    0 is the edge of the reducing side; the relieving side opens only after the overlap (dead band).

    Parameters
    ----------
    spool : float
        Position before the step [m].
    magnet : float
        Force of the magnet [Pa of port pressure].
    port_pressure : float
        Pressure of the port [Pa, gauge].
    h : float
        Length of the step [s].
    thickness : float
        Viscosity of the oil over that at its reference temperature.
    friction : float
        Friction of the spool [Pa of port pressure].
    valve : Record
        Values of the valve.

    Returns
    -------
    float
        Position [m].
    """
    return spool_after(spool, magnet, port_pressure, spool_decay(h, thickness, valve), spool_gain(valve), friction, valve)


@njit(cache=True, error_model="numpy", forceinline=True)
def spool_decay(h: float, thickness: float, valve: Record) -> float:
    """Return the share of the spool's way that is still to come after h [s], in oil of a viscosity over the reference's."""
    return exp(-h / (valve.spool_time * thickness))


@njit(cache=True, error_model="numpy", forceinline=True)
def spool_gain(valve: Record) -> float:
    """Return the way of the spool per difference between the pressures of magnet and port [m/Pa]."""
    return valve.spool_stroke / valve.full_opening_pressure


@njit(cache=True, error_model="numpy", forceinline=True)
def spool_after(
    spool: float, magnet: float, port_pressure: float, decay: float, gain: float, friction: float, valve: Record
) -> float:
    """Return :func:`spool_position` after a time whose ``decay`` is known, with the ``gain`` of :func:`spool_gain`."""
    lowest, highest = held_pressures(magnet, friction, valve)
    target = min(max(spool, gain * (lowest - port_pressure)), gain * (highest - port_pressure))
    # the stops limit the travel and not the speed, which grows with the remaining force
    return min(max(target + (spool - target) * decay, -valve.spool_dead_band - valve.spool_stroke), valve.spool_stroke)


@njit(cache=True, error_model="numpy", forceinline=True)
def closing_pressure(
    spool: float, reducing: bool, magnet: float, h: float, thickness: float, friction: float, valve: Record
) -> float:
    """Return the port pressure that, held over h, brings the spool to its edge.

    Parameters
    ----------
    spool : float
        Position of the spool [m].
    reducing : bool
        True for the edge towards the supply, False for that of the relieving side.
    magnet : float
        Force of the magnet [Pa of port pressure].
    h : float
        Time [s].
    thickness : float
        Viscosity of the oil over that at its reference temperature.
    friction : float
        Friction of the spool [Pa of port pressure].
    valve : Record
        Values of the valve.

    Returns
    -------
    float
        Pressure [Pa], infinite where no pressure does so.
    """
    decay = spool_decay(h, thickness, valve)
    edge = 0.0 if reducing else -valve.spool_dead_band
    target = (edge - spool * decay) / (1.0 - decay)
    lowest, highest = held_pressures(magnet, friction, valve)
    # the highest pressure closes the supply's edge, the lowest one the drain's
    held = highest if target < spool else lowest
    return held - target / valve.spool_stroke * valve.full_opening_pressure


@njit(cache=True, error_model="numpy", forceinline=True)
def opening(spool: float, valve: Record) -> float:
    """Return the share of the full orifice, -1 (drain) to 1 (supply); it is 0 inside the dead band."""
    if spool > 0.0:
        return spool / valve.spool_stroke
    if spool < -valve.spool_dead_band:
        return (spool + valve.spool_dead_band) / valve.spool_stroke
    return 0.0


@njit(cache=True, error_model="numpy", forceinline=True)
def orifice_speed(density: float) -> float:
    """Return sqrt(2 / rho) of the orifice law [m3/2 kg-1/2], for :func:`port_flow`."""
    return sqrt(2.0 / density)


@njit(cache=True, error_model="numpy", forceinline=True)
def laminar_force(viscosity: float, density: float) -> float:
    """Return the pressure drop times area [N] below which the flow of a sharp-edged orifice is laminar.

    There the discharge coefficient grows with the root of the Reynolds number, C_d = 0.2 sqrt(Re), and meets the turbulent 0.61 at
    Re = 9.3 (Merritt, Hydraulic Control Systems, 1967). Areas contain the turbulent coefficient.
    """
    speed = TURBULENT_FROM * viscosity / (density * DISCHARGE)  # times the diameter
    return 0.5 * density * speed * speed * 0.25 * pi * DISCHARGE


@njit(cache=True, error_model="numpy", forceinline=True)
def edge_area(share: float, valve: Record) -> float:
    """Return the area of an opening of the spool and of the bore on the edge's other side, one after the other [m2]."""
    if share < 0.0:
        area, bore = -share * valve.drain_area, valve.drain_bore_area
    else:
        area, bore = share * valve.orifice_area, valve.supply_bore_area
    return area * bore / sqrt(area * area + bore * bore) if bore > 0.0 else area


@njit(cache=True, error_model="numpy", forceinline=True)
def narrowest(edge: float, bore: float) -> float:
    """Return the area from which the limit of laminar flow is computed [m2]: that of the bore or of the fully opened edge."""
    return min(edge, bore) if bore > 0.0 else edge


@njit(cache=True, error_model="numpy", forceinline=True)
def orifice(area: float, drop: float, full: float, speed: float, laminar: float) -> tuple[float, float]:
    """Return the flow of an opening and its derivative by the pressure drop, by the orifice law Q = A sqrt(2 dp / rho).

    Below the pressure drop at which the flow becomes laminar, Q is proportional to dp.

    Parameters
    ----------
    area : float
        Area of the opening [m2], with the discharge coefficient.
    drop : float
        Pressure drop [Pa].
    full : float
        Area from which the limit of laminar flow is computed [m2].
    speed : float
        Value of :func:`orifice_speed`.
    laminar : float
        Value of :func:`laminar_force`.

    Returns
    -------
    tuple of float
        Flow [m3/s] and its derivative [m3/(s Pa)].
    """
    below = max(STEEPEST, laminar / full)
    if drop == 0.0:  # mostly an empty line; this avoids the square roots below, which take long
        return 0.0, area * (speed / sqrt(below))
    square = drop * drop + below * below
    root = speed / sqrt(sqrt(square))
    return area * drop * root, area * root * (1.0 - 0.5 * drop * drop / square)


@njit(cache=True, error_model="numpy", forceinline=True)
def port_flow(
    share: float, port_pressure: float, supply_pressure: float, speed: float, laminar: float, valve: Record
) -> tuple[float, float]:
    """Return the flow to the clutch and its derivative by port pressure, by :func:`orifice`.

    No oil flows back into a supply whose pressure is lower than the port's (check valve in the line P).

    Parameters
    ----------
    share : float
        Opening of the orifice, -1 to 1.
    port_pressure, supply_pressure : float
        Pressures [Pa].
    speed : float
        Value of :func:`orifice_speed`.
    laminar : float
        Value of :func:`laminar_force`.
    valve : Record
        Values of the valve.

    Returns
    -------
    tuple of float
        Flow [m3/s] and its derivative by port pressure [m3/(s Pa)].
    """
    if share == 0.0:
        return 0.0, 0.0
    area = edge_area(share, valve)
    if share > 0.0:
        drop = supply_pressure - port_pressure
        if drop <= 0.0:
            return 0.0, 0.0
        flow, slope = orifice(area, drop, narrowest(valve.orifice_area, valve.supply_bore_area), speed, laminar)
        return flow, -slope
    flow, slope = orifice(area, port_pressure, narrowest(valve.drain_area, valve.drain_bore_area), speed, laminar)
    return -flow, -slope


@njit(cache=True, error_model="numpy", forceinline=True)
def held_flow(state: Record, port_pressure: float, supply_pressure: float, most: float) -> tuple[float, float]:
    """Return flow and slope like :func:`port_flow` for a valve outside the plant, from its answer, which is held for a tick.

    The answer is Q0 + slope (p - p0). Whatever the answer, within a tick the flow keeps its direction, no oil comes from a supply
    whose pressure is below the port's, and none leaves an empty line. A step does not move the line's pressure beyond that of the
    supply or below that of an empty line: ``most`` [m3/(s Pa)] is the flow that changes the line's pressure by 1 Pa in a step. So
    the port gains no energy that the supply did not deliver.
    """
    flow = state.cut_flow + state.cut_slope * (port_pressure - state.cut_pressure)
    highest = most * max(0.0, supply_pressure - port_pressure) if state.cut_flow >= 0.0 else 0.0
    lowest = -most * max(0.0, port_pressure) if state.cut_flow <= 0.0 else 0.0
    if flow > highest:
        return highest, -most if highest > 0.0 else 0.0
    if flow < lowest:
        return lowest, -most if lowest < 0.0 else 0.0
    return flow, state.cut_slope


@njit(**INLINED)
def fill(world: Record, k: int, h: float) -> None:
    """Compute what depends on the step's length, in oil of the reference temperature, and the spool's way per pressure."""
    my = world.values.proportional_valve[k]
    my.coil_left, my.gain = coil_decay(h, my), spool_gain(my)
    my.per_viscosity = 1.0 / world.values.oil_supply[my.oil].viscosity
    my.shaken = shaken_off(my.pulses, my)
    my.spool_left, my.spool_thickness = spool_decay(h, 1.0, my), 1.0


@njit(**INLINED)
def command(world: Record, k: int, outputs: Record, drive: int) -> None:
    """Set the duty of this sample.

    Where the current equals its setpoint, the setpoint of the last sample is taken, so that it has the delay that the duty would
    have.
    """
    me, my = world.parts.proportional_valve[k], world.values.proportional_valve[k]
    safe = world.safe > 0.0
    if drive != BY_DUTY:
        me.pending = outputs[my.output].duty
    if my.ideal_current > 0.0:
        me.current = 0.0 if safe else outputs[my.output].setpoint
    me.duty = 0.0 if safe else me.pending


@njit(**INLINED)
def before(world: Record, k: int, h: float, t: float) -> None:
    """Move coil, magnet and spool over the step; the flow is solved together with the line that it fills."""
    me, my = world.parts.proportional_valve[k], world.values.proportional_valve[k]
    me.on = me.duty if my.pwm == 0.0 else on_share(t, h, me.duty, my.pwm)
    current = me.current
    if my.ideal_current == 0.0:
        me.current = coil_after(me.current, me.on, my.coil_left, my)
    if me.cut == 0.0:
        # in the middle of the step: the mean current, and the port's pressure continued from the last step
        line = world.oil[my.line]
        thickness = world.parts.oil_supply[my.oil].viscosity * my.per_viscosity
        if thickness != my.spool_thickness:
            my.spool_left, my.spool_thickness = spool_decay(h, thickness, my), thickness
        friction = friction_under(me.on, my.shaken, my) if my.pwm == 0.0 else my.friction_pressure
        me.magnet = magnet_pressure(me.magnet, 0.5 * (current + me.current), my)
        me.spool = spool_after(me.spool, me.magnet, line.port + 0.5 * line.rise, my.spool_left, my.gain, friction, my)
        me.share = opening(me.spool, my)


@njit(**INLINED)
def pickup(world: Record, k: int, h: float, index: int, shown: Record) -> None:
    """Set the voltage of the coil less its mean in the wire of the transducer beside it."""
    me, my = world.parts.proportional_valve[k], world.values.proportional_valve[k]
    if my.beside != NOWHERE:
        # the mean voltage induces nothing
        on = on_share((index - 1) * h, h, me.duty, my.pulses) if me.duty > 0.0 else 0.0
        shown.induced[my.beside] = on - me.duty


@njit(**INLINED)
def line_flow(
    valve: Record, line: float, supply: float, speed: float, laminar: float, most: float, values: Record
) -> tuple[float, float]:
    """Return (flow into the line [m3/s], its slope) of the spool, or of a valve that stands outside the plant."""
    if valve.cut > 0.0:
        return held_flow(valve, line, supply, most)
    return port_flow(valve.share, line, supply, speed, laminar, values)


@njit(cache=True, error_model="numpy", forceinline=True)
def leak(area: float, drop: float, speed: float, most: float) -> float:
    """Return the flow through a leak by the orifice law Q = A sqrt(2 dp / rho), at most ``most`` per pressure drop.

    Parameters
    ----------
    area : float
        Area of the leak [m2], with the discharge coefficient.
    drop : float
        Pressure drop [Pa]; no oil comes back.
    speed : float
        Value of :func:`orifice_speed`.
    most : float
        Flow per pressure drop that a step can take [m3/(s Pa)], which also bounds the slope at a small drop.

    Returns
    -------
    float
        Flow [m3/s].
    """
    return min(area * speed * sqrt(drop), most * drop) if drop > 0.0 else 0.0


@njit(**INLINED)
def fed(world: Record, k: int, line: float, flow: float, h: float) -> None:
    """Record the oil and the work that the valve has delivered to its line in a step; called by the part that solves the flow."""
    me = world.parts.proportional_valve[k]
    me.flow = flow
    me.work += line * flow * h
    world.oil[world.values.proportional_valve[k].supply].drawn += max(0.0, flow)  # relieved oil goes to the tank


def shown_values(rig: ShownRig, name: str) -> tuple[float, ...]:
    """Return the fields of its ValveState."""
    me = rig.device(name)
    return (me["duty"], me["current"], me["spool"], me["flow"], rig.fed_pressure(name), rig.command_age, rig.safe)


# on: share of the supply voltage on the coil in this step; pending: duty from the next sample on; work: work on the port since
# time 0; cut > 0: the valve without its coil stands outside (plant.engine.outside), and cut_* is its answer. ideal_current > 0: the
# current equals its setpoint; pwm: frequency, 0 where the PWM is averaged; pulses: frequency of the induced pulses, which is set
# also where the PWM is averaged; beside: column of the transducer whose wire lies beside its own, NOWHERE for none; leak_area: of a
# gap of worn edges between supply and port, 0 for none
PART = Part(
    "proportional_valve",
    10,
    (ValveConfig,),
    state=(
        "duty",
        "on",
        "pending",
        "current",
        "magnet",
        "spool",
        "flow",
        "share",
        "work",
        "cut",
        "cut_flow",
        "cut_slope",
        "cut_pressure",
    ),
    derived=(
        "coil_left",
        "spool_left",
        "spool_thickness",
        "gain",
        "per_viscosity",
        "shaken",
        "ideal_current",
        "pwm",
        "pulses",
        "leak_area",
    ),
    wires=("line", "supply", "oil", "output", "beside"),
    stages={"fill": fill, "command": command, "before": before, "pickup": pickup},
    role=VALVE,
    joined={
        "feeds": Wire("clutch"),
        "supply": Wire("oil", needed=False),
        "output": Wire("output"),
        "beside": Wire("transducer", needed=False),
    },
    effects={"valve_hysteresis": {"hysteresis": 0.0, "friction_pressure": 0.0}, "current_loop": {}, "pwm_frequency": {}},
    message="ValveState",
    shown_values=shown_values,
    shows=(
        Shown("duty", "duty", "ratio", 0.0, 1.0, "PWM duty on the coil of {called}.", "share of the supply's voltage"),
        Shown("flow", "flow", "flow", -1e-3, 1e-3, "Oil flow of {called} to {fed}.", "positive fills the clutch"),
    ),
)
