# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Torque that the engine delivers, torque that the road requires, and the shifts of a recording that the engine survives."""

from __future__ import annotations

from math import atan, log1p, pi, sqrt
from typing import TYPE_CHECKING

import numpy as np

from rig_nodes.plant import full_torque, road_force
from rig_nodes.runs import Table

if TYPE_CHECKING:
    from rig_nodes.rig import RigConfig
    from rig_nodes.runs import Recorded

RPM = pi / 30.0
BEGAN = 49.274  # rad/s: speed at which the coast-down of thesis 7.3.1 began; the rig states a loss at it
LARGEST, FASTEST = 271.0, 2400.0 * RPM  # thesis 3.1: torque and speed of the engine
WATCHED = 4.0  # s after an order in which a shift is evaluated
# loads before the shift of the grids of thesis 7.1.3.5, as in the procedures of the rig hydmag [Nm]
UP, DOWN = (40.0, 80.0, 120.0), (40.0, 80.0, 120.0, 180.0, 240.0)
SPEEDS = (1000.0, 1200.0, 1500.0, 1800.0, 2000.0)


def axle(config: RigConfig) -> float:
    """Return the speed of wk over that of the wheels."""
    return next(one.teeth[1] / one.teeth[0] for one in config.structure.meshes if one.bodies == ("wk", "wheels"))


def demand(config: RigConfig, gear: int, speed: float, torque: float) -> float:
    """Return the torque that the input takes in steady state, with the gearbox's losses and without the drag of open clutches.

    Parameters
    ----------
    config : RigConfig
        The rig.
    gear : int
        Number of the gear.
    speed : float
        Speed of w0 [rad/s].
    torque : float
        M_wyj [Nm].

    Returns
    -------
    float
        M_wej [Nm].
    """
    ratio, out, into = config.transmission.ratios[gear], config.loss_out, config.loss_in
    to_wk = 41.0 / 40.0  # losses of the output are stated on the z5 axis
    passed = torque + out.drag * to_wk
    behind = max(0.0, out.constant + out.share * passed + out.square * passed**2) * to_wk
    taken = passed / ratio
    bent = min(taken, -0.5 * into.share / into.square) if into.square < 0.0 else taken
    before = max(0.0, into.constant + into.share * bent + into.square * bent**2)
    turning = sqrt(into.at_rest**2 + (into.at_470**2 - into.at_rest**2) * speed / BEGAN)
    return taken + before + behind / ratio + turning


def grade_for(config: RigConfig, velocity: float, torque: float) -> float | None:
    """Return the grade at which M_wyj is ``torque`` [Nm] at a constant velocity [m/s]; None where no road is so steep."""
    car = config.vehicle
    asked = torque * axle(config) / car.wheel_radius
    low, high = -0.6, 0.6
    if not road_force(velocity, low, car) <= asked <= road_force(velocity, high, car):
        return None
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if road_force(velocity, middle, car) < asked else (low, middle)
    return low


def curve(config: RigConfig) -> Table:
    """Return torque and power of the engine at full throttle over its speed."""
    rows = []
    for rpm in (*range(1000, 2500, 100),):
        torque = full_torque.py_func(rpm * RPM, config.motor)
        rows.append((rpm * RPM, torque, torque * rpm * RPM))
    return Table(
        "The engine at full throttle: 271 Nm, 50 kW, 1000 to 2400 rpm of thesis 3.1; one parabola on each side of 271 Nm.",
        {"n_wej": "rpm", "torque": "Nm", "power": "kW"},
        rows,
    )


def largest(config: RigConfig) -> Table:
    """Return the largest torque and the largest power of the curve within the speeds of the thesis."""
    speeds = np.linspace(1000.0 * RPM, FASTEST, 14001)
    torques = np.array([full_torque.py_func(one, config.motor) for one in speeds])
    most, strong = int(torques.argmax()), int((torques * speeds).argmax())
    return Table(
        "Largest torque and largest power of the engine between 1000 and 2400 rpm.",
        {"what": "", "n_wej": "rpm", "torque": "Nm", "power": "kW"},
        [
            ("torque", speeds[most], torques[most], torques[most] * speeds[most]),
            ("power", speeds[strong], torques[strong], torques[strong] * speeds[strong]),
            ("at 2400 rpm", speeds[-1], torques[-1], torques[-1] * speeds[-1]),
        ],
    )


def grid(config: RigConfig) -> Table:
    """Return for each point of the laboratory's grid the grade, M_wej before the shift and the engine's speed after it."""
    rows = []
    for shift, loads, before, after in (("I-II", UP, 1, 2), ("II-I", DOWN, 2, 1)):
        ratios = config.transmission.ratios
        for rpm in SPEEDS:
            for load in loads:
                speed, then = rpm * RPM, rpm * RPM * ratios[after] / ratios[before]
                velocity = speed / ratios[before] / axle(config) * config.vehicle.wheel_radius
                needed = demand(config, before, speed, load)
                most = full_torque.py_func(speed, config.motor)
                rows.append((shift, speed, load, grade_for(config, velocity, load), needed, most, needed / most, then))
    return Table(
        "The laboratory's shifts (thesis 7.1.3.5) on the road: the grade for M_wyj, M_wej of steady travel before the shift, the "
        "torque of the engine at full throttle, and the speed to which the vehicle brings the engine.",
        {"shift": "", "n_wej": "rpm", "M_wyj": "Nm", "grade": "%", "M_wej": "Nm", "curve": "Nm", "share": "%", "n_after": "rpm"},
        rows,
    )


def climb(config: RigConfig) -> Table:
    """Return the speed at which the engine at full throttle holds the vehicle in gear II on a grade."""
    ratio, car, rows = config.transmission.ratios[2], config.vehicle, []
    for grade in (0.04, 0.05, 0.06):
        low, high = 1000.0 * RPM, FASTEST
        for _ in range(60):
            speed = 0.5 * (low + high)
            velocity = speed / ratio / axle(config) * car.wheel_radius
            force = road_force(velocity, grade, car)
            asked = demand(config, 2, speed, force * car.wheel_radius / axle(config))
            low, high = (speed, high) if asked < full_torque.py_func(speed, config.motor) else (low, speed)
        slip = 1.0 - force / (car.slip_stiffness + force)
        power = full_torque.py_func(speed, config.motor) * speed
        rows.append((grade, speed, velocity * slip, power, force * velocity * slip / power))
    return Table(
        "Gear II on a grade at full throttle: speeds at which the engine's torque equals that of road, axle and gearbox, the "
        "vehicle's speed with the slip of its tyres, the engine's power and the share of it that moves the vehicle.",
        {"grade": "%", "n_wej": "rpm", "velocity": "km/h", "power": "kW", "efficiency": "%"},
        rows,
    )


def coast_down(config: RigConfig) -> Table:
    """Return time and distance of coasting on the level against rolling resistance and air, by the closed form."""
    car = config.vehicle
    steady, air = road_force(0.0, 0.0, car), 0.5 * car.air_density * car.drag_area
    mass = car.mass + config.wheels.inertia / car.wheel_radius**2
    rows = []
    for start in (5.0 / 3.6, 10.0 / 3.6, 20.0 / 3.6, 30.0 / 3.6):
        reach = sqrt(air / steady) * start
        rows.append((start, mass / sqrt(steady * air) * atan(reach), 0.5 * mass / air * log1p(reach**2)))
    return Table(
        "Coasting on the level, axle and gearbox free of losses: time and distance to a standstill, m dv/dt = -F - c v^2.",
        {"from": "km/h", "time": "s", "way": "m"},
        rows,
    )


def survival(config: RigConfig, recording: Recorded) -> Table:
    """Return for each shift between two gears whether the engine survives it.

    It survives a shift when, from the order to the next one but for 4 s at most, it neither stalls nor falls below its idle speed,
    its speed stays up to the 2400 rpm of thesis 3.1, and its torque on the gearbox up to the 271 Nm of thesis 3.1.
    """
    orders = [(at, round(value)) for at, name, _, value in recording.events if name == "shift_ordered"]
    names = {number: gear.name for number, gear in enumerate(config.structure.gears, 1)}
    t, speed, torque, out = recording.t, recording["n_wej"], recording["M_wej"], recording["M_wyj"]
    rows, last = [], 0
    for k, (at, gear) in enumerate(orders):
        end = min(orders[k + 1][0] if k + 1 < len(orders) else t[-1], at + WATCHED)
        within, before = (t >= at) & (t <= end), (t >= at - 0.2) & (t < at)
        if last and gear and last != gear:
            low, high, most = (float(one) for one in (speed[within].min(), speed[within].max(), torque[within].max()))
            broken = [
                words
                for words, is_so in (
                    ("stalls", low < config.motor.stall_speed),
                    ("below idle", low < config.motor.idle_speed),
                    ("above 2400 rpm", high > FASTEST),
                    ("above 271 Nm", most > LARGEST),
                )
                if is_so
            ]
            n, m = float(speed[before].mean()), float(out[before].mean())
            rows.append((f"{names[last]}-{names[gear]}", n, m, low, high, most, ", ".join(broken) or "yes", float(not broken)))
        last = gear
    return Table(
        "Shifts of the recording with speed and load before the order, extremes of speed and torque at the input, and whether the "
        "engine survives (1) or why not.",
        {
            "shift": "",
            "n_wej": "rpm",
            "M_wyj": "Nm",
            "lowest": "rpm",
            "highest": "rpm",
            "M_wej": "Nm",
            "survives": "",
            "verdict": "-",
        },
        rows,
    )


CALCULATIONS = {"curve": curve, "largest": largest, "grid": grid, "climb": climb, "coast_down": coast_down, "survival": survival}
