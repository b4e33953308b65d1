# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A user's own rig is written, checked, drawn and run; a variant names only the values that differ."""

import json
import xml.etree.ElementTree as ElementTree

import pytest

from rig_nodes.bags.reader import Bag
from rig_nodes.base.config import RIGS_DIR
from rig_nodes.base.names import installed
from rig_nodes.cli.main import main
from rig_nodes.rig.configuration import load_rig
from rig_nodes.runs.recorded import record
from rig_nodes.runs.rig import Rig
from rig_nodes.runs.sequence import load_sequence


@pytest.fixture(scope="module")
def mine(tmp_path_factory):
    """The folder that `rig new rig` writes."""
    folder = tmp_path_factory.mktemp("rigs") / "mine"
    assert main(["new", "rig", str(folder)]) == 0
    return folder


def test_what_is_written_runs_and_shifts_well(mine, tmp_path):
    assert main(["simulate", "demo", "--rig", str(mine), "--out", str(tmp_path / "run")]) == 0
    report = json.loads((tmp_path / "run" / "report.json").read_text())
    assert [(verdict["grade"], verdict["reasons"]) for verdict in report["quality"]] == [("good", [])] * 2
    assert all(row["overlap_s"] < 0.4 for row in report["shifts"]), "the old clutch lets go"
    bag = Bag(tmp_path / "run")
    gears = [message.gear for _, message in bag.messages("/gearbox/state")]
    assert [gear for k, gear in enumerate(gears) if k == 0 or gear != gears[k - 1]] == [0, 1, 0, 2, 0, 1]


def test_it_meets_its_own_validation_rows(mine, capsys):
    assert main(["validate", "--rig", str(mine), "--jobs", "1"]) == 0
    assert "predicted inside 1 of 1; calibrated inside 1 of 1" in capsys.readouterr().out


def test_it_is_not_written_over_anything(mine, capsys):
    before = (mine / "rig.yaml").read_text()
    assert main(["new", "rig", str(mine)]) == 2
    assert "is not empty, expected a new or empty folder" in capsys.readouterr().err
    assert (mine / "rig.yaml").read_text() == before


DRAWN = ("chapter9", "three_speed", "hydmag_hydrostatic")  # in a campaign: all


@pytest.mark.parametrize(
    "rig", [*DRAWN, *(pytest.param(rig, marks=pytest.mark.campaign) for rig in installed("rigs") if rig not in DRAWN)]
)
def test_check_says_what_a_rig_comes_to_and_draws_it(rig, tmp_path, capsys):
    picture = tmp_path / "picture.svg"
    assert main(["check", rig, "--picture", str(picture)]) == 0
    output, config = capsys.readouterr().out, load_rig(rig)
    for gear in config.structure.gears:
        assert f"gear {gear.name}: " in output
    words = " ".join(element.text or "" for element in ElementTree.parse(picture).iter())
    for name in (*config.structure.bodies, *(clutch.called for clutch in config.structure.clutches if "joins" in clutch.wires)):
        assert name in words


def test_the_picture_lies_in_the_folder_of_the_rig_and_its_path_is_printed(mine, tmp_path, monkeypatch, capsys):
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    for last_line in (
        f"picture of the driveline: {mine / 'picture.svg'} (written)",
        f"picture of the driveline: {mine / 'picture.svg'}",
    ):
        assert main(["check", str(mine)]) == 0
        assert capsys.readouterr().out.splitlines()[-1] == last_line
    before = (RIGS_DIR / "three_speed" / "picture.svg").stat().st_mtime_ns
    assert main(["check", "three_speed"]) == 0
    assert capsys.readouterr().out.splitlines()[-1] == f"picture of the driveline: {RIGS_DIR / 'three_speed' / 'picture.svg'}"
    assert (RIGS_DIR / "three_speed" / "picture.svg").stat().st_mtime_ns == before, "an installed rig is not written to"
    (tmp_path / "other.yaml").write_text(f"description: another\nbase: {mine}\n")
    assert main(["check", str(tmp_path / "other.yaml")]) == 0
    assert (tmp_path / "other.svg").is_file() and not list((tmp_path / "here").iterdir())
    assert main(["check", str(mine), "--picture", "mine.png"]) == 2
    assert "--picture mine.png: what is written there is a file that ends in .svg" in capsys.readouterr().err


def test_a_variant_says_only_what_differs(mine, tmp_path):
    into = tmp_path / "other"
    into.mkdir()
    (into / "rig.yaml").write_text(f'description: heavier\nbase: {mine}\nbodies:\n  output:\n    inertia: [0.3 kg m2, "tried"]\n')
    base, other = load_rig(mine), load_rig(into)
    assert (base.output.inertia, other.output.inertia) == (0.15, 0.3)
    assert other.name == "other" and other.motor == base.motor and other.structure == base.structure
    assert load_sequence("demo", None, into).name == "demo", "its base's sequences are its own"


# ---- three speeds by hand: 1 + 72/40, 56/35, 1


RATIOS = {1: 2.8, 2: 1.6, 3: 1.0}


@pytest.fixture(scope="module")
def three():
    return load_rig("three_speed", {"effects.transducers": "off"})


def test_the_ratios_follow_from_the_teeth(three):
    assert three.transmission.ratios == {number: pytest.approx(ratio, rel=1e-12) for number, ratio in RATIOS.items()}


@pytest.mark.parametrize("gear", RATIOS)
def test_steady_states_are_those_of_a_calculation_by_hand(three, gear):
    """By hand: load, 3 Nm of drag at the output and drag of open clutches; 2 Nm and 2 % of the clutches' torque at the input."""
    rig = Rig(three)
    rig.set("oil", 4e6, True)
    rig.advance(0.3)
    rig.order_gear(gear)
    rig.advance(1.5)
    rig.set("motor", 100.0, True)
    rig.set("load", 3e6, True)
    rig.advance(6.0)
    assert rig.locked_gear() == gear
    w_in, w_out = rig.true("input.speed"), rig.true("output.speed")
    assert w_in == pytest.approx(100.0, rel=1e-4) and w_out == pytest.approx(w_in / RATIOS[gear], rel=1e-9)
    load = rig.load_torque()
    n = w_out * 30 / 3.141592653589793
    assert load == pytest.approx(100e-6 / (2 * 3.141592653589793) * 3e6 * (3.84e-7 * n * n - 6.36e-4 * n + 1.32) + 0.5, rel=1e-3)
    ring = (112 * w_out - 40 * w_in) / 72
    slips = {
        "brake_1": (ring, -40 / 72, 112 / 72),
        "clutch_2": (35 / 56 * w_in - w_out, 35 / 56, -1.0),
        "clutch_3": (w_in - w_out, 1.0, -1.0),
    }  # slip, and its derivatives by the speeds of input and output
    drags = {name: float(rig.device(name)["drag"]) * slip for name, (slip, *_) in slips.items()}
    held = {1: "brake_1", 2: "clutch_2", 3: "clutch_3"}[gear]
    # balance at the output: the held clutch's torque carries load, bearings and drag
    at_output = load + 3.0 + sum(drags[name] * slips[name][2] for name in slips)
    torque = -at_output / slips[held][2]
    assert rig.friction_torque(held) == pytest.approx(torque, rel=2e-3)
    given = sum(drags[name] * slips[name][1] for name in slips) + torque * slips[held][1]
    lost = 2.0 + 0.02 * abs(torque * slips[held][1])
    assert rig.true("M_in") == pytest.approx(given + lost, rel=2e-3)


def test_all_gears_up_and_down_under_load(three):
    run = record(three, load_sequence("demo", None, "three_speed"))
    assert run.end["state"] == "ended", run.end
    n_in, n_out = (run.recording.channels[name] for name in ("n_in", "n_out"))
    orders = [(round(at * 1e4), before, gear) for at, before, gear in run.recording.orders]
    assert [gear for *_, gear in orders] == [1, 2, 3, 2, 1]
    for (_, _, gear), (at, *_) in zip(orders[1:], [*orders[2:], (len(n_in) - 6_000, 0, 0)]):
        assert n_in[at - 10] / n_out[at - 10] == pytest.approx(RATIOS[gear], rel=1e-3)
    assert n_out[orders[1][0] : orders[-1][0]].min() > 0.8 * n_in.max() / 2.8, "under load all the way"


def test_the_energy_of_a_run_closes(three):
    rig = Rig(three)
    rig.set("oil", 4e6, True)
    rig.advance(0.3)
    for gear in (1, 2, 3):
        rig.order_gear(gear)
        rig.set("motor", 100.0, True)
        rig.set("load", 3e6, True)
        rig.advance(3.0)
    energy = rig.energy()
    assert energy["motor"] > 1e4 and abs(energy["residual"]) < 1e-9 * energy["motor"]


def test_a_rig_is_its_folder_wherever_it_lies(mine, tmp_path):
    assert load_rig(str(mine)).name == "mine" and load_rig(mine / "rig.yaml").as_dict() == load_rig(mine).as_dict()
    assert sorted(path.name for path in (RIGS_DIR / "three_speed").iterdir()) == [
        "calibration.yaml",
        "controller.yaml",
        "picture.svg",
        "rig.yaml",
        "sequences",
        "validation.yaml",
    ]
