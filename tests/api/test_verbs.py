# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""What verbs do is a call of the Python API: each gives what its verb prints or writes, and refuses wrong input in a sentence."""

import inspect
import json
from pathlib import Path

import pytest

import rig_nodes
from rig_nodes.bags import canonical_hash
from rig_nodes.cli.main import main
from rig_nodes.controllers import ControllerOutputs
from rig_nodes.studies.faults import score
from rig_nodes.studies.faults.cases import cases_of

ENDINGS = {"dbc": "rig.dbc", "registers": "registers.md", "record": "rig_record.h"}


@pytest.fixture(scope="module")
def rig():
    return rig_nodes.load("hydmag", alfa46={"t12": "-200 ms"})


def refused(call) -> str:
    """Returns the sentence of a call that is refused."""
    with pytest.raises(rig_nodes.RigError) as refusal:
        call()
    assert "\n" not in str(refusal.value)
    return str(refusal.value)


@pytest.mark.parametrize("what", ENDINGS)
def test_files_of_a_rig_are_those_of_the_command_line(rig, what, tmp_path):
    line, call = tmp_path / f"line_{ENDINGS[what]}", tmp_path / f"call_{ENDINGS[what]}"
    assert main(["export", what, "-o", str(line), "--set", "alfa46.t12=-200 ms"]) == 0
    rig.export(str(call))
    assert call.read_bytes() == line.read_bytes() and call.stat().st_size > 500


def test_a_check_says_what_the_command_line_prints(tmp_path, capsys):
    assert main(["check", "three_speed", "--picture", str(tmp_path / "line.svg")]) == 0
    own = rig_nodes.load("three_speed")
    assert own.check() == capsys.readouterr().out.splitlines()[:-1]
    assert own.draw(tmp_path / "call.svg") and not own.draw(tmp_path / "call.svg")
    assert (tmp_path / "call.svg").read_bytes() == (tmp_path / "line.svg").read_bytes()


@pytest.mark.parametrize(
    ("call", "sentence"),
    [
        (lambda rig: rig.export("rig.txt"), "rig.txt: its ending says no kind of file of a rig; expected .dbc, .csv, .md, .h"),
        (lambda rig: rig.export(None), "file is None, expected a path"),
        (lambda rig: rig.export("nowhere/rig.dbc"), "nowhere/rig.dbc"),
        (lambda rig: rig_nodes.load("ural2").export("rig.dbc"), "export dbc is for a rig with gears and a shift controller"),
        (lambda rig: rig.export_controller_fmu("mine.c", "mine.fmu"), "sources is 'mine.c', expected a list of paths"),
        (lambda rig: rig.export_controller_fmu([], "mine.fmu"), "needs the C file of your controller"),
        (lambda rig: rig.export_controller_fmu(["a.c"], "a.fmu", include=["no"]), "include no: there is no such folder"),
        (lambda rig: rig.export_controller_fmu(["a.c"], "a.fmu"), "a.c: there is no such file"),
        (lambda rig: rig.draw("driveline.png"), "driveline.png: the picture of a driveline is a file that ends in .svg"),
    ],
)
def test_files_that_cannot_be_written_are_refused_in_a_sentence(rig, call, sentence, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("a.fmu").mkdir()
    assert sentence in refused(lambda: call(rig))


@pytest.fixture(scope="module")
def run(rig):
    """A run of half a second: gear I at standstill."""
    steps = [{"oil": {"pressure": "4 MPa"}}, {"wait": {"for": "200 ms"}}, {"shift": {"to": "I"}}, {"wait": {"for": "300 ms"}}]
    return rig.simulate(steps, seed=4)


def test_through_plants_the_topics_that_differ_are_those_of_the_command_line(run, tmp_path, capsys):
    again = run.rerun()
    assert (again.different, again.moved, again.notes, again.answers) == ([], [], [], None)
    assert (
        canonical_hash(str(again.run.folder))["/instruments/controller"]
        == canonical_hash(str(run.folder))["/instruments/controller"]
    )
    assert again.run.report["run"]["mode"] == "rerun"
    other = run.rerun(settings={"oil_supply": {"temperature": "50 degC"}})
    line = ["rerun", str(run.folder), "--through", "plant", "--out", str(tmp_path / "line")]
    assert main([*line, "--set", "oil_supply.temperature=50 degC"]) == 0
    printed = capsys.readouterr().out.splitlines()
    assert (
        printed[0] == f"{len(other.different)} of {other.topics} topics differ from the recorded ones: {', '.join(other.different)}"
    )
    assert printed[1:-1] == other.moved
    assert canonical_hash(str(tmp_path / "line"))["all"] == canonical_hash(str(other.run.folder))["all"]


class Idle:
    """A controller that leaves all valves without current."""

    level = "duty"

    def initialize(self, info):
        pass

    def step(self, inputs):
        return ControllerOutputs()

    def terminate(self):
        pass


def test_through_a_controller_its_answers_are_counted(run):
    own = run.rerun("alfa46").answers
    assert own.same == own.samples > 400 and own.first is None and not own.end
    assert run.rerun("alfa46", settings={"alfa46.gain_p": "20 ohm"}).answers.first > 0.0
    other = run.rerun(Idle).answers
    assert 0 < other.same < other.samples == own.samples and other.first >= 0.2


@pytest.mark.parametrize(
    ("call", "sentence"),
    [
        (lambda run: run.rerun(None), "through is None, expected 'plant', or a controller"),
        (lambda run: run.rerun(level="duty"), "level is of a controller; the recorded commands have their own"),
        (lambda run: run.rerun(rig="clutch_bench"), "which the rig 'clutch_bench' does not have"),
        (lambda run: run.rerun("python:none.py:A"), "none.py"),
        (lambda run: run.rerun(settings=["alfa46.t12"]), "settings is ['alfa46.t12'], expected a dict of names and values"),
    ],
)
def test_what_cannot_be_run_again_is_refused_in_a_sentence(run, call, sentence):
    assert sentence in refused(lambda: call(run))


SERIES = """description: two loads
source: nobody
sequence: small.yaml
repeats: 2
series:
  - grid: {load: [10 Nm, 20 Nm]}
    label: "${load}"
    conditions: {m_wyj: "${load}", series: 3}
    parameters: {load: "${load}"}
"""
STEPS = """description: oil and a load
parameters: {load: 5 Nm}
steps:
  - oil: {pressure: 4 MPa}
  - load: {torque: "${load}"}
  - wait: {for: 50 ms}
"""


@pytest.fixture
def loads(tmp_path):
    """The file of a procedure with two series."""
    (tmp_path / "small.yaml").write_text(STEPS)
    (tmp_path / "loads.yaml").write_text(SERIES)
    return tmp_path / "loads.yaml"


def test_the_runs_of_a_procedure_are_those_of_the_command_line(rig, loads, tmp_path, capsys):
    line, call = tmp_path / "line", tmp_path / "call"
    assert main(["procedure", str(loads), "--series", "20Nm", "--set", "alfa46.t12=-200 ms", "--out", str(line)]) == 0
    table = rig_nodes.procedure(loads, ["20Nm"], rig=rig, folder=call)
    for name in ("20Nm-1", "20Nm-2"):
        assert canonical_hash(str(call / name))["all"] == canonical_hash(str(line / name))["all"]
    assert (call / "procedure.json").read_text() == (line / "procedure.json").read_text()
    assert (list(table["run"]), list(table["m_wyj"]), set(table["end"])) == (["20Nm-1", "20Nm-2"], [20.0, 20.0], {"ended"})
    assert table.units["m_wyj"] == "Nm" and list(table["label"]) == ["20Nm"] * 2 and list(table["series"]) == [3, 3]


def test_a_table_of_a_procedure_has_what_its_report_found(loads, tmp_path):
    one = rig_nodes.procedure("valve_response", ["ZR-P1"], folder=tmp_path / "valve")
    found = json.loads((tmp_path / "valve" / "procedure.json").read_text())["found"]
    columns = {name for name in one.columns if "." in name}
    assert columns and len(one) == 2, one.columns
    for row in found:
        if (name := f"{row['kind']}.{row['key']}") in columns:
            factor = {"ms": 1e-3, "MPa": 1e6}.get(row["unit"], 1.0)
            assert one[name].mean() == pytest.approx(factor * row["mean"])
    assert one.units["ZR-P1.valve_delay_s"] == "s" and one["ZR-P1.valve_delay_s"].mean() == pytest.approx(0.194, abs=2e-3)


def test_series_are_listed_with_their_conditions(rig, loads, capsys):
    assert main(["procedure", str(loads), "--labels"]) == 0
    table = rig_nodes.procedure_series(loads, rig=rig)
    assert capsys.readouterr().out.split() == list(table["label"]) and list(table["m_wyj"]) == [10.0, 20.0]


@pytest.mark.parametrize(
    ("call", "sentence"),
    [
        (lambda _: rig_nodes.procedure("grid_upp"), "there is no procedure 'grid_upp'"),
        (lambda _: rig_nodes.procedure(3), "name is 3, expected a path"),
        (lambda _: rig_nodes.procedure("grid_up", "19"), "series is '19', expected a list of texts"),
        (lambda _: rig_nodes.procedure("grid_up", rig=3), "rig is 3, expected a Rig, its name or its file"),
        (lambda loads: rig_nodes.procedure(loads, ["30Nm"], rig="hydmag"), "there is no series '30Nm'; did you mean '20Nm'"),
        (lambda loads: rig_nodes.procedure(loads, rig="hydmag", folder=loads.parent), "exists and is not an empty folder"),
        (lambda _: rig_nodes.procedure("delay_series", rig=rig_nodes.load("hydmag", alfa46={"t12": 0.0})), "sets it itself"),
    ],
)
def test_a_procedure_that_cannot_run_is_refused_in_a_sentence(loads, call, sentence):
    assert sentence in refused(lambda: call(loads))


def test_a_measurement_is_that_of_the_command_line(monkeypatch, tmp_path):
    monkeypatch.setattr("rig_nodes.studies.benchmark.kernel.VARIANTS", {"the usual": ({}, True)})
    assert main(["bench", "kernel", "--repeats", "1", "--json", str(tmp_path / "x.json")]) == 0
    line, call = json.loads((tmp_path / "x.json").read_text()), rig_nodes.bench("hydmag", ["kernel"], repeats=1)
    assert {**call["machine"], "load": 0.0} == {**line["machine"], "load": 0.0}, "but for the load at the time"
    assert call["kernel"]["the usual"].keys() == line["kernel"]["the usual"].keys()
    assert call["kernel"]["the usual"]["real_time_factor"] > 0.0


def late(course):
    """A detector that gives its alarm at the end of every run."""
    return course.t[-1], "dc_motor.weak"


def test_scores_of_a_detector_are_those_of_the_command_line(monkeypatch, tmp_path):
    monkeypatch.setattr(score, "cases_of", lambda *given: cases_of(*given)[:3])
    (tmp_path / "late.py").write_text(inspect.getsource(late))
    detector = ["--detector", f"{tmp_path / 'late.py'}:late", "--jobs", "1", "--json", str(tmp_path / "x.json")]
    assert main(["faults", "bench", "--healthy", "2", "--sizes", "1", *detector]) == 0
    line = json.loads((tmp_path / "x.json").read_text())
    found = json.loads(json.dumps(rig_nodes.bench_faults("hydmag", late, healthy=2, sizes=[1])))
    assert {**found, "generator": line["generator"], "detector": line["detector"]} == line
    assert found["runs"] == 3 and found["false_alarms_healthy"] == [2, 2]


@pytest.mark.parametrize(
    ("call", "sentence"),
    [
        (lambda: rig_nodes.bench("hydmag", "kernel"), "parts is 'kernel', expected a list of texts"),
        (lambda: rig_nodes.bench("hydmag", ["kernel"], repeats=0.5), "repeats is 0.5, expected a whole number of at least 1"),
        (lambda: rig_nodes.bench(None, ["kernel"]), "rig is None, expected a Rig, its name or its file"),
        (lambda: rig_nodes.bench_faults("hydmag", "late.py:late"), "detector is 'late.py:late', expected a function"),
        (lambda: rig_nodes.bench_faults("hydmag", sizes=[0.5, 0]), "sizes is [0.5, 0], expected numbers above 0"),
        (lambda: rig_nodes.bench_faults("hydmag", sizes=["1"]), "sizes is ['1'], expected numbers above 0"),
        (lambda: rig_nodes.bench_faults("hydmag", sizes=2), "sizes is 2, expected numbers above 0"),
        (lambda: rig_nodes.bench_faults("hydmag", jobs=True), "jobs is True, expected a whole number of at least 1"),
        (lambda: rig_nodes.bench_faults("hydmag", seed=-1), "seed is -1, expected a whole number from 0 to 9223372036854775807"),
    ],
)
def test_what_cannot_be_measured_is_refused_in_a_sentence(call, sentence):
    assert sentence in refused(call)


def test_rows_are_judged_as_by_the_command_line(capsys):
    assert main(["validate", "--rig", "three_speed", "--set", "loss_in.drag=20 Nm", "--jobs", "1", "--json", "-"]) == 0
    lines = json.loads(capsys.readouterr().out)["rows"]
    table = rig_nodes.validate(rig_nodes.load("three_speed", loss_in={"drag": 20.0}))
    assert [dict(row) for row in table] == [{name: line[name] for name in table.columns} for line in lines]
    assert "outside" in table["verdict"] and len(rig_nodes.validate("three_speed", ["ratio_*"])) == 3


def test_rows_of_the_laboratory_are_judged_and_drawn_as_by_the_command_line(capsys, tmp_path):
    arguments = ["--rows", "cylinder_*", "--jobs", "1", "--json", "-", "--pictures", str(tmp_path / "line")]
    assert main(["validate", *arguments]) == 0
    lines = json.loads(capsys.readouterr().out)["rows"]
    table = rig_nodes.validate("hydmag", ["cylinder_*"], pictures=tmp_path / "call")
    assert [dict(row) for row in table] == [{name: line[name] for name in table.columns} for line in lines]
    assert sorted(one.name for one in (tmp_path / "call").iterdir()) == sorted(one.name for one in (tmp_path / "line").iterdir())


@pytest.mark.parametrize(
    ("call", "sentence"),
    [
        (lambda: rig_nodes.validate("three_speed", "ratio_1"), "rows is 'ratio_1', expected a list of texts"),
        (lambda: rig_nodes.validate("three_speed", ["ratios"]), "there is no row 'ratios'"),
        (lambda: rig_nodes.validate("three_speed", pictures="p"), "pictures belongs to the laboratory's programme"),
        (lambda: rig_nodes.validate("hydmag", procedures=["grid"]), "there is no procedure 'grid'; did you mean"),
        (lambda: rig_nodes.validate("hydmag", ["cylinder_*"], pictures=3), "pictures is 3, expected a path"),
        (lambda: rig_nodes.calibrate("chapter9"), "the rows of 'chapter9' are those of 'hydmag'"),
        (lambda: rig_nodes.calibrate("three_speed", stages="all"), "stages is 'all', expected a list of texts"),
        (lambda: rig_nodes.calibrate("three_speed", generations=-1), "generations is -1, expected a whole number of at least 0"),
        (lambda: rig_nodes.calibrate("three_speed", trade_offs=True), "trade-offs belong to the laboratory's rows"),
    ],
)
def test_what_cannot_be_validated_or_calibrated_is_refused_in_a_sentence(call, sentence):
    assert sentence in refused(call)


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        ({"objectives": "peak,time"}, "objectives is 'peak,time', expected a list of texts"),
        ({"objectives": ["peak", "noise"]}, "objectives: there is no objective 'noise'"),
        ({"ways": ["I-III"]}, "ways: there is no way 'I-III'"),
        ({"speeds": 1000}, "speeds is 1000, expected "),
        ({"oil": (60.0, 20.0)}, "oil (60.0, 20.0): the range must rise from 0 or more"),
        ({"bounds": ["peak"]}, "bounds is ['peak'], expected a dict of objectives and values"),
        ({"bounds": {"peak": None}}, "bound peak=None: expected a text with its unit, or a number in SI"),
        ({"bounds": {"dip": -0.1}}, "bound dip=-0.1: expected 0 or more"),
        ({"judge_rigs": -1}, "judge_rigs is -1, expected a whole number of at least 0"),
        ({"generations": 0.5}, "generations is 0.5, expected a whole number of at least 1"),
        ({"spreads": "none.json"}, "none.json: holds no spreads"),
        ({"rig": "ural2"}, "tune is for a rig with gears and a shift controller"),
        (
            {"rig": "hydmag_engine"},
            "sets the load in steps by a load pump's relief valve, and rig 'hydmag_engine' has another load",
        ),
        ({"folder": None}, "folder is None, expected a path"),
    ],
)
def test_a_tuning_that_is_not_possible_is_refused_in_a_sentence(given, sentence, tmp_path):
    call = {"rig": "hydmag", "folder": tmp_path / "tuned", **given}
    assert sentence in refused(lambda: rig_nodes.tune(**call)) and not (tmp_path / "tuned").exists()
