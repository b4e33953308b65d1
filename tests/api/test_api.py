# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The Python API as a user meets it: values in SI, tables with units, files of any kind, and one clear sentence for bad input."""

import copy
import gc
import json
import math
import os
import pickle
import re
import shutil
import sqlite3
import stat
import subprocess
import sys
from base64 import b64decode
from contextlib import closing
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

import rig_nodes
from rig_nodes.analysis import loop_columns, put_loops
from rig_nodes.bags import Bag, canonical_hash
from rig_nodes.base import load_yaml
from rig_nodes.cli.main import main
from rig_nodes.controllers import ControllerOutputs
from rig_nodes.runs import Lost, Workers

SAMPLE = Path(__file__).parents[2] / "bags" / "sample"
SHORT = Path(__file__).parents[1] / "sweep" / "short.yaml"

FIRST = [  # gear I at standstill, then the motor: the shortest run with something to see
    {"oil": {"pressure": "4 MPa"}},
    {"wait": {"until": {"signal": "p_p", "above": "3.9 MPa"}}},
    {"shift": {"to": "I"}},
    {"motor": {"speed": "1500 rpm"}},
    {"wait": {"until": {"signal": "n_wej", "near": "1500 rpm", "within": "8 rpm"}, "hold": "200 ms"}},
]
UP = [{"load": {"torque": "${load}"}}, {"wait": {"for": "500 ms"}}, {"shift": {"to": "II"}}, {"wait": {"for": "800 ms"}}]
BACK = [{"shift": {"to": "I"}}, {"wait": {"for": "800 ms"}}]


@pytest.fixture(scope="module")
def rig():
    return rig_nodes.load("hydmag")


@pytest.fixture(scope="module")
def run(rig):
    return rig.simulate("demo", seed=1)


def test_importing_the_package_loads_nothing_heavy_and_takes_no_time():
    code = "import rig_nodes, sys; print(sorted({'numpy', 'numba', 'pandas', 'matplotlib', 'scipy'} & sys.modules.keys()))"

    def seconds() -> float:
        command = [sys.executable, "-X", "importtime", "-c", code]
        done = subprocess.run(command, capture_output=True, text=True, check=True)
        assert done.stdout.strip() == "[]"
        return int(re.search(r"\| +(\d+) \| rig_nodes$", done.stderr, re.MULTILINE)[1]) / 1e6

    assert any(seconds() < 0.15 for _ in range(3))  # other tests run beside it


def test_a_run_is_that_of_the_command_line(run, tmp_path):
    assert main(["simulate", "demo", "--out", str(tmp_path / "line")]) == 0
    saved = run.save(tmp_path / "saved")
    assert sorted(one.name for one in saved.iterdir()) == sorted(one.name for one in (tmp_path / "line").iterdir())
    assert canonical_hash(str(saved))["all"] == canonical_hash(str(tmp_path / "line"))["all"]
    assert (saved / "report.json").read_text() == (tmp_path / "line" / "report.json").read_text()


def test_settings_are_texts_or_si_numbers_nested_or_with_dots(rig):
    ways = [
        rig_nodes.load("hydmag", alfa46={"t12": "-190 ms", "output_1": {"P1": "100 ms 160 mA"}}),
        rig_nodes.load("hydmag", **{"alfa46.t12": -0.19, "alfa46.output_1.P1": (0.1, 0.16)}),
    ]
    assert ways[0].config.as_dict() == ways[1].config.as_dict() != rig.config.as_dict()


@pytest.mark.parametrize(
    ("call", "sentence"),
    [
        (lambda: rig_nodes.load("hydmagg"), "there is no rig 'hydmagg'; did you mean 'hydmag'"),
        (
            lambda: rig_nodes.load("hydmag", alfa46={"t13": 1.0}),
            "setting alfa46.t13=1.0: there is no value of alfa46 't13'; did you mean",
        ),
        (
            lambda: rig_nodes.load("hydmag", **{"alfa46.t12": [1]}),
            "setting alfa46.t12 is [1]; expected a text with a unit or a number",
        ),
        (lambda: rig_nodes.load("hydmag", **{"alfa46.t12": 99.0}), "setting alfa46.t12=99.0 s: the value is 99.0 s, outside"),
        (lambda: rig_nodes.load("hydmag").simulate("demmo"), "there is no sequence 'demmo'; did you mean 'demo'"),
        (lambda: rig_nodes.load("hydmag").simulate([]), "steps must be a list with at least one step"),
        (lambda: rig_nodes.load("hydmag").simulate([*FIRST, {"wait": {"four": "1 s"}}]), "step:6: unknown key 'four' in wait"),
        (lambda: rig_nodes.load("hydmag").simulate(FIRST, parameters={"load": 1}), "there is no parameter 'load'"),
        (lambda: rig_nodes.load("hydmag").simulate("demo", controller="python:none.py:A"), "none.py"),
        (lambda: rig_nodes.load("ural2").simulate([{"shift": {"to": "I"}}]), "step:1: unknown key 'shift' in a step"),
        (
            lambda: rig_nodes.load("hydmag").simulate("demo", seed=-1),
            "seed is -1, expected a whole number from 0 to 9223372036854775807",
        ),
        (lambda: rig_nodes.open(None), "path is None, expected that of a run's folder, a bag or a logger's file"),
        (
            lambda: rig_nodes.sweep("hydmag", FIRST, {"load": "1 Nm"}, folder="kept"),
            "folder is kept: a sweep that is kept takes a sequence's name or file; write the steps to one",
        ),
        (lambda: rig_nodes.sweep("hydmag", [{"wait": {"four": "1 s"}}], {"load": "1 Nm"}), "step:1: unknown key 'four' in wait"),
        (lambda: rig_nodes.load("hydmag").modes("III"), "--gear III: there is no gear 'III'"),
        (lambda: rig_nodes.sweep("hydmag", "demo", {}, bags=True), "bags are kept in the sweep's folder; give folder too"),
        (lambda: rig_nodes.sweep("hydmag", "demo", {"seed": "1, 2"}, controller="udp:9000"), "one program of its own"),
        (lambda: rig_nodes.sweep("hydmag", "demo", {}), "a sweep needs something to vary: by the name of each parameter"),
        (lambda: rig_nodes.open("nowhere"), "nowhere: there is no such file or folder"),
        (lambda: rig_nodes.sweep("hydmag", "demo", {"alfa46.t12": "1 MPa, 2 MPa"}), "vary alfa46.t12"),
    ],
)
def test_bad_input_gets_one_sentence(call, sentence):
    with pytest.raises(rig_nodes.RigError) as refusal:
        call()
    assert sentence in str(refusal.value) and "\n" not in str(refusal.value)


class NoPath:
    def __repr__(self):
        return "an object"


@pytest.mark.parametrize(
    ("call", "sentence"),
    [
        (lambda rig, run: rig.simulate(FIRST, delay=1.5), "delay is 1.5, expected a whole number from 0 to 50"),
        (lambda rig, run: rig.session(delay="x"), "delay is 'x', expected a whole number from 0 to 50"),
        (lambda rig, run: rig.simulate(FIRST, parameters=[1]), "parameters is [1], expected a dict of names and values"),
        (
            lambda rig, run: rig.simulate(FIRST, controller=""),
            "controller is '', expected a text as after --controller, or a class",
        ),
        (lambda rig, run: rig.simulate(FIRST, controller=NoPath()), "controller is an object, expected a text"),
        (lambda rig, run: rig.modes(5), "gear is 5, expected the name of a gear"),
        (lambda rig, run: rig.modes(locked="clutch_s1"), "locked is 'clutch_s1', expected a list of texts"),
        (lambda rig, run: rig.session().set("motor", False), "motor is False; expected a number in SI, or a text with its unit"),
        (lambda rig, run: rig.session().set(5, 1.0), "name is 5, expected that of a setpoint or setting"),
        (lambda rig, run: rig.session().fault(5), "name is 5, expected that of a fault"),
        (lambda rig, run: run.plot(3), "there is no shift 3; the run has 2 shifts, the first is 1"),
        (lambda rig, run: run.plot(True), "there is no shift True; the run has 2 shifts, the first is 1"),
        (lambda rig, run: run.to_pandas(["p1"], period=0), "period is 0, expected a time of at least 1 us"),
        (lambda rig, run: run.to_pandas(["p1"], period=math.inf), "period is inf, expected a time of at least 1 us"),
        (lambda rig, run: run.to_pandas(5), "signals is 5, expected a list of texts"),
        (lambda rig, run: run.to_pandas([5]), "signals is [5], expected a list of texts"),
        (lambda rig, run: run.save(None), "folder is None, expected a path"),
        (lambda rig, run: run.export(5), "file is 5, expected a path"),
        (lambda rig, run: rig_nodes.open("a.csv", rig="hydmag"), "a.csv: there is no such file"),
        (lambda rig, run: rig_nodes.open(__file__, rig=5), "rig is 5, expected a Rig, its name or its file"),
        (lambda rig, run: rig_nodes.open(__file__, profile=5), "profile is 5, expected a path"),
        (lambda rig, run: rig_nodes.sweep(rig, "demo", 5), "vary is 5, expected a dict of names and values"),
        (
            lambda rig, run: rig_nodes.sweep(rig, "demo", {"alfa46.t12": 5}),
            "vary alfa46.t12 is 5, expected a list of values or a text",
        ),
        (
            lambda rig, run: rig_nodes.sweep(rig, "demo", {"alfa46.t12": "1 ms, 2 ms"}, seed=1.5),
            "seed is 1.5, expected a whole number",
        ),
        (
            lambda rig, run: rig_nodes.sweep(rig, "demo", {"alfa46.t12": "1 ms, 2 ms"}, samples="3"),
            "samples is '3', expected a whole",
        ),
        (lambda rig, run: rig_nodes.sweep(rig, "demo", {"alfa46.t12": [1.0]}, folder=5), "folder is 5, expected a path"),
        (lambda rig, run: rig_nodes.load("hydmag", alfa46={"output_1": {"P1": (5, "160 mA")}}), "numbers in SI, time and current"),
        (
            lambda rig, run: rig.simulate(
                [*FIRST[:1], {"wait": {"until": {"signal": "p_p", "near": "1 MPa", "within": "-1 MPa"}}}]
            ),
            "within is -1 MPa, expected more than 0",
        ),
        (
            lambda rig, run: rig_nodes.load("hydmag", kernel={"step": "7 us"}),
            "step of 7 us does not divide the controller's sample",
        ),
    ],
)
def test_a_value_of_another_kind_is_refused_where_it_is_given(rig, run, call, sentence):
    with pytest.raises(rig_nodes.RigError) as refusal:
        call(rig, run)
    assert sentence in str(refusal.value) and "\n" not in str(refusal.value)


@pytest.mark.parametrize(("name", "write"), [("a.csv", "export"), ("a.h", "export"), ("a.svg", "draw"), ("a.fmu", "export_fmu")])
def test_no_file_of_somebody_else_is_replaced(rig, name, write, tmp_path):
    (tmp_path / name).write_text("t [s],p1 [bar]\n")
    with pytest.raises(rig_nodes.RigError, match="it exists and is no older file of this kind; remove it, or choose another name"):
        getattr(rig, write)(tmp_path / name)
    assert (tmp_path / name).read_text() == "t [s],p1 [bar]\n"
    if write != "export_fmu":
        (tmp_path / name).unlink()
        getattr(rig, write)(tmp_path / name)
        getattr(rig, write)(tmp_path / name)  # an older one of its own


def test_whole_numbers_of_numpy_and_points_as_texts_are_taken(rig, run):
    assert len(run.plot(np.int64(1)).axes) > 3 and run.signals.get("zz") is None and run.signals.get("p1").unit == "Pa"
    one = rig_nodes.load("hydmag", alfa46={"output_1": {"P1": ("200 ms", "160 mA")}})
    assert one.config.as_dict() == rig_nodes.load("hydmag", alfa46={"output_1": {"P1": (0.2, 0.16)}}).config.as_dict()


def test_signals_and_copies_outlive_their_run(rig):
    signals = rig.simulate(FIRST[:2]).signals
    assert rig.simulate(FIRST[:2]).signals["p_p"].max() == signals["p_p"].max() > 3.8e6
    one = rig.simulate(FIRST[:2])
    twin, folder = copy.deepcopy(one), one.folder
    del one
    assert twin.signals["p_p"].max() == signals["p_p"].max()
    del twin
    gc.collect()
    assert not folder.exists() and not folder.parent.exists()


def test_a_saved_run_is_where_it_was_saved_and_open_to_others(rig, tmp_path):
    run = rig.simulate(FIRST[:2])
    umask = os.umask(0o022)
    try:
        saved = run.save(tmp_path / "saved")
    finally:
        os.umask(umask)
    assert run.folder == saved and stat.S_IMODE(saved.stat().st_mode) == 0o777 & ~umask
    assert len(run.signals["p_p"]) > 10 and run.save(tmp_path / "again").is_dir()


def test_runs_are_compared_by_their_folders_and_by_known_ways_only(tmp_path):
    run = rig_nodes.open(SAMPLE)
    other = shutil.copytree(SAMPLE, tmp_path / "other")
    assert run.compare(str(other)).metrics[0]["difference"] == 0.0
    with pytest.raises(rig_nodes.RigError, match="alignment by 'order': expected by 'events' or 'correlation'"):
        run.compare(run, by="order")


def test_a_run_is_exported_as_the_command_line_does(run, tmp_path):
    saved = run.save(tmp_path / "run")
    found = run.export(tmp_path / "one.csv", ["p?", "n_wej"], period="5 ms", units="shown")
    words = ["--signals", "p?,n_wej", "--clock", "5 ms", "--units", "shown", "-o", str(tmp_path / "other.csv")]
    assert main(["export", "csv", str(saved), *words]) == 0
    assert found.file.read_bytes() == (tmp_path / "other.csv").read_bytes() and found.cut_off == ""
    for name, more, sentence in (
        ("one.csv", {}, "is there already; choose a new name"),
        ("one.xls", {}, "its ending says no kind of file; expected .csv, .parquet"),
        ("one.mf4", {"period": 0.1}, "a period is for csv and parquet"),
        ("one.parquet", {"period": 0.0}, "period is 0.0, expected a time of at least 1 us"),
        ("one.blf", {"units": "shown"}, "blf holds the frames of the rig's CAN database"),
        ("two.csv", {"signals": ["p9"]}, "there is no signal 'p9'"),
    ):
        with pytest.raises(rig_nodes.RigError, match=re.escape(sentence)):
            run.export(tmp_path / name, **more)


def test_the_page_of_a_run_is_that_of_the_command_line(rig, tmp_path):
    run = rig.simulate(FIRST[:2])
    assert main(["report", str(run.save(tmp_path / "run")), "--html", str(tmp_path / "line.html")]) == 0
    run.page(tmp_path / "call.html")
    assert (tmp_path / "call.html").read_text() == (tmp_path / "line.html").read_text()
    with pytest.raises(rig_nodes.RigError, match="page.txt: the page of a run is a file that ends in .html or .pdf"):
        run.page("page.txt")


def test_a_bag_of_sqlite3_is_opened_as_its_run(rig, tmp_path):
    run = rig.simulate(FIRST[:2])
    bag = Bag(run.folder)
    numbers = {topic: number for number, topic in enumerate(bag.types, 1)}
    with closing(sqlite3.connect(tmp_path / "run.db3")) as store:
        store.execute("CREATE TABLE topics(id INTEGER PRIMARY KEY, name, type, serialization_format, offered_qos_profiles)")
        store.execute("CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB)")
        topics = [(number, topic, bag.types[topic]) for topic, number in numbers.items()]
        store.executemany("INSERT INTO topics VALUES (?, ?, ?, 'cdr', '')", topics)
        rows = [(numbers[topic], time, data) for time, topic, data in bag.timeline()]
        store.executemany("INSERT INTO messages(topic_id, timestamp, data) VALUES (?, ?, ?)", rows)
        store.commit()
    opened = rig_nodes.open(tmp_path / "run.db3")
    assert np.array_equal(opened.signals["p_p"], run.signals["p_p"]) and opened.end["state"] == "ended"
    assert len(opened.events) == len(run.events) and rig_nodes.open(opened.save(tmp_path / "saved")).signals["p_p"].max() > 3.8e6


def test_steps_are_swept_as_a_file_with_them_is(tmp_path):
    steps, vary = load_yaml(SHORT), {"rest": ["50 ms", "60 ms"]}
    one, other = rig_nodes.sweep("hydmag", steps, vary), rig_nodes.sweep("hydmag", SHORT, vary)
    assert one["t_c_s"].tolist() == other["t_c_s"].tolist() and len(one) == 2
    assert one[:1].plot().axes, "a part of a sweep is drawn too"


def test_a_sweep_takes_what_that_of_the_command_line_takes(tmp_path, capsys):
    box, folder = tmp_path / "box.py", tmp_path / "sweep"
    box.write_text(
        "from rig_nodes.controllers import ControllerOutputs\n\n\nclass Box:\n    levels = ('current',)\n\n"
        "    def initialize(self, info):\n        self.outputs = len(info.outputs)\n\n    def step(self, inputs):\n"
        "        command = [0.74 if inputs.gear_request == k + 1 else 0.0 for k in range(self.outputs)]\n"
        "        return ControllerOutputs(command, gear=inputs.gear_request)\n\n    def terminate(self):\n        pass\n"
    )
    vary = {"alfa46.t12": ["-0.24 s", "-0.2 s"], "seed": "3, 5"}
    own = {"controller": f"python:{box}:Box", "delay": 2, "parameters": {"rest": "40 ms"}}
    table = rig_nodes.sweep("hydmag", SHORT, vary, method="list", folder=folder, bags=True, **own)
    assert list(table["end"]) == ["ended", "ended"] and len(table) == 2
    bag = rig_nodes.open(folder / "bags" / "000001")
    assert bag.report["run"]["seed"] == 5 and bag.report["run"]["controller"]["name"].endswith("Box")
    words = ["--method", "list", "--controller", f"python:{box}:Box", "--delay", "2", "--with", "rest=40 ms", "--bags"]
    varied = [f"--vary={name}={spec if isinstance(spec, str) else ', '.join(spec)}" for name, spec in vary.items()]
    assert main(["sweep", str(SHORT), "--rig", "hydmag", *varied, *words, "--out", str(folder)]) == 0
    assert "2 of 2 members are finished already" in capsys.readouterr().err, "it is the same sweep"
    assert pq.read_table(folder / "results.parquet")["t_order_s"].to_pylist() == table["t_order_s"].tolist()


def test_modes_are_those_of_the_command_line(capsys):
    table = rig_nodes.load("ural2").modes()
    assert main(["modes", "ural2", "--json", "-"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert table["frequency_hz"].tolist() == printed["frequencies_hz"] and table[0]["damping"] == printed["damping"][0]
    assert [table[k][body] for k in (0, 1) for body in printed["bodies"]] == [x for row in printed["shapes"][:2] for x in row]


@pytest.mark.parametrize("how", [pytest.param("stdin", marks=pytest.mark.campaign), "script"])
def test_a_sweep_with_processes_needs_no_guard_in_a_script(how, tmp_path):
    code = (
        "print('begun')\nimport rig_nodes\n"
        f"table = rig_nodes.sweep('hydmag', {str(SHORT)!r}, {{'rest': ['50 ms', '0.06 s']}}, jobs=2)\n"
        "print(list(table['end']), table['rest'].tolist(), list(table['to_gear']))\n"
    )
    (tmp_path / "mine.py").write_text(code)
    arguments = {"args": [sys.executable, "-"], "input": code} if how == "stdin" else {"args": [sys.executable, "mine.py"]}
    done = subprocess.run(**arguments, cwd=tmp_path, capture_output=True, text=True, timeout=200)
    assert done.stdout == "begun\n['ended', 'ended'] [0.05, 0.06] ['II', 'II']\n" and "Traceback" not in done.stderr, done.stderr


def test_members_lost_with_their_processes_are_run_by_the_next_call(tmp_path, monkeypatch):
    vary = {"rest": ["50 ms", "60 ms"]}
    with monkeypatch.context() as patch:
        patch.setattr(
            Workers, "stream", lambda _self, _run, items: [(k, None, Lost("2 processes were killed")) for k, _ in enumerate(items)]
        )
        with pytest.raises(rig_nodes.RigError, match="member 1: 2 processes were killed"):
            rig_nodes.sweep("hydmag", SHORT, vary, folder=tmp_path / "sweep")
    assert list(rig_nodes.sweep("hydmag", SHORT, vary, folder=tmp_path / "sweep")["end"]) == ["ended", "ended"]


def test_a_signal_is_an_array_with_times_and_a_unit(run):
    p2 = run.signals["p2"]
    assert p2.unit == "Pa" and len(p2.time) == len(p2) and np.array_equal(p2, p2.values)
    assert math.isclose(p2.to("MPa").max(), p2.max() / 1e6) and math.isclose(p2.to("bar").to("Pa").max(), p2.max())
    late = p2[p2.time > 9.0]
    assert late.time[0] > 9.0 and len(late.time) == len(late) < len(p2)
    for made in (p2 - p2.mean(), np.diff(p2), np.gradient(p2, p2.time), np.sort(p2), p2.round(), -p2, p2[None], p2[::2] * 2.0):
        assert type(made) is np.ndarray
    assert p2[::-1].time[0] == p2.time[-1] and p2[p2 > 1e6].time.shape == p2[p2 > 1e6].values.shape and p2[3] == p2.values[3]
    assert np.allclose(copy.deepcopy(late), late) and np.max([p2.to("MPa")]) == p2.to("MPa").max()
    again = pickle.loads(pickle.dumps(late))
    assert again.unit == "Pa" and np.array_equal(again.time, late.time)
    with pytest.raises(
        rig_nodes.RigError, match="p2 is in Pa and not to be had in 'rpm'; expected one of Pa, kPa, MPa, mbar, bar, psi"
    ):
        p2.to("rpm")
    with pytest.raises(rig_nodes.RigError, match="there is no signal 'p3' in the run"):
        run.signals["p3"]


def test_tables_name_what_they_do_not_have(run):
    assert list(run.shifts["from_gear"]) == ["I", "II"] and run.shifts.units["t_c_s"] == "s" and run.shifts.units["k"] == ""
    assert run.shifts[0]["quality"] == "fair" and len(list(run.shifts)) == 2
    with pytest.raises(rig_nodes.RigError, match="there is no column 't_c'; did you mean 't_c_s'"):
        run.shifts["t_c"]
    with pytest.raises(rig_nodes.RigError, match="there is no row 7; the table has 2 rows"):
        run.shifts[7]
    assert repr(run.shifts[:1]).splitlines()[0].split()[:3] == ["from_gear", "to_gear", "t_order_s"] and len(run.events[:3]) == 3
    arrow = run.shifts.to_arrow()
    assert arrow["k"].to_pylist() == list(run.shifts["k"]) and arrow.field("t_c_s").metadata == {b"unit": b"s"}
    assert run.shifts[:0].to_arrow().column_names == run.shifts.columns and "k" in run.shifts and "t_c" not in run.shifts
    frame = run.shifts.to_pandas()
    assert frame.loc[0, "k"] == run.shifts["k"][0] and frame.attrs["units"]["e_loss_j"] == "J"


def test_a_data_frame_has_the_rows_of_the_logger_and_the_last_value_of_slower_signals(run):
    frame = run.to_pandas(["p1", "p_p", "gear"])
    fast, slow = run.signals["p1"], run.signals["p_p"]
    assert np.array_equal(frame["p1"][: len(fast)], fast) and np.allclose(frame.index[: len(fast)], fast.time)
    held = frame["p_p"].loc[slow.time[500] : slow.time[501] - 1e-6]
    assert held.unique().tolist() == [slow[500]] and len(held) > 50
    assert run.to_pandas(["n_wej"], period="10 ms", units="shown")["n_wej"].max() == pytest.approx(1500, abs=25)
    for names, sentence in ((["p1", "p3"], "there is no signal 'p3' in the run; did you mean"), ("p1", "expected a list of texts")):
        with pytest.raises(rig_nodes.RigError, match=sentence):
            run.to_pandas(names)
    arrow = run.to_arrow(["p1"], period=0.01)
    assert arrow.column("time").to_pylist()[:2] == [0.0, 0.01] and arrow.field("p1").metadata[b"unit"] == b"Pa"


def test_values_of_loops_are_columns_of_each_shift_and_in_the_names_of_the_report(rig, tmp_path, capsys):
    loop = {"repeat": {"each": {"load": ["40 Nm", "80 Nm"]}, "steps": [*UP, *BACK]}}
    run = rig.simulate([*FIRST, loop])
    assert list(run.shifts["load"]) == [40.0, 40.0, 80.0, 80.0] and run.shifts.units["load"] == "Nm"
    assert np.allclose(run.shifts["output_torque_nm"][::2], [40.0, 80.0], atol=3.0)
    assert main(["report", str(run.save(tmp_path / "loop"))]) == 0
    said = capsys.readouterr().out
    assert "1: I -> II, load 40 Nm" in said and "shift 4, II -> I at" in said and ", load 80 Nm, is" in said
    assert rig_nodes.open(tmp_path / "loop").shifts["load"][2] == 80.0


def test_a_sweep_of_a_sequence_with_loops_has_their_columns_in_its_results(tmp_path):
    loop = {"repeat": {"each": {"load": ["40 Nm"]}, "steps": [{"repeat": {"each": {"k": ["one"]}, "steps": UP}}]}}
    (tmp_path / "loops.yaml").write_text(json.dumps({"description": "loops", "steps": [*FIRST, loop]}))
    sequence, folder = tmp_path / "loops.yaml", tmp_path / "sweep"
    table = rig_nodes.sweep("hydmag", sequence, {"alfa46.t12": ["-240 ms", "-200 ms"]}, folder=folder)
    assert list(table["load"]) == [40.0, 40.0] and table.units["load"] == "Nm" and list(table["loop.k"]) == ["one", "one"]
    assert main(["sweep", str(folder)]) == 0
    results = pq.read_table(folder / "results.parquet")
    assert results["load"].to_pylist() == [40.0, 40.0] and results.schema.field("load").metadata[b"unit"] == b"Nm"
    again = rig_nodes.sweep("hydmag", sequence, {"alfa46.t12": ["-240 ms", "-200 ms"]}, folder=folder)
    assert list(again["t_c_s"]) == list(table["t_c_s"])


def test_a_loop_over_two_dimensions_has_a_column_for_each():
    turns = [{"load": "40 Nm", "n": "first"}, {"load": "4 MPa", "n": "second"}]
    loops = [{"first": step, "last": step, "values": values} for step, values in enumerate(turns, 1)]
    rows = [{"t_order_s": 1.0}, {"t_order_s": 2.0}]
    put_loops(rows, loops, [(0.5, 1.0), (1.5, 2.0)])
    assert [loop_columns(row) for row in rows] == [
        {"load.torque": (40.0, "Nm"), "n": ("first", "")},
        {"load.pressure": (4e6, "Pa"), "n": ("second", "")},
    ]


def test_loops_in_a_bag_that_are_none_leave_the_shifts_without():
    for loops in ([1], [{"first": 1}], [{"first": "a", "last": 2, "values": {}}], [{"first": 1, "last": 2, "values": 3}], {"a": 1}):
        rows = [{"t_order_s": 1.0}]
        put_loops(rows, loops, [(0.5, 1.0)])
        assert rows == [{"t_order_s": 1.0}]


def test_an_exported_run_and_a_loggers_csv_are_opened(run, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    run.save("run")
    assert main(["export", "mf4", "run", "-o", "run.mf4"]) == 0
    exported = rig_nodes.open("run.mf4")
    assert exported.shifts["t_c_s"] == pytest.approx(run.shifts["t_c_s"], abs=1e-3) and exported.report["run"]["mode"] == "import"
    shown = run.to_pandas(["M_wej", "n_wej", "M_wyj", "n_wyj", "p1", "p2"], period="1 ms")
    shown.columns = [f"{name} [{shown.attrs['units'][name]}]" for name in shown.columns]
    shown.rename_axis("time [s]").to_csv("log.csv")
    logged = rig_nodes.open("log.csv", rig="hydmag", orders="0.195:0-1, 3.845:1-2, 8.32:2-1")
    assert logged.shifts["k"] == pytest.approx(run.shifts["k"], abs=1e-3)
    with pytest.raises(rig_nodes.RigError, match="its rig is not given"):
        rig_nodes.open("log.csv")
    with pytest.raises(rig_nodes.RigError, match="run: rig is for loggers' files; a run has its own"):
        rig_nodes.open("run", rig="hydmag")
    with pytest.raises(rig_nodes.RigError, match="run: is there already and is not an empty folder"):
        run.save("run")


def test_the_figure_of_a_run_has_the_plots_of_the_page_and_shades_the_phases(run):
    whole, shift = run.plot(), run.plot(shift=2)
    titles = [f"{ax.get_title(loc='left')} [{ax.get_ylabel()}]" for ax in whole.axes]
    assert titles[:2] == ["Coil current [mA]", "Clutch and supply pressure [MPa]"] and titles[-1] == "Heat in the clutches [kJ]"
    assert {line.get_label() for line in whole.axes[-3].lines} >= {"n_wej", "n_wyj"} and len(whole.axes[0].patches) == 6
    assert any(text.get_text() == "Downshift II → I under load" for text in shift.texts)
    assert [label for ax in shift.axes if (label := ax.get_ylabel())] == [
        "pressure [MPa]",
        "clutch torque [Nm]",
        "shaft torque [Nm]",
        "speed [rpm]",
    ]
    with pytest.raises(rig_nodes.RigError, match="there is no shift 3; the run has 2 shifts, the first is 1"):
        run.plot(shift=3)


def test_what_a_notebook_shows(rig, run):
    picture = re.search('src="data:image/svg[+]xml;base64,(.*?)"', rig._repr_html_())[1]
    assert "<svg" in b64decode(picture).decode() and "gears: I 1.382, II 1.025" in repr(rig)
    assert "run demo of hydmag, simulated, 13.3 s, seed 1; ended: the sequence ended" in repr(run)
    shown = run._repr_html_()
    assert "<table>" in shown and "data:image/png;base64" in shown


def test_a_missing_package_is_named_with_its_extra(run, monkeypatch):
    for package, name, call in (("matplotlib", "matplotlib", run.plot), ("pandas", "pandas", run.to_pandas)):
        with monkeypatch.context() as patch:
            patch.setitem(sys.modules, package, None)
            with pytest.raises(rig_nodes.RigError, match=rf"^the Python package {package} is not installed; pip install {name}$"):
                call()
            assert "<table>" in run._repr_html_()


class Deaf:
    """A controller that keeps all valves off and never says that a shift has ended."""

    levels = ("duty",)

    def initialize(self, info):
        self.outputs = len(info.outputs)

    def step(self, inputs):
        return ControllerOutputs([0.0] * self.outputs, gear=0, shifting=True)

    def terminate(self):
        pass


def test_a_class_of_ones_own_is_the_controller_and_a_failed_run_says_why(rig):
    run = rig.simulate([*FIRST[:2], {"shift": {"to": "I", "timeout": "500 ms"}}], controller=Deaf)
    assert run.end["state"] == "failed", run.end
    assert "step:3: shift refused" in run.end["reason"]
    assert run.report["run"]["controller"]["name"].endswith(":Deaf") and "failed: " in repr(run)


def test_a_rig_without_gears_is_run_and_drawn_too():
    run = rig_nodes.load("chain_saw").simulate(seed=2)
    assert run.end["state"] == "ended" and len(run.shifts) == 0 and len(run.plot().axes) > 1
    assert repr(run).endswith("no shifts: the rig has no gears") and "no shifts: the rig has no gears" in run._repr_html_()
