# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The demo of every installed rig with gears is an example of a good run."""

import json

import pytest

from rig_nodes.analysis.definitions import STANDSTILL
from rig_nodes.analysis.quality import FAIR, GRADES
from rig_nodes.base.names import installed
from rig_nodes.cli.main import main
from rig_nodes.rig.configuration import load_rig

RIGS = [name for name in installed("rigs") if load_rig(name).structure.shifts]


@pytest.mark.parametrize("rig", RIGS)
def test_the_demo_of_a_rig_has_valid_shifts_and_no_result_beyond_its_definition(rig, tmp_path):
    assert main(["simulate", "demo", "--rig", rig, "--out", str(tmp_path / "run")]) == 0
    report = json.loads((tmp_path / "run" / "report.json").read_text())
    assert report["shifts"] and all(row["valid"] for row in report["shifts"]), [row["why"] for row in report["shifts"]]
    grades = [one["grade"] for one in report["quality"] if one]
    assert grades and max(map(GRADES.index, grades)) <= GRADES.index(FAIR), report["quality"]
    for row in report["shifts"]:
        found = {key: row[key] for key in ("k", "e_loss_j", "e_loss_settled_j", "t_o_s") if row[key] is not None}
        assert found.get("k", 1.0) <= 1.01 and min(found.values(), default=0.0) >= 0.0, found
        assert row["output_speed_min_rpm"] > STANDSTILL or row["from_gear"] == 0
        assert set(row["undefined"]).isdisjoint(found)
