# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The frame saw with a swinging sash: the paper's kinematics, sash and teeth against closed forms and scipy, its motors."""

import math
import re

import numpy as np
import pytest
from ruamel.yaml import YAML

from rig_nodes.base.config import RIGS_DIR
from rig_nodes.base.errors import RigError
from rig_nodes.driveline.builder import Driveline
from rig_nodes.driveline.run import run
from rig_nodes.plant.parts.sash import motion
from rig_nodes.plant.parts.saw_cutting import depth_of_cut, feed_per_tooth
from rig_nodes.rig.configuration import load_rig
from rig_nodes.runs.calculations import Recorded, calculations_of
from rig_nodes.runs.rig import Rig

CALCULATIONS = calculations_of("frame_saw")
TRUE = {"effects.transducers": "off"}
SPEED = 980 * math.pi / 30.0  # of the motor
OLD, NEW = 15e-3, 31.5e-3  # m: feeds of the sequence demo


def saw(feeds: tuple[tuple[float, float], ...], **settings: str) -> tuple[Rig, Recorded]:
    """Returns a rig after some feeds [m], each for a time [s], and the true values of its logger."""
    rig, rows = Rig(load_rig("frame_saw", {**TRUE, **{name.replace("__", "."): value for name, value in settings.items()}})), []
    rig.set("motor", SPEED, True)
    for feed, seconds in feeds:
        rig.set("feed", feed, feed > 0.0)
        for _ in range(round(seconds)):
            rig.advance(1.0)
            rows.append(rig.take_rows(10_000)[1])
    values = np.concatenate(rows)
    return rig, Recorded(1e-4 * np.arange(len(values)), [], dict(zip(rig.logger_names, values.T)), str)


@pytest.fixture(scope="module")
def config():
    return load_rig("frame_saw", TRUE)


@pytest.fixture(scope="module")
def sawn():
    """The rig as it is, settled at no feed, the old and the new one."""
    return saw(((0.0, 25.0), (OLD, 15.0), (NEW, 20.0)))


def table(name: str, config, recording: Recorded | None = None) -> list[dict]:
    found = CALCULATIONS[name].table(config, recording)
    return [dict(zip(found.columns, row)) for row in found.in_units()]


# ---- the paper


def test_every_number_of_table_1_is_rounded_cut_off_or_swapped(config):
    rows = table("feed_table", config)
    assert len(rows) == 36
    assert all(abs(row["feed_per_tooth"] - row["printed"]) < 0.01 for row in rows if not row["print"].startswith("swapped"))
    counts = {row["print"]: row["count"] for row in table("print_errors", config)}
    assert counts["not explained"] == 0 and counts["rounded"] == 23 and sum(counts.values()) == 36


def test_every_number_of_the_paper_has_its_row(config):
    rows = YAML(typ="safe").load((RIGS_DIR / "frame_saw" / "validation.yaml").read_text())["rows"]
    printed = " ".join(f"{row.get('printed', '')} {row['text']} {row['low']} {row['high']}" for row in rows)
    numbers = [
        "200",
        "26",
        "3.25",
        "30",
        "20",
        "10",
        "1.7",
        "2.5",
        "18",
        "28",
        "65",
        "75",
        "1.5",
        "37",
        "2",
        "360",
        "720",
        "1",
        "3.43",
        "45",
        "2.0",
        "2.2",
    ]
    numbers += [f"{row['printed']:.2f}" for row in table("feed_table", config)]
    assert [one for one in numbers if not re.search(rf"(?<![\d.]){re.escape(one)}(?![\d])", printed)] == []


def test_the_printed_radius_belongs_to_a_third_of_the_mean_and_not_to_half_of_it(config):
    radius = {row["end_feed"]: row["radius"] for row in table("eccentric", config)}
    assert radius["a third of the mean"] == pytest.approx(3.25, abs=0.005)
    assert radius["half of the mean"] == pytest.approx(2.87, abs=0.005)


def test_the_swing_advances_the_blades_in_the_middle_half_of_the_half_turn(config):
    turns = {row["turn"]: row for row in table("eccentric_phase", config)}
    assert turns["to advancing"]["angle"] == pytest.approx(45.0, abs=0.01)
    assert turns["to drawing back"]["angle"] == pytest.approx(135.0, abs=0.01)
    assert turns["to advancing"]["of_stroke"] == pytest.approx(50.0 - 50.0 / math.sqrt(2.0), abs=0.01)


@pytest.mark.parametrize("swing", [0.0, 1e-3, 3.25e-3, 8e-3])
@pytest.mark.parametrize("feed", [5e-3, 20e-3, 30e-3])
def test_the_teeth_take_away_what_the_feed_brings(feed, swing):
    angles = np.arccos(1.0 - 2.0 * (np.arange(20_000) + 0.5) / 20_000)
    depths = np.array([depth_of_cut(angle, feed, swing, 0.065) for angle in angles])
    assert np.maximum(depths, 0.0).mean() / 0.065 == pytest.approx(feed, rel=1e-3)


def test_where_no_wood_is_gone_before_it_the_feed_per_tooth_is_formula_8():
    for y in np.linspace(0.06, 0.4, 50):
        depth = depth_of_cut(math.acos(max(1.0 - y / 0.2, -1.0)) - 1e-12, 30e-3, 3.25e-3, 0.065)
        assert depth == pytest.approx(feed_per_tooth(y, 30e-3, 3.25e-3, 0.2, 0.026), abs=1e-8)


def test_nothing_is_cut_and_nothing_scraped_without_a_log():
    _, recording = saw(((0.0, 10.0), (NEW, 3.0), (0.0, 6.0)))
    assert np.abs(recording["M_saw"][:100_000]).max() == 0.0
    assert recording["M_saw"][100_000:130_000].max() > 1000.0
    assert np.abs(recording["M_saw"][-10_000:]).max() == 0.0


# ---- sash and teeth in the engine


def test_the_derivatives_of_the_travel_are_those_of_its_difference_quotients():
    for rod in (0.0, 0.3, 0.8):
        for angle in np.linspace(0.1, 6.2, 23):
            low, high = motion(angle - 1e-5, 0.2, rod), motion(angle + 1e-5, 0.2, rod)
            _, first, second = motion(angle, 0.2, rod)
            assert (high[0] - low[0]) / 2e-5 == pytest.approx(first, abs=1e-8)
            assert (high[1] - low[1]) / 2e-5 == pytest.approx(second, abs=1e-8)


def test_the_sash_turns_like_the_slider_crank_of_the_driveline(config):
    """A crank that coasts from a speed, without motor, weight and drag; driveline.laws solves this in another way."""
    free = {
        "bearings.drag": "0 Nm s/rad",
        "saw.blades": "0 -",
        "sash.weight": "0 -",
        "sash.rod_ratio": "0.25 -",
        "crank.inertia": "20 kg m2",
    }
    rig = Rig(load_rig("frame_saw", {**TRUE, **free}))
    rig.set("motor", SPEED, True)
    rig.advance(12.0)
    rig.set("motor", 0.0, False)
    rig.advance(0.3)
    state, speed, driving = rig.device("sash"), rig.true("crank.speed"), rig.true("motor.speed")
    twist = float(rig.world.line["twist"][0])
    d = Driveline()
    d.inertia("motor", 2.5, driving)
    d.inertia("crank", 20.0, speed)
    d.shaft("belt", "motor", "crank", stiffness=40_000.0, damping=60.0, cb=3.4386, twist=twist)
    d.slider_crank("sash", "crank", mass=250.0, radius=0.2, rod=0.8, angle=float(state["angle"]))
    rig.advance(1.0)
    there = run(d.build(), 1.0, 1e-4, {}).speed("crank")
    assert rig.true("crank.speed") == pytest.approx(there[-1], abs=2e-4)
    assert np.ptp(there) > 0.05 * there[-1], "the sash must slow and drive the crank"


def test_energy_closes_to_a_millionth_of_what_flows_with_the_sashs_own_stored(sawn):
    rig, _ = sawn
    energy = rig.energy()
    assert energy["motor"] > 1e6 and energy["load"] > 0.8e6
    assert abs(energy["residual"]) < 1e-6 * energy["motor"]
    assert abs(float(rig.device("sash")["lacking"])) < 1e-3


def test_the_sash_is_of_second_order_in_the_step():
    """With a crank as light as the sash's own reduced inertia, and a short rod."""
    light = {"saw__blades": "0 -", "crank__inertia": "15 kg m2", "sash__rod_ratio": "0.3 -"}
    ends = [saw(((0.0, 9.0),), kernel__step=step, **light)[0].true("crank.speed") for step in ("100 us", "50 us", "25 us")]
    assert (ends[0] - ends[1]) / (ends[1] - ends[2]) == pytest.approx(4.0, rel=0.1)
    assert abs(ends[0] - ends[1]) < 1e-5 * ends[0]


def test_speed_and_power_over_a_turn_are_those_of_scipy(sawn, config):
    """The integration by scipy uses the formulas of the paper and the rig's values, but no code of the engine."""
    _, recording = sawn
    ours, theirs = table("ripple", config, recording), table("steady_turn", config)
    for mine, other in zip(ours, theirs, strict=True):
        assert mine["phase"] == other["phase"]
        assert mine["speed"] == pytest.approx(other["speed"], rel=1e-3)
        assert mine["ripple"] == pytest.approx(other["ripple"], rel=2e-3)
        for name in ("motor", "motor_least", "motor_most", "teeth", "teeth_most"):
            assert mine[name] == pytest.approx(other[name], rel=3e-3, abs=0.05), (mine["phase"], name)


def test_the_quasi_static_turn_is_that_of_a_stiff_belt_and_a_motor_without_delay():
    stiff = {"belt__stiffness": "4000000 Nm/rad", "belt__damping": "600 Nm s/rad", "motor_drive__torque_time": "0.1 ms"}
    rig, recording = saw(((0.0, 25.0), (OLD, 15.0), (NEW, 20.0)), **stiff)
    for mine, other in zip(table("ripple", rig.config, recording), table("quasi_static", rig.config), strict=True):
        assert mine["ripple"] == pytest.approx(other["ripple"], rel=5e-3)
        assert mine["motor"] == pytest.approx(other["motor"], rel=5e-3)
        assert mine["teeth"] == pytest.approx(other["teeth"], rel=3e-3, abs=0.05)


def test_inertia_forces_on_the_frame_are_those_of_the_calculation(config):
    _, recording = saw(((0.0, 12.0),))
    slow = recording["n_crank"][-10_000:]
    share = (slow.max() * 30.0 / math.pi / 285.0) ** 2
    best = next(row for row in table("balance", config) if row["rod_ratio"] == 0.0 and row["counterweight"] == 50.0)
    # the crank's own angular acceleration adds at most a twentieth
    for name, column in (("F_along", "vertical"), ("F_across", "horizontal")):
        largest = np.abs(recording[name][-10_000:]).max() / 1e3
        assert best[column] * 0.95 < largest < best[column] * share * 1.05


# ---- the motors


def test_45_kw_fall_short_of_twice_the_output_and_65_kw_do_not(sawn, config):
    rig, recording = saw(((0.0, 12.0), (OLD, 4.0), (NEW, 25.0)), motor_drive__power_limit="45 kW")
    weak = table("ripple", rig.config, recording)[-1]
    assert weak["output"] < 1.8 and weak["motor"] == pytest.approx(45.0, abs=0.1) and weak["speed"] < 0.9 * 285
    assert table("ripple", config, sawn[1])[-1]["output"] == pytest.approx(2.1, abs=0.01)
    needed = {(row["frame"], round(row["output"], 1)): row["motor"] for row in table("sawing_power", config)}
    assert needed["without swing", 1.0] == pytest.approx(45.0, abs=0.5)
    assert 45.0 < needed["with swing", 2.0] < needed["with swing", 2.2] < 65.0


def test_the_frame_without_swing_takes_an_older_motors_power_at_the_output_of_the_calculation(config):
    older = table("older_motors", config)[0]
    assert older["growth"] == 1.7 and older["motor"] == pytest.approx(45.0 / 1.7)
    without = {"saw__eccentric_radius": "0 mm", "saw__cutting_pressure": "58.9 MPa"}
    _, recording = saw(((0.0, 12.0), (older["output"] * OLD, 12.0)), **without)
    last = slice(-20_000, None)  # some nine turns
    assert np.mean((recording["M_motor"] * recording["n_motor"])[last]) == pytest.approx(older["motor"] * 1e3, rel=0.02)


def test_a_stalled_saw_stands_and_is_not_driven_back_by_its_teeth():
    rig, recording = saw(((0.0, 12.0), (50e-3, 20.0)), motor_drive__power_limit="20 kW", motor_drive__torque_limit="250 Nm")
    assert abs(recording["n_crank"][-1]) < 1e-6
    assert recording["n_crank"].min() > -0.5
    assert abs(rig.energy()["residual"]) < 1e-6 * rig.energy()["motor"]


# ---- what is refused


@pytest.mark.parametrize(
    "line, wrong, sentence",
    [
        ("    radius: [200 mm", "    radius: [-200 mm", "radius"),
        ("    pitch: [26 mm", "    pitch: [26 kg", "pitch"),
        ("    sash: sash\n", "    sash: motor_drive\n", "motor_drive"),
        ("    rod_ratio: [0 -", "    rod_ratio: [1.2 -", "rod_ratio"),
        ("    blades: [10 -", "    blade: [10 -", "blade"),
    ],
)
def test_a_wrong_value_is_one_sentence_with_file_and_line(line, wrong, sentence, tmp_path):
    text = (RIGS_DIR / "frame_saw" / "rig.yaml").read_text(encoding="utf-8")
    assert text.count(line) == 1
    (tmp_path / "rig.yaml").write_text(text.replace(line, wrong))
    number = text[: text.index(line)].count("\n") + 1
    with pytest.raises(RigError) as caught:
        load_rig(tmp_path)
    assert f"rig.yaml:{number}" in str(caught.value) and sentence in str(caught.value) and "\n" not in str(caught.value)
