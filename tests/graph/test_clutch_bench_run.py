# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""`rig run` of the clutch bench: its devices are nodes, its bag has the topics of `simulate`, and its results are the same."""

import json

import numpy as np
import pytest
from running_graph import rig_run

from rig_nodes.bags.reader import Bag
from rig_nodes.rig.configuration import load_rig
from rig_nodes.runs.recorded import record
from rig_nodes.runs.sequence import load_sequence

PARAMETERS = {"pressures": "1 MPa, 1.25 MPa, 1.5 MPa", "wetting": "200 ms"}


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """Returns the folder of a run on the node graph and its output."""
    folder = tmp_path_factory.mktemp("bench") / "run"
    parameters = [word for name, value in PARAMETERS.items() for word in ("--with", f"{name}={value}")]
    code, output = rig_run(folder, *parameters, "--speed", "max", sequence="clutch_bench")
    assert code == 0, output
    return folder, output


def test_every_topic_of_the_bench_is_in_the_bag_and_nothing_is_lost(run):
    folder, out = run
    bag = Bag(folder)
    assert set(load_rig("clutch_bench").catalogue.topics) - set(bag.counts) == {"/testing_machine/command"}
    assert bag.check() == [] and "messages lost: 0" in out
    report = json.loads((folder / "report.json").read_text())
    assert set(report["run"]["processes"]) == {"container", "sequencer", "recorder"}
    assert report["run"]["end"]["state"] == "ended"


def test_the_results_are_those_of_the_run_in_one_process(run):
    folder, _ = run
    report = json.loads((folder / "report.json").read_text())["bench"]
    logged = record(load_rig("clutch_bench"), load_sequence("clutch_bench", PARAMETERS)).recording
    same = logged.channels
    assert [round(row["cylinder_pa"] * 1e-6, 1) for row in report["slip_tests"]] == [1.0, 1.3, 1.5]
    # over DDS commands arrive some samples later, which does not change the torque at slip
    assert report["slip_tests"][-1]["m_eks_nm"] == pytest.approx(same["M_e"].max(), abs=1.0)
    assert report["line"]["k_kor"]["thesis"] == pytest.approx(1.0, rel=0.01)
    t, work = Bag(folder).series("motor_sh_work")
    assert np.all(np.diff(t) > 0.0)
    assert work[-1] > (same["M_e"] * same["n"]).sum() * logged.period > 10.0, "more than the slipping plates took"
