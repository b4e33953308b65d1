# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""`rig controller check --faults`: what becomes of a shift of a controller with each type of fault."""

import json

from rig_nodes.cli.main import main
from rig_nodes.plant.faults.fault import faults


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
