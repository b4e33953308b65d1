# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Each way in which a controller can fail: the sentence that a person reads, the exit code and the safe state.

tests/graph/test_controller_process.py tests the same on the graph.
"""

import json
import re
import subprocess
import threading

import pytest

from rig_nodes.bags.reader import Bag
from rig_nodes.cli.main import main
from rig_nodes.controllers.can.bus import open_bus
from rig_nodes.controllers.examples.can_alfa46 import CanController
from rig_nodes.controllers.examples.modbus_alfa46 import ModbusController
from rig_nodes.controllers.plug import BuiltIn

from .conftest import CONTROLLERS, INCLUDE

FAIL = 400  # number of the sample at which the controllers fail
SEQUENCE = """
description: gear I is ordered at once, and the controller fails while the valve of S1 is driven
steps:
  - oil: {pressure: 4 MPa}
  - shift: {to: I, timeout: 900 ms}
  - wait: {for: 1 s}
"""
HOLDING = """
#include "rig_controller.h"
#include <stdlib.h>
const rig_controller_abi_info *rig_controller_abi(void) { DESCRIBE }
int rig_controller_create(rig_controller_info *info, void **instance) { (void)info; *instance = 0; return RIG_OK; }
int rig_controller_step(void *instance, const rig_controller_inputs *in, rig_controller_outputs *out) {
  (void)instance;
  out->command[0] = 0.5; out->gear = in->gear_request; out->shifting = in->gear_request > 0;
  if (in->sample >= FAIL) { WHAT }
  return RIG_OK;
}
void rig_controller_destroy(void *instance) { (void)instance; }
"""
DESCRIBE = "RIG_CONTROLLER_DESCRIBE(RIG_LEVEL_CURRENT);"


def holding(what="", describe=DESCRIBE):
    """Returns the C text of a controller that holds 500 mA on output 1 and does something from sample FAIL on."""
    return HOLDING.replace("DESCRIBE", describe).replace("FAIL", str(FAIL)).replace("WHAT", what)


@pytest.fixture
def simulate(tmp_path, capsys):
    """Runs `rig simulate` on the sequence with a controller; returns (exit code, stdout, stderr)."""
    (tmp_path / "sequence.yaml").write_text(SEQUENCE)

    def run(spec, *more):
        sequence, folder = str(tmp_path / "sequence.yaml"), str(tmp_path / "run")
        code = main(["simulate", sequence, "--out", folder, "--controller", spec, *more])
        captured = capsys.readouterr()
        return code, captured.out, captured.err

    return run


# ---- before the run


def missing(build, _tmp_path):
    return build(holding().replace("rig_controller_destroy", "rig_controller_free"))


def lacking(build, _tmp_path):
    return build("void model_step(void);\n" + holding("model_step();"))


def other_abi(build, _tmp_path):
    return build(holding(describe="static rig_controller_abi_info d = {7, 2, 0, 0, 0, 0}; return &d;"))


def other_machine(build, _tmp_path):
    path = build(holding())
    data = bytearray(path.read_bytes())
    data[18:20] = (183).to_bytes(2, "little")  # e_machine of the ELF header: EM_AARCH64
    path.write_bytes(data)
    return path


@pytest.mark.parametrize(
    ("made", "sentence"),
    [
        (missing, "the library does not export rig_controller_destroy; see rig_controller.h"),
        (lacking, "the library cannot be loaded: {}: undefined symbol: model_step"),
        (
            other_abi,
            "the library was made for ABI 7 of rig_controller.h, this rig has ABI 2; compile it again with this "
            "rig's header and rig_record.h",
        ),
        (other_machine, "the library is for aarch64, 64 bits; this machine is x86_64, 64 bits"),
    ],
)
def test_a_library_that_does_not_fit_is_refused(made, sentence, simulate, build, tmp_path):
    path = made(build, tmp_path)
    code, _, error = simulate(f"c:{path}")
    assert (code, error) == (2, f"rig: controller c:{path}: {sentence.format(path)}\n")
    assert not (tmp_path / "run").exists()


# ---- during the run


def check_safe_state(folder, oldest):
    """Checks that the bag shows the valve driven, then a trip, then no output; the last held command is up to ``oldest`` s old."""
    run = json.loads((folder / "report.json").read_text())["run"]
    assert run["end"]["state"] == "tripped"
    bag = Bag(folder)
    assert not any(bag.gaps().values())
    (tripped,) = [t for t, _, name, _, _ in bag.events() if name == "rig_tripped"]
    states = [(t, m) for t, m in bag.messages("/valve_zr_p1/state")]
    assert max(m.duty for t, m in states if not m.safe) > 0.1
    safe = [(1e-9 * t, m.duty) for t, m in states if m.safe]
    assert len(safe) > 10 and all(duty == 0.0 for t, duty in safe if t > tripped + 1e-6)
    t, _ = bag.series("I_set_zr_p1")
    assert 0.0 <= tripped - t[-1] <= oldest + 0.006, "a message each 5 ms"
    t, current = bag.series("I_zr_p1")
    assert current.max() > 0.1 and current[-1] < 0.03, "the coil current has decayed"
    return run["end"]["reason"], tripped


@pytest.mark.parametrize(
    ("what", "sentence"),
    [
        ("*(volatile int *)8 = 1;", "the library's process was ended by SIGSEGV (segmentation fault)"),
        ("exit(3);", "the library's process ended itself with exit code 3"),
        ("for (volatile int k = 0;;) k = 0;", "no answer for 200 ms (--step-timeout)"),
        (
            "__builtin_memset(out + 1, 7, 64);",
            "the library wrote 64 bytes behind out of rig_controller_step; that memory is not its own",
        ),
        ("out->command[1] = 0.0 / (in->time - in->time);", "command[1] is nan, expected 0 to 0.8 A"),
    ],
)
def test_a_library_that_fails_in_the_run(what, sentence, simulate, build, tmp_path):
    path = build(holding(what), "-w")
    code, _, error = simulate(f"c:{path}", "--step-timeout", "0.2")
    reason = f"controller c:{path}, sample {FAIL}: {sentence}"
    assert code == 1 and error.replace("-nan", "nan") == f"rig: {reason}\n"
    stated, tripped = check_safe_state(tmp_path / "run", 0.001)
    assert stated.replace("-nan", "nan") == reason and FAIL * 1e-3 <= tripped <= FAIL * 1e-3 + 0.005


def test_a_plug_that_breaks_trips_the_rig_with_a_sentence(simulate, tmp_path, monkeypatch):
    def broken(plug, inputs, answer=BuiltIn._answer):
        return answer(plug, inputs) if inputs.sample < FAIL else {}["gear"]

    monkeypatch.setattr(BuiltIn, "_answer", broken)
    code, _, error = simulate("alfa46")
    reason = f"controller alfa46, sample {FAIL}: the plug could not get its answer: KeyError: 'gear'"
    assert (code, error) == (1, f"rig: {reason}\n")
    assert check_safe_state(tmp_path / "run", 0.001)[0] == reason
    assert "return answer(plug, inputs) if" in (tmp_path / "run" / "logs" / "controller.log").read_text(), "the traceback"


def test_a_library_that_crashes_at_its_end_is_a_warning_of_the_run(simulate, build, tmp_path):
    path = build(holding("out->shifting = 0;").replace("{ (void)instance; }", "{ *(volatile int *)instance = 1; }"))
    code, _, error = simulate(f"c:{path}")
    fault = "in rig_controller_destroy the library's process was ended by SIGSEGV (segmentation fault)"
    assert (code, error) == (0, f"rig: warning: controller c:{path}: {fault}\n")
    run = json.loads((tmp_path / "run" / "report.json").read_text())["run"]
    assert run["end"]["state"] == "ended" and run["controller"]["end_fault"] == fault


def test_a_program_over_udp_that_dies(simulate, tmp_path, free_udp_port):
    program, main_c = tmp_path / "dying", CONTROLLERS / "examples" / "udp_main.c"
    (tmp_path / "dying.c").write_text(holding("_Exit(9);"))
    subprocess.run(["cc", f"-I{INCLUDE}", "-o", program, main_c, tmp_path / "dying.c", "-lm"], check=True)
    process = subprocess.Popen([program, "127.0.0.1", str(free_udp_port)])
    code, _, error = simulate(f"udp:{free_udp_port}", "--level", "current")
    assert process.wait(10) == 9
    reason = f"controller udp:{free_udp_port}, sample {FAIL}: no program listens at its port any more"
    assert (code, error) == (1, f"rig: {reason}\n")
    assert check_safe_state(tmp_path / "run", 0.001)[0] == reason


class Shortening:
    """A bus whose command frames are only 6 bytes long from a counter value on."""

    def __init__(self, bus):
        self.bus, self.recv, self.shutdown = bus, bus.recv, bus.shutdown

    def send(self, frame):
        if frame.arbitration_id == 0x201 and int.from_bytes(frame.data[:2], "little") >= FAIL:
            frame.data, frame.dlc = frame.data[:6], 6
        self.bus.send(frame)


class Leaving(ModbusController):
    """A client that disappears."""

    def run(self, stop):
        self.stop = stop
        super().run(stop)

    def answer(self, registers):
        if (registers[0] << 16 | registers[1]) >= FAIL:
            self.stop.set()
        return super().answer(registers)


def can_with_short_frames(config, _port):
    bus = Shortening(open_bus("shortening", "virtual", "test"))
    return "can:shortening?interface=virtual", CanController(bus, config), bus.shutdown


def modbus_that_leaves(config, port):
    return f"modbus:{port}", Leaving(port, config), lambda: None


@pytest.mark.parametrize(
    ("made", "line"),
    [
        (
            can_with_short_frames,
            r"frame CONTROL_COMMAND_CURRENT \(0x201\) came with 6 bytes instead of 8; it is not used, "
            "nor are others like it",
        ),
        (modbus_that_leaves, r"no command on Modbus TCP 127.0.0.1:\d+ for 50 ms; the rig trips at 100 ms"),
    ],
)
def test_a_controller_by_its_own_clock_that_fails(made, line, simulate, config, tmp_path, free_udp_port):
    spec, controller, end = made(config, free_udp_port)
    stop = threading.Event()
    thread = threading.Thread(target=controller.run, args=(stop,), daemon=True)
    thread.start()
    try:
        code, out, error = simulate(spec)
    finally:
        stop.set()
        thread.join(5.0)
        end()
    assert code == 1 and re.fullmatch(r"rig: .*older than 100 ms.*\n", error)
    assert re.search(line, out), out
    check_safe_state(tmp_path / "run", 0.1)
