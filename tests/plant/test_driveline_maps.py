# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Torques and capacities over two quantities: converters, engine maps and others, compared with scipy and closed forms."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import RegularGridInterpolator

from rig_nodes.base.errors import RigError
from rig_nodes.driveline.builder import Driveline
from rig_nodes.driveline.run import Run, run
from rig_nodes.driveline.vibration import modes

RATIOS, LAMBDAS = [0.0, 0.2, 0.4, 0.6, 0.8, 0.88, 0.95, 1.0], np.array([1.9, 1.9, 1.85, 1.75, 1.5, 1.3, 0.8, 0.0]) * 1e-3
MULTIPLIED = [2.2, 1.9, 1.6, 1.35, 1.1, 1.0, 1.0, 1.0]  # torque of the turbine over that of the pump (assumed)
PUMP = np.linspace(0.0, 600.0, 1201)


def closes(r):
    flowed = 1e-9 + np.abs(np.diff(r.e_in)).sum() + r.stored.max()
    return np.abs(r.residual()).max() < 1e-9 * flowed and r.capped == 0


def taken(pump, turbine):
    """Torque lambda n^2 that the pump of a converter takes."""
    return np.interp(turbine / pump, RATIOS, LAMBDAS) * pump**2


def test_a_converter_near_its_coupling_point_is_smooth_at_1_ms():
    """A turbine of 0.001 kg m2 follows its pump with 4800 1/s, five times in a step."""
    d = Driveline()
    d.inertia("pump", 0.2, speed=300.0)
    d.inertia("turbine", 0.001, speed=290.0)
    table = RATIOS, PUMP, -np.outer(LAMBDAS, PUMP**2)
    d.torque("fluid", "pump", "turbine", by=("ratio", "speed"), of=(("turbine", "pump"), "pump"), table=table)
    r = run(d.build(), 0.5, 1e-3, {"pump": 60.0, "turbine": -60.0})

    def rate(t, y):
        return [(60.0 - taken(*y)) / 0.2, (taken(*y) - 60.0) / 0.001]

    truth = solve_ivp(rate, (0.0, 0.5), [300.0, 290.0], method="Radau", rtol=1e-9, atol=1e-9, t_eval=r.t)
    assert np.abs(r.speeds - truth.y.T).max() < 1e-4 * 300.0
    assert np.abs(np.diff(r.speed("turbine")[20:])).max() < 1e-6 and closes(r)


def test_a_converter_with_a_stator_multiplies_torque_until_its_turbine_has_caught_up():
    d = Driveline()
    d.inertia("engine", 0.2, speed=100.0)
    d.inertia("car", 12.0)
    of = ("turbine", "pump")
    d.inertia("pump", 0.0)
    d.inertia("turbine", 0.0)
    d.gear("pump", "engine", 1.0)
    d.gear("turbine", "car", 2.5)
    table = RATIOS, PUMP, np.outer(LAMBDAS, PUMP**2)
    d.torque("pumped", "pump", by=("ratio", "speed"), of=(of, "pump"), table=(*table[:2], -table[2]))
    d.torque("driven", "turbine", by=("speed", "ratio"), of=("pump", of), table=(PUMP, RATIOS, (table[2] * np.c_[MULTIPLIED]).T))
    r = run(d.build(), 6.0, 1e-3, {"engine": 120.0, "car": -60.0})

    def rate(t, y):
        pump, turbine = y[0], 2.5 * y[1]
        push = taken(pump, turbine)
        more = np.interp(turbine / pump, RATIOS, LAMBDAS * MULTIPLIED) * pump**2
        return [(120.0 - push) / 0.2, (2.5 * more - 60.0) / 12.0]

    truth = solve_ivp(rate, (0.0, 6.0), [100.0, 0.0], rtol=1e-9, atol=1e-9, max_step=0.01, t_eval=r.t)
    assert np.abs(r.speeds[:, :2] - truth.y.T).max() < 1e-4 * 300.0 and r.speed("turbine")[-1] > 0.9 * r.speed("pump")[-1]
    assert r.torque("driven")[0] == pytest.approx(-2.2 * r.torque("pumped")[0]) and closes(r)


SPEEDS, THROTTLES = np.array([0.0, 100.0, 200.0, 350.0, 500.0]), np.array([0.0, 0.2, 0.6, 1.0])
ENGINE = np.array([[0.0, 60, 120, 150], [-10, 70, 150, 200], [-20, 50, 160, 230], [-35, 10, 120, 220], [-60, -30, 40, 90]])


def engine(load):
    d = Driveline()
    d.inertia("engine", 0.25, speed=90.0)
    d.torque("map", "engine", by=("speed", "input"), of=(None, "throttle"), table=(SPEEDS, THROTTLES, ENGINE))
    d.torque("load", "engine", table=([0.0, 600.0], [0.0, -load]))
    return d.build()


def test_an_engine_map_over_speed_and_throttle_is_of_second_order():
    def throttle(t):
        return 0.5 - 0.5 * math.cos(4.0 * t)

    at = RegularGridInterpolator((SPEEDS, THROTTLES), ENGINE)
    truth = solve_ivp(
        lambda t, y: [(at((y[0], throttle(t))) - 0.2 * y[0]) / 0.25], (0.0, 2.0), [90.0], rtol=1e-9, atol=1e-9, max_step=1e-3
    )
    ends = [run(engine(120.0), 2.0, step, {"throttle": throttle}) for step in (8e-3, 4e-3, 1e-3)]
    errors = [abs(one.speeds[-1, 0] - truth.y[0, -1]) for one in ends]
    assert errors[2] < 1e-6 * 300.0 and errors[0] > 2.5 * errors[1] and all(map(closes, ends))
    assert ends[2].torque("map")[-1] == pytest.approx(at((ends[2].speeds[-1, 0], throttle(2.0))).item())


def test_a_controller_holds_the_speed_of_an_engine_by_the_throttle_of_its_map():
    one = Run(engine(60.0), 1e-3, controller=lambda now: {"throttle": min(1.0, max(0.0, 0.02 * (250.0 - now.speed("engine"))))})
    one.to(3.0)
    speed = one.result().speed("engine")[-1]
    at = RegularGridInterpolator((SPEEDS, THROTTLES), ENGINE)
    assert at((speed, 0.02 * (250.0 - speed))) == pytest.approx(0.1 * speed, abs=0.1) and 230.0 < speed < 250.0


def test_a_capacity_over_slip_and_an_input_brakes_as_its_closed_form():
    """J dw/dt = -(20 + 0.5 w) p, which a table of four points holds exactly, with p = t: ln((40 + w0) / (40 + w)) = t^2 / (4 J)."""
    d = Driveline()
    d.inertia("a", 0.5, speed=100.0)
    d.brake("b", "a")
    d.capacity("b", ("b", "press"), by=("speed", "input"), table=([0.0, 200.0], [0.0, 4.0], [[0.0, 80.0], [0.0, 480.0]]))
    r = run(d.build(), 1.0, 1e-3, {"press": ([0.0, 4.0], [0.0, 4.0])})
    assert r.speed("a") == pytest.approx(140.0 * np.exp(-(r.t**2) / 2.0) - 40.0, abs=1e-4) and closes(r)
    assert r.torque("b")[-1] == pytest.approx(20.0 + 0.5 * r.speed("a")[-1])


def test_a_torque_over_angle_and_time_swings_a_pendulum_whose_weight_grows():
    angles, times = np.linspace(-math.pi, math.pi, 2001), np.linspace(0.0, 4.0, 41)
    d = Driveline()
    d.inertia("pendulum", 0.5)
    table = angles, times, -np.outer(8.0 * np.sin(angles), 1.0 + times)
    table[2][[0, -1]] = 0.0
    d.torque("weight", "pendulum", by=("angle", "time"), table=table, period=2.0 * math.pi, angle=2.0)
    r = run(d.build(), 4.0, 1e-4)
    truth = solve_ivp(
        lambda t, y: [-16.0 * (1.0 + t) * math.sin(y[1]), y[0]], (0.0, 4.0), [0.0, 2.0], rtol=1e-10, atol=1e-10, t_eval=r.t
    )
    assert np.abs(r.speed("pendulum") - truth.y[0]).max() < 1e-4 * np.abs(truth.y[0]).max() and closes(r)


def test_modes_take_both_slopes_of_a_torque_over_two_quantities():
    def built(**torque):
        d = Driveline()
        d.inertia("a", 0.2, speed=50.0)
        d.inertia("b", 0.3, speed=30.0)
        d.shaft("s", "a", "b", stiffness=500.0)
        d.torque("t", "a", **torque)
        return modes(d.build())

    plane = [[0.5 * x + 0.2 * u for u in (0.0, 100.0)] for x in (0.0, 100.0)]
    both = built(by=("speed", "speed"), of=("a", "b"), table=([0.0, 100.0], [0.0, 100.0], plane))
    turned = built(by=("ratio", "speed"), of=(("b", "a"), "a"), table=([0.0, 1.0], [0.0, 100.0], [[0.0, 0.0], [0.0, 100.0]]))
    # (w_b / w_a) w_a has the slope 1 over w_b and none over w_a
    alone = built(by=("speed", "speed"), of=("a", "b"), table=([0.0, 100.0], [0.0, 100.0], [[0.0, 100.0], [0.0, 100.0]]))
    assert both.damping[-1] < 0.0 and turned.frequencies == pytest.approx(alone.frequencies)
    assert turned.damping == pytest.approx(alone.damping)


@pytest.mark.parametrize(
    ("torque", "sentence"),
    [
        ({"table": ([0, 1], [0, 1], [[1, 2]])}, "in as many rows as the first has points"),
        ({"table": ([0, 0], [0, 1], [[1, 2], [3, 4]])}, "two points or more of each quantity, all rising; it cannot jump"),
        ({"by": ("speed", "sped")}, "is by 'sped'; speed, angle, ratio, input, time, state are possible"),
        ({"by": ("time", "input"), "of": (None, "x")}, "one of the two must be a speed, an angle or a state"),
        ({"by": ("speed", "input"), "of": (None, "b")}, "the name 'b' is already taken"),
        ({"by": ("speed", "input"), "of": (None, "t")}, "the name 't' is already taken"),
        ({"by": ("speed", "ratio"), "of": (None, "a")}, "by ratio is of 'a'; two names are needed"),
        ({"by": ("angle", "speed"), "period": 1.0}, "ends with other values than it begins with"),
        ({"by": ("speed", "time"), "period": 1.0}, "only a table over an angle repeats"),
    ],
)
def test_a_wrong_table_over_two_quantities_is_refused_in_words(torque, sentence):
    d = Driveline()
    d.inertia("a", 0.5)
    d.inertia("b", 0.5)
    with pytest.raises(RigError, match=sentence):
        d.torque("t", "a", **{"by": ("speed", "time"), "table": ([0, 1], [0, 1], [[1, 2], [3, 4]]), **torque})
