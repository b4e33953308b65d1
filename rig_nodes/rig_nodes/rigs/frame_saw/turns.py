# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The frame saw's teeth on the crank, and its turn in the steady state by scipy; calculations.py uses it."""

from __future__ import annotations

from math import floor, pi, sin
from typing import TYPE_CHECKING

import numpy as np
from scipy.integrate import solve_ivp

from rig_nodes.base import RigError
from rig_nodes.plant import GRAVITY, depth_of_cut, force_per_width, motion

if TYPE_CHECKING:
    from rig_nodes.rig import RigConfig

MM, RPM = 1e-3, pi / 30.0
MOTOR_SPEED = 980 * RPM  # setpoint of the sequence demo
FINE = 4000  # points over half a turn for the computation of means
NEWTON = 12  # steps of Newton's method


class NoSteadyTurn(RigError):
    """The motor does not keep its speed."""


def crank_speed(config: RigConfig) -> float:
    """Return the speed of the crank at the motor's setpoint [rad/s]."""
    return MOTOR_SPEED / config.belt.cb


def teeth_torque(config: RigConfig, angle: float, feed: float, swing: float, pressure: float) -> float:
    """Torque of the teeth on the crank [Nm]."""
    saw, radius = config.saw, config.sash.radius
    if feed <= 0.0:
        return 0.0
    angle -= 2.0 * pi * floor(0.5 * angle / pi)
    depth = depth_of_cut(angle, feed, swing, 0.5 * saw.pitch / radius)
    values = saw if pressure == saw.cutting_pressure else _Edge(pressure, saw.edge_force, saw.scraping_force, saw.edge_depth)
    force = force_per_width.py_func(depth, angle < pi, values)
    return force * saw.kerf * saw.blades * saw.height / saw.pitch * radius * abs(sin(angle))


class _Edge:
    """Values of a saw's wood with another cutting pressure."""

    def __init__(self, pressure: float, edge: float, scraping: float, depth: float) -> None:
        self.cutting_pressure, self.edge_force, self.scraping_force, self.edge_depth = pressure, edge, scraping, depth


def one_turn(config: RigConfig, feed: float, stiff: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return one turn in the steady state, found by scipy.

    Parameters
    ----------
    config : RigConfig
        The rig.
    feed : float
        Feed per turn [m].
    stiff : bool
        Whether the belt is stiff and the motor's torque follows at once, as in a quasi-static calculation.

    Returns
    -------
    tuple of (n,) array
        Angle of the crank [rad], its speed [rad/s], power of the motor and of the teeth [W].

    Raises
    ------
    NoSteadyTurn
        When there is no such turn, because the motor is too weak.
    """
    motor, sash, belt = config.motor_drive, config.sash, config.belt
    ratio, swing, pressure = belt.cb, config.saw.eccentric_radius, config.saw.cutting_pressure

    def asked(speed: float, integral: float, limit: float) -> float:
        """Torque setpoint of the motor's speed loop, by the motor's speed and the limit of its power."""
        highest = min(motor.torque_limit, limit / speed)
        return min(max(motor.speed_gain * (MOTOR_SPEED - speed) + integral, -motor.braking_limit), highest)

    def slope(angle: float, state: np.ndarray, limit: float) -> list[float]:
        speed, integral = state[:2]
        driving = ratio * speed if stiff else state[2]
        on_belt = asked(driving, integral, limit) if stiff else belt.stiffness * state[3] + belt.damping * (driving - ratio * speed)
        _, first, second = motion(angle, sash.radius, sash.rod_ratio)
        weight = GRAVITY * sash.weight * (sash.mass * first - sash.counterweight * sash.radius * sin(angle))
        torque = ratio * on_belt - config.bearings.drag * speed - teeth_torque(config, angle, feed, swing, pressure) + weight
        inertia = config.crank.inertia + sash.mass * first**2 + (ratio**2 * config.motor.inertia if stiff else 0.0)
        out = [(torque - sash.mass * first * second * speed**2) / inertia, motor.speed_gain_integral * (MOTOR_SPEED - driving)]
        if not stiff:
            out += [
                (state[4] - on_belt) / config.motor.inertia,
                driving - ratio * speed,
                (asked(driving, integral, limit) - state[4]) / motor.torque_time,
            ]
        return [one / speed for one in out]

    angles = np.linspace(0.0, 2.0 * pi, 1441)

    def turned(start: np.ndarray, limit: float) -> np.ndarray:
        """Return the speed and the other states at the angles of a turn."""
        return solve_ivp(slope, (0.0, 2.0 * pi), start, t_eval=angles, rtol=1e-7, atol=1e-9, max_step=0.03, args=(limit,)).y

    torque = 50.0 + 16000.0 * feed
    start = np.array([MOTOR_SPEED / ratio, torque, MOTOR_SPEED, torque / belt.stiffness, torque][: 2 if stiff else 5])
    states, scale = np.zeros((len(start), len(angles))), np.abs(start)
    steps = np.diag(scale * np.array([1e-3, 1e-2, 1e-3, 1e-1, 1e-2][: len(start)]))
    # Newton's method finds a turn that ends in the state in which it begins; its differences are large compared with the tolerance
    # of solve_ivp. The first solution is for a motor of sufficient power, and the turn of the limited motor is found from it
    for limit in (4.0 * motor.power_limit, motor.power_limit):
        for _ in range(NEWTON):
            states = turned(start, limit)
            missed = states[:, -1] - start
            if np.all(np.abs(missed) <= 1e-5 * scale):
                break
            ends = [turned(start + step, limit)[:, -1] for step in steps]
            slopes = [(end - states[:, -1]) / step.sum() for end, step in zip(ends, steps)]
            start = start - np.linalg.lstsq(np.transpose(slopes) - np.eye(len(start)), missed, rcond=None)[0]
    held = (
        np.allclose(states[:, -1] / scale, states[:, 0] / scale, atol=1e-4)
        and abs(states[0].mean() * ratio / MOTOR_SPEED - 1.0) < 0.01
    )
    if not held:
        raise NoSteadyTurn(
            f"the saw has no steady turn at a feed of {feed / MM:g} mm and {motor.power_limit / 1e3:g} kW; it slows down"
        )
    speed = states[0]
    power = np.array([asked(ratio * w, i, motor.power_limit) * ratio * w for w, i in states.T]) if stiff else states[4] * states[2]
    teeth = np.array([teeth_torque(config, angle, feed, swing, pressure) for angle in angles])
    return angles, speed, power, teeth * speed
