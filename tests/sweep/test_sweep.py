# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Members, their rows and the command: a member has the same bits in any process, and a failed member has a row too."""

import json
import sys
from pathlib import Path

import pytest

from rig_nodes.analysis.metrics import metric_keys
from rig_nodes.base.errors import RigError
from rig_nodes.cli import run_arguments
from rig_nodes.cli.main import main, run_verb
from rig_nodes.runs.workers import Workers
from rig_nodes.studies.sweep.plan import Plan, make_plan
from rig_nodes.studies.sweep.plugged import MOST_DELAY, plugged_of
from rig_nodes.studies.sweep.run import manifest_of, run_sweep
from rig_nodes.studies.sweep.store import METADATA, RESULTS, SWEEP_JOURNAL, Store

pq = pytest.importorskip("pyarrow.parquet")
SHORT = str(Path(__file__).with_name("short.yaml"))
VALUES = tuple(key for key in metric_keys() if key not in ("why", "undefined"))  # of a shift, as a table holds them


def ran(folder, plan, bags=False):
    with Store(folder, manifest_of(plan, bags)) as store, Workers(1) as workers:
        run_sweep(plan, store, workers.stream)
        return pq.read_table(store.write_results(plan))


def test_a_member_is_what_simulate_gives(tmp_path):
    table = ran(tmp_path / "sweep", make_plan(Plan(SHORT, "hydmag", seed=4), {"alfa46.t12": "-200 ms, -100 ms"}))
    row = table.to_pylist()[-1]
    assert main(["simulate", SHORT, "--seed", "5", "--set", "alfa46.t12=-100 ms", "--out", str(tmp_path / "run")]) == 0
    shift = json.loads((tmp_path / "run" / "report.json").read_text())["shifts"][-1]
    assert {key: row[key] for key in VALUES} == {key: shift[key] for key in VALUES}
    assert row["undefined"] == "" and row["at_order.S2.piston_m"] == shift["at_order"]["clutches"]["S2"]["piston_m"] == 0.0
    assert row["why"] == "; ".join(shift["why"]) and row["seed"] == 5 and row["alfa46.t12"] == -100.0


def test_a_failing_member_is_a_row_and_the_rest_goes_on(tmp_path):
    # P2 must come after P1, at 330 ms: the second member's profile is refused
    table = ran(tmp_path / "sweep", make_plan(Plan(SHORT, "hydmag"), {"alfa46.output_1.P1.time": "200 ms, 400 ms, 210 ms"}))
    assert [(row["member"], row["end"]) for row in table.to_pylist() if row["shift"] in (1, None)] == [
        (0, "ended"),
        (1, "refused"),
        (2, "ended"),
    ]
    row = next(row for row in table.to_pylist() if row["member"] == 1)
    assert "must come after P1" in row["reason"] and row["t_c_s"] is None


def test_bags_give_the_same_rows(tmp_path):
    plan = make_plan(Plan(SHORT, "hydmag"), {"rest": "30 ms, 60 ms"})
    without, bagged = ran(tmp_path / "a", plan), ran(tmp_path / "b", plan, bags=True)
    assert bagged.to_pylist() == without.to_pylist()
    assert (tmp_path / "b" / "bags" / "000001" / "short_0.mcap").is_file()
    assert sorted(path.name for path in (tmp_path / "b" / "bags").iterdir()) == ["000000", "000001"]


def test_the_file_says_where_it_is_from(tmp_path):
    plan = make_plan(Plan(SHORT, "hydmag", samples=2, seed=9), {"alfa46.t12": "-200 ms .. -100 ms", "rest": "30 ms, 60 ms"})
    table = ran(tmp_path / "sweep", plan)
    about = json.loads(table.schema.metadata[METADATA])
    assert about["plan"]["seed"] == 9 and about["configuration"]["alfa46"]["t21"] == pytest.approx(-0.22)
    assert {"rig_nodes", "plant", "numba"} <= set(about["versions"])
    units = {name: (table.schema.field(name).metadata or {}).get(b"unit") for name in table.schema.names}
    assert (units["alfa46.t12"], units["rest"], units["t_c_s"], units["input_torque_max_nm"], units["k"]) == (
        b"ms",
        b"ms",
        b"s",
        b"Nm",
        None,
    )


def test_the_command_goes_on_and_says_so(tmp_path, capsys):
    folder = str(tmp_path / "sweep")
    arguments = ["sweep", SHORT, "--vary", "rest=30 ms, 60 ms", "--jobs", "1", "--out", folder, "--json"]
    assert main(arguments) == 0
    first = json.loads(capsys.readouterr().out)
    assert (first["members"], first["finished"], first["finished_before"], first["ends"]) == (2, 2, 0, {"ended": 2})
    assert main(["sweep", folder, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["finished_before"] == 2
    assert main(["sweep", folder]) == 0
    assert capsys.readouterr().out.endswith(f"results.parquet; look at it with: ./rig report {folder} --html page.html\n")
    assert main([*arguments[:3], "rest=30 ms, 70 ms", *arguments[4:]]) == 2
    assert "holds another sweep" in capsys.readouterr().err
    assert main(["sweep", folder, "--seed", "2"]) == 2
    assert "leave out --seed" in capsys.readouterr().err


def test_a_sweep_of_which_nothing_came_to_its_end_says_so_by_its_exit_code_too(tmp_path, capsys):
    arguments = ["sweep", SHORT, "--jobs", "1", "--out", str(tmp_path / "sweep"), "--vary"]
    assert main([*arguments, "alfa46.current_limit=100 mA, 200 mA"]) == 1  # below the profiles' 740 mA
    captured = capsys.readouterr()
    assert "none of the 2 members came to its end" in captured.err
    assert "setting alfa46.current_limit=100.0 mA: alfa46.output_1.P1 asks for 160 mA" in captured.out


@pytest.mark.parametrize(
    "arguments, sentence",
    [
        ([], "a sweep needs something to vary"),
        (["--vary", "rest=1 rpm"], "rest"),
        (["--vary", "rest=30 ms", "--rig", "nope"], "there is no rig 'nope'"),
    ],
)
def test_what_is_wrong_is_said_before_processes_are_started(arguments, sentence, capsys, monkeypatch):
    """Where nothing is compiled yet, the start of the processes takes half a minute."""
    monkeypatch.setattr("rig_nodes.runs.start_server", None)
    assert main(["sweep", SHORT, *arguments]) == 2
    assert sentence in capsys.readouterr().err


def test_an_interrupt_ends_it_and_says_how_to_go_on(tmp_path, capsys, monkeypatch):
    def interrupted(plan, store, stream, progress=None):
        raise KeyboardInterrupt

    monkeypatch.setattr("rig_nodes.api.swept.run_sweep", interrupted)
    folder = tmp_path / "sweep"
    assert main(["sweep", SHORT, "--vary", "rest=30 ms, 60 ms", "--jobs", "1", "--out", str(folder)]) == 130
    assert f"go on with: ./rig sweep {folder}" in capsys.readouterr().err
    monkeypatch.undo()
    assert main(["sweep", str(folder), "--jobs", "1"]) == 0
    assert (folder / RESULTS).is_file()


def test_a_killed_sweep_is_not_reported_as_a_whole_one(tmp_path, capsys):
    folder = tmp_path / "sweep"
    ran(folder, make_plan(Plan(SHORT, "hydmag"), {"rest": "30 ms, 60 ms"}))
    assert main(["report", str(folder)]) == 0
    journal = folder / SWEEP_JOURNAL
    journal.write_bytes(journal.read_bytes().splitlines(keepends=True)[0])
    (folder / RESULTS).unlink()
    capsys.readouterr()
    assert main(["report", str(folder)]) == 3
    assert f"the sweep is not finished: 1 of 2 members are finished; go on with it: ./rig sweep {folder}" in capsys.readouterr().err


def test_dask_gives_the_same_bytes(tmp_path):
    """The cluster is local and has a process of its own."""
    pytest.importorskip("distributed")
    from rig_nodes.studies.sweep.cluster import dask_stream

    plan = make_plan(Plan(SHORT, "hydmag"), {"rest": "30 ms, 60 ms, 90 ms"})
    with Store(tmp_path / "dask", manifest_of(plan, False)) as store, dask_stream("local:1") as stream:
        assert run_sweep(plan, store, stream) == 3
        store.write_results(plan)
    assert ran(tmp_path / "here", plan).num_rows >= 3
    assert (tmp_path / "dask" / RESULTS).read_bytes() == (tmp_path / "here" / RESULTS).read_bytes()


def test_no_cluster_there(tmp_path):
    with pytest.raises(RigError, match="expected a number of processes"):
        run_verb("sweep", [SHORT, "--vary", "rest=30 ms, 60 ms", "--dask", "local:none", "--out", str(tmp_path / "s")])


ALFA46 = "python:rig_nodes.controllers.examples.alfa46:Alfa46"


@pytest.mark.parametrize(
    ("level", "delay"),
    [pytest.param(None, 1, id="duty", marks=pytest.mark.campaign), pytest.param("current", 2, id="current, two samples late")],
)
def test_a_member_with_a_controller_is_what_simulate_gives(tmp_path, level, delay):
    plan = make_plan(Plan(SHORT, "hydmag", plugged=plugged_of(ALFA46, level, delay)), {"alfa46.t12": "-200 ms, -100 ms"})
    row = ran(tmp_path / "sweep", plan).to_pylist()[-1]
    words = ["--seed", "2", "--set", "alfa46.t12=-100 ms", "--controller", ALFA46, "--out", str(tmp_path / "run")]
    if level:
        words += ["--level", level, "--delay", str(delay)]
    assert main(["simulate", SHORT, *words]) == 0
    shift = json.loads((tmp_path / "run" / "report.json").read_text())["shifts"][-1]
    assert {key: row[key] for key in VALUES} == {key: shift[key] for key in VALUES}
    assert row["undefined"] == "" and row["at_order.S2.piston_m"] == shift["at_order"]["clutches"]["S2"]["piston_m"] == 0.0
    assert shift["valid"] and row["end"] == "ended"


def test_a_controller_that_fails_in_some_members_is_a_row_there_and_its_own_in_each(tmp_path, capsys):
    """The controller counts its own samples: if one instance served two members, it would fail in the later one too."""
    mine = tmp_path / "mine.py"
    mine.write_text(
        "from rig_nodes.controllers.examples.alfa46 import Alfa46\n\n\n"
        "class Mine(Alfa46):\n    seen = 0\n\n"
        "    def step(self, inputs):\n        self.seen += 1\n"
        "        assert self.seen < 4000\n        return super().step(inputs)\n"
    )
    folder = tmp_path / "sweep"
    command = [
        "sweep",
        SHORT,
        "--vary",
        "rest=10 ms, 3 s, 20 ms",
        "--jobs",
        "1",
        "--out",
        str(folder),
        "--controller",
        f"python:{mine}:Mine",
    ]
    assert main(command) == 0
    rows = {row["member"]: row for row in pq.read_table(folder / RESULTS).to_pylist()}
    assert [rows[k]["end"] for k in range(3)] == ["ended", "tripped", "ended"]
    assert rows[1]["reason"] == ("controller python:mine.py:Mine, sample 3999: step failed: mine.py line 9: AssertionError")
    capsys.readouterr()
    mine.write_text(mine.read_text().replace("4000", "9000"))
    assert main(command) == 2
    assert "holds another sweep (controller is not the same)" in capsys.readouterr().err


def test_what_goes_wrong_at_the_end_of_controllers_is_told(tmp_path, capsys):
    mine = tmp_path / "mine.py"
    mine.write_text(
        "from rig_nodes.controllers.examples.alfa46 import Alfa46\n\n\n"
        "class Mine(Alfa46):\n    def terminate(self):\n        raise ValueError('the log is full')\n"
    )
    command = ["sweep", SHORT, "--vary", "seed=1, 2", "--jobs", "1", "--out", str(tmp_path / "sweep")]
    assert main([*command, "--controller", f"python:{mine}:Mine"]) == 0
    said = "warning: at the end of 2, controller python:mine.py:Mine: terminate failed: mine.py line 6: ValueError: the log is full"
    assert said in capsys.readouterr().out


@pytest.mark.parametrize(
    ("spec", "why"),
    [
        ("udp:9000", "controller udp:9000: it is one program of its own, which cannot drive the members of a sweep"),
        ("python:nothing.py:Mine", "nothing.py"),
        ("rust:x", "there is no kind 'rust'; known are alfa46, python"),
    ],
)
def test_a_controller_that_a_sweep_cannot_run_is_refused_at_once(tmp_path, capsys, spec, why):
    out = tmp_path / "sweep"
    assert main(["sweep", SHORT, "--vary", "rest=10 ms, 20 ms", "--controller", spec, "--out", str(out)]) == 2
    assert why in capsys.readouterr().err and not out.exists()


def test_a_sweep_takes_the_delays_that_simulate_takes():
    assert MOST_DELAY == run_arguments.MOST_DELAY
    with pytest.raises(RigError, match=f"delay is {MOST_DELAY + 1}, expected 0 to {MOST_DELAY} samples"):
        plugged_of(None, None, MOST_DELAY + 1)


def test_without_pyarrow_one_sentence_says_how_to_get_it(monkeypatch, tmp_path, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    assert main(["sweep", SHORT, "--vary", "alfa46.t12=-200 ms, -100 ms", "--jobs", "1"]) == 2
    error = capsys.readouterr().err
    assert (
        "the Python package pyarrow is not installed; pip install pyarrow" in error
        and error.count("\n") == 1
        and not list(tmp_path.iterdir())
    )
