# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The demo sequence as a user sees it: two good shifts, and visibly bad ones when the rig has wrong settings."""

import numpy as np
import pytest

from rig_nodes.analysis.run_report import build_report
from rig_nodes.bags.reader import Bag
from rig_nodes.rig.configuration import load_rig
from rig_nodes.runs.sequence import load_sequence
from rig_nodes.runs.simulation import simulate

NO_SUPPLY = """
description: the demo with the clutch oil off
steps:
  - oil: {off: true}
  - shift: {to: I, timeout: 3 s}
  - motor: {speed: 1500 rpm}
  - wait: {until: {signal: n_wej, above: 1490 rpm}, timeout: 10 s}
  - load: {torque: 80 Nm}
  - wait: {for: 1 s}
  - shift: {to: II, timeout: 5 s}
  - shift: {to: I, timeout: 5 s}
  - motor: {off: true}
"""


def run(folder, sequence="demo", **settings):
    """Returns (bag, report) of a simulated sequence with changed settings."""
    values = {name.replace("__", "."): value for name, value in settings.items()}
    record = simulate(load_rig("hydmag", values), load_sequence(sequence, default="hydmag"), folder)
    bag = Bag(folder)
    return bag, build_report(bag, record)


@pytest.fixture(scope="module")
def demo(tmp_path_factory):
    return run(tmp_path_factory.mktemp("demo"))


def test_both_shifts_are_complete_and_without_a_dip(demo):
    _, report = demo
    assert [(s["from_gear"], s["to_gear"]) for s in report["shifts"]] == [(1, 2), (2, 1)]
    for shift in report["shifts"]:
        assert shift["valid"], shift["why"]
        assert shift["k"] >= 0.95
        assert shift["input_speed_rpm"] == pytest.approx(1500, abs=5)
        assert 0.1 < shift["t_dt_s"] < 0.5
    assert report["shifts"][0]["output_torque_nm"] == pytest.approx(80, abs=1)
    assert report["run"]["end"]["state"] == "ended" and report["run"]["lost"] == 0


def test_joint_states_carry_the_angle_that_the_encoders_have_counted(demo):
    bag, _ = demo
    stamps, joints = zip(*bag.messages("/instruments/joint_states"))
    t, angle = 1e-9 * np.array(stamps), np.array([joint.position for joint in joints])
    speed = np.array([joint.velocity for joint in joints])
    assert list(joints[0].name) == ["w0", "wk"] and angle[0].tolist() == [0.0, 0.0]
    moved = np.diff(angle, axis=0)
    assert (moved > -0.01).all() and angle[-1].min() > 1000.0, "it goes on, without wrapping"
    between = np.diff(t)[:, None] * 0.5 * (speed[:-1] + speed[1:])
    # the messages are 10 ms apart, so a shift's jerk can lie between two of them
    assert np.abs(moved - between).max() < 0.2
    assert angle[-1] == pytest.approx(between.sum(axis=0), rel=1e-3)


def test_energy_balances_within_a_hundredth_of_the_clutch_heat(demo):
    _, report = demo
    for window in report["energy"]["shifts"]:
        heat = window["heat_s1_j"] + window["heat_s2_j"]
        assert heat > 100.0
        assert abs(window["residual_j"]) < 0.01 * heat


def test_the_output_never_turns_backwards(demo):
    bag, _ = demo
    assert bag.series("n_wyj")[1].min() >= 0.0
    # a shaft that has come to rest stays at rest except for rounding
    assert min(m.speed_out for _, m in bag.messages("/gearbox/state")) > -1e-12


def between(p, t, low, high):
    """Returns the time [s] that a pressure takes from low to high [MPa], from the first passing of each."""
    return t[np.argmax(p > high)] - t[np.argmax(p > low)]


def test_pressures_show_fill_and_rise(demo):
    """p2 waits for its ramp, fills slowly under the springs and jumps; p1 jumps, dips, and follows its current without rest."""
    bag, report = demo
    log = bag.logger()
    seen = {}
    for shift, name in zip(report["shifts"], ("p2", "p1")):
        first = int((shift["t_order_s"] - log.t0) / log.period)
        seen[name] = np.convolve(log.channels[name][first : first + 10_000], np.ones(30) / 30, "same") / 1e6
    p1, p2, t = seen["p1"], seen["p2"], np.arange(10_000) * log.period
    assert p2[:3000].max() < 0.15, "nothing before the current leaves 215 mA at 0.33 s"
    fill = 0.14 / between(p2, t, 0.22, 0.36)
    assert 0.5 < fill < 3.0, "filling is limited by the flow and the springs, MPa/s"
    assert 0.5 / between(p2, t, 0.7, 1.2) > 5.0 * fill
    assert 1.1 / between(p1, t, 1.0, 2.1) == pytest.approx(5.87, rel=0.1), "Annex D's ramp, MPa/s"
    jump = p1[: int(np.argmax(p1 > 1.0))]
    peak = int(np.argmax(jump > 0.75))
    assert jump[peak:].min() < 0.75, "p1 overshoots as the piston meets the plates, and dips (fig. 7.6)"
    ramp = p1[len(jump) : int(np.argmax(p1 > 2.1))]
    assert np.diff(ramp[::200]).min() > 0.03, "no rest for 20 ms"
    for p in (p1, p2):
        assert p[-100:].mean() == pytest.approx(2.3, abs=0.2), "the end value of chapter 9, as far as it was calibrated"


def test_times_and_currents_of_the_order_are_those_of_the_settings(demo):
    """t12 = -220 ms: ZR-P2 is energised with the order, ZR-P1 falls 220 ms later (tab. 7.5, series 19)."""
    bag, report = demo
    t_order = report["shifts"][0]["t_order_s"]
    t, engaging = bag.series("I_set_zr_p2")
    _, releasing = bag.series("I_set_zr_p1")
    after = np.round((t - t_order) * 1e3).astype(int)
    at = {ms: np.flatnonzero(after == ms)[0] for ms in (125, 219, 330, 470, 580, 970, 1470)}
    assert engaging[at[125]] == pytest.approx(0.215) and engaging[at[330]] == pytest.approx(0.215)
    assert engaging[at[580]] == pytest.approx(0.740)
    assert releasing[at[219]] == pytest.approx(0.740)
    assert releasing[at[470]] == pytest.approx(0.130) and releasing[at[970]] == pytest.approx(0.130)
    assert releasing[at[1470]] == pytest.approx(0.0, abs=1e-12)


def test_late_engagement_dips(tmp_path):
    _, report = run(tmp_path, alfa46__t12="200 ms")
    assert report["shifts"][0]["k"] < 0.5


def test_swapped_valves_are_not_a_shift(tmp_path):
    _, report = run(tmp_path, wiring="swapped")
    assert not any(shift["valid"] for shift in report["shifts"])


def test_without_supply_there_is_no_shift(tmp_path):
    sequence = tmp_path / "no_supply.yaml"
    sequence.write_text(NO_SUPPLY)
    _, report = run(tmp_path / "run", str(sequence), trips__watched="off")
    assert report["shifts"] and not any(shift["valid"] for shift in report["shifts"])


def test_twice_the_same_bytes(demo, tmp_path):
    bag, _ = demo
    run(tmp_path / "again")
    assert bag.path.read_bytes() == next((tmp_path / "again").glob("*.mcap")).read_bytes()


def test_every_topic_of_the_catalogue_is_in_the_bag_without_gaps(demo):

    bag, _ = demo
    assert set(load_rig("hydmag").catalogue.topics) == set(bag.counts)
    assert bag.gaps() == {}
    assert bag.check() == []
