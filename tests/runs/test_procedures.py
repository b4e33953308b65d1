# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The laboratory's procedures: every one loads, its first series runs to its end, and wrong ones are refused."""

import json
import math
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from rig_nodes.analysis.shift import shifts
from rig_nodes.bags.reader import Bag
from rig_nodes.base.config import RIGS_DIR
from rig_nodes.base.errors import RigError
from rig_nodes.cli.main import main
from rig_nodes.runs.campaign import run_campaign
from rig_nodes.runs.procedure import load_procedure, prepare, run_repeat
from rig_nodes.runs.sequence import load_sequence
from rig_nodes.runs.workers import Workers

RPM = math.pi / 30.0
NAMES = sorted(path.stem for path in RIGS_DIR.glob("*/procedures/*.yaml"))
COUNTS = {
    "road_grid": 15,
    "coast_down": 1,
    "delay_series": 19,
    "grid_down": 33,
    "grid_up": 30,
    "profile_series": 47,
    "valve_response": 2,
    "clutch_bench_series": 32,
    "cylinder_bench_series": 1,
    "spring_bench_series": 1,
}
BENCHES = [name for name in NAMES if name.endswith("_bench_series")]  # chapter 8: without gears, every series once
ORDERS = {
    "road_grid": [2, 0, 1, 2, 1],
    "coast_down": [],
    "delay_series": [2, 0, 1, 2, 1, 2, 1],
    "grid_down": [2, 0, 1, 2, 1],
    "grid_up": [2, 0, 1, 2, 1],
    "profile_series": [1, 0, 1],
    "valve_response": [1],
}

SMALL = """description: two loads
source: nobody
sequence: small.yaml
repeats: 2
series:
  - grid: {m_wyj: [10 Nm, 20 Nm]}
    label: "${m_wyj}"
    conditions: {m_wyj: "${m_wyj}", valve: ZR-P1, series: 3}
    parameters: {load: "${m_wyj}"}
    settings: {alfa46.t12: -100 ms}
"""
SMALL_SEQUENCE = """description: oil and a load
parameters: {load: 5 Nm}
steps:
  - oil: {pressure: 4 MPa}
  - load: {torque: "${load}"}
  - wait: {for: 50 ms}
"""


@pytest.fixture
def small(tmp_path):
    (tmp_path / "small.yaml").write_text(SMALL_SEQUENCE)
    path = tmp_path / "loads.yaml"
    path.write_text(SMALL)
    return path


@pytest.fixture(scope="module")
def first_runs():
    """Procedure -> (its first series, the first run of it)."""
    out = {}
    for name in NAMES:
        series = load_procedure(name).series()[0]
        out[name] = series, run_repeat(series, 0)
    return out


# ---- what is installed


@pytest.mark.parametrize("path", sorted(RIGS_DIR.glob("*/sequences/*.yaml")), ids=lambda path: path.stem)
def test_every_sequence_loads_with_its_defaults(path):
    assert load_sequence(path).steps


@pytest.mark.parametrize("name", NAMES)
def test_every_series_of_every_procedure_can_be_run(name):
    all_series = load_procedure(name).series()
    assert len(all_series) == COUNTS[name]
    for series in all_series:
        prepare(series)
    seeds = [series.first_seed + k for series in all_series for k in range(series.repeats)]
    runs = (1 if name in (*BENCHES, "road_grid") else 2) * len(all_series)
    assert len(seeds) == len(set(seeds)) == runs, "every series twice in chapter 7, each run with noise of its own"


def test_series_have_the_laboratorys_settings(config):
    """By hand from Annex B, series 7, Annex C, series 5, and tab. 7.4, series 7."""
    profiles = {series.label: prepare(series)[0].alfa46.profiles for series in load_procedure("profile_series").series()}
    assert profiles["ZR-P1-7"][0, :3] == pytest.approx(np.array([[0.3, 0.13], [0.42, 0.13], [0.6, 0.74]]))
    assert profiles["ZR-P2-5"][1, :3] == pytest.approx(np.array([[0.125, 0.22], [0.3, 0.22], [0.6, 0.74]]))
    assert np.array_equal(profiles["ZR-P1-7"][1], config.alfa46.profiles[1]), "the other valve keeps its own"
    for chosen in ("ZR-P1-19", "ZR-P2-10"):  # tab. 7.2 and 7.3: the rig's own settings
        assert profiles[chosen] == pytest.approx(config.alfa46.profiles)
    seventh, last = (load_procedure("delay_series").series([number])[0] for number in ("7", "19"))
    assert seventh.conditions == pytest.approx({"series": 7, "t12": -0.175, "t21": 0.125, "n_wej": 500 * RPM, "m_wyj": 60.0})
    values = prepare(seventh)[0].alfa46.values
    assert (values.t12, values.t21) == pytest.approx((-0.175, 0.125))
    assert prepare(last)[0].alfa46.values == config.alfa46.values


def test_the_grids_go_as_far_as_the_laboratorys():
    """7.1.3.5: up to 120 Nm upwards and 240 Nm downwards, but not at 1000 and 2000 rpm."""
    for name, shift, highest in (
        ("grid_up", "I-II", dict.fromkeys((1000, 1200, 1500, 1800, 2000), 120.0)),
        ("grid_down", "II-I", {1000: 180.0, 1200: 240.0, 1500: 240.0, 1800: 240.0, 2000: 180.0}),
    ):
        found = {}
        for series in load_procedure(name).series():
            assert series.conditions["shift"] == shift
            rpm = round(series.conditions["n_wej"] / RPM)
            found[rpm] = max(found.get(rpm, 0.0), series.conditions["m_wyj"])
        assert found == highest


# ---- their first series


@pytest.mark.parametrize("name", NAMES)
def test_the_first_series_runs_to_its_end_with_its_orders(first_runs, name):
    series, run = first_runs[name]
    assert run.end["state"] == "ended", run.end
    ordered = [int(gear) for _, event, _, gear in run.events if event == "shift_ordered"]
    assert ordered == ([] if name in BENCHES else ORDERS[name])
    assert run.recording.period == (series.period or 1e-4)


@pytest.mark.parametrize("name", ["delay_series", "grid_up", "grid_down"])
def test_shifts_are_made_at_the_speed_and_load_of_the_conditions(first_runs, name):
    series, run = first_runs[name]
    rows = shifts(run.recording)
    # with the delays of the first series the output stops; this is measured and reported too
    reasons = [why for row in rows for why in row["why"]]
    assert all("the output stood still" in why for why in reasons) and (name == "delay_series" or not reasons), reasons
    wanted = {"I-II": [1], "II-I": [2]}.get(series.conditions.get("shift"), [1])
    for row in rows:
        if row["from_gear"] in wanted:
            assert row["input_speed_rpm"] == pytest.approx(series.conditions["n_wej"] / RPM, abs=2.0)
            assert row["output_torque_nm"] == pytest.approx(series.conditions["m_wyj"], abs=1.0)


def test_the_clutch_is_opened_under_the_load_of_the_conditions(first_runs):
    series, run = first_runs["profile_series"]
    recording = run.recording
    opened, closed = (round(t / recording.period) for t, *_ in recording.orders[1:])
    before = slice(opened - 2000, opened)
    assert recording.channels["M_wyj"][before].mean() == pytest.approx(series.conditions["m_wyj"], abs=0.5)
    assert recording.channels["n_wej"][before].mean() == pytest.approx(series.conditions["n_wej"], rel=5e-3)
    assert recording.channels["n_wyj"][closed] < 1.0, "the load has stopped the output before it is engaged again"
    assert recording.channels["p1"][closed] < 0.15e6


def test_the_shaft_runs_out_by_itself(first_runs):
    """From 470 rpm only the losses brake it, and its speed falls in every second until it is at rest."""
    _, run = first_runs["coast_down"]
    off = next(t for t, name, text, _ in run.events if text == "motor off")
    n, period = run.recording.channels["n_wej"], run.recording.period
    start = round(off / period)
    assert n[start - 10_000 : start].mean() == pytest.approx(470 * RPM, rel=5e-3)
    assert run.recording.channels["M_wej"][start - 10_000 : start].mean() > 3.0
    seconds = n[start : start + 10_000 * int((len(n) - start) // 10_000)].reshape(-1, 10_000).mean(axis=1)
    assert np.all(np.diff(seconds) < 0.0) and n[-100:].mean() < 2 * RPM
    # within the transducers' class, hum and noise
    assert max(run.recording.channels["p1"].max(), run.recording.channels["p2"].max()) < 0.1e6, "both clutches open"


def test_the_valve_is_recorded_for_five_seconds_at_125_khz(first_runs):
    _, run = first_runs["valve_response"]
    recording = run.recording
    assert recording.period == 8e-6 and recording.rows >= 5 * 125_000
    order = round(recording.orders[0][0] / recording.period)
    assert recording.channels["I_zr_p1"][:order].max() < 0.01 < recording.channels["I_zr_p1"][order + 12_500]
    assert recording.channels["p1"][-125:].mean() == pytest.approx(2.3e6, rel=0.05)


def test_repeats_differ_by_noise_only(small):
    (series, *_) = load_procedure(small, "hydmag").series()
    first, second = (run_repeat(series, repeat).recording.channels["p_p"] for repeat in (0, 1))
    assert not np.array_equal(first, second)
    assert first == pytest.approx(second, abs=0.05e6)


# ---- choosing and refusing


def test_series_are_chosen_by_label_and_by_number():
    procedure = load_procedure("profile_series")
    assert [s.label for s in procedure.series(["19"])] == ["ZR-P1-19"]
    assert [s.label for s in procedure.series(["ZR-P2-10", "8"])] == ["ZR-P1-8", "ZR-P2-8", "ZR-P2-10"]
    with pytest.raises(RigError, match="there is no series '48'"):
        procedure.series(["48"])


@pytest.mark.parametrize(
    "old, new, sentence",
    [
        ("repeats: 2", "repeats: 0", r"loads\.yaml:4: repeats is 0, expected a whole number"),
        ("sequence: small.yaml", "sequence: smal.yaml", r"loads\.yaml:3: sequence: .*there is no such file"),
        ("grid: {m_wyj", "gird: {m_wyj", r"loads\.yaml:6: unknown key 'gird'.*did you mean 'grid'"),
        ("[10 Nm, 20 Nm]", "10 Nm", r"grid.m_wyj must be a list of values"),
        ("[10 Nm, 20 Nm]", "[10 Nm, 10 Nm]", r"the label '10Nm' is there twice"),
        ('label: "${m_wyj}"', 'label: "${m_wij}"', r"there is no name '\$\{m_wij\}'; did you mean '\$\{m_wyj\}'"),
        ("valve: ZR-P1", "valve: ZR-P3", r"valve is 'ZR-P3', expected ZR-P1, ZR-P2"),
        ("series: 3", "shift: I-III", r"loads\.yaml:8: shift is 'I-III', expected I-II, II-I"),
        ("grid: {m_wyj: [10 Nm, 20 Nm]}", "table: no.csv", r"loads\.yaml:6: table: .*no\.csv cannot be read"),
        ("grid: {m_wyj: [10 Nm, 20 Nm]}", "table: bad.csv", r"bad\.csv needs a heading and rows"),
    ],
)
def test_a_wrong_procedure_is_refused(small, old, new, sentence):
    assert old in SMALL
    (small.parent / "bad.csv").write_text("# comment\nm_wyj,x\n10 Nm\n")
    small.write_text(SMALL.replace(old, new, 1))
    with pytest.raises(RigError, match=sentence):
        load_procedure(small, "hydmag")


def test_the_conditions_of_another_gearbox_have_its_own_names(small, tmp_path, capsys):
    (tmp_path / "small.yaml").write_text("rig: three_speed\n" + SMALL_SEQUENCE)
    text = SMALL.replace("valve: ZR-P1, series: 3", "shift: 2-3, clutch: C3, valve: V-C3")
    small.write_text(text)
    assert main(["procedure", str(small), "--rig", "three_speed", "--series", "10Nm", "--out", str(tmp_path / "out")]) == 0
    (series,) = json.loads((tmp_path / "out" / "procedure.json").read_text())["series"]
    assert series["conditions"] == {"m_wyj": 10.0, "shift": "2-3", "clutch": "C3", "valve": "V-C3"}
    capsys.readouterr()
    small.write_text(text.replace("2-3", "I-II"))
    assert main(["procedure", str(small), "--rig", "three_speed"]) == 2
    assert "loads.yaml:8: shift is 'I-II', expected 1-2, 2-1, 2-3, 3-2" in capsys.readouterr().err


def test_a_setting_that_the_series_set_themselves_is_refused(small):
    series = load_procedure(small, "hydmag").series()[0]
    with pytest.raises(RigError, match="setting alfa46.t12: series '10Nm' of 'loads' sets it itself"):
        prepare(series, settings={"alfa46.t12": "0 ms"})
    assert prepare(series, settings={"alfa46.t21": "-50 ms"})[0].alfa46.values.t21 == pytest.approx(-0.05)


# ---- many at once


def highest_supply(series, run):
    """Returns the measured value of a run, in a process of its own."""
    if series.conditions["m_wyj"] > 25.0:
        raise RigError("too much for this test")
    return series.label, float(run.recording.channels["p_p"].max())


def test_two_processes_give_what_one_gives(small):
    series, progress = load_procedure(small, "hydmag").series(), []
    with Workers(1) as here, Workers(2) as there:
        alone = run_campaign(series, highest_supply, workers=here)
        together = run_campaign(series, highest_supply, workers=there, progress=lambda *count: progress.append(count))
        assert together == alone and [[label for label, _ in runs] for runs in alone] == [["10Nm"] * 2, ["20Nm"] * 2]
        assert progress == [(1, 4), (2, 4), (3, 4), (4, 4)]
        small.write_text(SMALL.replace("20 Nm", "30 Nm"))
        with pytest.raises(RigError, match="too much for this test"):
            run_campaign(load_procedure(small, "hydmag").series(), highest_supply, workers=there)
        assert run_campaign(series, highest_supply, workers=there) == alone, "the processes live on"


def pid_of(_item):
    """Returns the process id of the worker."""
    return os.getpid()


def broken(item):
    """Raises an error that is no RigError."""
    return 1 / item


def deadly(_item):
    """Ends its process as a lack of memory does."""
    os.kill(os.getpid(), signal.SIGKILL)


def test_a_killed_process_is_replaced_and_a_fault_or_a_deadly_item_ends_a_campaign_with_a_sentence():
    with Workers(2) as workers:
        with pytest.raises(RuntimeError, match="ZeroDivisionError"):
            workers.map(broken, [1, 0, 2])
        pids = set(workers.map(pid_of, range(50)))
        assert os.getpid() not in pids and 1 <= len(pids) <= 2
        os.kill(pids.pop(), signal.SIGKILL)
        assert len(workers.map(pid_of, range(50))) == 50
        with pytest.raises(RigError, match="2 processes were killed from outside while they ran it; where memory is short"):
            workers.map(deadly, range(4))


def test_an_interrupt_ends_a_campaign_without_a_word_of_its_processes(small):
    program = Path(__file__).with_name("interrupted_campaign.py")
    process = subprocess.Popen(
        [sys.executable, program, small], text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True
    )
    assert process.stdout.readline() == "running\n"
    os.killpg(process.pid, signal.SIGINT)  # to all of them, as a terminal does
    began = time.monotonic()
    output, error = process.communicate(timeout=30)
    assert (process.returncode, output, error) == (130, "interrupted\n", "")
    assert time.monotonic() - began < 10.0, "hundreds of runs are left, none of them is begun"


# ---- the command


def test_the_command_writes_a_bag_and_a_report_for_each_repeat(small, tmp_path, capsys):
    assert main(["procedure", str(small), "--series", "20Nm", "--out", str(tmp_path / "out")]) == 0
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["20Nm-1", "20Nm-2", "procedure.json"]
    first, second = (Bag(tmp_path / "out" / name).run_info() for name in ("20Nm-1", "20Nm-2"))
    assert first["parameters"] == {"load": "20 Nm"} and (first["seed"], second["seed"]) == (3, 4)
    assert first["configuration"]["alfa46"]["t12"] == pytest.approx(-0.1)
    assert (tmp_path / "out" / "20Nm-2" / "report.json").is_file()
    out = capsys.readouterr().out
    assert "series 20Nm, run 2 of 2" in out and "found by loads, means of the runs of each series:" in out
    (series,) = json.loads((tmp_path / "out" / "procedure.json").read_text())["series"]
    assert series["label"] == "20Nm" and series["runs"] == ["20Nm-1", "20Nm-2"]
    assert main(["report", str(tmp_path / "out"), "--json"]) == 0
    content = json.loads(capsys.readouterr().out)
    assert [run["run"] for run in content["runs"]] == series["runs"] and content["spread"] == series["found"]


def test_the_command_lists_labels_and_refuses_others(small, capsys):
    assert main(["procedure", str(small), "--labels"]) == 0
    assert capsys.readouterr().out == "10Nm\n20Nm\n"
    assert main(["procedure", str(small), "--series", "30Nm"]) == 2
    assert "procedure 'loads': there is no series '30Nm'; did you mean '20Nm' or '10Nm'?" in capsys.readouterr().err
    assert main(["list", "procedures"]) == 0
    assert sorted(line.split()[0] for line in capsys.readouterr().out.splitlines()[1:]) == NAMES
