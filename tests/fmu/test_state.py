# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The state of both kinds of FMU: saved, brought back, taken to another process, and what is no state of this FMU."""

import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from fmpy import read_model_description
from fmpy.validation import validate_fmu

from rig_nodes.base.errors import RigError
from rig_nodes.controllers.c.library import INCLUDE
from rig_nodes.controllers.fmi.importer import Fmu, FmuFailed
from rig_nodes.rig.configuration import load_rig
from rig_nodes.runs.fmu.build import build_controller_fmu
from rig_nodes.runs.fmu.rig_process import RigModel

ALFA46_C = INCLUDE.parent / "examples" / "alfa46.c"
QUICKLY = ["-O0"]  # compiles in half the time
MPA = 1e6
GIVEN = {"motor_speed": 62.8, "motor_enable": True, "oil_pressure": 4 * MPA, "oil_enable": True}


class State:
    """The functions of an instance for its state, which FMPy names alike for both versions."""

    def __init__(self, fmu):
        self.fmu = fmu

    def saved(self):
        """Returns the state as bytes."""
        state = self.fmu._call("getFMUState")
        data = self.fmu._call("serializeFMUState", state)
        self.fmu._call("freeFMUState", state)
        return data

    def load(self, data):
        state = self.fmu._call("deserializeFMUState", data)
        self.fmu._call("setFMUState", state)
        self.fmu._call("freeFMUState", state)


def outputs(fmu):
    """Returns all numbers that the instance shows."""
    return fmu.reader([name for name, v in fmu.variables.items() if v.causality == "output" and v.type != "String"])()


def until_4_s(fmu):
    """Steps to 4 s, in the middle of a shift from I to II, with a setting and a setpoint changed on the way."""
    fmu.set(seed=5, **{"alfa46.t12": -0.1})
    fmu.initialize(**GIVEN)
    fmu.set(gear_request=1)
    fmu.step(0.0, 2.0)
    fmu.set(**{"alfa46.t12": -0.15, "oil_supply.temperature": 60.0}, motor_speed=80.0)
    fmu.step(2.0, 1.7)
    fmu.set(gear_request=2)
    fmu.step(3.7, 0.3)


def branch(fmu, milliseconds=60):
    """Goes on from 4 s, with another setpoint on the way, and returns what is shown at the end."""
    fmu.step(4.0, 0.03)
    fmu.set(load_pressure=1 * MPA, load_enable=True)
    fmu.step(4.03, (milliseconds - 30) * 1e-3)
    return outputs(fmu)


ELSEWHERE = """
import json, sys
sys.path.insert(0, sys.argv[1])
from test_state import State, branch
from rig_nodes.controllers.fmi.importer import Fmu
with Fmu(sys.argv[2]) as fmu:
    State(fmu).load(open(sys.argv[3], "rb").read())
    print(json.dumps(branch(fmu)))
"""


def test_a_state_at_4_s_brought_back_10_times_goes_on_with_the_same_bits(fmu, rig_fmu, request):
    path = rig_fmu(2 if "2.0" in request.node.name else 3)
    until_4_s(fmu)
    state, shown = State(fmu), outputs(fmu)
    data = state.saved()
    on = branch(fmu)
    assert on != shown and state.saved() != data
    kept = fmu._call("deserializeFMUState", data)
    for _ in range(10):
        fmu._call("setFMUState", kept)
        assert outputs(fmu) == shown and fmu.get("motor_speed", "load_enable") == [80.0, False]
        assert branch(fmu) == on
    fmu._call("setFMUState", kept)
    assert state.saved() == data, "a state is the same bytes each time"
    with Fmu(path, "other") as other:
        for _ in range(2):  # a new instance, and one with a run of its own
            other._call("setFMUState", kept)
            assert branch(other) == on
            other.reset()
            other.initialize(seed=2)
            other.step(0.0, 0.01)
    fmu._call("freeFMUState", kept)


def test_a_state_at_4_s_goes_on_with_the_same_bits_in_another_process(fmu2, rig_fmu, tmp_path, request):
    until_4_s(fmu2)
    (tmp_path / "state").write_bytes(State(fmu2).saved())
    done = subprocess.run(
        [sys.executable, "-c", ELSEWHERE, str(request.path.parent), str(rig_fmu()), str(tmp_path / "state")],
        capture_output=True,
        text=True,
        timeout=100,
    )
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout) == branch(fmu2)


def test_several_instances_go_on_from_one_state_each_its_own_way(fmu2, rig_fmu):
    fmu2.initialize(**GIVEN, gear_request=1)
    fmu2.step(0.0, 0.4)
    data = State(fmu2).saved()
    with Fmu(rig_fmu(), "other") as other:
        State(other).load(data)
        found = {}
        for one, speed in ((fmu2, 62.8), (other, 31.4)):
            one.set(motor_speed=speed)
            one.step(0.4, 0.5)
            found[speed] = one.get("true.n_wej")[0]
        State(other).load(data)
        other.step(0.4, 0.5)
        assert found[31.4] < found[62.8] == other.get("true.n_wej")[0]


def test_after_a_trip_an_error_or_before_the_initialization_a_state_is_brought_back(fmu2):
    new = State(fmu2).saved()
    fmu2.initialize(**{**GIVEN, "motor_speed": 314.0})
    fmu2.step(0.0, 0.1)
    begun, shown = State(fmu2).saved(), outputs(fmu2)
    with pytest.raises(FmuFailed, match="motor.speed"):
        fmu2.set(motor_speed=1e9)
        fmu2.step(0.1, 1e-3)
    with pytest.raises(FmuFailed):
        fmu2.step(0.1, 1e-3)
    State(fmu2).load(begun)
    assert outputs(fmu2) == shown
    fmu2.step(0.1, 1e-3)
    State(fmu2).load(new)
    fmu2.set(seed=4)
    fmu2.initialize()
    assert fmu2.get("sample") == [0]


def test_bytes_that_are_no_state_of_this_fmu_are_refused(fmu, rig_fmu):
    fmu.initialize()
    fmu.step(0.0, 0.01)
    state = State(fmu)
    data = state.saved()
    other = data[:16] + b"{other}".ljust(64, b"\0") + data[80:]
    damaged = bytearray(data)
    damaged[-100] ^= 1
    for wrong, sentence in (
        (b"", "0 bytes are no saved state of this FMU"),
        (b"x" * 100, "100 bytes are no saved state of this FMU"),
        (b"x" * len(data), "this is no saved state of an FMU of rig_nodes"),
        (other, "the state is that of another FMU, or of another version of this one, with the token {other}"),
        (data[:-1], f"the state has {len(data) - 1} bytes, expected {len(data)}"),
        (data + b"x", f"the state has {len(data) + 1} bytes, expected {len(data)}"),
        (bytes(damaged), "the state is damaged: its checksum is not that of its bytes"),
    ):
        with pytest.raises(FmuFailed, match=re.escape(sentence)) as failure:
            state.load(wrong)
        assert failure.value.status == "error"
    with pytest.raises(FmuFailed, match="no saved state"):
        fmu._call("setFMUState", None)
    fmu.step(0.01, 1e-3)


@pytest.fixture
def model(tmp_path, request):
    """The rig behind an FMU, without a process; a test may give settings of the rig."""
    (tmp_path / "rig.json").write_text(json.dumps({"rig": "hydmag", "set": getattr(request, "param", {})}))
    model = RigModel(tmp_path)
    model.values.numbers[:] = [v.start if isinstance(v.start, int | float) else 0.0 for v in model.values.variables]
    model.initialize()
    return model


def test_a_trip_is_undone_by_an_older_state(model):
    model.step(10)
    data, state = model.save(), model.rig.state_hash()
    model.rig.trip("overload", "test")
    model.step(10)
    tripped = model.save()
    for saved, reason in ((data, ""), (tripped, "overload"), (data, "")):
        model.restore(saved)
        assert (model.rig.reason, model.rig.safe) == (reason, bool(reason))
    assert model.rig.state_hash() == state


GROWING = "p1.offset, size=10 %, onset=growing, over=40 ms, at=5 ms"
FAULTS = f"{GROWING} ; oil_supply.air, at=2 ms, for=8 ms ; n_wej.stuck, at=20 ms"


@pytest.mark.parametrize("model", [{"faults": FAULTS}], indirect=True)
def test_faults_go_on_from_where_they_were(model):
    """At 15 ms one grows, one is over, and one is to come; in an older state none has begun."""
    begun = model.save()
    model.step(15)
    data = model.save()
    model.step(25)

    def shown():
        return [(one.order.of.name, one.began, one.level) for one in model.rig.faults.acting], model.rig.state_hash()

    numbers, on = model.values.numbers.copy(), shown()
    for older in (begun, data):
        model.restore(older)
        assert model.save() == older
        model.step(40 - model.rig.sample)
        assert shown() == on and np.array_equal(model.values.numbers, numbers, equal_nan=True)


def test_the_rig_refuses_the_state_of_another_version(model, tmp_path):
    data, other = model.save(), RigModel(tmp_path)
    other._key = "of another version"
    for wrong in (data, data[:-8], b"{}", b"\0" * 40):
        with pytest.raises(RigError, match="the state is that of another rig or another version of rig_nodes"):
            (other if wrong is data else model).restore(wrong)


def test_a_run_that_is_recorded_is_not_set_back(fmu2, tmp_path):
    fmu2.initialize(record=str(tmp_path / "run"))
    fmu2.step(0.0, 0.01)
    with pytest.raises(FmuFailed, match="that is recorded is neither saved nor brought back; leave the parameter record empty"):
        State(fmu2).saved()
    fmu2.step(0.01, 0.01)


def test_the_example_of_the_page_branches(rig_fmu, tmp_path, monkeypatch, capsys):
    page = (Path(__file__).parents[2] / "docs" / "how_to" / "fmu.md").read_text(encoding="utf-8")
    (example,) = (block for block in re.findall(r"```python\n(.*?)```", page, re.DOTALL) if "setFMUState" in block)
    monkeypatch.chdir(tmp_path)
    shutil.copy(rig_fmu(), "hydmag.fmu")
    exec(compile(example, "fmu.md", "exec"), {})
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines] == ["-0.2", "-0.1", "0.0"] and len({line.split()[1] for line in lines}) == 1


# ---- a controller


@pytest.mark.parametrize("fmi", [2, 3])
def test_a_controller_goes_on_with_the_same_bits_in_another_instance(fmi, controller_fmu):
    path = controller_fmu(fmi)
    assert validate_fmu(str(path)) == []
    with Fmu(path, "one") as one, Fmu(path, "other") as other:
        one.set(t12=-0.1)
        one.initialize(gear_request=1)
        for ms in range(700):
            one.set(current_1=0.1 + 1e-4 * ms, gear_request=1 + (ms > 650))
            one.step(ms * 1e-3, 1e-3)
        data, on = State(one).saved(), []
        assert State(one).saved() == data
        for box in (one, other, one):
            if box is other or on:
                State(box).load(data)
            for ms in range(700, 900):
                box.set(current_1=0.3, current_2=1e-4 * ms)
                box.step(ms * 1e-3, 1e-3)
            on.append(outputs(box))
        assert on[0] == on[1] == on[2] and on[0][1] > 0.0
        one.terminate()
        State(other).load(State(one).saved())
        with pytest.raises(FmuFailed, match="a step is for an initialized instance"):
            other.step(0.9, 1e-3)


def test_a_controller_without_the_two_functions_offers_no_state(tmp_path):
    text = ALFA46_C.read_text()
    place = text.index("uint32_t rig_controller_save")
    (tmp_path / "without.c").write_text(text[:place])
    (tmp_path / "half.c").write_text(text[: text.index("int rig_controller_load")])
    build_controller_fmu([tmp_path / "without.c"], tmp_path / "without.fmu", load_rig("hydmag"), flags=QUICKLY)
    offered = read_model_description(str(tmp_path / "without.fmu")).coSimulation
    assert (offered.canGetAndSetFMUstate, offered.canSerializeFMUstate) == (False, False)
    with Fmu(tmp_path / "without.fmu") as fmu:
        fmu.initialize()
        with pytest.raises(FmuFailed, match="the controller has no rig_controller_save and rig_controller_load"):
            State(fmu).saved()
        fmu.step(0.0, 1e-3)
    with pytest.raises(RigError, match="rig_controller_load"):
        build_controller_fmu([tmp_path / "half.c"], tmp_path / "half.fmu", load_rig("hydmag"), flags=QUICKLY)


def test_a_state_of_other_code_is_refused(controller_fmu, tmp_path):
    source, path = tmp_path / "other.c", tmp_path / controller_fmu(2).name
    source.write_text(ALFA46_C.read_text() + "/* another version */\n")
    build_controller_fmu([source], path, load_rig("hydmag"), flags=QUICKLY)
    with Fmu(controller_fmu(2)) as one, Fmu(path) as other:
        one.initialize()
        with pytest.raises(FmuFailed, match="of another FMU, or of another version of this one"):
            State(other).load(State(one).saved())
