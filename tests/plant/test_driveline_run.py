# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Running a driveline from Python: results by name, stopping and continuing, a controller in the loop, long tables."""

import copy
import math
import subprocess
import sys
import time

import numpy as np
import pytest

from rig_nodes.base.errors import RigError
from rig_nodes.driveline.builder import Driveline
from rig_nodes.driveline.run import Run, run
from rig_nodes.driveline.vibration import modes

K = 2.5  # teeth of a set's ring over those of its sun


def engagement(stick=1.0):
    d = Driveline()
    d.inertia("a", 0.7, speed=100.0)
    d.inertia("b", 0.127)
    d.clutch("c", "a", "b", stick=stick)
    return d.build()


def test_angles_are_exact_through_an_event_inside_a_step():
    r = run(engagement(), 1.0, 0.25, {"c": 30.0})
    lock = 100.0 / (30.0 / 0.7 + 30.0 / 0.127)
    common = 70.0 / 0.827
    assert r.angle("a")[-1] == pytest.approx(0.5 * (100.0 + common) * lock + common * (1.0 - lock), rel=1e-12)
    assert r.angle("b")[-1] == pytest.approx(0.5 * common * lock + common * (1.0 - lock), rel=1e-12)
    assert r.slip("c")[0] == 100.0 and abs(r.slip("c")[-1]) < 1e-12


def test_an_event_comes_with_the_speeds_of_all_bodies():
    r = run(engagement(), 1.0, 0.25, {"c": 30.0})
    at = [e.kind for e in r.events].index("lock")
    assert r.event_speeds.shape == (len(r.events), 2)
    assert r.event_speeds[at] == pytest.approx([70.0 / 0.827] * 2, rel=1e-12)
    assert r.event_angles[at] == pytest.approx(0.5 * r.events[at].t * np.array([100.0 + 70.0 / 0.827, 70.0 / 0.827]), rel=1e-12)


def test_the_torque_in_a_gear_is_what_its_wheels_lack_to_accelerate():
    d = Driveline()
    d.inertia("motor", 0.1)
    d.inertia("wheel", 2.0)
    d.gear("motor", "wheel", 5.0)
    r = run(d.build(), 1.0, 0.1, {"motor": 3.0, "wheel": -1.0})
    gain = (5.0 * 3.0 - 1.0) / (2.0 + 25.0 * 0.1)
    assert r.torque("motor-wheel", "motor") == pytest.approx(0.1 * 5.0 * gain - 3.0, rel=1e-12)
    assert r.torque("motor-wheel", "wheel") == pytest.approx(2.0 * gain + 1.0, rel=1e-12)
    assert r.accelerations()[:, 1] == pytest.approx(gain, rel=1e-12)


def test_the_torques_on_the_members_of_a_planetary_set_stand_as_its_teeth():
    """With a brake on the ring and a shaft behind the carrier they are always 1 to k to -(1 + k) on sun, ring, carrier (Willis)."""
    d = Driveline()
    d.inertia("sun", 0.2)
    d.inertia("ring", 0.7)
    d.inertia("carrier", 0.5)
    d.inertia("wheel", 3.0)
    d.planetary("set", "sun", "ring", "carrier", K)
    d.brake("low", "ring")
    d.shaft("shaft", "carrier", "wheel", stiffness=900.0, damping=1.0)
    r = run(d.build(), 0.5, 1e-3, {"sun": 20.0, "low": 500.0})
    sun, ring, carrier = (r.torque("set", body) for body in ("sun", "ring", "carrier"))
    assert sun == pytest.approx(0.2 * r.accelerations()[:, 0] - 20.0, abs=1e-9)
    assert ring == pytest.approx(K * sun, abs=1e-9) and carrier == pytest.approx(-(1.0 + K) * sun, abs=1e-9)
    assert r.torque("low") == pytest.approx(ring, abs=1e-9)
    assert carrier - 0.5 * r.accelerations()[:, 2] == pytest.approx(r.torque("shaft"), abs=1e-9)
    assert np.ptp(r.torque("shaft")) > 30.0


def test_row_0_has_the_torques_of_the_start():
    d = Driveline()
    d.inertia("a", 2.0)
    d.inertia("b", 1.0)
    d.brake("held", "a")
    d.shaft("s", "a", "b", stiffness=100.0, twist=0.1)
    r = run(d.build(), 0.1, 1e-3, {"a": 3.0, "held": 50.0})
    assert r.torque("held")[0] == pytest.approx(3.0 - 10.0) and r.torque("s")[0] == pytest.approx(10.0)
    assert r.accelerations()[0] == pytest.approx([0.0, 10.0], abs=1e-9)
    assert r.e_in[0] == 0.0 and r.impulse[0, 0] == 0.0 and r.stored[0] == pytest.approx(0.5)


def shifting():
    d = Driveline()
    for name, j, speed in (("a", 0.7, 90.0), ("b", 0.2, 0.0), ("c", 1.1, 20.0)):
        d.inertia(name, j, speed=speed)
    d.clutch("ab", "a", "b", stick=1.2)
    d.clutch("bc", "b", "c", drag=0.01)
    d.shaft("s", "a", "c", stiffness=300.0, damping=0.4)
    inputs = {"a": lambda t: 20.0 * math.sin(7.0 * t), "ab": ([0.0, 0.5, 0.5, 2.0], [0.0, 60.0, 0.0, 90.0]), "bc": 9.0}
    return d.build(), inputs


def test_a_run_that_is_stopped_and_continued_gives_the_same_bits():
    system, inputs = shifting()
    whole = run(system, 2.0, 1e-3, inputs)
    pieces = Run(system, 1e-3, inputs)
    pieces.step()
    assert pieces.t == 1e-3
    for stop in (0.3, 0.5, 0.501, 1.7):
        pieces.to(stop)
    other = copy.deepcopy(pieces)
    for one in (pieces, other):
        one.to(2.0)
        r = one.result()
        for name in ("t", "speeds", "angles", "modes", "torques", "twists", "e_in", "e_fric", "event_speeds"):
            assert np.array_equal(getattr(r, name), getattr(whole, name)), name
        assert r.events == whole.events and len(r.events) > 5


def test_a_controller_is_called_every_so_many_steps_and_its_torque_holds_between():
    """A sampled proportional speed controller has the closed form of its difference equation."""
    d = Driveline()
    d.inertia("a", 0.5)
    gain, target, called = 20.0, 80.0, []

    def controller(now):
        called.append(now.t)
        return {"a": gain * (target - now.speed("a"))}

    r = run(d.build(), 1.0, 1e-3, controller=controller, every=10)
    left = 1.0 - gain * 0.01 / 0.5
    assert r.speed("a")[::10] == pytest.approx(target * (1.0 - left ** np.arange(101)), rel=1e-9)
    assert called == pytest.approx(np.arange(100) * 0.01) and len(r.t) == 1001


def test_a_controller_sees_slip_and_sets_a_capacity():
    """The controller makes the slip fall along a straight line, which each row meets from one step to the next."""

    def controller(now):
        wanted = max(0.0, 100.0 - 200.0 * (now.t + 1e-3))
        ask = (now.slip("c") - wanted) / (1e-3 * (1.0 / 0.7 + 1.0 / 0.127))
        return {"c": 40.0 if now.locked("c") else max(0.0, ask)}

    r = run(engagement(), 1.0, 1e-3, controller=controller)
    sliding = r.t < 0.499
    assert r.slip("c")[sliding] == pytest.approx(100.0 - 200.0 * r.t[sliding], abs=1e-8)
    assert [e.t for e in r.events if e.kind == "lock"] == pytest.approx([0.5], abs=1e-9)


def test_inputs_may_be_set_by_hand_between_steps():
    d = Driveline()
    d.inertia("a", 2.0)
    one = Run(d.build(), 0.01, {"a": 4.0})
    assert one.to(0.5).speed("a") == pytest.approx(1.0)
    one.set(a=-2.0)
    now = one.step(50)
    assert (now.t, now.speed("a"), now.angle("a")) == pytest.approx((1.0, 0.5, 0.25 + 0.375))
    assert one.result().torques.shape == (101, 0)


@pytest.mark.parametrize("step, points", [(1e-3, 100_001), (2e-4, 77_777)])
def test_a_table_of_100_000_points_costs_no_more_than_a_function(step, points):
    def torque(t):
        return 30.0 * math.sin(9.0 * t) + 4.0 * math.sin(300.0 * t)

    system, inputs = engagement(stick=1.1), {}
    times = np.linspace(0.0, 10.0, points)
    table = times, np.array([torque(t) for t in times])
    took, ends = {}, {}
    for name, signal in (("table", table), ("function", torque)):
        inputs["a"], inputs["c"] = signal, 60.0
        took[name] = math.inf
        for _ in range(3):
            begin = time.process_time()
            r = run(system, 10.0, step, inputs)
            took[name] = min(took[name], time.process_time() - begin)
        ends[name] = r.speeds[-1]
        assert len(r.t) == round(10.0 / step) + 1
    assert took["table"] < 1.5 * took["function"] + 0.01
    driven = 30.0 / 9.0 * (1.0 - math.cos(90.0)) + 4.0 / 300.0 * (1.0 - math.cos(3000.0))
    assert ends["table"] == pytest.approx([(70.0 + driven) / 0.827] * 2, abs=2e-5)


def test_a_table_finer_than_the_step_keeps_its_impulse():
    rng = np.random.default_rng(5)
    times, values = np.sort(rng.uniform(0.0, 2.0, 50_000)), rng.uniform(-100.0, 100.0, 50_000)
    d = Driveline()
    d.inertia("a", 1.0)
    r = run(d.build(), 3.0, 1e-2, {"a": (times, values)})
    inside = 0.5 * np.sum((values[1:] + values[:-1]) * np.diff(times))
    assert r.speeds[-1, 0] == pytest.approx(times[0] * values[0] + inside + (3.0 - times[-1]) * values[-1], abs=1e-9)
    assert len(r.t) == 301


@pytest.mark.parametrize(
    "act, words",
    [
        (lambda s: Run(s, 0.0), "a step of 0.0 s"),
        (lambda s: Run(s, 0.1, every=0), "called every 0 steps"),
        (lambda s: run(s, -1.0, 0.1), "end time -1.0 s"),
        (lambda s: Run(s, 0.1).to(math.inf), "end time inf s"),
        (lambda s: Run(s, 0.1, {"c": "much"}), "input 'c' is 'much'; a number, a function of time or a table"),
        (lambda s: Run(s, 0.1, {"c": np.zeros((3, 3))}), "input 'c' is array.* a number, a function of time or a table"),
        (lambda s: modes(s, locked=np.zeros((2, 2))), "locked is array.* a list of names"),
        (lambda s: Run(s, 0.1, {"c": ([0.0, 1.0], [1.0, math.nan])}), "table for 'c' is not finite"),
        (lambda s: Run(s, 0.1, {"c": ([1.0, 0.0], [1.0, 2.0])}), "times not falling"),
        (lambda s: Run(s, 0.1, controller=lambda now: {"d": 1.0}).step(), "no input 'd'; inputs are: a, b, c"),
        (lambda s: Run(s, 0.1, controller=lambda now: {"c": -1.0}).step(), "capacity of 'c' falls to -1"),
        (lambda s: run(s, 1.0, 0.1).speed("d"), "no body 'd'; there are: a, b"),
        (lambda s: run(s, 1.0, 0.1).torque("d"), "no clutch, shaft, gear or set 'd'; there are: c"),
    ],
)
def test_refuses_in_one_sentence(act, words):
    with pytest.raises(RigError, match=words) as refusal:
        act(engagement())
    assert refusal.value.exit_code == 2 and "\n" not in str(refusal.value)


def test_a_gears_torque_wants_one_of_its_bodies():
    d = Driveline()
    d.inertia("a", 1.0)
    d.inertia("b", 1.0)
    d.gear("a", "b", 2.0, "wheels")
    with pytest.raises(RigError, match="'wheels' puts torques on a and b; name one of them"):
        run(d.build(), 1.0, 0.1).torque("wheels")


def test_elements_that_a_description_does_not_use_have_no_compiled_code():
    """A process that runs only clutches and shafts neither compiles nor loads anything for tables and motions."""
    code = """
from rig_nodes.driveline.builder import Driveline
from rig_nodes.driveline.kernel import driveline_step
from rig_nodes.driveline.law_steps import run_laws, settled_step
from rig_nodes.driveline.run import run

def compiled():
    print(len(driveline_step.signatures), len(settled_step.signatures), len(run_laws.signatures))

d = Driveline()
for name in "abc":
    d.inertia(name, 1.0)
d.clutch("k", "a", "b")
d.shaft("s", "b", "c", stiffness=1e3)
run(d.build(), 0.1, 1e-3, {"a": 5.0, "k": 2.0})
compiled()
d.inertia("d", 1.0)
d.mesh("m", "c", "d", 2.0, 0.9)
run(d.build(), 0.1, 1e-3, {"a": 5.0, "k": 2.0})
compiled()
"""
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.splitlines()
    assert out == ["1 0 0", "1 1 1"]
