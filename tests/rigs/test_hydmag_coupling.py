# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The metal coupling of high torsional compliance: alone against closed forms, and between motor and gearbox of the HydmAG."""

import json
from math import atan, pi, radians, sqrt, tan
from pathlib import Path

import numpy as np
import pytest

import rig_nodes
from rig_nodes.base.errors import RigError
from rig_nodes.cli.main import main
from rig_nodes.rig.configuration import load_rig
from rig_nodes.runs.rig import Rig

ROOT = Path(__file__).resolve().parents[2]
# a motor winds the coupling against a flywheel; by default the coupling has neither friction nor play
BENCH = """\
description: a coupling between a motor and a flywheel
step: [100 us, "test"]
bodies:
  rotor: {{inertia: [0.2 kg m2, "test"], speed: [{speed} rad/s, "test"]}}
  wheel: {{inertia: [{wheel} kg m2, "test"]}}
parts:
  motor:
    part: dc_motor
    body: rotor
    torque_limit: [5000 Nm, "test"]
    braking_limit: [5000 Nm, "test"]
    power_limit: [1000 kW, "test"]
    torque_time: [3 ms, "test"]
    speed_gain: [30 Nm s/rad, "test"]
    speed_gain_integral: [2000 Nm/rad, "test"]
    ramp: [100 rad/s2, "test"]
  coupling:
    part: twisting_coupling
    joins: [rotor, wheel]
    inner_diameter: [40 mm, "test"]
    inner_angle: [40 deg, "test"]
    outer_diameter: [70 mm, "test"]
    outer_angle: [50 deg, "test"]
    thread_friction: [{mu} -, "test"]
    spring_preload: [{preload} N, "test"]
    spring_rate: [400 N/mm, "test"]
    knee_travel: [{knee} mm, "test"]
    knee_rate: [900 N/mm, "test"]
    spring_friction: [{springs} %, "test"]
    stop_travel: [100 mm, "test"]
    stop_stiffness: [20000 Nm/rad, "test"]
    stop_damping: [0 Nm s/rad, "test"]
    play: [{play} deg, "test"]
    seal_friction: [{seals} Nm, "test"]
    damping: [0 Nm s/rad, "test"]
transducers:
  n: {{type: speed, shows: rotor.speed, at: motor, range: [-50 rad/s, 50 rad/s], text: "speed"}}
instruments:
  speed_range: [100 rad/s, "test"]
  speed_gate: [1 ms, "test"]
  hum_frequency: [50 Hz, "test"]
  anti_alias: [1 kHz, "test"]
  resolution_bits: [12 -, "test"]
effects:
  transducers: [off, "test"]
"""
FREE = {"mu": 0.0, "preload": 0.0, "knee": 100.0, "springs": 0.0, "play": 0.0, "seals": 0.0, "speed": 0.0, "wheel": 0.3}
D, G, LEVER = (0.040, 0.070), (radians(40.0), radians(50.0)), 20000.0


def lever(rho: float) -> float:
    """Torque per force of the springs: both threads carry the torque, each with its axial force (paper (4), (5))."""
    return 1.0 / sum(2.0 / (d * tan(g + rho)) for d, g in zip(D, G))


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    """Return a function that makes the bench with other values than FREE."""
    folder = tmp_path_factory.mktemp("bench")

    def made(**values) -> Rig:
        place = folder / f"{len(list(folder.iterdir()))}"
        place.mkdir()
        (place / "rig.yaml").write_text(BENCH.format(**{**FREE, **values}))
        return Rig(load_rig(place))

    return made


def followed(rig: Rig, seconds: float) -> np.ndarray:
    """Advance and return rows of time, twist, torque, heat and stored energy at every millisecond."""
    me, out = rig.device("coupling"), []
    for _ in range(round(seconds * 1000)):
        rig.advance_samples(1)
        out.append((rig.time, me["twist"], me["torque"], me["heat"], me["stored"]))
    return np.array(out)


def test_winding_and_unwinding_have_the_torques_of_the_threads_and_a_cycle_loses_the_area_between(bench):
    mu, share, knee, preload = 0.1, 0.03, 0.030, 3000.0
    rig = bench(mu=mu, springs=100 * share, knee=1e3 * knee, preload=preload, wheel=10000.0)
    free, up, down = lever(0.0), lever(atan(mu)) * (1 + share), lever(-atan(mu)) * (1 - share)
    seat = 0.5 * (up + down) * preload / 20000.0

    def force(twist):
        x = free * (twist - seat)
        return preload + np.where(x < knee, 400e3 * x, 400e3 * knee + 900e3 * (x - knee))

    legs = []
    for speed in (2.0, -1.0, 1.0, -1.0):
        rig.set("motor", speed, True)
        legs.append(followed(rig, 1.6 if speed > 1.0 else 1.0))
    for leg, factor in zip(legs, (up, down, up, down)):
        steady = leg[300:-10]
        assert abs(steady[:, 2] / (factor * force(steady[:, 1])) - 1.0).max() < 1e-6
    assert min(free * (leg[:, 1].min() - seat) for leg in legs[1:]) < knee < max(free * (leg[:, 1].max() - seat) for leg in legs)
    # from the end of one unwinding to the same twist of the next one: a closed cycle, with further travel down, up and down
    cycle = np.concatenate(legs[2:])
    first, back = cycle[300], cycle[1000 + 300 :]
    at = np.interp(first[1], back[::-1, 1], back[::-1, 0])
    lost = np.interp(at, back[:, 0], back[:, 3]) - first[3]
    top = cycle[:, 1].max()
    twists = np.linspace(first[1], top, 200001)
    area = (up - down) * np.trapezoid(force(twists), twists)
    assert lost == pytest.approx(area, rel=2e-4)


@pytest.mark.parametrize("play", [0.0, 20.0])
def test_it_swings_with_the_frequency_of_its_springs_on_one_side_and_of_its_stop_on_the_other(bench, play):
    speed, reduced = 3.0, 1.0 / (1.0 / 0.2 + 1.0 / 0.3)
    rig = bench(speed=speed, play=play)
    seen = followed(rig, 2.0)
    rising = np.flatnonzero((seen[:-1, 1] < 0.0) & (seen[1:, 1] >= 0.0))
    t, twist = seen[:, 0], seen[:, 1]
    crossings = t[rising] - twist[rising] * (t[rising + 1] - t[rising]) / (twist[rising + 1] - twist[rising])
    springs = 400e3 * lever(0.0) ** 2
    period = pi * sqrt(reduced / springs) + pi * sqrt(reduced / 20000.0) + 2.0 * radians(play) / speed
    assert len(crossings) >= 4
    assert np.diff(crossings).mean() == pytest.approx(period, rel=5e-4)
    assert twist.max() == pytest.approx(speed * sqrt(reduced / springs), rel=1e-3)


def test_it_gives_back_what_its_springs_and_stops_were_given(bench):
    rig = bench(mu=0.08, springs=2.0, knee=20.0, preload=500.0, play=3.0, seals=0.3, speed=12.0)
    begun = 0.5 * 0.2 * 12.0**2
    rig.advance(3.0)
    energy = rig.energy()
    assert energy["friction"] > 1.0
    assert abs(energy["residual"]) < 1e-6 * begun


def test_a_coupling_under_less_than_its_preload_turns_as_one_with_its_stop(bench):
    rig = bench(preload=20000.0, mu=0.1)
    rig.set("motor", 5.0, True)
    rig.advance(1.0)
    me = rig.device("coupling")
    assert me["travel"] == 0.0
    rotor, wheel = rig.world.line["v"]
    assert rotor == pytest.approx(wheel, abs=1e-3)
    assert wheel == pytest.approx(5.0, abs=0.05)


# ---- the numbers of the paper

# rows that are not met, and those that show a contradiction of the paper, each explained on the rig's page
MISSED = {"constant_1", "name_40hm_c"}
CONTRADICTED = {"ratio_high", "ratio_angle", "ratio_mu", "mu_high", "turn_work_11"}


def test_every_printed_number_is_met_or_explained_on_the_page(tmp_path):
    file = tmp_path / "rows.json"
    main(["validate", "--rig", "hydmag_coupling", "--jobs", "1", "--json", str(file)])
    rows = json.loads(file.read_text())["rows"]
    assert len(rows) == 109
    assert {row["id"] for row in rows if row["verdict"] == "outside"} == MISSED
    assert {row["id"] for row in rows if row["verdict"] == "source contradicts itself"} == CONTRADICTED
    assert len({row["id"] for row in rows if row["verdict"] == "inside"}) == 109 - len(MISSED | CONTRADICTED)
    page = (ROOT / "docs" / "rigs" / "hydmag_coupling.md").read_text()
    assert all(f"`{name}`" in page for name in MISSED | CONTRADICTED)


# ---- between motor and gearbox


STIFF = {
    "coupling.spring_preload": "200 kN",
    "coupling.stop_stiffness": "1000000 Nm/rad",
    "coupling.stop_damping": "300 Nm s/rad",
    "coupling.play": "0 deg",
    "rotor.inertia": "0.6546 kg m2",
    "w0.inertia": "0.0544 kg m2",
}
STIFF_SHAFT = {"input_shaft.stiffness": "1000000 Nm/rad", "input_shaft.damping": "300 Nm s/rad"}
HARD = {"coupling.spring_rate": "5000 N/mm", "coupling.knee_rate": "5000 N/mm"}


def shifted(name: str, settings: dict[str, str]) -> tuple[Rig, np.ndarray]:
    """Return the rig after a shift under load from the first gear to the second, and its true M_wej from the order on."""
    rig = Rig(load_rig(name, {"effects.transducers": "off", **settings}))
    rig.set("oil", 4e6, True)
    rig.advance(0.5)
    rig.order_gear(1)
    rig.advance(1.0)
    rig.set("motor", 157.08, True)
    rig.advance(2.5)
    rig.set("load", 3.2e6, True)
    rig.advance(1.5)
    rig.order_gear(2)
    torque = []
    for _ in range(20):
        rig.advance(0.1)
        torque.append(rig.rows_at(1e-4, rig.sample * 10 - 999, 1000)[:, rig.channels.index("M_wej")])
    return rig, np.concatenate(torque)


@pytest.fixture(scope="module")
def shifts():
    """Return the rig and the torque of a shift: on a stiff shaft, with the coupling, a very stiff one, hard springs."""
    return {
        "without": shifted("hydmag", STIFF_SHAFT),
        "with": shifted("hydmag_coupling", {}),
        "stiff": shifted("hydmag_coupling", STIFF),
        "hard": shifted("hydmag_coupling", HARD),
    }


def test_a_very_stiff_coupling_leaves_the_peak_of_a_stiff_shaft(shifts):
    assert shifts["stiff"][1].max() == pytest.approx(shifts["without"][1].max(), rel=0.01)


def test_the_coupling_takes_a_fifth_off_the_peak_and_hard_springs_put_some_on_it(shifts):
    without = shifts["without"][1].max()
    assert shifts["with"][1].max() < 0.8 * without
    assert shifts["hard"][1].max() > 1.2 * without


def test_the_energy_of_the_rig_closes_with_the_coupling_in_it(shifts):
    for name in ("with", "hard"):
        energy = shifts[name][0].energy()
        assert energy["friction"] > 10.0
        assert abs(energy["residual"]) < 1e-9 * energy["motor"]


def test_the_meter_behind_the_coupling_shows_its_torque_when_nothing_accelerates(shifts):
    rig, torque = shifts["with"]
    assert torque[-100:].mean() == pytest.approx(float(rig.device("coupling")["torque"]), abs=0.01)


def test_what_accelerates_the_wheels_behind_the_coupling_is_part_of_the_peak():
    """The springs let the gearbox's input swing: 26 of its 203 Nm accelerate its wheels, 0.0544 kg m2."""
    row = rig_nodes.load("hydmag_coupling").simulate("demo", seed=1).report["shifts"][0]
    assert row["peak"]["error_nm"] < 0.04 * row["input_torque_high_nm"]


def test_it_is_moved_by_the_quick_step(shifts):
    rig = shifts["with"][0]
    assert not rig.world.plan.driven


@pytest.mark.parametrize(
    ("line", "sentence"),
    [
        ("thread_friction: [0.6 -, x]", "thread_friction"),
        ("inner_angle: [20 deg, x]", "inner_angle"),
        ("thread_friction: [0.48 -, x]\n    inner_angle: [25 deg, x]", "locks itself"),
        ("stop_stiffness: [50 Nm/rad, x]", "of the springs"),
        ("joins: [rotor, rotor]", "itself"),
        ("joins: [rotor, wo]", "'w0'"),
    ],
)
def test_wrong_values_are_named_with_file_and_line(tmp_path, line, sentence):
    file = tmp_path / "rig.yaml"
    file.write_text(f"description: wrong\nbase: hydmag_coupling\nparts:\n  coupling:\n    {line}\n")
    with pytest.raises(RigError) as refused:
        load_rig(tmp_path)
    assert sentence in str(refused.value)
    assert f"{file}:5: " in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_setting_that_makes_it_lock_itself_is_refused():
    with pytest.raises(RigError, match=r"coupling\.thread_friction is 0\.49, with which"):
        load_rig("hydmag_coupling", {"coupling.thread_friction": "0.49 -", "coupling.inner_angle": "26 deg"})
