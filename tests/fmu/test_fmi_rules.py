# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Requirements of FMI: the order of calls, the stop time, the content of the description, and the end of a step by a trip."""

import zipfile
from pathlib import Path

import numpy as np
import pytest
from fmpy import read_model_description, simulate_fmu

import rig_nodes
from rig_nodes.base.errors import RigError
from rig_nodes.controllers.fmi.importer import Fmu, FmuFailed
from rig_nodes.rig.configuration import load_rig
from rig_nodes.runs.fmu.rig_variables import Reader, Values, rig_variables, with_parameters
from rig_nodes.runs.rig import Rig

PACKAGE = Path(rig_nodes.__file__).parents[1]
SI = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")


# ---- the order of calls


def test_a_step_past_the_stop_time_is_an_error_and_one_up_to_it_is_not(fmu):
    fmu.initialize(0.5, 0.7)
    fmu.step(0.5, 0.1)
    for _ in range(2):
        with pytest.raises(
            FmuFailed, match=r"a step from 0\.600000 s to 0\.701000 s is asked for, past the stop time of 0\.7"
        ) as failure:
            fmu.step(0.6, 0.101)
        assert failure.value.status == "error"
    fmu.step(0.6, 0.1)
    with pytest.raises(FmuFailed, match="past the stop time"):
        fmu.step(0.7, 0.001)
    fmu.reset()
    fmu.initialize()
    fmu.step(0.0, 1.0)


@pytest.mark.parametrize("fmi", [2, 3])
def test_a_controller_has_a_stop_time_too(controller_fmu, fmi):
    with Fmu(controller_fmu(fmi)) as fmu:
        fmu.initialize(0.0, 0.003)
        fmu.step(0.0, 0.003)
        with pytest.raises(FmuFailed, match="past the stop time of 0.003000 s"):
            fmu.step(0.003, 0.001)


@pytest.mark.parametrize(
    ("act", "sentence"),
    [
        (lambda f: f.get("n_wej"), "n_wej is an output and has no value before the initialization"),
        (lambda f: f.step(0.0, 1e-3), "a step is for an initialized instance"),
        (lambda f: f.terminate(), "there is no run that could be terminated"),
        (lambda f: f.initialize(1.0, 0.5), "the stop time of 0.5 s lies before the start time of 1 s"),
        (lambda f: f.initialize(float("inf")), "a start time of inf s is refused"),
        (lambda f: (f.initialize(), f.initialize()), "before the initialization|the initialization comes first, and once"),
        (lambda f: (f.initialize(), f.terminate(), f.terminate()), "there is no run that could be terminated"),
        (lambda f: (f.initialize(), f.terminate(), f.set(gear_request=1)), "gear_request cannot be set any more"),
        (lambda f: (f.initialize(), f.terminate(), f.step(0.0, 1e-3)), "a step is for an initialized instance"),
    ],
)
def test_calls_out_of_order_are_errors_with_a_sentence(fmu, act, sentence):
    with pytest.raises(FmuFailed, match=sentence) as failure:
        act(fmu)
    assert failure.value.status == "error"
    fmu.reset()
    fmu.initialize()
    fmu.step(0.0, 1e-3)
    fmu.terminate()
    assert fmu.get("sample") == [1]


@pytest.mark.parametrize("fmi", [2, 3])
def test_twenty_instances_do_not_meet_and_each_can_begin_again(controller_fmu, fmi):
    instances = [Fmu(controller_fmu(fmi), f"number {k}") for k in range(20)]
    try:
        for run in range(2):
            for instance in instances:
                instance.initialize()
            for ms in range(30):
                for k, instance in enumerate(instances):
                    instance.set(gear_request=int(k % 2 and ms >= 10))
                    instance.step(ms * 1e-3, 1e-3)
            setpoints = [instance.get("setpoint_1")[0] for instance in instances]
            assert setpoints[::2] == [0.0] * 10 and setpoints[1] > 0.0 and setpoints[1::2] == setpoints[1:2] * 10
            for instance in instances:
                if run == 0:
                    instance.terminate()
                instance.reset()
    finally:
        for instance in instances:
            instance.close()


# ---- the content of the description


@pytest.mark.parametrize("fmi", [2, 3])
def test_every_unit_has_its_base_units_and_states_have_words(rig_fmu, controller_fmu, fmi):
    description = read_model_description(str(rig_fmu(fmi)))
    units = {unit.name: unit.baseUnit for unit in description.unitDefinitions}
    variables = {v.name: v for v in description.modelVariables}
    without = [v.name for v in variables.values() if v.type in ("Real", "Float64") and not v.unit]
    assert without == ["command_1", "command_2", "command_3"], "duty or current, as the parameter says"
    assert all(base is not None for base in units.values())
    exponents = {name: tuple(int(getattr(base, key)) for key in SI) for name, base in units.items()}
    assert exponents["N.m"] == (1, 2, -2, 0, 0, 0, 0, 0) and exponents["H"] == (1, 2, -2, -2, 0, 0, 0, 0)
    assert exponents["1"] == (0,) * 8 and exponents["V/(A.s)"] == (1, 2, -4, -2, 0, 0, 0, 0)
    assert (float(units["degC"].factor), float(units["degC"].offset)) == (1.0, 273.15)
    assert (variables["p1"].unit, float(variables["p1"].nominal)) == ("Pa", 1e6)
    declared = variables["rig_state"].declaredType
    assert variables["rig_state"].type == ("Integer" if fmi == 2 else "Enumeration")
    if fmi == 3:
        assert [item.name for item in declared.items] == ["starting", "ready", "running", "tripped"]
        assert float(description.coSimulation.fixedInternalStepSize) == 1e-3
    else:
        with zipfile.ZipFile(rig_fmu(fmi)) as archive:
            assert (
                f'<SimpleType name="{declared.name}" description="0 starting, 1 ready, 2 running, 3 tripped">'
                in archive.read("modelDescription.xml").decode()
            )
    assert "whole multiples of 1 ms" in description.description
    assert all(unit.baseUnit is not None for unit in read_model_description(str(controller_fmu(fmi))).unitDefinitions)


@pytest.mark.parametrize("fmi", [2, 3])
def test_no_output_answers_to_an_input_before_the_next_step(rig_fmu, controller_fmu, fmi):
    for path in (rig_fmu(fmi), controller_fmu(fmi)):
        description = read_model_description(str(path))
        assert description.outputs and all(unknown.dependencies == [] for unknown in description.outputs)
    inputs = {v.name: v for v in description.modelVariables if v.causality == "input"}
    outputs = [v.name for v in description.modelVariables if v.causality == "output"]
    with Fmu(controller_fmu(fmi)) as fmu:
        initial = []
        for value in (0, 1):  # inputs do not act at the initialization either
            fmu.initialize(**dict.fromkeys(inputs, value))
            initial.append(fmu.get(*outputs))
            fmu.step(0.0, 0.1)
            before = fmu.get(*outputs)
            fmu.set(**dict.fromkeys(inputs, 2 - value))
            assert fmu.get(*outputs) == before
            fmu.reset()
    assert initial[0] == initial[1] and all(not unknown.dependencies for unknown in description.initialUnknowns)


def test_at_the_initialization_outputs_depend_on_what_the_description_says(rig_fmu):
    """Each parameter of some parts is changed in the rig itself; every output that changes must list the parameter."""
    description = read_model_description(str(rig_fmu()))
    stated = {unknown.variable.name: {known.name for known in unknown.dependencies} for unknown in description.initialUnknowns}
    config = load_rig("hydmag")
    values = Values(rig_variables(config))

    def initial(name=None, value=0.0):
        for v in values.variables:
            if v.type != "string":
                values.numbers[values.place[v.name]] = float(value if v.name == name else v.start or 0.0)
        Reader(Rig(with_parameters(config, values), int(values["seed"])), values).read()
        return values.numbers.copy()

    plain, moved_any = initial(), set()
    parts = ("seed", "instruments", "oil_supply", "effects", "load_pump", "valve_zr_p1", "clutch_s1", "motor")
    for v in values.variables:
        if v.causality != "parameter" or v.name.partition(".")[0] not in parts:
            continue
        value = 1 - v.start if v.type == "boolean" else 2 if v.type == "integer" else v.start * 0.98 or 1e-3
        try:
            changed = initial(v.name, value)
        except RigError:  # the value is out of its range
            continue
        moved = {values.variables[k].name for k in np.flatnonzero(changed != plain)} & stated.keys()
        assert all(v.name in stated[output] for output in moved), (v.name, moved)
        moved_any |= moved
    assert {"p1", "T_oil", "true.T_oil", "M_wej"} <= moved_any
    assert stated["true.T_oil"] == {"oil_supply.temperature"} and stated["gear"] == set()


# ---- a trip

REASON = "100 %n%s of the oil is gone"
TRIPPING = f"""
from rig_nodes.runs.rig import Rig
advance = Rig.advance_samples
def advance_samples(self, samples=1):
    advance(self, samples)
    if self.sample >= 250:
        self.trip({REASON!r}, "test")
Rig.advance_samples = advance_samples
"""


@pytest.fixture
def tripping(tmp_path, monkeypatch):
    """The rig of an FMU trips at 250 ms; with a recording the time is exact, because the rig then advances sample by sample."""
    (tmp_path / "sitecustomize.py").write_text(TRIPPING)
    monkeypatch.setenv("RIG_FMU_PATH", f"{tmp_path}:{PACKAGE}")
    return str(tmp_path / "record")


@pytest.mark.parametrize("fmi", [2, 3])
def test_a_trip_ends_the_step_and_its_reason_is_in_the_log(rig_fmu, tripping, fmi):
    with Fmu(rig_fmu(fmi)) as fmu:
        fmu.initialize(record=tripping)
        fmu.step(0.0, 0.2)
        with pytest.raises(FmuFailed) as failure:
            fmu.step(0.2, 0.1)
        assert (str(failure.value), failure.value.status) == (f"the rig tripped at 0.250 s: {REASON}", "terminated")
        assert fmu.get("reason", "sample", "rig_state") == [REASON, 250, 3]
        with pytest.raises(FmuFailed, match="the simulation has ended at 0.250000 s; terminate the instance, or reset it"):
            fmu.step(0.25, 0.1)
        fmu.terminate()


@pytest.mark.parametrize("fmi", [2, 3])
def test_fmpy_ends_its_simulation_at_the_trip(rig_fmu, tripping, fmi):
    texts = []
    result = simulate_fmu(
        str(rig_fmu(fmi)),
        stop_time=1.0,
        step_size=0.01,
        output_interval=0.01,
        output=["rig_state"],
        logger=lambda *message: texts.append(message[-1]),
    )
    assert result["time"][-1] == pytest.approx(0.25) and result["rig_state"][-1] == 3
    assert f"the rig tripped at 0.250 s: {REASON}".encode() in texts
