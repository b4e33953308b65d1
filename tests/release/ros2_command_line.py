#!/usr/bin/env python3
# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Release check of the ROS 2 command line against the rig: launch, run, node, topic, param, service, action.

Standard library only. Needs a `ros2` that sees rig_msgs and rig_nodes (a sourced overlay, ros_ws/README.md).
Starts the rig itself, in a ROS domain of its own. See README.md beside it.
"""

import argparse
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

SHORT = Path(__file__).resolve().parents[1] / "graph" / "short.yaml"
PACKAGES = ("rig_msgs", "rig_nodes")
EXECUTABLES = ("alfa46", "device", "recorder", "replay", "rig", "rig_container", "sequencer")  # sorted as ros2 prints them
TIMES, CURRENTS = "[0.01, 0.1, 0.4, 0.01, 0.1, 0.2]", "[0.3, 0.25, 0.6, 0.3, 0.2, 0.0]"
PROFILE = "{output: 1, times: %s, currents: %s}"
# Words after `ros2`, and texts that the answer must contain: without a rig, then with one that is operated by hand.
WITHOUT = (
    ("interface show rig_msgs/msg/ValveCommand", r"^\s*float64\[\] duty", r"^std_msgs/Header header"),
    ("interface show rig_msgs/action/Shift", r"^uint8 gear"),
    ("pkg executables rig_nodes", r"%s\s*\Z" % r"\s+".join(r"^rig_nodes %s$" % name for name in EXECUTABLES)),
    ("run rig_nodes rig list sequences", r"demo"),
)
BY_HAND = (
    (
        "node list",
        r"/alfa46$",
        r"/clutch_s1$",
        r"/instruments$",
        r"/load_pump$",
        r"/motor$",
        r"/recorder$",
        r"/rig$",
        r"/sequencer$",
        r"/valve_zr_p2$",
    ),
    (
        "node info /alfa46",
        r"/controller/command: rig_msgs/msg/ValveCommand",
        r"/controller/shift: rig_msgs/action/Shift",
        r"/alfa46/set_profile: rig_msgs/srv/SetProfile",
    ),
    (
        "topic list -t",
        r"^/motor/state \[rig_msgs/msg/MotorState\]",
        r"^/instruments/hmg4000 \[rig_msgs/msg/SampleBlock\]",
        r"\A(?![\s\S]*/(cylinder|hydraulic_motor|controller/signals))",
    ),
    (
        "topic info -v /controller/command",
        r"Publisher count: 1",
        r"Subscription count: 2",
        r"Reliability: RELIABLE",
        r"Deadline: 100000000 nanoseconds",
    ),
    ("topic echo --once /rig/state", r"^header:", r"^energy_residual:"),
    ("topic echo --once /instruments/channels", r"names:"),
    ("param list /alfa46", r"^\s*t12$", r"^\s*output_3\.currents$"),
    ("param describe /motor speed", r"Type: double", r"rad/s", r"Max value: 3\d\d"),
    ("param get /alfa46 t12", r"Double value is: "),
    ("param set /alfa46 t12 0.05", r"Set parameter successful"),
    ("param get /alfa46 t12", r"Double value is: 0\.05"),
    ("param set /alfa46 t12 7.5", r"Setting parameter failed: .*t12"),
    ("param set /motor speed 5000.0", r"Setting parameter failed: .*speed"),
    ("topic pub -t 3 -r 5 -w 2 /motor/command rig_msgs/msg/Setpoint", "{value: 100.0, enable: true}", r"publishing #1"),
    ("param get /motor enabled", r"Boolean value is: True"),
    ("topic pub -t 3 -r 5 -w 2 /motor/command rig_msgs/msg/Setpoint", "{value: 100.0}", r"publishing #1"),
    ("param get /motor enabled", r"Boolean value is: False"),
    ("service list -t", r"^/rig/e_stop \[std_srvs/srv/Trigger\]", r"^/alfa46/set_profile \[rig_msgs/srv/SetProfile\]"),
    ("service call /rig/e_stop std_srvs/srv/Trigger", r"success=True, message='emergency stop'"),
    ("service call /rig/reset std_srvs/srv/Trigger", r"success=True, message='safe state left'"),
    ("service call /alfa46/set_profile rig_msgs/srv/SetProfile", PROFILE % (TIMES, CURRENTS), r"success=True"),
    (
        "service call /alfa46/set_profile rig_msgs/srv/SetProfile",
        PROFILE % (TIMES, CURRENTS.replace("0.6", "0.9")),
        r"success=False, message='output_1.P3 asks for 900 mA",
    ),
    ("action list -t", r"^/controller/shift \[rig_msgs/action/Shift\]", r"^/sequencer/run \[rig_msgs/action/RunSequence\]"),
    ("action info /controller/shift", r"Action servers: 1", r"/alfa46$"),
    ("action send_goal --feedback /controller/shift rig_msgs/action/Shift", "{gear: 1}", r"success: true", r"SUCCEEDED"),
    ("action send_goal /controller/shift rig_msgs/action/Shift", "{gear: 7}", r"rejected"),
    ("action send_goal /controller/shift rig_msgs/action/Shift", "{gear: 0}", r"success: true", r"SUCCEEDED"),
    (
        "action send_goal --feedback /sequencer/run rig_msgs/action/RunSequence",
        "{name: no_such_sequence}",
        r"success: false",
        r"no_such_sequence",
        r"ABORTED",
    ),
    (
        "action send_goal --feedback /sequencer/run rig_msgs/action/RunSequence",
        "{name: %s}" % SHORT,
        r"Feedback:",
        r"is done",
        r"SUCCEEDED",
    ),
)
# An order that was answered is not sent twice.
ANSWERED = re.compile(r"^(response:|Result:|Set parameter|Setting parameter)", re.MULTILINE)


class CheckError(Exception):
    """The reason why the check cannot be made, in one sentence."""


class Check:
    """The commands of one check and their results."""

    def __init__(self, ros2, domain, patience, verbose):
        self.ros2, self.patience, self.verbose = ros2, patience, verbose
        # Line by line, so that the output of a command is complete when the command is ended.
        self.environment = dict(os.environ, ROS_DOMAIN_ID=str(domain), PYTHONUNBUFFERED="1")
        self.failed = []

    def call(self, words, seconds):
        """Returns the output of a command, which is ended when it takes longer than so many seconds."""
        process = self.start(words)
        try:
            return process.communicate(timeout=seconds)[0]
        except subprocess.TimeoutExpired:
            process.send_signal(signal.SIGINT)
            try:
                return process.communicate(timeout=10)[0]
            except subprocess.TimeoutExpired:
                process.kill()
                return process.communicate()[0]

    def start(self, words):
        return subprocess.Popen(
            [self.ros2, *words],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            env=self.environment,
            start_new_session=True,
        )

    def expect(self, words, patterns):
        """Repeats a command until everything is shown, because DDS needs some time for discovery."""
        deadline = time.monotonic() + 2 * self.patience
        while True:
            output = self.call(words, self.patience)
            missing = [p for p in patterns if not re.search(p, output, re.MULTILINE)]
            if not missing or time.monotonic() > deadline or ANSWERED.search(output):
                break
        self.note("ros2 " + " ".join(words), not missing, "no %r in:\n%s" % (missing[:1], output), output)

    def rate(self, words, unit, low, high):
        """Checks that the last number of a command that prints numbers repeatedly lies between low and high."""
        output = self.call(words, 12)
        found = re.findall(r"([\d.]+) ?%s" % unit if unit != "rate" else r"average rate: ([\d.]+)", output)
        good = bool(found) and low <= float(found[-1]) <= high
        self.note(
            "ros2 " + " ".join(words),
            good,
            "expected %g to %g in:\n%s" % (low, high, output),
            "%s %s" % (found[-1] if found else "nothing", unit),
        )

    def note(self, what, good, why, output=""):
        print("ros2: %s %s" % ("ok    " if good else "FAILED", what), flush=True)
        if not good:
            self.failed.append(what)
            print(why, flush=True)
        elif self.verbose:
            print("\n".join("          " + line for line in output.strip().splitlines()[:25]), flush=True)


def launch(check, *arguments):
    return check.start(["launch", "rig_nodes", "rig_launch.py", *arguments])


def end(process, seconds=60):
    """Sends Ctrl-C to the launch and its nodes; returns the whole output."""
    if process.poll() is None:
        os.killpg(process.pid, signal.SIGINT)
    try:
        return process.communicate(timeout=seconds)[0]
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        return process.communicate()[0]


def ask(check, commands):
    """Runs every command of a list."""
    for command, *patterns in commands:
        words = command.split()
        if patterns[0].startswith("{"):
            words.append(patterns.pop(0))
        check.expect(words, patterns)


def by_hand(check, folder):
    """Starts a rig that runs until Ctrl-C, and runs every command against it."""
    rig = launch(check, "out:=%s" % folder)
    try:
        ask(check, BY_HAND)
        check.rate(["topic", "hz", "/motor/state"], "rate", 120.0, 220.0)
        check.rate(["topic", "bw", "/instruments/hmg4000"], "[KM]B/s", 0.3, 5000.0)
    finally:
        output = end(rig)
    report = read_report(folder)
    check.note(
        "the rig by hand ends on Ctrl-C with a whole bag",
        report.get("lost") == 0 and ended(report) == "interrupted",
        output[-3000:],
        json.dumps(report.get("end")),
    )


def a_sequence(check, folder):
    """Starts a launch that ends with its sequence."""
    process = launch(check, "sequence:=%s" % SHORT, "out:=%s" % folder, "seed:=7")
    output = finish(process)
    report = read_report(folder)
    good = process.returncode == 0 and report.get("lost") == 0 and ended(report) == "ended" and report.get("seed") == 7
    check.note(
        "ros2 launch rig_nodes rig_launch.py sequence:=short.yaml",
        good,
        output[-3000:],
        json.dumps({name: report.get(name) for name in ("end", "lost", "seed", "lateness_ms")}),
    )
    check.expect(["run", "rig_nodes", "replay", str(folder), "--rate", "max"], [r"/motor/state"])


def a_bench(check, folder):
    """Starts the clutch bench, which has no shift controller, with a parameter whose value has commas."""
    process = launch(check, "sequence:=clutch_bench", "with:=pressures=1 MPa, 1.5 MPa,wetting=200 ms", "out:=%s" % folder)
    output = finish(process)
    report = read_report(folder)
    check.note(
        "ros2 launch rig_nodes rig_launch.py sequence:=clutch_bench",
        process.returncode == 0 and report.get("lost") == 0 and ended(report) == "ended",
        output[-3000:],
        json.dumps(report.get("end")),
    )


def refusals(check, folder):
    """Starts launches that cannot continue, which must print why and end."""
    for arguments, sentence in (
        (["sequence:=no_such_sequence", "record:=false"], r"no_such_sequence"),
        (["rig:=no_such_rig", "record:=false"], r"no_such_rig"),
        (["set:=alfa46.t12=9 s", "record:=false"], r"alfa46\.t12"),
        (["sequence:=spring_bench", "delay:=2", "record:=false"], r"no valves for a shift"),
        (["out:=%s" % folder], r"not an empty folder"),
    ):
        process = launch(check, *arguments)
        output = finish(process)
        check.note(
            "ros2 launch rig_nodes rig_launch.py %s: refused" % " ".join(arguments),
            process.returncode != 0 and re.search(sentence, output),
            output[-3000:],
        )


def a_death(check, folder):
    """Kills a node, which must end the launch with the node's name, and the recorded messages must be complete."""
    rig = launch(check, "out:=%s" % folder)
    check.expect(["topic", "echo", "--once", "/rig/state"], [r"^header:"])
    killed = [
        int(path.parent.name)
        for path in Path("/proc").glob("[0-9]*/cmdline")
        if re.search(rb"lib/rig_nodes/alfa46\0", contents(path)) and bytes(folder) in contents(path)
    ]
    for pid in killed:
        os.kill(pid, signal.SIGKILL)
    output = finish(rig)
    report = read_report(folder)
    good = rig.returncode != 0 and "alfa46 killed by signal 9" in output and ended(report) == "failed"
    check.note("a killed alfa46 ends the launch", bool(killed) and good, output[-3000:], json.dumps(report.get("end")))


def finish(process):
    """Returns the whole output of a launch that ends by itself; it is ended when it does not."""
    try:
        return process.communicate(timeout=180)[0]
    except subprocess.TimeoutExpired:
        return end(process)


def contents(path):
    try:
        return path.read_bytes()
    except OSError:
        return b""


def read_report(folder):
    """Returns the run part of the report in a folder, empty when there is none."""
    path = folder / "report.json"
    return json.loads(path.read_text())["run"] if path.is_file() else {}


def ended(report):
    """Returns the state in which the run ended, empty when the report does not contain it."""
    return report.get("end", {}).get("state", "")


def main(arguments):
    parser = argparse.ArgumentParser(description="Run the ROS 2 command line against a rig started for it.")
    parser.add_argument("--ros2", default=shutil.which("ros2"), metavar="FILE", help="the ros2 command (on PATH)")
    parser.add_argument("--domain", type=int, default=87, metavar="N", help="ROS domain for the check (87)")
    parser.add_argument("--patience", type=float, default=60.0, metavar="S", help="for one answer (60)")
    parser.add_argument("--verbose", action="store_true", help="print what the commands answer")
    options = parser.parse_args(arguments)
    if not options.ros2:
        raise CheckError("there is no ros2 on PATH: source a ROS 2 Jazzy and the overlay, or use --ros2")
    check = Check(options.ros2, options.domain, options.patience, options.verbose)
    listed = check.call(["pkg", "list"], options.patience).split()
    for name in PACKAGES:
        if name not in listed:
            raise CheckError("ros2 does not see the package %s: build and source the overlay (ros_ws/README.md)" % name)
    folder = Path(tempfile.mkdtemp(prefix="ros2_command_line_"))
    try:
        ask(check, WITHOUT)
        by_hand(check, folder / "by_hand")
        a_sequence(check, folder / "sequence")
        a_bench(check, folder / "bench")
        a_death(check, folder / "death")
        refusals(check, folder)
    finally:
        check.call(["daemon", "stop"], 20)
        shutil.rmtree(folder, ignore_errors=True)
    print("ros2: %s" % ("FAILED: %d" % len(check.failed) if check.failed else "passed"))
    return 1 if check.failed else 0


if __name__ == "__main__":
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
    try:
        sys.exit(main(sys.argv[1:]))
    except CheckError as e:
        sys.stderr.write("ros2: %s\n" % e)
        sys.exit(2)
    except KeyboardInterrupt:
        sys.exit(130)
