# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Controllers in processes of their own on the graph: the same bits in lockstep, the safe state when their process ends."""

import json
import socket
import subprocess
import sys

import numpy as np
import pytest
from running_graph import SHORT, RigRun, rig_run

from rig_nodes.bags.reader import Bag
from rig_nodes.controllers import load_controller
from rig_nodes.rig.configuration import load_rig
from rig_nodes.runs.sequence import load_sequence
from rig_nodes.runs.simulation import simulate

NOT_THE_PLANTS = {"/controller/events", "all"}
BREAKING = """
#include "rig_controller.h"
const rig_controller_abi_info *rig_controller_abi(void) { RIG_CONTROLLER_DESCRIBE(RIG_LEVEL_DUTY); }
int rig_controller_create(rig_controller_info *info, void **instance) { (void)info; *instance = 0; return RIG_OK; }
int rig_controller_step(void *instance, const rig_controller_inputs *in, rig_controller_outputs *out) {
  (void)instance;
  if (in->sample >= 500) { WHAT }
  out->command[0] = 0.5;
  return RIG_OK;
}
void rig_controller_destroy(void *instance) { (void)instance; }
"""


@pytest.fixture
def breaking(tmp_path):
    def make(what):
        path = tmp_path / "breaking.c"
        path.write_text(BREAKING.replace("WHAT", what))
        return f"c:{path}"

    return make


@pytest.fixture
def port():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        return free.getsockname()[1]


NAMING = """
import sys

from rig_nodes.controllers.examples.alfa46 import Alfa46
from rig_nodes.controllers.udp.frames import serve


class Naming(Alfa46):
    levels = ("duty",)
    wants, signals, settings = ("p_p",), {"p_supply": "Pa"}, {"third": 0.25}

    def step(self, inputs):
        out = super().step(inputs)
        out.signals = {"p_supply": inputs.others["p_p"]}
        out.setpoint[2] = inputs.settings["third"]
        return out


if __name__ == "__main__":
    serve(Naming(), "127.0.0.1", int(sys.argv[1]), Naming.levels)
"""


def start_udp(folder, port):
    """Returns the program of the Alfa46 law with names of its own, and the specification of the same law in the rig's process."""
    (folder / "naming.py").write_text(NAMING)
    return subprocess.Popen([sys.executable, folder / "naming.py", str(port)]), f"python:{folder / 'naming.py'}:Naming"


OWN = """
from rig_nodes.controllers.examples.alfa46 import Alfa46


class Own(Alfa46):
    levels = ("duty",)
    wants = ("p_p", "M_wej")
    signals = ("p_supply", "torque")
    settings = {"third": 0.25}

    def step(self, inputs):
        out = super().step(inputs)
        out.signals = {"p_supply": inputs.others["p_p"], "torque": inputs.others["M_wej"]}
        out.setpoint[2] = inputs.settings["third"]
        return out
"""
SEQUENCE = """
description: gear I, a setting, and on
ready: {timeout: 20 s}
steps:
  - oil: {pressure: 4 MPa}
  - motor: {speed: 300 rpm}
  - shift: {to: I, timeout: 5 s}
  - controller: {third: 0.5}
  - wait: {for: 200 ms}
"""


@pytest.mark.parametrize(
    "arguments", [("--speed", "max"), pytest.param((), marks=pytest.mark.against_the_clock)], ids=["lockstep", "real time"]
)
def test_a_controller_gets_what_it_wants_and_the_settings_that_it_names_as_its_own(tmp_path, arguments):
    """In lockstep it receives the transducers of each sample, as in simulate; in real time the newest value of each topic."""
    (tmp_path / "own.py").write_text(OWN)
    (tmp_path / "sequence.yaml").write_text(SEQUENCE)
    spec, sequence = f"python:{tmp_path / 'own.py'}:Own", tmp_path / "sequence.yaml"
    code, output = rig_run(tmp_path / "run", *arguments, "--controller", spec, sequence=sequence)
    assert code == 0, output
    if arguments:
        assert other_topics(tmp_path, spec=spec, sequence=sequence) == set()
    own = Bag(tmp_path / "run").logger("/controller/signals", fill=True).channels
    assert list(own) == ["p_supply", "torque"]
    # in real time samples may be missing
    assert np.nanmin(own["p_supply"]) < 1e6 and 3.9e6 < own["p_supply"][-1] < 4.2e6
    assert np.nanmax(own["torque"]) > 5.0, "the motor speeds up its shaft"
    shown = [message.setpoint[2] for _, message in Bag(tmp_path / "run").messages("/controller/command")]
    assert (shown[0], shown[-1]) == (0.25, 0.5)


def other_topics(folder, spec="alfa46", sequence=SHORT):
    """Returns the topics whose content differs from that of `simulate` with the same controller."""
    config = load_rig("hydmag")
    simulate(config, load_sequence(sequence, default="hydmag"), folder / "simulated", controller=load_controller(spec, config))
    expected, found = (Bag(folder / name).canonical_hash() for name in ("simulated", "run"))
    return {topic for topic in expected if found.get(topic) != expected[topic]} - NOT_THE_PLANTS


@pytest.mark.parametrize(
    ("what", "arguments", "sentence", "oldest"),
    [
        ("*(volatile int *)8 = 1;", ("--speed", "1"), "sample 500: the library's process was ended by SIGSEGV", 0.007),
        ("for (;;);", ("--speed", "1", "--step-timeout", "3"), "sample 500: no answer for 3 s (--step-timeout)", 0.007),
        pytest.param(
            "*(volatile int *)8 = 1;",
            (),
            "sample 500: the library's process was ended by SIGSEGV",
            0.107,
            marks=[pytest.mark.against_the_clock, pytest.mark.campaign],
        ),
        pytest.param(
            "out->message[0] = 33; return RIG_ERROR;",
            (),
            "sample 500: status error: !",
            0.107,
            marks=[pytest.mark.against_the_clock, pytest.mark.campaign],
        ),
        pytest.param("for (;;);", (), "sample 500: no answer for 90 ms", 0.107, marks=pytest.mark.against_the_clock),
    ],
    ids=["crash in lockstep", "hang in lockstep", "crash in real time", "error in real time", "hang in real time"],
)
def test_a_library_that_breaks_ends_in_the_safe_state(tmp_path, breaking, what, arguments, sentence, oldest):
    code, output = rig_run(tmp_path / "run", *arguments, "--controller", breaking(what))
    assert code == 1 and sentence in output.splitlines()[-1], output
    bag = Bag(tmp_path / "run")
    assert sentence in [m.reason for _, m in bag.messages("/rig/state")][-1]
    assert any(sentence in text for _, _, name, text, _ in bag.events() if name == "rig_tripped")
    assert sentence in json.loads((tmp_path / "run" / "report.json").read_text())["run"]["end"]["reason"]
    assert next(m.command_age for _, m in bag.messages("/valve_zr_p1/state") if m.safe) <= oldest
    texts = [text for _, topic, name, text, _ in bag.events() if name == "controller_failed"]
    assert len(texts) == 1 and "sample 500: " in texts[0]


NOBODY = """
description: in real time without a controller
ready: {timeout: 3 s}
steps:
  - wait: {for: 10 ms}
"""


def test_in_real_time_a_controller_that_does_not_come_is_named_with_its_place(tmp_path):
    (tmp_path / "nobody.yaml").write_text(NOBODY)
    run = RigRun(tmp_path / "run", "--controller", "ros:", sequence=tmp_path / "nobody.yaml")
    domain = run.until("ROS_DOMAIN_ID=").rpartition("=")[2].strip()
    place = f"controller on ROS topic /controller/answer in domain {domain}"
    assert run.until("waiting for").strip() == f"waiting for {place}, 1 s"
    code, output = run.end()
    last_line = output.splitlines()[-1]
    assert code == 1
    assert last_line.startswith("rig: sequence 'nobody': the rig was not ready within 3 s; no controller has come on ROS topic")
    assert f"in domain {domain}; start its node in the same ROS domain (export ROS_DOMAIN_ID={domain} in both" in last_line


def test_ctrl_c_ends_the_waiting_in_lockstep_at_once(tmp_path, port):
    run = RigRun(tmp_path / "run", "--speed", "max", "--step-timeout", "none", "--controller", f"udp:{port}")
    run.until("all nodes are connected")
    run.until(f"waiting for controller on udp {port}")
    run.ctrl_c()
    code, output = run.end()
    assert code == 130 and "interrupted by Ctrl-C" in output and "was killed" not in output
    *_, (_, state) = Bag(run.folder).messages("/rig/state")
    assert state.reason == "the run was ended before its sequence was done"


def test_udp_in_lockstep_gives_the_same_bits_and_waiting_is_seen(tmp_path, port):
    (tmp_path / "sequence.yaml").write_text(SEQUENCE)
    run = RigRun(tmp_path / "run", "--speed", "max", "--controller", f"udp:{port}", sequence=tmp_path / "sequence.yaml")
    run.until(f"waiting for controller on udp {port}, 1 s")
    program, same = start_udp(tmp_path, port)
    try:
        code, output = run.end()
    finally:
        program.kill()
        program.wait()
    assert code == 0, output
    assert other_topics(tmp_path, spec=same, sequence=tmp_path / "sequence.yaml") == set()
    bag = Bag(run.folder)
    assert 3.9e6 < bag.logger("/controller/signals").channels["p_supply"][-1] < 4.2e6
    shown = [message.setpoint[2] for _, message in bag.messages("/controller/command")]
    assert (shown[0], shown[-1]) == (0.25, 0.5)


@pytest.mark.against_the_clock
def test_a_killed_udp_controller_in_real_time_is_the_safe_state(tmp_path, port):
    program, _ = start_udp(tmp_path, port)
    run = RigRun(tmp_path / "run", "--controller", f"udp:{port}")
    try:
        run.until("motor speed 600 rpm")
    finally:
        program.kill()
        program.wait()
    code, output = run.end()
    assert code == 1 and "no program listens at its port any more" in output.splitlines()[-1]
    bag = Bag(run.folder)
    assert 3.9e6 < np.nanmax(bag.logger("/controller/signals", fill=True).channels["p_supply"]) < 4.2e6
    assert next(m.command_age for _, m in bag.messages("/valve_zr_p1/state") if m.safe) <= 0.107
