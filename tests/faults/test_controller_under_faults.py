# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""`rig controller check --faults`: what becomes of a shift of a controller with each type of fault."""

import json

import pytest

from rig_nodes.base.errors import RigError
from rig_nodes.cli.main import main
from rig_nodes.controllers.load import load_controller
from rig_nodes.plant.faults.fault import faults
from rig_nodes.rig.configuration import load_rig
from rig_nodes.runs.fault_check import check_under_faults


def test_the_table_says_what_became_of_each_type_of_fault(capsys):
    assert main(["controller", "check", "alfa46", "--faults", "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    found = {row["fault"]: row for row in said["faults"]}
    assert found[""]["outcome"] == "shifted well"
    assert (
        found["valve_zr_p2.coil_open"]["outcome"] == "tripped in time"
        and "trip coil_open" in found["valve_zr_p2.coil_open"]["text"]
    )
    assert found["valve_zr_p1.stuck"]["outcome"] == "did harm" and "tie_up" in found["valve_zr_p1.stuck"]["text"]
    assert "contradicts_p2_low" in found["valve_zr_p2.stuck"]["text"] and "dead_I_zr_p2" in found["I_zr_p2.dropped"]["text"]
    assert found["valve_zr_p2.inlet"]["outcome"] == "shifted badly" and found["clutch_s2.worn"]["outcome"] == "shifted well"
    assert {name.partition(".")[2] for name in found if name} == {one.name for one in faults().values()}
    assert sum(said["counts"].values()) == len(found) - 1


def test_a_rig_with_one_gear_is_refused_in_one_sentence(tmp_path):
    (tmp_path / "rig.yaml").write_text("description: one gear\nbase: hydmag\ngears: {II: ~}\n")
    config = load_rig(tmp_path)
    with pytest.raises(RigError, match=r"^controller check --faults shifts from one gear to the next; '.*' has gear I alone$"):
        next(check_under_faults(lambda rig: load_controller("alfa46", rig), config))
