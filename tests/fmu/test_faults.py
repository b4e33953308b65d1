# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Orders of faults to an FMU that runs: they act as in the rig itself, are refused in a sentence, and go with its state."""

import json
from pathlib import Path

import pytest
from fmpy.validation import validate_fmu
from test_state import State, outputs

from rig_nodes.bags.reader import Bag
from rig_nodes.cli.main import main
from rig_nodes.controllers.fmi.importer import Fmu, FmuFailed
from rig_nodes.rig.configuration import load_rig
from rig_nodes.runs.fmu.build import build_rig_fmu
from rig_nodes.runs.fmu.drive import main as drive
from rig_nodes.runs.fmu.rig_variables import rig_variables
from rig_nodes.runs.rig import Rig

ON, MPA = {"faults": "on"}, 1e6
GIVEN = {"oil_pressure": 4 * MPA, "oil_enable": True, "gear_request": 1}
OFFSET, OFF = "p2.offset, size=2 %, for=150 ms", "oil_supply.air, off=true"
ORDERS = {  # by ms
    100: "oil_supply.air, onset=growing, over=100 ms; p1.offset, size=2 %, at=3 ms",
    250: f"{OFF};valve_zr_p1.sticking, size=0.3 MPa",
    300: "",
    400: OFFSET,
}


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Instance and path of each version, made with faults enabled."""
    folder, found = tmp_path_factory.mktemp("faults"), {}
    for fmi in (2, 3):
        path = folder / f"ill{fmi}.fmu"
        build_rig_fmu(path, "hydmag", ON, fmi)
        found[fmi] = Fmu(path), path
    yield found
    for instance, _ in found.values():
        instance.close()


@pytest.fixture(params=[2, 3], ids=["FMI 2.0", "FMI 3.0"])
def ill(request, made):
    """An instance of each version that takes orders of faults, in its initial state."""
    made[request.param][0].reset()
    return made[request.param][0]


def test_the_input_is_there_where_faults_are_enabled(made):
    assert "fault" not in {v.name for v in rig_variables(load_rig("hydmag"))}
    assert validate_fmu(str(made[3][1])) == []
    for instance, _ in made.values():
        fault = instance.variables["fault"]
        assert (fault.type, fault.causality, fault.variability, fault.start) == ("String", "input", "discrete", "")


@pytest.mark.parametrize("step", [1, 50])
def test_orders_while_it_runs_give_the_bits_of_the_rig_at_any_step(ill, step):
    rig = Rig(load_rig("hydmag", ON), seed=7)
    rig.set("oil", 4 * MPA, True)
    rig.order_gear(1)
    for ms in range(0, 500, 50):
        for order in filter(None, ORDERS.get(ms, "").split(";")):
            rig.order_fault(order)
        rig.advance(0.05)
    ill.set(seed=7)
    ill.initialize(**GIVEN)
    for ms in range(0, 500, step):
        if ms in ORDERS:
            ill.set(fault=ORDERS[ms])
        ill.step(ms * 1e-3, step * 1e-3)
    names = ("p_p", "p1", "p2", "I_zr_p1", "n_wej", "T_oil")
    assert ill.get(*names) == [rig.measurement(name) for name in names]
    assert ill.get("true.p1", "s1_slip") == [rig.shown_truly("p1"), rig.slip(0)]
    healthy = Rig(load_rig("hydmag"), seed=7)
    healthy.set("oil", 4 * MPA, True)
    healthy.order_gear(1)
    healthy.advance(0.5)
    assert rig.shown_truly("p1") != healthy.shown_truly("p1")


SEQUENCE = """
description: a shift with faults, two at one time, and one three times with the same order
steps:
  - oil: {pressure: 4 MPa}
  - fault: {name: p1.offset, size: 2 %}
  - fault: {name: valve_zr_p1.sticking, size: 0.3 MPa}
  - shift: {to: I, timeout: 3 s}
  - repeat:
      times: 3
      steps:
        - fault: {name: p2.stuck, for: 3 ms}
        - wait: {for: 5 ms}
  - fault: {name: p1.offset, off: true}
  - wait: {for: 100 ms}
"""


def test_a_sequence_with_faults_driven_through_fmi_has_the_bits_of_simulate(made, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("ill.yaml").write_text(SEQUENCE)
    assert drive([str(made[2][1]), "ill.yaml", "--out", "fmu"]) == 0
    assert main(["simulate", "ill.yaml", "--faults", "--out", "simulate"]) == 0
    found, expected = (Bag(tmp_path / name).canonical_hash() for name in ("fmu", "simulate"))
    different = {"/rig/run_info", "/controller/events", "/sequencer/events", "all"}  # the record of the run and the events differ
    assert {topic for topic in expected if found.get(topic) != expected[topic]} == different
    reports = [json.loads((tmp_path / name / "report.json").read_text())["run"]["faults"] for name in ("fmu", "simulate")]
    assert len(reports[0]) == 5 and reports[0] == reports[1]


def test_a_fault_with_which_a_sequence_ends_is_ordered_too(made, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("end.yaml").write_text(
        "description: a fault at the end\nsteps:\n  - wait: {for: 100 ms}\n  - fault: {name: p1.offset, size: 2 %}\n"
    )
    assert drive([str(made[2][1]), "end.yaml", "--out", "fmu"]) == 0
    assert main(["simulate", "end.yaml", "--faults", "--out", "simulate"]) == 0
    ill, expected = (json.loads((tmp_path / name / "report.json").read_text())["run"]["faults"] for name in ("fmu", "simulate"))
    assert [one["name"] for one in ill] == ["p1.offset"] and ill == expected


def test_a_sequence_with_faults_is_refused_where_the_fmu_has_none(rig_fmu, tmp_path, capsys):
    (tmp_path / "ill.yaml").write_text(SEQUENCE)
    assert drive([str(rig_fmu()), str(tmp_path / "ill.yaml")]) == 2
    assert "faults are disabled" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("order", "sentence"),
    [
        ("p1.stuk", "fault: there is no fault 'p1.stuk'; did you mean 'p1.stuck'"),
        ("p1.offset, size=3", "size is 3, expected -1 to 1"),
        (OFF, "oil_supply.air cannot end: it is not there; there are none"),
        ("messages.lost", "the Alfa46 runs inside the rig, without messages"),
        ("p1.stuck;", "there is no fault ''"),
        ("p1.stuck" + 1100 * " ", "fault takes at most 1023 characters"),
    ],
)
def test_an_order_that_does_not_fit_is_an_error_with_a_sentence(ill, order, sentence):
    ill.initialize(**GIVEN)
    ill.step(0.0, 0.01)
    with pytest.raises(FmuFailed) as refused:
        ill.set(fault=order)
        ill.step(0.01, 0.01)
    assert refused.value.status == "error" and sentence in str(refused.value)
    ill.reset()
    assert ill.get("fault") == [""]
    ill.initialize(**GIVEN)
    ill.step(0.0, 0.01)


def test_the_same_text_is_no_second_order_and_after_an_empty_one_it_is(ill):
    ill.initialize(**GIVEN)
    ill.set(fault="p1.stuck")
    for ms in (0, 10):
        ill.set(fault="p1.stuck")
        ill.step(ms * 1e-3, 0.01)
    ill.set(fault="")
    ill.step(0.02, 0.01)
    ill.set(fault="p1.stuck")
    with pytest.raises(FmuFailed, match="fault p1.stuck is there already"):
        ill.step(0.03, 0.01)


def test_an_order_goes_with_the_state(made):
    """The state of before it, of between its text and its step, and of after it, in this instance and in a new one."""

    def on(fmu):
        """Goes on from 0.3 s to 0.4 s and returns what is shown there."""
        fmu.step(0.3, 0.1)
        return outputs(fmu)

    ill, path = made[3]
    ill.reset()
    state = State(ill)
    ill.initialize(**GIVEN)
    ill.step(0.0, 0.3)
    before = state.saved()
    healthy = on(ill)
    state.load(before)
    ill.set(fault=OFFSET)
    between = state.saved()
    sick = on(ill)
    after = state.saved()
    assert sick != healthy
    ill.step(0.4, 0.1)
    later = outputs(ill)
    with Fmu(path, "other") as other:
        for one in (ill, other):
            state = State(one)
            state.load(after)
            assert one.get("fault") == [OFFSET] and state.saved() == after
            one.set(fault=OFFSET)  # it was taken, so it is no order
            one.step(0.4, 0.1)
            assert outputs(one) == later
            state.load(between)
            assert on(one) == sick
            state.load(before)
            assert one.get("fault") == [""] and on(one) == healthy
            state.load(before)
            one.set(fault=OFFSET)
            assert on(one) == sick
            with pytest.raises(FmuFailed, match="there is no fault"):
                one.set(fault="p1.stuk")
                one.step(0.4, 0.1)
            state.load(after)
            one.step(0.4, 0.1)
            assert outputs(one) == later
