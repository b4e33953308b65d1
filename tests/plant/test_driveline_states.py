# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""States, as temperatures, that take in what elements lose and on which laws depend, compared with closed forms and scipy."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from rig_nodes.base.errors import RigError
from rig_nodes.driveline.builder import Driveline
from rig_nodes.driveline.run import run
from rig_nodes.driveline.vibration import modes


def closes(r):
    flowed = 1e-9 + np.abs(np.diff(r.e_in)).sum() + r.stored.max()
    return np.abs(r.residual()).max() < 1e-9 * flowed and r.capped == 0


def pulled(speed, kelvin):
    """Torque of an eddy current brake by Kloss: 100 Nm at 10 rad/s and 293.15 K, whose copper takes on resistance as it warms."""
    share = speed / (10.0 * (1.0 + 3.92e-3 * (kelvin - 293.15)))
    return 200.0 * share / (1.0 + share * share)


@pytest.mark.parametrize("step", [1e-3, 1e-4])
def test_eddy_current_brake_of_the_modelica_standard_library_warms_and_fades(step):
    """Published results of EddyCurrentBrake with full excitation from the start (tests/plant/test_driveline_published.py)."""
    d = Driveline()
    d.inertia("wheel", 1.0, speed=20.0)
    d.state("disc", 1.0, 293.15)
    speeds, kelvins = np.linspace(0.0, 20.0, 401), np.linspace(293.15, 500.0, 101)
    table = speeds, kelvins, -pulled(*np.meshgrid(speeds, kelvins, indexing="ij"))
    d.torque("brake", "wheel", by=("speed", "state"), of=(None, "disc"), table=table)
    d.heat("disc", "brake")
    r = run(d.build(), 1.0, step)
    published = [
        (0.05, 373.55433714906599, 0.89062731401255513),
        (0.1, 437.39678902485889, 1.5399938347353128),
        (0.2, 485.76498337114828, 2.21600853228863),
        (0.5, 493.14072315496401, 2.5502703181904445),
        (1.0, 493.14984771874254, 2.5622780615885228),
    ]
    at = np.searchsorted(r.t, [t - 1e-9 for t, *_ in published])
    assert r.state("disc")[at] == pytest.approx([kelvin for _, kelvin, _ in published], rel=1e-5)
    assert r.angle("wheel")[at] == pytest.approx([angle for *_, angle in published], rel=1e-5)
    # all the kinetic energy has become heat
    assert r.state("disc") - 293.15 == pytest.approx(200.0 - 0.5 * r.speed("wheel") ** 2, abs=2e-7) and closes(r)


def test_a_hot_brake_fades_and_cools_as_by_scipy():
    """Closed by J w' = -tau and C T' = 0.9 tau w - G T with tau = 60 (1 - T / 200): the ground is at 0."""
    d = Driveline()
    d.inertia("drum", 2.0, speed=100.0)
    d.state("lining", 80.0)
    d.brake("shoe", "drum")
    d.capacity("shoe", "lining", by="state", table=([0.0, 150.0], [60.0, 15.0]))
    d.heat("lining", "shoe", share=0.9)
    d.shaft("air", "lining", "ground", stiffness=0.0, damping=5.0)
    r = run(d.build(), 3.0, 1e-3)
    rate = lambda t, y: [-30.0 * (1.0 - y[1] / 200.0), (54.0 * (1.0 - y[1] / 200.0) * y[0] - 5.0 * y[1]) / 80.0]  # noqa: E731
    truth = solve_ivp(rate, (0.0, 3.0), [100.0, 0.0], rtol=1e-11, atol=1e-11, t_eval=r.t)
    assert np.abs(r.speed("drum") - truth.y[0]).max() < 1e-5 * 100.0
    assert np.abs(r.state("lining") - truth.y[1]).max() < 1e-5 * truth.y[1].max() and truth.y[1].max() > 80.0
    assert closes(r) and r.e_fric[-1].sum() == pytest.approx(r.stored[0] - r.stored[-1])


def test_what_shafts_springs_clutches_and_meshes_lose_is_what_their_states_take_in():
    d = Driveline()
    for name in ("a", "b", "c", "e"):
        d.inertia(name, 0.2, speed=20.0 * (name == "a"))
    d.shaft("damped", "a", "b", stiffness=500.0, damping=2.0)
    d.shaft("iwan", "b", "c", stiffness=300.0, hysteresis=[(800.0, 3.0), (400.0, 6.0)])
    d.inertia("f", 0.1)
    d.mesh("teeth", "c", "e", 2.0, 0.9)
    d.clutch("plates", "e", "f", drag=0.01)
    for name in ("damped", "iwan", "teeth", "plates"):
        d.state(f"of {name}", 10.0, 300.0)
        d.heat(f"of {name}", name)
    system = d.build()
    r = run(system, 0.5, 1e-4, {"plates": 5.0, "a": 30.0})
    lost = dict(zip(system.shafts, r.e_shaft.T)) | dict(zip(system.elements, (r.e_fric + r.e_visc).T))
    for name in ("damped", "iwan", "plates"):
        assert 10.0 * (r.state(f"of {name}") - 300.0) == pytest.approx(lost[name], abs=1e-8) and lost[name][-1] > 0.1
    assert 10.0 * (r.state("of teeth") - 300.0) == pytest.approx(lost["teeth loss"], abs=1e-8) and closes(r)


def test_states_conduct_to_each_other_and_take_a_flow_as_in_closed_form():
    """Two equal states with a conductor: their sum takes the flow in, and their difference d follows C d' = P - 2 G d."""
    d = Driveline()
    d.inertia("still", 1.0)
    d.state("near", 4.0, 10.0)
    d.state("far", 4.0)
    d.shaft("rod", "near", "far", stiffness=0.0, damping=2.0)
    r = run(d.build(), 5.0, 1e-2, {"near": 8.0})
    between = 2.0 + 8.0 * np.exp(-r.t)
    assert r.state("near") + r.state("far") == pytest.approx(10.0 + 2.0 * r.t, abs=1e-9)
    assert r.state("near") - r.state("far") == pytest.approx(between, abs=1e-9)
    assert r.torque("rod") == pytest.approx(2.0 * between, abs=1e-8) and np.abs(r.residual()).max() < 1e-9


def test_states_are_in_no_mode():
    def built(warm):
        d = Driveline()
        d.inertia("a", 0.2)
        d.inertia("b", 0.3)
        d.shaft("s", "a", "b", stiffness=500.0, damping=0.1)
        if warm:
            d.state("oil", 4.0, 300.0)
            d.heat("oil", "s")
        return modes(d.build())

    assert built(True).frequencies == pytest.approx(built(False).frequencies) and len(built(True).frequencies) == 2
    assert built(False).frequencies[1] == pytest.approx(math.sqrt(500.0 / 0.12) / (2.0 * math.pi))


@pytest.mark.parametrize(
    ("wrong", "sentence"),
    [
        (lambda d: d.gear("a", "oil", 2.0), "names the state 'oil', which is no body"),
        (lambda d: d.torque("t", "a", "oil", table=([0.0], [1.0])), "names the state 'oil', which is no body"),
        (lambda d: d.torque("t", "a", by="speed", of="oil", table=([0.0], [1.0])), "is by speed and of 'oil'; a state is"),
        (lambda d: d.torque("t", "a", by="state", table=([0.0], [1.0])), "is by state and of 'a'"),
        (lambda d: d.shaft("s", "oil", "ground", stiffness=3.0), "joins states; it can have a damping only"),
        (lambda d: d.heat("oil", "x"), "heat of 'x': there is no 'x' that can lose; there are: b"),
        (lambda d: d.heat("a", "b"), "there is no state 'a'; there are: oil"),
        (lambda d: d.state("water", 0.0), "capacity of state 'water' is 0.0; a finite number above 0 is needed"),
    ],
)
def test_a_wrong_state_is_refused_in_words(wrong, sentence):
    d = Driveline()
    d.inertia("a", 0.5)
    d.brake("b", "a")
    d.state("oil", 2.0)
    with pytest.raises(RigError, match=sentence):
        wrong(d)
