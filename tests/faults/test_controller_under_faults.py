# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""`rig controller check --faults`: what becomes of a shift of a controller with each fault of a rig."""

import json

import pytest

from rig_nodes.base.errors import RigError
from rig_nodes.cli.main import main
from rig_nodes.controllers.load import load_controller
from rig_nodes.controllers.plug import BuiltIn
from rig_nodes.controllers.seam import ControllerOutputs, Status
from rig_nodes.rig.configuration import load_rig
from rig_nodes.rig.faults import faults_of
from rig_nodes.runs.fault_check import Upshift, check_under_faults, chosen_faults, judged

CONFIG = load_rig("hydmag")
BEHAVED = (
    *("valve_zr_p2.coil_open", "valve_zr_p1.stuck", "valve_zr_p2.stuck", "valve_zr_p2.inlet"),
    *("I_zr_p2.dropped", "clutch_s2.worn"),
)


def test_the_table_says_what_became_of_each_fault(capsys):
    assert main(["controller", "check", "alfa46", "--faults", "--only", ",".join(BEHAVED), "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    found = {row["fault"]: row for row in said["faults"]}
    assert found[""]["outcome"] == "shifted well" and set(found) == {"", *BEHAVED}
    assert (
        found["valve_zr_p2.coil_open"]["outcome"] == "tripped in time"
        and "s after the order: trip coil_open" in found["valve_zr_p2.coil_open"]["text"]
    )
    assert found["valve_zr_p1.stuck"]["outcome"] == "did harm" and "tie_up" in found["valve_zr_p1.stuck"]["text"]
    assert "contradicts_p2_low" in found["valve_zr_p2.stuck"]["text"] and "dead_I_zr_p2" in found["I_zr_p2.dropped"]["text"]
    assert found["valve_zr_p2.inlet"]["outcome"] == "shifted badly" and found["clutch_s2.worn"]["outcome"] == "shifted well"
    assert sum(said["counts"].values()) == len(found) - 1


def test_each_fault_is_met_in_a_shift_in_which_what_is_faulty_takes_part(capsys):
    words = ["controller", "check", "alfa46", "--faults", "--rig", "three_speed", "--json", "--only"]
    assert main([*words, "valve_c2.coil_open,valve_c3.coil_open"]) == 0
    rows = {row["fault"]: row for row in json.loads(capsys.readouterr().out)["faults"]}
    assert rows[""]["text"].startswith("1 -> 2: in gear after")
    assert rows["valve_c2.coil_open"]["text"].startswith("1 -> 2: ") and "coil_open_valve_c2" in rows["valve_c2.coil_open"]["text"]
    assert rows["valve_c3.coil_open"]["text"].startswith("2 -> 3: ") and "coil_open_valve_c3" in rows["valve_c3.coil_open"]["text"]


def test_it_goes_through_every_fault_that_the_rig_can_have_with_a_controller_outside():
    known = faults_of(CONFIG)
    chosen = {one.name for one in chosen_faults(CONFIG, "*")}
    left_out = {name for name in known if name not in chosen}
    assert {name for name in left_out if not known[name].lacking} == {"output_1.fill_time", "output_2.fill_time"}
    for one in CONFIG.structure.transducers:
        assert {f"{one.name}.{fault}" for fault in ("offset", "drift", "gain", "stuck", "dropped", "loose")} <= chosen
    assert {one.name for one in chosen_faults(CONFIG, "p_p.st*, motor.weak")} == {"p_p.stuck", "motor.weak"}


class Reacting(BuiltIn):
    """An Alfa46 that does something else from the fault's beginning on, by the name of the fault."""

    def __init__(self, config):
        super().__init__(config)
        self.fault = (config.faults or ("",))[0].partition(",")[0]

    def _answer(self, inputs):
        if inputs.sample < 2700 or not self.fault:
            return super()._answer(inputs)
        if self.fault == "p1.gain":
            raise ValueError("a reading of 0 divides it")
        if self.fault == "p2.gain":
            return ControllerOutputs(status=Status.DISCARD, message="it thinks")
        return ControllerOutputs(status=Status.ERROR, message="the pressure does not follow")


def test_a_controller_that_breaks_down_or_falls_silent_did_not_trip_in_time_and_one_that_tells_of_the_fault_did():
    found = {one.fault: one for one in check_under_faults(Reacting, CONFIG, "p1.gain,p2.gain,p_po.gain")}
    assert {name: one.outcome for name, one in found.items()} == {
        "": "shifted well",
        "p1.gain": "failed itself",
        "p2.gain": "failed itself",
        "p_po.gain": "tripped in time",
    }
    assert "before the order: controller alfa46, sample 2700" in found["p1.gain"].text


@pytest.mark.parametrize(
    "seconds, torque, outcome",
    [(1.0, 90.0, "tripped in time"), (-0.1, 0.0, "tripped in time"), (1.2, 90.0, "shifted badly"), (1.0, 160.0, "shifted badly")],
)
def test_a_trip_came_in_time_when_no_shift_would_have_been_bad_by_then(seconds, torque, outcome):
    healthy, ill = Upshift(0.6, 100.0, "", "", 0.0), Upshift(None, torque, "coil_open_valve_zr_p2", "trip coil_open", seconds)
    assert CONFIG.value("trips.coil_open_valve_zr_p2.delay") == 0.2
    assert judged(faults_of(CONFIG)["valve_zr_p2.coil_open"], ill, healthy, CONFIG) == outcome


def test_what_it_cannot_do_is_refused_in_one_sentence(tmp_path, capsys):
    (tmp_path / "rig.yaml").write_text("description: one gear\nbase: hydmag\ngears: {II: ~}\n")
    config = load_rig(tmp_path)
    with pytest.raises(RigError, match=r"^controller check --faults shifts up from one gear to the next; '.*' has I alone$"):
        next(check_under_faults(lambda rig: load_controller("alfa46", rig), config))
    assert main(["controller", "check", "alfa46", "--faults", "--only", "p1.stuk"]) == 2
    assert "there is no fault 'p1.stuk'; did you mean 'p1.stuck'" in capsys.readouterr().err
    assert main(["controller", "check", "alfa46", "--only", "p1.stuck"]) == 2
    assert "--only names faults, so it goes with --faults" in capsys.readouterr().err
