# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A bag alone is enough to run it again, through its plant, another plant, or a controller."""

import json
import re
from copy import deepcopy

import pytest
from ruamel.yaml import YAML

from rig_nodes.analysis.moved import moved_lines
from rig_nodes.analysis.of_runs import gather
from rig_nodes.analysis.run_report import build_report
from rig_nodes.bags.copy import describe
from rig_nodes.bags.metadata import OFFERED, profile_text
from rig_nodes.bags.opened import OpenedBags
from rig_nodes.bags.reader import Bag
from rig_nodes.bags.writer import BagWriter
from rig_nodes.base.names import installed
from rig_nodes.cli.main import main
from rig_nodes.controllers import load_controller
from rig_nodes.rig.configuration import load_rig
from rig_nodes.rig.recorded_rig import config_of_record
from rig_nodes.runs.rerun import different_topics
from rig_nodes.runs.sequence import load_sequence
from rig_nodes.runs.simulation import simulate

from ..dated import with_dates

SHIFTS = """
description: a shift up, with a setting and a setpoint changed on the way
steps:
  - oil: {pressure: 4 MPa}
  - wait: {for: 300 ms}
  - shift: {to: I}
  - motor: {speed: 300 rpm}
  - load: {torque: 20 Nm}
  - wait: {for: 900 ms}
  - set: {alfa46.t12: 100 ms}
  - shift: {to: II}
  - set: {oil_supply.temperature: 50 degC}
  - wait: {for: 100 ms}
"""


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """Makes the bag of the sequence with a delay of the controller's answers, and returns its folder."""
    folder = tmp_path_factory.mktemp("recorded")
    (folder / "shifts.yaml").write_text(SHIFTS)
    config = load_rig("hydmag", {"clutch_s1.clearance": "1.7 mm"})
    run = simulate(
        config,
        load_sequence(folder / "shifts.yaml", default="hydmag"),
        folder / "run",
        5,
        controller=load_controller(None, config),
        delay=3,
    )
    assert run["end"]["state"] == "ended", run["end"]
    return folder / "run"


@pytest.mark.parametrize("name", installed("rigs"))
def test_the_record_of_each_rig_gives_the_rig_back(name):
    record = json.loads(json.dumps(load_rig(name).as_dict(), sort_keys=True))
    assert json.loads(json.dumps(config_of_record(record, "bag").as_dict())) == record


def test_through_the_plant_a_bag_repeats_itself_to_the_bit_and_names_its_parent(recorded, tmp_path, capsys):
    assert main(["rerun", str(recorded), "--through", "plant", "--out", str(tmp_path / "again")]) == 0
    assert "topics are bit for bit as recorded" in capsys.readouterr().out
    parent, new = gather(recorded), gather(tmp_path / "again")
    assert different_topics(parent, new) == []
    assert new.run_info()["parent"]["hash"] == Bag(recorded).canonical_hash()["all"]
    assert new.run_info()["seed"] == 5


def test_with_another_spring_the_topics_and_metrics_that_moved_are_named(recorded, tmp_path, capsys):
    arguments = ["rerun", str(recorded), "--through", "plant", "--out", str(tmp_path / "again")]
    assert main([*arguments, "--set", "clutch_s2.spring_rate=150 N/mm"]) == 0
    output = capsys.readouterr().out
    assert "topics differ" in output and "/clutch_s2/state" in output and "moved: shift 1, I -> II" in output
    assert "/controller/command" not in output  # the commands are the recorded ones
    assert all(abs(float(times)) > 1.0 for times in re.findall(r"\(([-+0-9.]+) times the largest error\)", output))
    assert "metrics of shifts differ by less than their largest measuring error" in output


def test_metrics_that_moved_by_less_than_their_error_are_only_counted(recorded):
    bag = Bag(recorded)
    report = build_report(bag, bag.run_info())
    other = deepcopy(report)
    row, error = other["shifts"][0], other["uncertainty"][0]
    row["t_c_s"] += 0.4 * error["t_c_s"]
    row["k"] -= 0.9 * error["k"]
    assert moved_lines(report, other) == [
        "2 metrics of shifts differ by less than their largest measuring error, by at most 0.90 of it"
    ]
    row["input_torque_max_nm"] += 3.0 * error["input_torque_max_nm"]
    moved, counted = moved_lines(report, other)
    assert moved.startswith("moved: shift 1, ") and moved.endswith(" (+3.00 times the largest error)") and counted.startswith("2 ")
    assert moved_lines(report, report) == ["no metric of a shift moved"]


def test_through_a_controller_of_the_same_law_the_answers_are_the_recorded_ones(recorded, tmp_path, capsys):
    out = tmp_path / "again"
    assert main(["rerun", str(recorded), "--through", "controller", "alfa46", "--out", str(out)]) == 0
    count = Bag(recorded).counts["/controller/command"]
    assert f"{count} of {count} answers are bit for bit as recorded" in capsys.readouterr().out
    assert different_topics(gather(recorded), gather(out)) == []


def test_through_a_controller_of_other_settings_the_first_other_answer_is_told(recorded, tmp_path, capsys):
    arguments = ["rerun", str(recorded), "--through", "controller", "alfa46", "--out", str(tmp_path / "again")]
    assert main([*arguments, "--set", "alfa46.gain_p=20 ohm"]) == 0
    assert "the first other answer is that at 0." in capsys.readouterr().out


def test_through_a_controller_users_topics_stay_as_they_were_recorded(recorded, tmp_path):
    user, ros_type, data = "/camera/lamp", "my_pkg/msg/Lamp", b"\0\1\0\0\1"  # of a type that is not installed
    offer = profile_text("latched")
    with OpenedBags([recorded]) as bags, BagWriter(tmp_path / "run", "run", topics={}) as new:
        for topic in bags.types:
            describe(new, bags, topic)
        new.describe(user, ros_type, "cdr/ros2msg", "bool on\n", {OFFERED: offer})
        for time, (topic, message) in bags.timeline(bags.types):
            new.write(topic, bags.types[topic], message, time)
        new.write(user, ros_type, data, bags.last)
    out = tmp_path / "again"
    assert main(["rerun", str(tmp_path / "run"), "--through", "controller", "alfa46", "--out", str(out)]) == 0
    with OpenedBags([out]) as again:
        assert [row for _, row in again.timeline([user])] == [(user, data)]
        assert again.channel(user)[1:] == ("bool on\n", {OFFERED: offer})
    stored = YAML(typ="safe").load(out / "metadata.yaml")["rosbag2_bagfile_information"]["topics_with_message_count"]
    (about,) = [one["topic_metadata"] for one in stored if one["topic_metadata"]["name"] == user]
    assert about["offered_qos_profiles"][0]["durability"] == "transient_local"


@pytest.mark.parametrize("through", [["plant"], ["controller", "alfa46"]])
def test_a_bag_whose_log_times_are_dates_is_run_again_in_the_time_of_the_run(recorded, tmp_path, through):
    dated = with_dates(recorded, tmp_path / "run.mcap")
    assert main(["rerun", str(dated), "--out", str(tmp_path / "again"), "--through", *through]) == 0
    assert Bag(tmp_path / "again").last == Bag(recorded).last
    assert different_topics(gather(recorded), gather(tmp_path / "again")) == []
    assert different_topics(gather(dated), gather(tmp_path / "again")) == []


@pytest.mark.parametrize(
    ("through", "sentence"),
    [(["controller"], "expected plant, or controller and its"), (["plant", "--rig", "clutch_bench"], "does not have")],
)
def test_what_does_not_fit_is_refused_and_leaves_nothing(recorded, tmp_path, capsys, through, sentence):
    assert main(["rerun", str(recorded), "--out", str(tmp_path / "again"), "--through", *through]) == 2
    assert sentence in capsys.readouterr().err
    assert not (tmp_path / "again").exists()
