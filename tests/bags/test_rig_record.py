# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The rig of a bag: it is found from the bag's own record, of any age and without the rig's folder, otherwise from the topics."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from rig_nodes.bags.old_form import record_of_today
from rig_nodes.bags.opened import OpenedBags
from rig_nodes.bags.reader import Bag
from rig_nodes.bags.rig_in_bag import rig_record
from rig_nodes.base.config import RIGS_DIR
from rig_nodes.base.errors import BagError
from rig_nodes.cli.main import main
from rig_nodes.rig.configuration import load_rig
from rig_nodes.rig.recorded_rig import config_of_record
from rig_nodes.runs.run_file import Ordered, write_run
from rig_nodes.runs.sequence import load_sequence
from rig_nodes.runs.simulation import simulate

BEFORE = Path(__file__).parent / "before"  # the sample bag of version 0.1.0
SHORT = """
rig: ./mine
description: a gear laid in
steps:
  - oil: {pressure: 4 MPa}
  - wait: {for: 300 ms}
  - shift: {to: 1}
  - wait: {for: 200 ms}
"""


@pytest.fixture(scope="module")
def foreign(tmp_path_factory):
    """The run of a rig in a folder of its own, which does not exist any more."""
    folder = tmp_path_factory.mktemp("foreign")
    mine = folder / "mine"
    shutil.copytree(RIGS_DIR / "three_speed", mine)
    rig = (mine / "rig.yaml").read_text().replace("n_out", "n_wheel").replace("called: C2", "called: K2")
    (mine / "rig.yaml").write_text(rig)
    sequence = folder / "short.yaml"
    sequence.write_text(SHORT)
    simulate(load_rig(mine), load_sequence(sequence, default="hydmag"), folder / "run")
    shutil.rmtree(mine)
    return folder / "run"


def test_a_bag_knows_its_rig_after_the_rigs_folder_is_gone(foreign):
    bag = Bag(foreign)
    assert [clutch.name for clutch in bag.transmission.clutches] == ["B1", "K2", "C3"]
    assert bag.series("n_wheel")[0].size and "n_out" not in bag.catalogue.signals
    assert set(bag.types) <= set(bag.catalogue.all_topics)
    with OpenedBags([foreign]) as index:
        assert index.bag(["/rig/run_info"]).catalogue == bag.catalogue


def test_such_a_bag_is_reported_under_its_own_names(foreign):
    assert main(["report", str(foreign)]) == 0
    report = json.loads((foreign / "report.json").read_text())
    assert "heat_k2_j" in report["energy"]["run"] and report["basis"]["rig"] == "mine"


def test_such_a_bag_is_viewed_under_its_own_names(foreign, capsys):
    pytest.importorskip("rerun")
    assert main(["view", str(foreign), "--no-open"]) == 0
    out = capsys.readouterr()
    assert "written" in out.out and "holds nothing of" not in out.err


def test_a_bag_cut_off_before_its_record_is_of_the_rig_that_was_ordered(foreign, tmp_path, capsys):
    """A recorder killed in its first moments has stored some topics and not yet what the rig is."""
    cut = ["bag", "cut", str(foreign), "--topics", "/load_pump/n_wheel,/rig/state", "--out", str(tmp_path / "run")]
    assert main(cut) == 0
    bag = Bag(tmp_path / "run")
    assert bag.run_info() == {}, "the condition of the test"
    config = config_of_record(Bag(foreign).record, "the bag")
    write_run(tmp_path / "run", Ordered(config, "mine"))
    bag = Bag(tmp_path / "run")
    assert bag.record == config.as_dict()
    assert np.array_equal(bag.series("n_wheel"), Bag(foreign).series("n_wheel"))
    capsys.readouterr()
    assert main(["report", str(tmp_path / "run")]) == 2
    assert "record of the rig" not in capsys.readouterr().err


def test_a_record_of_before_has_a_rigid_input_shaft_and_else_the_values_of_today():
    old = Bag(BEFORE).run_info()["configuration"]
    record, today = rig_record(old), load_rig("hydmag").as_dict()
    assert "structure" not in old and record["structure"] == load_rig("chapter9").as_dict()["structure"]
    assert not {"rotor", "input_shaft"} & set(record)
    changed = {**old, "gearbox": {**old["gearbox"], "inertia_in": 0.5, "loss_out_constant": 3.0}}
    record = record_of_today(changed)
    assert (record["w0"]["inertia"], record["loss_out"]["drag"], record["loss_in"]["at_470"]) == (0.5, 3.0, 7.5554)
    assert old["clutch_s1"].items() <= record["clutch_s1"].items() and "gearbox" not in record
    assert record["alfa46"] == {**today["alfa46"], **old["alfa46"]}
    assert record_of_today(today) is today


def test_a_bench_of_before_is_read_likewise():
    old = {
        "kind": "clutch_bench",
        "name": "mine",
        "hydraulic_motor": {"inertia": 0.07, "friction": 5.0},
        "shaft": {"inertia": 0.04, "meter_stiffness": 4e4, "meter_damping": 9.0},
        "pack": {"rest_torque": 12.0},
        "plate_pack": {"surfaces": 10.0},
    }
    record = record_of_today(old)
    assert record["motor"] == {"inertia": 0.07} and record["shaft"] == {"inertia": 0.04}
    assert record["torque_meter"] == {"stiffness": 4e4, "damping": 9.0} and record["clutch_pack"]["rest_torque"] == 12.0
    assert record["hydraulic_motor"]["friction"] == 5.0 and "inertia" not in record["hydraulic_motor"]
    assert record["plate_pack"]["surfaces"] == 10.0 and record["plate_pack"]["inner_radius"] == 0.04 and record["name"] == "mine"


@pytest.mark.parametrize("rig", ["hydmag", "clutch_bench", "three_speed"])
def test_a_bag_that_says_nothing_of_its_rig_is_of_the_one_with_its_topics(rig):
    config = load_rig(rig)
    assert rig_record(None, config.catalogue.topics)["structure"] == config.as_dict()["structure"]


@pytest.mark.parametrize("verb", ["report", "export", "view", "compare"])
def test_a_verb_that_takes_an_installed_rig_for_a_bag_without_its_own_says_so_once(verb, tmp_path, capsys):
    bag, sample = str(tmp_path / "bag"), str(BEFORE.parents[2] / "bags" / "sample")
    assert main(["bag", "cut", sample, "--exclude-regex", "/rig/run_info", "--out", bag]) == 0
    rest = {"report": ["--json"], "view": ["--no-open"], "compare": [sample]}.get(verb, ["-o", str(tmp_path / "run.csv")])
    if verb == "view":
        pytest.importorskip("rerun")
    capsys.readouterr()
    assert main([verb, *["csv"] * (verb == "export"), bag, *rest]) == 0
    out = capsys.readouterr()
    sentence = "does not name its rig, and is read as a bag of the installed rig 'hydmag', whose topics are most like its own"
    assert out.err.count(sentence) == 1 and sentence not in out.out


@pytest.mark.parametrize(
    "record",
    [
        {"gearbox": 3},
        {"structure": {}},
        {"structure": 3},
        {"structure": {"bodies": ["a"] * 1000}},
        {"structure": {**load_rig("hydmag").as_dict()["structure"], "devices": [{"name": "x", "part": "os"}]}},
    ],
    ids=["values that are none", "empty", "a number", "a thousand bodies", "a part that there is not"],
)
def test_a_record_that_is_none_is_refused_in_one_sentence(record, monkeypatch):
    bag = Bag(BEFORE)
    monkeypatch.setattr(bag, "run_info", lambda: {"configuration": record})
    with pytest.raises(BagError, match="its record of the rig cannot be used"):
        bag.catalogue


@pytest.mark.parametrize(
    ("topics", "says"),
    [
        (("/gearbox/state",), r"its topics \(/gearbox/state\) are those of .*hydmag, .*three_speed"),
        (("/x",), r"its topics \(/x\) are those of no installed rig"),
        ((), "its topics .there are none. are those of no installed rig"),
    ],
)
def test_a_bag_whose_topics_do_not_tell_the_rig_is_refused(topics, says):
    with pytest.raises(ValueError, match=says):
        rig_record(None, topics)
