# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The elements against published results of the Modelica Standard Library's examples (Modelica.Mechanics.Rotational.Examples).

The figures are single values of the reference results that the Modelica Association publishes for regression tests
(github.com/modelica/MAP-LIB_ReferenceResults, one CSV for each example). They are results of another solver with a tolerance
of its own: speeds are compared to 1e-4 of the largest speed, events to 1e-5 s, all at a step of 100 us.
tests/plant/test_coupled_clutches.py does the same for CoupledClutches.
"""

import math

import numpy as np
import pytest

from rig_nodes.driveline.builder import Driveline
from rig_nodes.driveline.run import run

STEP = 1e-4


def closes(r):
    flowed = 1e-9 + np.abs(np.diff(r.e_in)).sum() + r.stored.max()
    return np.abs(r.residual()).max() < 1e-9 * flowed and r.capped == 0


def agrees(r, what, published):
    """Checks a row of a result at the published times to 1e-4 of its largest size."""
    at = [np.argmin(np.abs(r.t - t)) for t, _ in published]
    assert np.abs(r.t[at] - [t for t, _ in published]).max() < 1e-9
    assert what[at] == pytest.approx([value for _, value in published], abs=1e-4 * np.abs(what).max())


def events(r, published, after=0.0):
    """Checks that after a time the events are the published ones, to 1e-5 s, and no others."""
    seen = [e for e in r.events if e.t > after]
    assert [(e.element, e.kind) for e in seen] == [one[1:] for one in published]
    assert [e.t for e in seen] == pytest.approx([one[0] for one in published], abs=1e-5)


def test_lossy_gear_demo_1_a_mesh_of_efficiency_one_half_drives_both_ways_and_sticks():
    d = Driveline()
    d.inertia("a", 1.0)
    d.inertia("b", 1.5)
    d.mesh("gear", "a", "b", 2.0, 0.5)
    inputs = {"a": lambda t: 10.0 * math.sin(2.0 * math.pi * t), "b": lambda t: -10.0 + 2.5 * t}
    r = run(d.build(), 0.5, STEP, inputs)
    speeds = [(0.01, -0.00919082119), (0.04, -0.02084149997), (0.06, -0.01562560759), (0.25, 0.00569808854), (0.3, 0.01318118017)]
    agrees(r, r.speed("b"), [*speeds, (0.36, 0.00523145435), (0.47, -0.00038170992)])
    agrees(r, r.angle("b"), [(0.1, -0.00111688795), (0.4, 0.00020835793)])
    gear = "gear loss"
    events(
        r,
        [(0.0804771289, gear, "lock"), (0.1995199008, gear, "break"), (0.3713427450, gear, "lock"), (0.4645394616, gear, "break")],
        after=1e-6,
    )
    assert closes(r)


def test_simple_gear_shift_a_planetary_set_a_brake_a_clutch_and_a_load_by_the_square_of_its_speed():
    speeds = np.linspace(-20.0, 20.0, 8001)
    d = Driveline()
    d.inertia("engine", 1.0)
    d.inertia("ring", 0.0)
    d.inertia("load", 10.0)
    d.planetary("set", "engine", "ring", "load", 75.0 / 50.0)
    d.clutch("clutch", "engine", "ring")
    d.brake("brake", "ring")
    d.torque("air", "load", table=(speeds, -20.0 * speeds * np.abs(speeds) / 10.471975511966**2))
    inputs = {
        "engine": ([0.0, 0.5, 0.5, 5.0], [0.0, 0.0, 20.0, 20.0]),
        "clutch": ([0.0, 2.0, 2.1, 5.0], [0.0, 0.0, 100.0, 100.0]),
        "brake": ([0.0, 2.0, 2.1, 5.0], [100.0, 100.0, 0.0, 0.0]),
    }
    r = run(d.build(), 5.0, STEP, inputs)
    agrees(r, r.speed("engine"), [(1.0, 3.835122367), (2.0, 11.248623326), (2.05, 11.041758059), (2.1, 6.625091392)])
    agrees(
        r, r.speed("load"), [(1.0, 1.534048947), (2.05, 4.470135609), (2.08, 4.608982822), (2.4, 5.436555458), (5.0, 8.090029944)]
    )
    published = [
        (2.0, "clutch", "close"),
        (2.0408163582, "brake", "break"),
        (2.1, "brake", "free"),
        (2.1107903792, "clutch", "lock"),
    ]
    events(r, published, after=0.6)
    assert closes(r)


def test_friction_a_clutch_a_brake_and_a_shaft_between_them():
    d = Driveline()
    for name, j, speed in (("motor", 1.0, 100.0), ("middle", 0.05, 90.0), ("wheel", 1.0, 90.0)):
        d.inertia(name, j, speed=speed)
    d.clutch("clutch", "motor", "middle")
    d.shaft("spring", "middle", "wheel", stiffness=160.0, damping=1.0)
    d.brake("brake", "wheel")
    inputs = {
        "motor": lambda t: 200.0 * math.sin(100.0 * t) * (t < 0.5),
        "clutch": 80.0,
        "brake": ([0.0, 0.5, 0.5, 3.0], [0.0, 0.0, 800.0, 800.0]),
    }
    r = run(d.build(), 3.0, STEP, inputs, breakpoints=[0.5])
    speeds = [
        (0.005, 99.844835),
        (0.0285, 102.4810088),
        (0.5, 91.7871567),
        (0.53, 90.6621252),
        (0.54, 89.8912431),
        (3.0, 2.2898910),
    ]
    agrees(r, r.speed("motor"), speeds)
    times = [e.t for e in r.events if e.element == "clutch" and e.t > 0.0]
    assert times[0] == pytest.approx(0.006779709, abs=1e-5) and min(times, key=lambda t: abs(t - 0.534248645)) == pytest.approx(
        0.534248645, abs=1e-5
    )
    assert closes(r)


def test_one_way_clutch_a_free_wheel_beside_a_clutch():
    d = Driveline()
    d.inertia("in", 1.0, speed=-0.5)
    d.inertia("out", 1.0)
    d.freewheel("free-wheel", "in", "out")
    d.clutch("engaged", "in", "out", stick=25.0)
    pulses = ([0.0, 0.3, 0.3, 0.95, 0.95, 1.6, 1.6, 2.0], [0.0, 0.0, 1.5, 1.5, 0.0, 0.0, 1.5, 1.5])
    r = run(d.build(), 2.0, STEP, {"in": lambda t: 10.0 * math.sin(6.0 * math.pi * t), "engaged": pulses})
    agrees(r, r.speed("in"), [(0.05, -0.2813138477), (0.09, 0.0485022178), (0.3, -0.6791924079), (0.36, -0.6248935369)])
    agrees(r, r.speed("in"), [(0.392, -0.3498729775), (1.97, -0.2086882725), (2.0, -0.2499789142)])
    locks = next(e.t for e in r.events if (e.element, e.kind) == ("free-wheel", "lock"))
    assert locks == pytest.approx(0.0802800431, abs=1e-5)
    agrees(r, r.slip("engaged"), [(0.3, -0.9597133932), (0.36, -0.8154145222), (0.392, -0.4923939628), (2.0, 0.0)])
    assert closes(r)


def test_elastic_bearing_a_relation_between_a_gear_and_its_housing():
    """The gear of ratio 3 turns on a housing that swings: w_shaft - w_housing = 3 (w_out - w_housing)."""
    d = Driveline()
    for name, j in (("shaft", 1.0), ("housing", 5.0), ("load", 50.0), ("out", 0.0)):
        d.inertia(name, j)
    d.relation("gear", {"shaft": 1.0, "out": -3.0, "housing": 2.0})
    d.shaft("spring", "out", "load", stiffness=1e3)
    d.shaft("bearing", "housing", "ground", stiffness=1e5, damping=5.0)
    r = run(d.build(), 10.0, STEP, {"shaft": ([0.0, 5.0, 10.0], [0.0, 100.0, 100.0])})
    agrees(r, r.speed("shaft"), [(0.2, 0.275913624), (0.4, 0.3923499074), (0.6, 0.5698031763), (10.0, 114.462801283)])
    agrees(r, r.speed("load"), [(0.2, 0.0074451828), (0.4, 0.0724590058), (0.6, 0.1818118096), (10.0, 38.1322319232)])
    agrees(r, r.angle("housing"), [(0.2, -4.5200754e-05), (0.4, -1.65137746e-04), (0.6, -1.87225643e-04), (10.0, -1.683893462e-03)])
    assert closes(r)


def test_backlash_a_spring_and_damper_and_the_first_contact_of_one_with_backlash():
    """The first contact opens at 0.02366 s, where its damper would begin to pull, and the wheel turns freely through the gap.

    Later contacts are not compared: ElastoBacklash also limits the damping at the beginning of a contact to the torque of the
    spring, which this shaft does not do.
    """
    for gap, end, published, twist in (
        (0.0, 1.0, [(0.02, -85.880065173), (0.05, 0.836918958), (0.075, 68.485139332), (1.0, -0.143703314)], (1.0, 0.0105180348)),
        (
            0.25 * math.pi,
            0.038,
            [(0.01, -41.914423581), (0.02, -64.410048879), (0.024, -66.196494975), (0.038, -66.196494975)],
            (0.038, -0.3911192170),
        ),
    ):
        d = Driveline()
        d.inertia("wheel", 5.0)
        d.shaft("spring", "wheel", "ground", stiffness=20e3, damping=50.0, twist=0.5 * math.pi, backlash=gap)
        r = run(d.build(), end, STEP)
        agrees(r, r.speed("wheel"), published)
        agrees(r, r.twists[:, 0], [twist])
        assert closes(r)
