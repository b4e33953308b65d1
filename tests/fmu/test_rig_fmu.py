# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The rig as an FMU: its run in FMPy, its equality with the rig itself, and the life of its process."""

import json
import math
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from fmpy import read_model_description, simulate_fmu
from fmpy.validation import validate_fmu

from rig_nodes.bags.reader import Bag
from rig_nodes.base.errors import RigError
from rig_nodes.cli.main import main
from rig_nodes.controllers.fmi.importer import Fmu, FmuFailed
from rig_nodes.rig.configuration import load_rig
from rig_nodes.runs.fmu import drive as example
from rig_nodes.runs.fmu.build import build_rig_fmu
from rig_nodes.runs.rig import Rig

CATALOGUE = load_rig("hydmag").catalogue

MPA, RPM = 1e6, 0.10471975511965977


def children():
    """Returns the process numbers of this process's own children that are rigs behind FMUs."""
    pids = Path(f"/proc/{os.getpid()}/task/{os.getpid()}/children").read_text().split()
    return [int(p) for p in pids if b"rig_nodes.runs.fmu.rig_process" in Path(f"/proc/{p}/cmdline").read_bytes()]


def gone(pid):
    """Returns True when a process has ended, within 10 s."""
    for _ in range(1000):
        try:
            if Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] in "ZX":
                return True
        except (FileNotFoundError, ProcessLookupError):
            return True
        time.sleep(0.01)
    return False


# ---- the same rig


def test_fmpy_finds_nothing_wrong_and_runs_it(rig_fmu):
    assert validate_fmu(str(rig_fmu())) == []  # test_faults.py has it of FMI 3.0, with one input more
    result = simulate_fmu(
        str(rig_fmu()),
        stop_time=0.3,
        step_size=1e-3,
        output_interval=1e-2,
        start_values={"oil_pressure": 4 * MPA, "oil_enable": True},
        output=["p_p", "sample", "true.p_p"],
    )
    assert result["sample"][-1] == 300
    assert result["p_p"][0] < 0.1 * MPA and result["p_p"][-1] == pytest.approx(4 * MPA, rel=0.02)
    settled = 4 * MPA * (1.0 - math.exp(-0.3 / load_rig("hydmag").oil_supply.pressure_time))
    assert result["true.p_p"][-1] == pytest.approx(settled, rel=1e-3)


def test_its_variables_are_the_catalogue_and_the_settings(rig_fmu):
    variables = {v.name: v for v in read_model_description(str(rig_fmu())).modelVariables}
    assert set(CATALOGUE.signals) <= {name for name, v in variables.items() if v.causality == "output"}
    assert (variables["n_wej"].unit, variables["n_wej"].declaredType) == ("rad/s", None)
    assert float(variables["alfa46.t12"].start) == -0.22 and variables["alfa46.t12"].unit == "s"
    assert float(variables["alfa46.output_1.P1.current"].start) == 0.16
    assert variables["oil_supply.temperature"].causality == "parameter"


def shift_into_first(step, request_at=300):
    """Returns (time [s], motor, gear request) as inputs of a run of 1.2 s; ``step`` is in whole ms."""
    return [(t, t >= 600, 1 if t >= request_at else 0) for t in range(0, 1200, step)]


@pytest.mark.parametrize("step", [1, 300])
def test_any_step_of_whole_milliseconds_gives_the_bits_of_the_rig(fmu, step):
    """The compared rig is advanced in one piece where the inputs are constant."""
    rig = Rig(load_rig("hydmag"), seed=7)
    rig.set("oil", 4 * MPA, True)
    rig.advance(0.3)
    rig.order_gear(1)
    rig.advance(0.3)
    rig.set("motor", 300 * RPM, True)
    rig.advance(0.6)
    fmu.set(seed=7)
    fmu.initialize(oil_pressure=4 * MPA, oil_enable=True)
    for ms, motor, request in shift_into_first(step):
        fmu.set(gear_request=request, motor_speed=300 * RPM, motor_enable=motor)
        fmu.step(ms * 1e-3, step * 1e-3)
    for name in ("n_wej", "p1", "I_zr_p1", "M_wej"):
        assert fmu.get(name) == [rig.measurement(name)], name
    assert fmu.get("s1_slip", "true.n_wyj", "gear_ordered") == [rig.slip(0), rig.true("wk.speed"), 1]


def test_what_can_change_while_the_rig_runs_is_tunable_and_acts_with_the_next_step(rig_fmu, fmu, tmp_path):
    variables = {v.name: v for v in read_model_description(str(rig_fmu())).modelVariables}
    assert {name for name, v in variables.items() if v.variability == "tunable"} == {
        one.name for one in load_rig("hydmag").settings.kept() if one.live
    }
    fmu.initialize(oil_pressure=4 * MPA, oil_enable=True, record=str(tmp_path / "run"))
    rig = Rig(load_rig("hydmag"))
    rig.set("oil", 4 * MPA, True)
    fmu.step(0.0, 0.1)
    rig.advance(0.1)
    changed = {"oil_supply.temperature": 80.0, "alfa46.t12": 0.05}
    fmu.set(**changed)
    for name, value in changed.items():
        rig.set_value(name, value)
    for k, gear in enumerate((1, 2)):
        fmu.set(gear_request=gear)
        rig.order_gear(gear)
        fmu.step(0.1 + k, 1.0)
        rig.advance(1.0)
    for name in ("T_oil", "p1", "p2"):
        assert fmu.get(name) == [rig.measurement(name)], name
    with pytest.raises(FmuFailed, match="oil_supply.temperature of 500 degC refused; expected -30 to 150 degC"):
        fmu.set(**{"oil_supply.temperature": 500.0})
        fmu.step(2.1, 1e-3)
    fmu.terminate()
    changes = [(text, value) for _, _, name, text, value in Bag(tmp_path / "run").events() if name == "setting_changed"]
    assert changes == [("oil_supply.temperature = 80 degC", 80.0), ("alfa46.t12 = 0.05 s", 0.05)]


def test_settings_of_an_external_controller_are_not_the_rigs(fmu):
    fmu.set(controller=1)
    fmu.initialize()
    fmu.set(**{"alfa46.t12": 0.05})
    with pytest.raises(FmuFailed, match="alfa46.t12 is the shift controller's, and not the rig's to change"):
        fmu.step(0.0, 1e-3)


def test_a_gear_asked_for_during_a_shift_is_taken_at_its_end_whatever_the_step(fmu):
    """Gear I takes 650 ms (P3 of output 1); neutral is ordered 100 ms after it and begins when the shift is over."""
    taken = {}
    for step in (1, 50):
        fmu.reset()
        fmu.initialize(gear_request=1)
        states = []
        for ms in range(0, 1000, step):
            fmu.set(gear_request=1 if ms < 100 else 0)
            fmu.step(ms * 1e-3, step * 1e-3)
            states.append((ms + step, fmu.get("gear_ordered")[0]))
        taken[step] = next(ms for ms, gear in states if ms > 50 and gear == 0)
    assert taken == {1: 652, 50: 700}


UP_AND_DOWN = """
description: a shift up and a shift down at little load, five seconds
steps:
  - oil: {pressure: 4 MPa}
  - shift: {to: I, timeout: 3 s}
  - load: {pressure: 1 MPa}
  - motor: {speed: 300 rpm}
  - wait: {for: 450 ms}
  - shift: {to: II, timeout: 5 s}
  - wait: {for: 500 ms}
  - shift: {to: I, timeout: 5 s}
  - wait: {for: 300 ms}
"""


def leaves(node, place=""):
    """Yields the place and the value of everything in a report's row that is no map and no list."""
    if not isinstance(node, dict | list):
        yield place, node
        return
    for key, value in node.items() if isinstance(node, dict) else enumerate(node):
        yield from leaves(value, f"{place}.{key}")


@pytest.mark.parametrize("sequence", ["up_and_down.yaml", pytest.param("demo", marks=pytest.mark.campaign)])
def test_a_sequence_driven_through_fmi_has_the_metrics_of_simulate(sequence, rig_fmu, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("up_and_down.yaml").write_text(UP_AND_DOWN)
    assert example.main([str(rig_fmu()), sequence, "--out", "fmu"]) == 0
    assert main(["simulate", sequence, "--out", "simulate"]) == 0
    driven, simulated = (json.loads((tmp_path / name / "report.json").read_text()) for name in ("fmu", "simulate"))
    assert len(simulated["shifts"]) == 2 and all(shift["valid"] for shift in simulated["shifts"])
    for one, other in zip(driven["shifts"], simulated["shifts"], strict=True):
        assert dict(leaves(one)) == pytest.approx(dict(leaves(other)), abs=1e-6)
    hashes = [Bag(tmp_path / name).canonical_hash() for name in ("fmu", "simulate")]
    different = {"/rig/run_info", "/controller/events", "/sequencer/events", "all"}  # the record of the run and the events differ
    assert {topic for topic in hashes[1] if hashes[0].get(topic) != hashes[1][topic]} == different


@pytest.mark.parametrize("controller", ["duty", "current"])
def test_a_controller_stepped_beside_the_rig_has_one_sample_of_delay(fmu2, controller):
    """As in runs.simulation, the answer to sample s acts from s + 1 on."""
    rig, level = Rig(load_rig("hydmag"), controller="external", level=controller), ("duty", "current").index(controller)
    fmu2.set(controller=level + 1)
    fmu2.initialize()
    for sample in range(60):
        answer = [0.2 + 0.001 * sample, 0.0, 0.0]
        rig.advance_samples(1)
        rig.set_command(level, sample, answer, answer, 1, True, 0)
        fmu2.step(sample * 1e-3, 1e-3)
        fmu2.set(command_1=answer[0], command_gear=1, command_shifting=True)
    assert fmu2.get("I_zr_p1", "true.I_zr_p1") == [rig.measurement("I_zr_p1"), rig.valves[0]["current"]]
    assert rig.valves[0]["current"] > 0.05


def test_parameters_reach_the_rig(fmu):
    fmu.set(**{"alfa46.output_1.P1.current": 0.3, "oil_supply.temperature": 55.0, "effects.transducers": False})
    fmu.initialize(gear_request=1)
    fmu.step(0.0, 0.2)
    assert fmu.get("T_oil") == pytest.approx([55.0], abs=0.01)
    assert fmu.get("I_set_zr_p1")[0] == pytest.approx(0.3 * 199 / 200), "P1 lies at 200 ms, the newest sample at 199"


def test_reset_makes_it_new_and_instances_do_not_meet(fmu2, rig_fmu):
    one = fmu2
    with Fmu(rig_fmu(), "other") as other:
        one.initialize(oil_pressure=2 * MPA, oil_enable=True)
        other.initialize(oil_pressure=4 * MPA, oil_enable=True)
        one.step(0.0, 0.3)
        other.step(0.0, 0.3)
        first = one.get("true.p_p")[0]
        assert first == pytest.approx(2 * MPA, rel=1e-2) and other.get("true.p_p")[0] == pytest.approx(4 * MPA, rel=1e-2)
        one.reset()
        assert one.get("oil_pressure") == [0.0]
        one.initialize(oil_pressure=2 * MPA, oil_enable=True)
        assert one.get("sample") == [0]
        one.step(0.0, 0.3)
        assert one.get("true.p_p") == [first]


# ---- refusals


@pytest.mark.parametrize(
    ("act", "sentence"),
    [
        (lambda f: f.step(0.0, 2.5e-3), "communication step of 0.0025 s is refused; expected whole milliseconds"),
        (lambda f: f.step(0.0, 0.0), "expected whole milliseconds"),
        (lambda f: f.step(0.5, 1e-3), "a step from 0.500000 s is asked for, but the instance stands at 0.000000 s"),
        (lambda f: f.set(seed=2), "seed is a parameter and cannot be set after the initialization"),
        (lambda f: f.set(n_wej=2.0), "n_wej is an output"),
        (lambda f: (f.set(motor_speed=1e9), f.step(0.0, 1e-3)), "motor.speed of 1 000 000 000 rad/s refused; expected 0 to 314.2"),
    ],
)
def test_what_cannot_be_done_is_an_error_with_a_sentence(fmu, act, sentence):
    fmu.initialize()
    with pytest.raises(FmuFailed, match=sentence) as failure:
        act(fmu)
    assert failure.value.status == "error"


@pytest.mark.parametrize(
    ("values", "sentence"),
    [
        ({"alfa46.t12": 9.0}, "alfa46.t12 of 9 s refused; expected -5 to 5 s"),
        ({"alfa46.output_1.P2.time": 0.1}, "P2 is at 100 ms; it must come after P1 at 200 ms"),
        ({"controller": 3}, "controller is 3, expected 0"),
    ],
)
def test_parameters_out_of_range_are_refused_at_the_initialization(fmu, values, sentence):
    fmu.set(**values)
    with pytest.raises(FmuFailed, match=sentence):
        fmu.initialize()
    fmu.reset()
    fmu.initialize()
    fmu.step(0.0, 1e-3)


def test_a_folder_that_holds_something_is_not_recorded_into(fmu, tmp_path):
    (tmp_path / "mine").write_text("x")
    fmu.initialize(record=str(tmp_path))
    with pytest.raises(FmuFailed, match="not empty; name a new one"):
        fmu.step(0.0, 1e-3)


def test_a_command_that_no_coil_can_take_is_refused(fmu):
    fmu.set(controller=1)
    fmu.initialize()
    fmu.step(0.0, 1e-3)
    fmu.set(command_1=float("nan"))
    with pytest.raises(FmuFailed, match="must be 3 finite numbers"):
        fmu.step(1e-3, 1e-3)


def test_a_rig_with_a_device_outside_is_no_fmu(tmp_path):
    with pytest.raises(RigError, match="motor is cut out"):
        build_rig_fmu(tmp_path / "x.fmu", "hydmag", overrides={"motor.source": "topic"})
    with pytest.raises(RigError, match="there is no folder"):
        build_rig_fmu(tmp_path / "nowhere" / "x.fmu", "hydmag")


# ---- the process behind it


def test_no_process_is_left(rig_fmu):
    before = set(children())
    fmu = Fmu(rig_fmu())
    (pid,) = set(children()) - before
    fmu.initialize()
    fmu.close()
    assert gone(pid) and set(children()) == before


def test_the_death_of_the_process_is_fatal_and_said(rig_fmu):
    before = set(children())
    with Fmu(rig_fmu(3)) as fmu:
        fmu.initialize()
        (pid,) = set(children()) - before
        os.kill(pid, signal.SIGKILL)
        with pytest.raises(FmuFailed, match="the rig's process was ended by signal 9") as failure:
            fmu.step(0.0, 1e-3)
        assert failure.value.status == "fatal" and set(children()) == before
        with pytest.raises(FmuFailed) as failure:
            fmu.step(0.0, 1e-3)
        assert failure.value.status == "fatal"


def test_the_death_of_the_importer_ends_the_process(rig_fmu):
    code = (
        "import sys; from rig_nodes.controllers.fmi.importer import Fmu; fmu = Fmu(sys.argv[1]); fmu.initialize();"
        "import os; print(open(f'/proc/self/task/{os.getpid()}/children').read(), flush=True); sys.stdin.read()"
    )
    importer = subprocess.Popen(
        [sys.executable, "-c", code, str(rig_fmu())],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": str(Path(example.__file__).parents[2])},
    )
    pid = int(importer.stdout.readline().split()[0])
    importer.kill()
    importer.communicate()
    assert gone(pid)


@pytest.mark.parametrize(
    ("variable", "value", "sentence"),
    [
        ("RIG_FMU_PYTHON", "/nowhere/python", r"'/nowhere/python' does not start \(No such file or directory\)"),
        ("RIG_FMU_PATH", "/nowhere", "the rig's process ended with exit code 1.*RIG_FMU_PATH"),
    ],
)
def test_an_interpreter_that_is_not_the_rigs_is_named(rig_fmu, monkeypatch, variable, value, sentence):
    monkeypatch.setenv(variable, value)
    if variable == "RIG_FMU_PATH":
        monkeypatch.setenv("RIG_FMU_PYTHON", "/usr/bin/python3" if Path("/usr/bin/python3").exists() else sys.executable)
    before = set(children())
    with pytest.raises(RigError, match=sentence) as refusal:
        Fmu(rig_fmu())
    assert "\n" not in str(refusal.value) and set(children()) == before


SPOILING = """#!{python}
import sys
import numpy as np
from rig_nodes.runs.fmu import rig_process
from rig_nodes.runs.rig import Rig
move = Rig.move
def spoiled(rig, samples):
    if rig.sample >= 200:
        rig.clutches[1]["heat"] = np.nan
    return move(rig, samples)
Rig.move = spoiled
sys.argv = sys.argv[sys.argv.index("rig_nodes.runs.fmu.rig_process"):]
sys.exit(rig_process.main())
"""


def test_a_value_that_is_no_number_ends_the_run_and_is_handed_out_to_nobody(rig_fmu, tmp_path, monkeypatch):
    spoiling = tmp_path / "python"
    spoiling.write_text(SPOILING.format(python=sys.executable))
    spoiling.chmod(0o755)
    monkeypatch.setenv("RIG_FMU_PYTHON", str(spoiling))
    with Fmu(rig_fmu()) as fmu:
        fmu.set(record=str(tmp_path / "run"))
        fmu.initialize(oil_pressure=4 * MPA, oil_enable=True)
        fmu.step(0.0, 0.2)
        with pytest.raises(FmuFailed, match=r"\w+: \w+ became nan between 0.200 s and 0.201 s") as failure:
            fmu.step(0.2, 0.1)
        assert failure.value.exit_code == 1
        assert all(math.isfinite(value) for value in fmu.get(*CATALOGUE.signals, "true.p_p", "sample"))
        fmu.terminate()
    end = json.loads((tmp_path / "run" / "report.json").read_text())["run"]["end"]
    assert end["state"] == "tripped" and "between 0.200 s and 0.201 s" in end["reason"]


def test_the_command_writes_it(tmp_path, capsys):
    assert main(["export", "fmu", "-o", str(tmp_path / "mine.fmu"), "--set", "alfa46.t12=100 ms"]) == 0
    assert re.fullmatch(r"written to .*mine.fmu\n", capsys.readouterr().out)
    start = {v.name: v.start for v in read_model_description(str(tmp_path / "mine.fmu")).modelVariables}["alfa46.t12"]
    assert float(start) == 0.1
    assert main(["export", "fmu", "stray.c"]) == 2 and main(["export", "controller-fmu"]) == 2


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        ("controller-fmu own.c -o own.c", "-o own.c: what is written there is a file that ends in .fmu"),
        ("controller-fmu own.c -o linked.fmu", "-o linked.fmu: it is a file that is read; name another one"),
        ("dbc -o README.md", "-o README.md: what is written there is a file that ends in .dbc"),
        ("registers -o x.pdf", "-o x.pdf: what is written there is a file that ends in .csv or .md"),
        ("registers -o README.md", "-o README.md: it exists and is no older file of this kind; remove it, or choose another name"),
        ("fmu -o folder", "-o folder: it is a folder, expected a file"),
        ("controller-fmu folder", "folder: it is a folder, expected a file"),
        ("dbc -o none/rig.dbc", "-o none/rig.dbc: there is no folder none"),
        ("", "the following arguments are required: what (see 'rig export --help')"),
    ],
)
def test_the_command_writes_over_nothing_of_the_users(arguments, sentence, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    for name in ("own.c", "README.md"):
        Path(name).write_text("mine")
    Path("linked.fmu").symlink_to("own.c")
    Path("folder").mkdir()
    assert main(["export", *arguments.split()]) == 2
    assert capsys.readouterr().err == f"rig: {sentence}\n"
    assert Path("own.c").read_text() == Path("README.md").read_text() == "mine"
    assert sorted(path.name for path in tmp_path.rglob("*")) == ["README.md", "folder", "linked.fmu", "own.c"]


def test_an_older_export_is_written_over(tmp_path, capsys):
    old = tmp_path / "rig.dbc"
    assert [main(["export", "dbc", "-o", str(old), "--set", f"alfa46.t12={ms} ms"]) for ms in (100, 200)] == [0, 0]
    assert old.read_text().startswith("VERSION") and [path.name for path in tmp_path.iterdir()] == ["rig.dbc"]
