# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The verbs for operation by hand, gear, set, status, stop and reset, beside a running rig."""

import contextlib
import json
import os
import subprocess
import sys

import pytest
from running_graph import PATIENCE, Graph, RigRun
from verbs import Verbs

from rig_nodes.bags.reader import Bag
from rig_nodes.base.errors import RigError
from rig_nodes.cli.main import main
from rig_nodes.controllers.ros import domain as domains
from rig_nodes.controllers.ros.domain import allocate, of_running_rig, running_rigs
from rig_nodes.nodes import running_rig

pytestmark = pytest.mark.against_the_clock


@pytest.fixture(scope="module")
def graph(tmp_path_factory):
    graph = Graph(tmp_path_factory.mktemp("graph") / "by_hand")
    yield graph
    graph.close()


def rig(domain: int, *words: str) -> tuple[int, str, str]:
    """Returns exit code, stdout and stderr of a command."""
    plain = {name: value for name, value in os.environ.items() if name != "ROS_DOMAIN_ID"}
    done = subprocess.run(
        [sys.executable, "-P", "-m", "rig_nodes", *words, "--domain", str(domain)],
        capture_output=True,
        text=True,
        timeout=60,
        env=plain,
    )
    return done.returncode, done.stdout, done.stderr


@pytest.fixture(scope="module")
def ask(graph):
    """Calls the verbs for the graph, each in a new process in which Python is already loaded."""
    with Verbs() as verbs:
        yield lambda *words: verbs.run(*words, "--domain", str(graph.domain.number))


@pytest.fixture(scope="module")
def found(graph):
    """The running rig in the form in which a verb finds it."""
    with running_rig.RunningRig(graph.domain.number) as rig:
        yield rig


@pytest.fixture
def ask_on(graph, found, monkeypatch, capsys):
    """Calls the verbs in this process for a rig that has been found before, which saves the search for it."""
    monkeypatch.setattr(os, "environ", os.environ.copy())
    monkeypatch.setattr("rig_nodes.nodes.RunningRig", lambda number: contextlib.nullcontext(found))
    return lambda *words: (main([*words, "--domain", str(graph.domain.number)]), *capsys.readouterr())


def test_values_are_set_with_their_units_and_shown_as_people_read_them(ask, ask_on):
    assert ask("set", "motor.speed", "600 rpm") == (0, "motor.speed = 600 rpm\n", "")
    assert ask_on("set", "motor.enabled", "on") == (0, "motor.enabled = on\n", "")
    assert ask_on("set", "oil_supply.pressure", "40 bar") == (0, "oil_supply.pressure = 4 MPa\n", "")
    assert ask_on("set", "oil_supply.enabled", "on")[0] == 0
    profile = "300 mA, 250 mA, 0.6 A, 300 mA, 200 mA, 0 mA"
    assert ask_on("set", "alfa46.output_3.currents", profile)[0] == 0
    code, out, _ = ask("set")
    rows = {line.split()[0]: line for line in out.splitlines()}
    assert code == 0 and "600 rpm" in rows["motor.speed"] and "0 rpm to 3000.4 rpm" in rows["motor.speed"]
    assert "300 mA, 250 mA, 600 mA" in rows["alfa46.output_3.currents"]
    assert {"load_pump.relief_pressure", "oil_supply.temperature", "instruments.noise.p1"} <= rows.keys()
    assert not any("use_sim_time" in name for name in rows)


@pytest.mark.parametrize(
    "words, code, sentence",
    [
        (["set", "motor.speed", "50000 rpm"], 2, "motor.speed is 50000 rpm, outside 0 to 3000 rpm"),
        (["set", "motor.speed", "3 MPa"], 2, "'3 MPa' is a pressure, expected an angular velocity (rad/s, rpm)"),
        (["set", "motor.sped", "600 rpm"], 2, "there is no value of motor 'sped'; did you mean 'speed'"),
        (["set", "moter.speed", "600 rpm"], 2, "there is no value 'moter.speed'; did you mean 'motor.speed'"),
        (["set", "w0.inertia", "1 kg m2"], 2, "w0.inertia cannot be set while the rig runs; give --set w0.inertia=... to the run"),
        (["set", "motor.enabled", "maybe"], 2, "motor.enabled is 'maybe', expected one of on, off"),
        (
            ["set", "alfa46.output_1.currents", "300 mA, 250 mA, 900 mA, 300 mA, 200 mA, 0 mA"],
            1,
            "output_1.P3 asks for 900 mA; the valve takes 0 to 800 mA",
        ),
        (["gear", "III"], 2, "there is no gear 'III'; expected I, II or N (neutral)"),
        (["gear", "N"], 1, "shift refused: gear neutral is already ordered"),
        (["reset"], 1, "the rig is not in its safe state; nothing done"),
    ],
)
def test_what_is_wrong_is_one_sentence_and_what_the_rig_refuses_is_exit_code_1(ask_on, words, code, sentence):
    ended, out, error = ask_on(*words)
    assert ended == code and out == "" and sentence in error and error.startswith("rig: ") and error.count("\n") == 1


def test_a_gear_is_shifted_and_the_status_tells_of_it(ask):
    code, out, error = ask("gear", "I")
    assert (code, error) == (0, "") and out.startswith("gear I after ")
    code, out, _ = ask("status", "--json", "-")
    status = json.loads(out)
    assert code == 0 and status["state"] == "RUNNING" and status["gear"] == 1 and not status["shifting"]
    assert status["signals"]["n_wej"]["value"] == pytest.approx(62.8, rel=0.05)
    assert status["signals"]["p1"]["value"] > 1.5e6 and status["signals"]["p1"]["unit"] == "Pa"
    assert status["recording"] and status["recorded"] > 1000 and status["lost"] == 0
    assert status["devices"]["gearbox"] == {"level": "OK", "message": "gear I is engaged"}
    code, out, _ = ask("status")
    assert code == 0 and "running" in out.splitlines()[0] and "controller  gear I" in out
    assert any(line.split()[:3:2] == ["n_wej", "rpm"] for line in out.splitlines())


def test_the_red_button_and_the_way_out_of_it(ask, ask_on):
    assert ask("stop", "--emergency")[1].startswith("emergency stop")
    assert "tripped: emergency stop" in ask("status")[1].splitlines()[0]
    code, _, error = ask_on("gear", "II")
    assert code == 1 and "the rig is in its safe state (emergency stop)" in error
    assert ask("reset") == (0, "safe state left\n", "")


def test_the_only_rig_is_found_and_one_of_several_is_asked_for(graph, monkeypatch):
    monkeypatch.delenv("ROS_DOMAIN_ID", raising=False)
    assert graph.domain.number in running_rigs()
    for found in ([7], [graph.domain.number]):
        monkeypatch.setattr(domains, "running_rigs", lambda found=found: found)
        assert of_running_rig(None).number == found[0]
    monkeypatch.setattr(domains, "running_rigs", lambda: [3, 5])
    with pytest.raises(RigError, match="rigs run in the ROS domains 3, 5; choose one with --domain N"):
        of_running_rig(None)
    monkeypatch.setenv("ROS_DOMAIN_ID", "5")
    assert of_running_rig(None).number == 5 and of_running_rig(3).number == 3


@pytest.mark.parametrize("words", [["gear", "I"], ["set"], ["status"], ["stop"], ["reset"]], ids=lambda words: words[0])
def test_without_a_rig_it_is_said_at_once(monkeypatch, capsys, words):
    monkeypatch.setattr(domains, "running_rigs", list)
    monkeypatch.delenv("ROS_DOMAIN_ID", raising=False)
    assert main(words) == 2
    error = capsys.readouterr().err
    assert error == "rig: no rig runs on this host, or none has started yet; start one with: ./rig run\n"
    with allocate() as free:
        assert main([*words, "--domain", str(free.number)]) == 2
    assert "no rig runs in ROS domain" in capsys.readouterr().err
    assert main([*words, "--domain", "500"]) == 2
    assert "expected a number from 0 to 232" in capsys.readouterr().err


def test_stop_ends_a_rig_by_hand_in_order(graph, ask, ask_on):
    """Last test with the graph: it ends the graph, and the tests after it need no other rig."""
    assert ask_on("set", "load_pump.relief_pressure", "2 MPa")[0] == 0
    assert ask("stop")[0] == 0
    assert graph.supervisor.ended.wait(PATIENCE)
    assert (graph.supervisor.end.state, graph.supervisor.end.reason) == ("ended", "ended by hand")
    texts = {text for *_, name, text, _ in Bag(graph.folder).events() if name == "setting_changed"}
    assert "load_pump.relief_pressure = 2e+06 Pa" in texts


def test_stop_ends_a_sequence_with_exit_code_1_and_a_whole_bag(tmp_path):
    sequence = tmp_path / "long.yaml"
    sequence.write_text("description: long\nsteps:\n  - motor: {speed: 300 rpm}\n  - wait: {for: 60 s}\n")
    run = RigRun(tmp_path / "run", sequence=sequence)
    number = int(run.until("ROS_DOMAIN_ID=").rpartition("=")[2])
    run.until("step 2 of 2")
    assert rig(number, "stop") == (0, f"the rig ends (ROS domain {number})\n", "")
    assert (tmp_path / "run" / "report.json").exists(), "it waits for the report"
    code, output = run.end()
    assert code == 1 and "ended by /rig/end before its sequence was done" in output
    end = json.loads((tmp_path / "run" / "report.json").read_text())["run"]["end"]
    assert end["state"] == "failed"
    assert number not in running_rigs()
