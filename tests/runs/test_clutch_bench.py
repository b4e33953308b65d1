# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The clutch bench of chapter 8 and its force benches: their own procedures find the values that they were given."""

import json
from functools import cache
from math import pi

import numpy as np
import pytest

from rig_nodes.analysis.press_bench import of_press
from rig_nodes.analysis.slip_bench import cylinder_line, slip_line, slip_tests, spring_line
from rig_nodes.bags.reader import Bag
from rig_nodes.base.errors import RigError
from rig_nodes.cli.main import main
from rig_nodes.rig.configuration import load_rig
from rig_nodes.rigs.hydmag.laboratory.packs import PACKS
from rig_nodes.runs.procedure import load_procedure, prepare
from rig_nodes.runs.recorded import record
from rig_nodes.runs.rig import Rig
from rig_nodes.runs.sequence import load_sequence

RPM = pi / 30.0
TRUE = {"effects.transducers": "off"}
# ring 80x115: A and r_m by hand, (6.28) and (6.5)
AREA = pi * (57.5e-3**2 - 40e-3**2)
MEAN_RADIUS = 2.0 / 3.0 * (57.5e-3**3 - 40e-3**3) / (57.5e-3**2 - 40e-3**2)


def slipped(settings, seed=1, pressures="1 MPa, 2 MPa, 3 MPa", rig="clutch_bench"):
    """Returns (configuration, run) of slip tests on a bench with these values, its plates wetted for a short time."""
    config = load_rig(rig, settings)
    run = record(config, load_sequence("clutch_bench", {"pressures": pressures, "wetting": "200 ms"}), seed)
    assert run.end["state"] == "ended", run.end
    return config, run


def found_line(config, run):
    plates = config.plate_pack
    tests = slip_tests(of_press(config.structure, run.recording), plates)
    return slip_line(tests, plates, plates.friction_static, plates.friction_spline)


# --- the bench's own procedure -----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("k_kor", "rest", "surfaces", "seed"), [(0.9, 0.0, 18, 1), (1.0, 30.0, 10, 2), (1.1, 80.0, 12, 3), (1.19, 0.0, 16, 4)]
)
def test_a_planted_k_kor_comes_back_within_one_percent_through_the_instruments(k_kor, rest, surfaces, seed):
    config, run = slipped(
        {
            "plate_pack.friction_correction": f"{k_kor} -",
            "plate_pack.rest_torque": f"{rest} Nm",
            "plate_pack.surfaces": f"{surfaces} -",
        },
        seed,
    )
    line = found_line(config, run)
    assert line["tests"] == 3 and line["r_squared"] > 0.999
    assert line["k_kor"]["thesis"] == pytest.approx(k_kor, rel=0.01)
    # the intercept contains the class errors of p_z (31 kPa of offset, about 40 N) and of the torque meter
    assert line["m_rest_nm"] == pytest.approx(rest, abs=5.0)


def test_k_kor_of_the_gearboxes_plates_comes_back_too():
    series = next(one for one in load_procedure("clutch_bench_series").series() if one.label == "50x76-12")
    config, _ = prepare(series, settings={"plate_pack.friction_correction": "0.88 -"})
    sequence = load_sequence("clutch_bench", {"pressures": "1 MPa, 2 MPa, 3 MPa", "wetting": "200 ms"})
    assert found_line(config, record(config, sequence, 5))["k_kor"]["thesis"] == pytest.approx(0.88, rel=0.01)


def test_the_torque_at_slip_is_that_of_hand_calculation():
    config, run = slipped({**TRUE, "clutch_pack.friction_model": "traditional"}, pressures="2 MPa")
    (test,) = slip_tests(of_press(config.structure, run.recording), config.plate_pack)
    # (8.2) at 2 MPa: 4 * 63.034 + 2 * 1251.7 - 123.7 = 2631.836 N; (8.1) at the travel that was measured
    s = test["s_m"] * 1e3
    spring = 2.9035 * s**6 - 38.063 * s**5 + 197.57 * s**4 - 515.09 * s**3 + 658.13 * s**2 - 38.596 * s + 9.8468
    clamp = 2631.836 - spring
    assert test["clamp_n"] == pytest.approx(clamp, rel=1e-4)
    assert test["pressure_pa"] == pytest.approx(clamp / AREA, rel=1e-4)
    # the contact, 8000 N/mm from 2 mm on, is compressed by the same force
    assert clamp == pytest.approx(8000.0 * (s - 2.0), rel=2e-3)
    assert test["m_eks_nm"] == pytest.approx(18 * 0.12 * MEAN_RADIUS * clamp, rel=1e-3)


def test_models_are_compared_on_one_measurement():
    config, run = slipped({"clutch_pack.friction_model": "osinski", "plate_pack.surfaces": "10 -"})
    k_kor = found_line(config, run)["k_kor"]
    # a pack that follows Osinski's model: 1 against it, k_os(10) = 1 - 0.03 * 8 = 0.76 against the traditional one
    assert k_kor["osinski"] == pytest.approx(1.0, rel=0.01)
    assert k_kor["traditional"] == pytest.approx(0.76, rel=0.01)


def test_the_pack_is_let_go_at_once():
    """8.1.6 asks for as little wear and heat as possible."""
    _, run = slipped(TRUE, pressures="2 MPa")
    channels, period = run.recording.channels, run.recording.period
    slips = np.flatnonzero((channels["n"] > 0.5 * RPM) & (channels["p_z"] > 0.5e6))
    clamped = slips[slips > np.argmax(channels["M_e"]) - 10]
    assert 0 < len(clamped) * period < 0.2
    assert channels["n"].max() < 85 * RPM  # the flow regulator holds the speed without the load


def test_the_springs_bring_the_piston_back_to_its_stop():
    """8.1.2 requires this, so that the plates are free while they are wetted."""
    _, run = slipped(TRUE, pressures="3 MPa")
    assert run.recording.channels["s"].max() > 2.3e-3 and run.recording.channels["s"][-1] < 0.1e-3


def test_too_little_torque_gives_no_slip_and_says_so():
    config = load_rig("clutch_bench")
    sequence = load_sequence("clutch_bench", {"pressures": "2 MPa", "wetting": "200 ms", "highest": "3 MPa"})
    run = record(config, sequence)
    assert run.end["state"] == "failed" and "n above 4 rpm" in run.end["reason"]
    assert slip_tests(of_press(config.structure, run.recording), config.plate_pack) == []
    with pytest.raises(RigError, match="0 tests in which the pack slipped; a line needs at least 3"):
        found_line(config, run)


# --- the force benches -------------------------------------------------------------------------------


@cache
def force_bench(name):
    config = load_rig(name)
    return of_press(config.structure, record(config, load_sequence(name, None, name)).recording)


def test_the_cylinder_bench_gives_8_2_back():
    pressure, force = cylinder_line(force_bench("cylinder_bench"))
    assert len(pressure) == 3 * 8 and force.max() < 5000.0  # three series inside the transducer's range
    printed = 63.034 * (pressure * 1e-6) ** 2 + 1251.7 * pressure * 1e-6 - 123.7
    # class 0.25 of 25 MPa is 0.0625 MPa, at up to 1690 N/MPa; class 0.2 of 5 kN is 10 N
    assert np.abs(force - printed).max() < 0.0625 * 1690 + 10.0
    square, linear, constant = np.polyfit(pressure * 1e-6, force, 2)
    assert (square, linear) == (pytest.approx(63.0, abs=2.0), pytest.approx(1251.7, rel=0.01))
    assert constant == pytest.approx(-123.7, abs=0.0625 * 1252)


def test_seals_hold_the_falling_cylinder_the_other_way():
    config = load_rig("cylinder_bench", TRUE)
    run = record(config, load_sequence("cylinder_bench", {"up": "1 MPa, 2 MPa", "down": "1 MPa"}))
    p, force = run.recording.channels["p_z"], run.recording.channels["F_ps"]
    at = [round(t / run.recording.period) for t in (0.9, 2.9)]  # the first rise to 1 MPa and the fall to it
    assert p[at] == pytest.approx(1e6, rel=1e-3)
    assert force[at[1]] - force[at[0]] == pytest.approx(123.7 + 9.0, abs=1.0)


def test_the_spring_bench_gives_8_1_back():
    travels = np.array([0.5e-3, 1e-3, 2e-3, 3e-3, 4e-3])
    # (8.1) by hand with the minus that is missing in print
    printed = [101.7, 276.8, 573.5, 780.1, 913.9]
    assert spring_line(force_bench("spring_bench"), travels) == pytest.approx(printed, abs=0.4)


# --- as a rig ----------------------------------------------------------------------------------------


def moved(pieces):
    rig = Rig(load_rig("clutch_bench"), 7)
    rig.set("cylinder", 1e6, True)
    rig.set("relief", 8e6, True)
    rig.set("motor", 80 * RPM, True)
    for samples in pieces:
        rig.advance_samples(samples)
    return rig


def test_the_result_does_not_depend_on_how_time_is_cut():
    one, many = moved([2400]), moved([1, 999, 250, 1150])
    assert np.array_equal(one.rows_at(1e-4, 20_000, 4_000), many.rows_at(1e-4, 20_000, 4_000))
    assert np.array_equal(one.world.moved, many.world.moved)


def test_energies_balance():
    energy = moved([5000]).energy()
    assert energy["heat_pack"] > 1.0 and abs(energy["residual"]) < 1e-6 * energy["motor"]


def test_the_safe_state_lets_the_pack_go_until_reset():
    rig = moved([1000])
    assert rig.clutches[0]["clamp"] > 500.0
    rig.e_stop()
    rig.advance_samples(1000)
    assert rig.clutches[0]["clamp"] == 0.0 and abs(rig.true("shaft.speed")) < 1e-6 and rig.reason == "emergency stop"
    rig.reset()
    assert rig.status.name == "READY"
    with pytest.raises(RigError, match="nothing done"):
        rig.reset()


def test_a_transducer_that_is_not_fitted_shows_nothing():
    rig = moved([500])
    assert np.all(rig.rows_at(1e-4, 1, 4_000)[:, rig.channels.index("F_ps")] == 0.0)


@pytest.mark.parametrize(
    ("act", "sentence"),
    [
        (lambda rig: rig.set("press", 1e-3, True), "'clutch_bench' has no testing machine"),
        (lambda rig: rig.set("cylinder", 2e7, True), "cylinder.pressure of 20 000 000 Pa refused; expected 0 to 10 000 000 Pa"),
        (lambda rig: rig.set("motor", float("nan"), True), "hydraulic_motor.speed of nan rad/s refused"),
    ],
)
def test_what_the_bench_refuses(act, sentence):
    with pytest.raises(RigError, match=sentence):
        act(Rig(load_rig("clutch_bench")))


# --- as a user runs it -------------------------------------------------------------------------------


def test_the_sizes_of_the_series_are_those_of_the_tables():
    series = load_procedure("clutch_bench_series").series()
    assert len(series) == 15 + 5 + 5 + 2 + 5
    for one in series:
        config, sequence = prepare(one)
        pack, plates = PACKS[one.conditions["ring"]], config.plate_pack
        assert 2 * plates.inner_radius == pytest.approx(pack.inner_diameter)
        assert 2 * plates.outer_radius == pytest.approx(pack.outer_diameter)
        assert plates.inner_spline_diameter == pytest.approx(pack.inner_spline_diameter)
        assert plates.outer_spline_diameter == pytest.approx(pack.outer_spline_diameter)
        assert plates.surfaces == one.conditions["surfaces"] and plates.surfaces in pack.surfaces
        assert plates.friction_static == (0.30 if pack.name == "50x76" else 0.12)
        assert one.conditions.get("thickness", 2e-3) in (*pack.plate_thickness, 2e-3)
        assert sequence.rig == "clutch_bench"


def test_simulate_writes_bag_and_report(tmp_path, capsys):
    arguments = [
        "simulate",
        "clutch_bench",
        "--out",
        str(tmp_path / "run"),
        "--set",
        "plate_pack.surfaces=12 -",
        "--with",
        "pressures=1 MPa, 1.5 MPa, 2 MPa",
        "--with",
        "wetting=100 ms",
    ]
    assert main(arguments) == 0
    out = capsys.readouterr().out
    assert "M_eks Nm" in out and "k_kor against the models: thesis" in out and "messages lost: 0" in out
    bag, report = Bag(tmp_path / "run"), json.loads((tmp_path / "run" / "report.json").read_text())
    # only the spring bench has the command of the testing machine
    assert set(load_rig("clutch_bench").catalogue.topics) - set(bag.counts) == {"/testing_machine/command"}
    assert report["shifts"] == [] and report["run"]["configuration"]["name"] == "clutch_bench"
    assert [round(row["cylinder_pa"], -5) for row in report["bench"]["slip_tests"]] == [1e6, 1.5e6, 2e6]
    assert report["bench"]["line"]["k_kor"]["thesis"] == pytest.approx(1.0, rel=0.01)
    _, mode = bag.series("pack_mode")
    assert set(mode) == {0.0, 1.0, 2.0} and not bag.check()
    # the rows are the same as those that procedures measure in memory
    config = load_rig("clutch_bench", {"plate_pack.surfaces": "12 -"})
    run = record(config, load_sequence("clutch_bench", {"pressures": "1 MPa, 1.5 MPa, 2 MPa", "wetting": "100 ms"}))
    logger = bag.logger()
    rows = len(logger.channels["M_e"])
    assert np.array_equal(logger.channels["M_e"], run.recording.channels["M_e"][:rows]) and rows > 100_000


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["simulate", "demo", "--rig", "clutch_bench"], "sequence 'demo' is for a rig like hydmag, not for "),
        (
            ["simulate", "clutch_bench", "--rig", "hydmag"],
            "sequence 'clutch_bench' is for a rig like clutch_bench, not for 'hydmag'",
        ),
        (["simulate", "clutch_bench", "--level", "duty"], "'clutch_bench' has no valves for a shift controller"),
        (["simulate", "clutch_bench", "--delay", "2"], "leave out controller, level and delay"),
        (["run", "clutch_bench", "--delay", "2"], "leave out controller, level and delay"),
        (["run", "clutch_bench", "--view"], "--view: the live view shows a rig with gears"),
        (["run", "demo", "--rig", "spring_bench"], "sequence 'demo' is for a rig like hydmag, not for "),
        (["simulate", "clutch_bench", "--set", "alfa46.t12=0 ms"], "setting alfa46.t12=0 ms: there is no value 'alfa46.t12'"),
        (["simulate", "clutch_bench", "--set", "plate_pack.surfaces=12 mm"], "plate_pack.surfaces"),
        (["simulate", "clutch_bench", "--with", "pressures=12 bananas"], "unknown unit 'bananas'"),
        (["simulate", "clutch_bench", "--with", "pressures=1 MPa,,2 MPa"], "repeat.each.p_z must be a list of values"),
        (["validate", "--rig", "clutch_bench"], "the rig 'clutch_bench' has no validation.yaml"),
        (["controller", "check", "alfa46", "--rig", "clutch_bench"], "controller check is for a rig with gears"),
        (["export", "controller-fmu", "x.c", "--rig", "clutch_bench"], "export controller-fmu is for a rig with gears"),
    ],
)
def test_what_does_not_fit_the_bench_is_refused_in_one_sentence(arguments, sentence, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(arguments) == 2
    err = capsys.readouterr().err.splitlines()
    assert sentence in err[-1] and err[-1].startswith("rig: ") and not any("Traceback" in line for line in err)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("kind: brake_bench\n", "r.yaml:2: unknown key 'kind' in the rig"),
        ("base: clutch_bench\nvalve_zr_p1: {}\n", "r.yaml:3: unknown key 'valve_zr_p1'"),
        ("base: clutch_bench\nparts:\n  cylinder: {machine_speed: [1 m, x]}\n", "r.yaml:4: cylinder.machine_speed"),
    ],
)
def test_bench_files_are_checked_like_the_gearboxs(text, sentence, tmp_path):
    file = tmp_path / "r.yaml"
    file.write_text("description: x\n" + text)
    with pytest.raises(RigError) as refusal:
        load_rig(file)
    assert sentence in str(refusal.value)


def test_a_slip_that_is_wrong_for_every_rig_is_not_blamed_on_the_rig(tmp_path):
    file = tmp_path / "s.yaml"
    file.write_text("description: x\nsteps:\n  - wait: {four: 1 s}\n")
    with pytest.raises(RigError, match=r"s\.yaml:3: unknown key 'four' in wait") as refusal:
        load_sequence(file, rig="clutch_bench")
    assert "a rig like" not in str(refusal.value)


def test_a_sequence_asks_only_for_what_its_rig_has(tmp_path):
    file = tmp_path / "s.yaml"
    file.write_text("description: x\nrig: clutch_bench\nsteps:\n  - shift: {to: I}\n")
    with pytest.raises(RigError, match=r"s.yaml:4: unknown key 'shift' in a step; known are motor, relief"):
        load_sequence(file, default="hydmag")
    file.write_text("description: x\nrig: clutch_bench\nsteps:\n  - wait: {until: {signal: n_wej, above: 1 rpm}}\n")
    with pytest.raises(RigError, match="there is no signal 'n_wej'"):
        load_sequence(file, default="hydmag")
    file.write_text("description: x\nrig: nowhere\nsteps:\n  - wait: {for: 1 s}\n")
    with pytest.raises(RigError, match=r"s.yaml:2: rig: there is no rig 'nowhere'"):
        load_sequence(file, default="hydmag")
