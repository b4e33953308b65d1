# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Every element of driveline.builder in a rig's folder: the engine moves it as driveline_run.Run does."""

import shutil
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from rig_nodes.bags.reader import Bag
from rig_nodes.base.errors import RigError
from rig_nodes.cli.main import main
from rig_nodes.driveline.run import Run
from rig_nodes.rig.configuration import load_rig
from rig_nodes.rig.signals import torque_signals
from rig_nodes.rig.structure import structure_of
from rig_nodes.runs.joint_torques import JointTorques
from rig_nodes.runs.plan import plan_of
from rig_nodes.runs.rig import Rig

FOLDER = Path(__file__).parent / "every_element"
TEXT = (FOLDER / "rig.yaml").read_text()


@pytest.fixture(scope="module")
def config():
    return load_rig(FOLDER, {"effects.transducers": "off", "trips.watched": "off"})


@pytest.fixture(scope="module")
def moved(config):
    """Returns (rig, run, differences) with only the description's own inputs.

    The run is of the same description in Python without a rig; the differences are the largest of a speed at each 10 ms of 0.4 s.
    """
    plan = plan_of(config).plan
    run = Run(plan.system, config.kernel.step, {name: (table.x, table.y) for name, table in plan.inputs.items()})
    rig, missed = Rig(config), []
    for k in range(1, 41):
        rig.advance(0.01)
        missed.append(np.abs(speeds(rig) - run.to(0.01 * k).speeds).max())
    return rig, run, np.array(missed)


@pytest.fixture(scope="module")
def early(config):
    """Returns the state hash of a rig at 0.12 s, after events of all kinds."""
    rig = Rig(config)
    rig.advance(0.12)
    return rig.state_hash()


def speeds(rig) -> np.ndarray:
    return rig.world.plan.system.bodies_from_speeds @ rig.v


def test_the_engine_moves_every_element_as_python_alone_does(moved):
    rig, run, missed = moved
    assert missed.max() < 1e-9 and run.result().capped == 0 and rig.reason == ""
    assert len({event.element for event in run.result().events}) >= 5, "clutches, brakes and the worm lock and let go"
    for body in ("drum", "saw", "carrier", "right", "shaker", "end", "spider", "rotor", "crank", "swing", "turbine", "fork"):
        speed = run.result().speed(body)
        assert np.ptp(speed) > 0.5, f"{body} moves"


def test_torques_are_those_of_python_alone(moved):
    rig, run, _ = moved
    result = run.result()
    for name in ("soft", "geared", "shoes", "across", "low", "grip", "air", "gravity", "tyre", "shake", "fluid", "map", "pressed"):
        assert rig.true(f"{name}.torque") == pytest.approx(result.torque(name)[-1], rel=1e-9, abs=1e-8), name
    assert rig.true("worm.torque") == pytest.approx(-result.torque("worm", "input")[-1], rel=1e-9)
    assert rig.true("bevel.torque") == pytest.approx(-result.torque("bevel", "end")[-1], rel=1e-9)
    assert rig.true("reducer.torque") == pytest.approx(-result.torque("reducer", "pinion")[-1], rel=1e-9)
    for name, body in (("sweep", "turbine"), ("joint", "fork")):
        assert rig.true(f"{name}.torque") == pytest.approx(-result.torque(name, body)[-1], rel=1e-9), name
    assert rig.measurement("M_soft") == rig.true("soft.torque")


def test_a_temperature_is_that_of_python_alone_and_is_measured(moved):
    rig, run, _ = moved
    warm = run.result().state("lining")
    assert rig.true("lining.temperature") == pytest.approx(warm[-1], rel=1e-9) and np.ptp(warm) > 5.0
    assert rig.measurement("T_lining") == rig.true("lining.temperature")


def test_energy_closes_and_each_kind_of_loss_has_its_part(moved):
    rig, run, _ = moved
    energy, result = rig.energy(), run.result()
    assert abs(energy["residual"]) < 1e-9 * abs(energy["torques"])
    assert energy["motor"] == 0.0 and energy["torques"] == pytest.approx(-result.e_in[-1], rel=1e-9)
    assert energy["shafts"] == pytest.approx(result.e_shaft[-1].sum(), rel=1e-9) and energy["shafts"] > 1.0
    assert energy["elements"] == pytest.approx((result.e_fric + result.e_visc)[-1].sum(), rel=1e-9)


def test_the_motors_own_work_is_told_from_that_of_the_description(config):
    rig = Rig(config)
    rig.set("motor", 50.0, True)
    powers = [0.0]
    for _ in range(100):
        rig.advance(0.001)
        powers.append(float(rig.motor["torque"]) * rig.true("input.speed"))
    energy = rig.energy()
    assert energy["motor"] == pytest.approx(np.trapezoid(powers, dx=0.001), rel=1e-2) and energy["motor"] > 40.0
    assert abs(energy["residual"]) < 1e-9 * energy["motor"] + 1e-9 * abs(energy["torques"])


def test_the_result_does_not_depend_on_how_time_is_cut(config, early):
    rig = Rig(config)
    for samples in (1, 7, 92, 20):
        rig.advance_samples(samples)
    assert rig.state_hash() == early


def test_a_rig_put_aside_goes_on_as_if_nothing_had_been(config, early):
    rig = Rig(config)
    rig.advance(0.05)
    kept = rig.snapshot()
    rig.advance(0.05)
    rig.restore(kept)
    rig.advance(0.07)
    assert rig.state_hash() == early


def test_accelerations_are_of_all_torques(moved):
    rig, run, _ = moved
    rates = run.system.bodies_from_speeds @ rig.world.line["accel"]
    assert rates == pytest.approx(run.result().accelerations()[-1], rel=1e-6, abs=1e-6) and np.abs(rates).max() > 100.0
    assert rig.world.line["rate"][0] == pytest.approx(rates[run.system.bodies.index("input")])


def test_a_bag_knows_its_rig_without_the_folder(config):
    plain = config.structure.plain()
    assert structure_of(plain) == config.structure and structure_of(plain).plain() == plain


def test_values_are_settings_by_their_names(config):
    known = config.settings
    for name in (
        "worm.efficiency",
        "worm.back",
        "reducer.efficiency",
        "soft.backlash",
        "geared.ca",
        "across.stick_back",
        "low.drag",
        "piston.rod",
        "engine.speed",
    ):
        assert known.find(name).kept, name
    assert "shoes.drag" not in known and "drum.speed" not in known, "what is not written is no setting"
    looser = load_rig(FOLDER, {"soft.backlash": "3 deg"})
    assert looser.value("soft.backlash") == pytest.approx(np.radians(3.0))


def test_check_draws_every_element(tmp_path, capsys):
    assert main(["check", str(FOLDER), "--picture", str(tmp_path / "p.svg")]) == 0
    drawn = (tmp_path / "p.svg").read_text()
    for name in (
        "worm",
        "reducer, efficiency 0.8: ring 60 held",
        "differential",
        "soft",
        "geared",
        "shoes",
        "across",
        "low",
        "grip",
        "air",
        "weight",
        "gravity",
        "tyre",
        "between",
        "cam",
        "piston",
        "shake",
        "fluid",
        "sweep: its ratio varies",
    ):
        assert name in drawn, name
    assert "worm, efficiency 0.6" in drawn and len(ElementTree.fromstring(drawn)) > 50
    output = capsys.readouterr().out
    assert "elements: differential (relation), shoes (clutch)" in output and "cam (varying inertia)" in output


def test_a_run_records_the_torques_in_all_that_joins_bodies(tmp_path, moved):
    folder = tmp_path / "rig"
    shutil.copytree(FOLDER, folder)
    (folder / "sequences").mkdir()
    (folder / "sequences" / "short.yaml").write_text("description: some of it\nsteps:\n  - wait: {for: 200 ms}\n")
    words = ["--rig", str(folder), "--set", "effects.transducers=off", "--no-trips", "--out", str(tmp_path / "run")]
    assert main(["simulate", "short", *words]) == 0
    bag, result = Bag(tmp_path / "run"), moved[1].result()
    signals = torque_signals(bag.structure)
    assert [one.name for one in signals if one.of == "set"] == ["set_sun_torque", "set_ring_torque", "set_carrier_torque"]
    assert len(signals) == 36 and list(bag.logger("/rig/torques").channels) == [one.name for one in signals]
    for one in signals:
        times, torque = bag.series(one.name)
        rows = np.searchsorted(result.t, times - 1e-9)
        expected = result.torque(one.of, one.body or None)[rows]
        assert torque[1:] == pytest.approx(expected[1:], rel=1e-6, abs=1e-6), one.name
        assert np.abs(torque).max() > 0.1 and np.abs(times - result.t[rows]).max() < 1e-9
    times, torque = bag.series("M_shake")
    assert torque[1:] == pytest.approx(np.interp(times, result.t, result.torque("shake"))[1:], rel=1e-6, abs=1e-6)


def test_a_gearbox_tells_the_torques_of_its_wheels_when_it_is_asked_and_nothing_else_changes(tmp_path):
    (tmp_path / "asked").mkdir()
    (tmp_path / "asked" / "rig.yaml").write_text("description: with torques\nbase: three_speed\nsignals: [torques]\n")
    rigs = [Rig(load_rig(name)) for name in ("three_speed", tmp_path / "asked")]
    for rig in rigs:
        rig.set("oil", 4e6, True)
        rig.set("motor", 100.0, True)
        rig.order_gear(1)
        rig.advance(2.0)
    assert rigs[0].state_hash() == rigs[1].state_hash() and "/rig/torques" not in rigs[0].config.catalogue.topics
    torques = JointTorques(rigs[1])
    torque_of = dict(zip(torques.names, torques.values(), strict=True))
    # the torques of the set on its wheels are in the ratio of their teeth
    assert (
        torque_of["set_1_ring_torque"] == pytest.approx(72 / 40 * torque_of["set_1_input_torque"], rel=1e-9)
        and torque_of["set_1_input_torque"] < -0.5
    )
    assert torque_of["set_1_ring_torque"] == pytest.approx(rigs[1].friction_torque("brake_1"), rel=0.05), "the brake holds it"
    assert torque_of["set_1_output_torque"] == pytest.approx(-112 / 40 * torque_of["set_1_input_torque"], rel=1e-9)


WRONG = {
    "speeds that contradict": (
        '  input: {inertia: [0.05 kg m2, "assumed"]}\n  drum: {inertia: [2.0 kg m2, "assumed"]}',
        "  input: {inertia: [0.05 kg m2, x], speed: [9 rad/s, x]}\n  drum: {inertia: [2 kg m2, x], speed: [9 rad/s, x]}",
        "by the others 'drum' would have 0.45 rad/s",
    ),
    "an efficiency above 1": ('[60 %, "assumed"]', '[160 %, "assumed"]', "worm.efficiency is 160 %, outside 0.1 to 100 %"),
    "a table and a value": (
        "    table: [[[0 rpm, 1 Nm",
        "    efficiency: [60 %, x]\n    table: [[[0 rpm, 1 Nm",
        "has the keys efficiency and table",
    ),
    "a table back only": ("    table: [[[0 rpm, 1 Nm, 70 %], ", "    tables: [[[0 rpm, 1 Nm, 70 %], ", "unknown key 'tables'"),
    "a table above 1": ("[0 rpm, 60 %], [900", "[0 rpm, 160 %], [900", "efficiency of mesh 'bevel' from rotor back to end is 1.6"),
    "an efficiency without a name": ("{name: worm, bodies", "{bodies", "mesh 1 has an efficiency and no name"),
    "the way back without the way there": ('efficiency: [60 %, "assumed"], back', "back", "has the key back and no efficiency"),
    "a mesh that loses on a wheel": (
        '  drum: {inertia: [2.0 kg m2, "assumed"]}',
        "  drum: massless",
        "both sides of a mesh with an efficiency need an inertia",
    ),
    "a set that loses above 1": ('[80 %, "assumed"]', '[180 %, "assumed"]', "reducer.efficiency is 180 %, outside 0.1 to 100 %"),
    "a set with the way back only": (
        'efficiency: [80 %, "assumed"], back',
        "back",
        "planetary_sets.reducer has the key back and no",
    ),
    "a set that loses on a wheel": (
        '  pinion: {inertia: [0.1 kg m2, "assumed"]}',
        "  pinion: massless",
        "all members of a set with an efficiency need an inertia",
    ),
    "a name twice": ("name: worm", "name: drum", "meshes.drum: there is 'drum' among the bodies already"),
    "a relation of one": ("{carrier: 2, left: -1, right: -1}", "{carrier: 2}", "must be a map of two bodies or more"),
    "a coefficient of none": (
        "left: -1, right",
        "left: 0, right",
        "relations.differential.coefficients.left is 0, expected a number other",
    ),
    "a body that is not there": (
        "coefficients: {carrier",
        "coefficients: {carier",
        "names the body 'carier'; did you mean 'carrier'",
    ),
    "a shaft with both": (
        'damping: [0.4 Nm s/rad, "assumed"]',
        'damping: [0.4 Nm s/rad, "assumed"]\n    stiffness: [500 Nm/rad, x]',
        "shafts.soft must have one of the keys stiffness, and table",
    ),
    "a shaft that falls": (
        "[0.2 rad, 60 Nm]]",
        "[0.2 rad, 6 Nm]]",
        "the table of shaft 'soft' needs two points or more, twists rising",
    ),
    "a table that goes back": (
        "[0.2 rad, 60 Nm]]",
        "[0.02 rad, 60 Nm]]",
        "'0.02 rad' comes after '0.05 rad'; the points of a table must rise",
    ),
    "a unit of another dimension": ("[0.2 rad, 60 Nm]]", "[0.2 rad/s, 60 Nm]]", "is an angular velocity, expected an angle"),
    "a point of three": ("[0.2 rad, 60 Nm]]", "[0.2 rad, 60 Nm, 1]]", r"a point is \[angle, torque\], each with its unit"),
    "a table without a source": (
        '[[[0 rad/s, -30 Nm]], "assumed"]',
        "[[0 rad/s, -30 Nm]]",
        "torques.weight.table must be .value with unit or table",
    ),
    "backlash below 0": ('[1.5 deg, "assumed"]', '[-1.5 deg, "assumed"]', "soft.backlash is -1.5 deg, outside 0 to"),
    "a spring of one number": ("[[300 Nm/rad, 2 Nm],", "[[300 Nm/rad],", r"a spring is \[stiffness, torque\]"),
    "a spring without torque": ("[300 Nm/rad, 2 Nm]", "[300 Nm/rad, 0 Nm]", "torque in the hysteresis of shaft 'soft' is 0.0"),
    "no such file": ("shoes.csv", "shoe.csv", "capacity.table: .*shoe.csv cannot be read"),
    "a clutch on one body": ("joins: [engine, saw]", "body: engine", "clutches.shoes lacks the key 'joins'"),
    "a stick limit below 1": ("stick_back: [1.1 -,", "stick_back: [0.9 -,", "across.stick_back is 0.9 -, outside 1 to 10"),
    "friction that begins late": (
        "[[[0 rad/s, 1 -], [20 rad/s",
        "[[[1 rad/s, 1 -], [20 rad/s",
        "the table of friction of 'low' needs slips that rise from 0",
    ),
    "a law over time": (
        "gravity: {body: swing, by: angle",
        "gravity: {body: swing, by: time",
        "what depends on time alone belongs under inputs",
    ),
    "a law of nobody": (
        "tyre: {body: right, of: across",
        "tyre: {body: right, of: acros",
        "expected a body, or a clutch or brake whose slip counts; did you mean 'across'",
    ),
    "a torque on both": (
        "air: {body: saw,",
        "air: {body: saw, joins: [saw, engine],",
        "torques.air must have one of the keys body",
    ),
    "a speed at which it jumps": ("[1000 rpm, -4 Nm]", "[0 rpm, -4 Nm]", "the table of torque 'air' jumps at 0 rad/s"),
    "a period that is another": (
        'period: [360 deg, "one turn"], angle: [0.5',
        'period: [350 deg, "one turn"], angle: [0.5',
        "the table of torque 'gravity' reaches over 6.28319; its period is 6.10865",
    ),
    "an inertia below 0": ("[180 deg, 0.03 kg m2]", "[180 deg, -0.03 kg m2]", "the table of varying inertia 'cam' falls to -0.03"),
    "a rod that is too short": ("rod: [200 mm", "rod: [20 mm", "rod of slider-crank 'piston' is 0.02 m, its radius 0.08 m"),
    "two motions of one": (
        "  shake: {body: shaker}",
        "  shake: {body: shaker}\n  again: {body: shaker}",
        "motions prescribe the speeds of bodies",
    ),
    "an input of nobody": (
        "  engine: [12 Nm",
        "  engin: [12 Nm",
        "inputs.engin: nothing of this name takes an input; did you mean 'engine'",
    ),
    "an input of another dimension": ("  engine: [12 Nm", "  engine: [12 rpm", "is an angular velocity, expected a torque"),
    "a capacity below 0": ("[0.2 s, 3 Nm]]", "[0.2 s, -3 Nm]]", "inputs.across falls to -3; a capacity is at least 0"),
    "a time that comes back": ("[0.31 s, -2 Nm]]", "[0.2 s, -2 Nm]]", "inputs.input: '0.2 s' comes after '0.3 s'"),
    "signals of another kind": (
        "signals: [torques]",
        "signals: [torque]",
        r"signals is .'torque'., expected .torques., which records",
    ),
    "a heat of nothing": ("{grip: [90 %", "{grib: [90 %", "heat of 'grib': there is no 'grib' that can lose; there are: .* grip"),
    "a state that is not there": ("of: [left, lining]", "of: [left, linin]", "expected a state; did you mean 'lining'"),
    "an unknown key": ("    body: ring", "    body: ring\n    stik: [2 -, x]", "unknown key 'stik' in low; did you mean 'stick'"),
}


@pytest.mark.parametrize("what", WRONG)
def test_a_wrong_element_is_refused_in_one_sentence_with_its_line(tmp_path, what, capsys):
    old, new, sentence = WRONG[what]
    assert old in TEXT, "the edit fits no line of the rig"
    folder = tmp_path / "rig"
    shutil.copytree(FOLDER, folder)
    (folder / "rig.yaml").write_text(TEXT.replace(old, new, 1))
    with pytest.raises(RigError, match=sentence) as refused:
        load_rig(folder)
    error = str(refused.value)
    assert "rig.yaml:" in error and "\n" not in error and "driveline:" not in error
    assert main(["check", str(folder), "--picture", str(tmp_path / "p.svg")]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1 and not (tmp_path / "p.svg").exists()


@pytest.mark.parametrize(
    "text, sentence",
    [
        ("", "needs a heading"),
        ("speed, torque\n0, 0\n", "the heading 'speed' names no unit of angular velocity"),
        ("speed [rpm], torque [Nm]\n0, zero\n", "row 2, '0,zero', is not two numbers"),
        ("speed [rpm], torque [Nm]\n10, 1\n5, 2\n", "row 3: 5 comes after 10"),
        ("speed [rpm], torque [Nm]\n1,2,3\n", "of two columns each"),
        ("speed [rpm], torque [Nm]\n1, inf\n", "all finite"),
    ],
)
def test_a_wrong_table_beside_the_file_is_refused_in_one_sentence(tmp_path, text, sentence):
    folder = tmp_path / "rig"
    shutil.copytree(FOLDER, folder)
    (folder / "shoes.csv").write_text(text)
    with pytest.raises(RigError, match=sentence) as refused:
        load_rig(folder)
    assert "rig.yaml:" in str(refused.value) and "\n" not in str(refused.value)
