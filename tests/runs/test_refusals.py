# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Bad configuration and sequences: one sentence with file and line, exit code 2, nothing written."""

import os
import re
import signal
import subprocess
import sys
import threading
from types import SimpleNamespace

import pytest

from rig_nodes.base.config import CONFIG_DIR, RIGS_DIR
from rig_nodes.base.errors import RigError
from rig_nodes.base.names import find_of_rigs
from rig_nodes.cli.main import Shown, main
from rig_nodes.nodes.commands import Commands
from rig_nodes.rig.configuration import load_rig
from rig_nodes.runs.rig import Rig
from rig_nodes.runs.sequence import load_sequence
from rig_nodes.runs.sequence_runner import SequenceFailed, SequenceRunner
from rig_nodes.runs.simulation import simulate

RIG = (RIGS_DIR / "hydmag" / "rig.yaml").read_text()
ALFA46 = (CONFIG_DIR / "controllers" / "alfa46.yaml").read_text()
DEMO = (RIGS_DIR / "hydmag" / "sequences" / "demo.yaml").read_text()


def changed(text, old, new):
    assert old in text
    return text.replace(old, new, 1)


@pytest.mark.parametrize(
    "old, new, sentence",
    [
        ("ready: {timeout: 20 s}", "redy: {timeout: 20 s}", r"seq\.yaml:\d+: unknown key 'redy'.*did you mean 'ready'"),
        ("  - oil: {pressure: 4 MPa}", "  - oil: {pressure: 4 MPa, pressure: 5 MPa}", r"seq\.yaml:\d+:.*duplicate key"),
        ("speed: 1500 rpm", "speed: 1500 Nm", r"seq\.yaml:\d+:.*is a torque, expected an angular velocity"),
        ("speed: 1500 rpm", "speed: 1500", r"seq\.yaml:\d+:.*write a number with its unit"),
        ("speed: 1500 rpm", "speed: 1500 rmp", r"unknown unit 'rmp'"),
        ("speed: 1500 rpm", "speed: -1500 rpm", "the rig takes 0 to 3000 rpm"),
        ("speed: 1500 rpm", "speed: 1e6 rpm", r"seq\.yaml:\d+: motor.speed is 1e6 rpm; the rig takes 0 to 3000 rpm"),
        ("torque: 80 Nm", "torque: 800 Nm", "takes 0 to 500 Nm"),
        ("timeout: 10 s", "timeout: -3 s", "expected 0 to 86400 s"),
        ("to: II", "to: III", "expected neutral, I, II"),
        ("signal: n_wej, above: 1490 rpm", "signal: n_wei, above: 1490 rpm", "there is no signal 'n_wei'; did you mean 'n_wej'"),
        ("{signal: n_wej, above: 1490 rpm}", "{signal: n_wej}", "needs 'above', 'below' or both"),
        ("  - wait: {for: 3 s}", "  - wait: {for: 2 s, timeout: 3 s}", "takes no timeout"),
        ("above: 1490 rpm}", "above: 1490 rpm}, hold: 25 s", "wait.hold is 25 s, expected at most the timeout of 10 s"),
        ("  - wait: {for: 3 s}", "  - repeat: {times: 0, steps: [{wait: {for: 2 s}}]}", "repeat.times is 0"),
        ("  - oil: {pressure: 4 MPa}", "  - oil: {pressure: 4 MPa}\n    motor: {off: true}", "a step has one key"),
        ("steps:", "steps: {", "expected YAML"),
    ],
)
def test_sequence_is_refused(tmp_path, old, new, sentence):
    path = tmp_path / "seq.yaml"
    path.write_text(changed(DEMO, old, new))
    with pytest.raises(RigError, match=sentence):
        load_sequence(path, default="hydmag")


@pytest.mark.parametrize(
    "old, new, sentence",
    [
        ("P2: [330 ms, 300 mA]", "P2: [150 ms, 300 mA]", r"alfa46.*:\d+: .*output_1\.P2 is at 150 ms; it must come after P1"),
        ("P2: [330 ms, 300 mA]", "P2: [200 ms, 300 mA]", "must come after P1 at 200 ms"),
        ("P5: [750 ms, 130 mA]", "P5: [100 ms, 130 mA]", "must come after P4 at 250 ms"),
        ("P3: [650 ms, 740 mA]", "P3: [650 ms, 810 mA]", r"asks for 810 mA; the valve takes 0 to 800 mA"),
        ("P3: [650 ms, 740 mA]", "P3: [650 ms, -1 mA]", "asks for -1 mA"),
        ("P3: [650 ms, 740 mA]", "P3: [650 ms, 740 V]", "is a voltage, expected a current"),
        ("P3: [650 ms, 740 mA]", "P3: [650 ms]", r"must be \[time, current\]"),
        ("current_limit: [800 mA", "current_limit: [900 mA", "outside 0 to 800 mA"),
        ('gain_d: [2 V s/A, "thesis 3.4: D = 1; unit as P"]', "gain_d: 2 V s/A", "its source"),
    ],
)
def test_controller_settings_are_refused(tmp_path, old, new, sentence):
    controller = tmp_path / "alfa46_tried.yaml"
    controller.write_text(changed(ALFA46, old, new))
    rig = tmp_path / "rig.yaml"
    rig.write_text(changed(RIG, "controller: alfa46", f"controller: {controller}"))
    with pytest.raises(RigError, match=sentence):
        load_rig(rig)


@pytest.mark.parametrize(
    "old, new, sentence",
    [
        ("    speed_gain: [", "    speed_gian: [", r"rig\.yaml:\d+: unknown key 'speed_gian'"),
        ("torque_limit: [500 Nm", "torque_limit: [500 kW", "is a power, expected a torque"),
        ("    output: 2", "    output: 1", "the output of the controller 1 has the valve valve_zr_p1 already"),
        ("    output: 2", "    output: 9", "expected output 1 to 8"),
        ("surfaces: [12 -", "surfaces: [0 -", "outside 1 to 40"),
        ("inertia: [0.6546 kg m2", "inertia: [0.6546 kg", "is a mass, expected an inertia"),
    ],
)
def test_rig_is_refused(tmp_path, old, new, sentence):
    path = tmp_path / "rig.yaml"
    path.write_text(changed(RIG, old, new))
    with pytest.raises(RigError, match=sentence):
        load_rig(path)


TOGETHER = [
    # 0.1273 kg m2 on the z5 axis is 0.1273 * 1.025^2 = 0.1337 on wk
    ("M_wyj", "inertia", "0.134 kg m2", "is 0.134, expected at most the 0.1337 of z5.inertia"),
    ("plate_pack", "friction_kinetic", "0.31 -", "is 0.31, expected at most the 0.3 of plate_pack.friction_static"),
]


@pytest.mark.parametrize("part, name, text, sentence", TOGETHER)
def test_values_that_cannot_be_true_together_are_refused_wherever_they_stand(tmp_path, part, name, text, sentence):
    with pytest.raises(RigError, match=f"^setting {part}.{name}={text}: {part}.{name} {sentence}"):
        load_rig("hydmag", {f"{part}.{name}": text})
    path = tmp_path / "rig.yaml"
    path.write_text(re.sub(rf"(^  {part}:$.*?^    {name}: )\[[^,]*", rf"\g<1>[{text}", RIG, count=1, flags=re.M | re.S))
    line = next(k for k, row in enumerate(path.read_text().splitlines(), 1) if text in row)
    with pytest.raises(RigError, match=rf"rig\.yaml:{line}: {part}.{name} {sentence}"):
        load_rig(path)
    path.write_text(f'description: "x"\nbase: hydmag\nparts:\n  {part}:\n    {name}: [{text}, "x"]\n')
    with pytest.raises(RigError, match=rf"rig\.yaml:5: {part}.{name} {sentence}"):
        load_rig(path)


def test_settings_are_held_together_when_all_have_been_taken():
    heavy = load_rig("hydmag", {"M_wyj.inertia": "0.9 kg m2", "z5.inertia": "1 kg m2"})
    assert heavy.M_wyj.inertia == 0.9 and load_rig("hydmag", {"M_wyj.inertia": "0.1337 kg m2"})
    with pytest.raises(RigError, match="setting z5.inertia=0.01 kg m2: M_wyj.inertia is 0.016"):
        load_rig("hydmag", {"z5.inertia": "0.01 kg m2"})
    with pytest.raises(RigError, match="setting plate_pack.friction_kinetic=0.2 -: .* at most the 0.12 of"):
        load_rig("clutch_bench", {"plate_pack.friction_kinetic": "0.2 -"})


def test_a_current_limit_below_the_profiles_is_refused(tmp_path):
    sentence = "^setting alfa46.current_limit=100 mA: alfa46.output_1.P1 asks for 160 mA; the valve takes 0 to 100 mA"
    with pytest.raises(RigError, match=sentence):
        load_rig("hydmag", {"alfa46.current_limit": "100 mA"})
    path = tmp_path / "rig.yaml"
    path.write_text('description: "x"\nbase: hydmag\ncontroller_values:\n  current_limit: [700 mA, "x"]\n')
    with pytest.raises(RigError, match=r"rig\.yaml:4: alfa46.output_1.P3 asks for 740 mA; the valve takes 0 to 700 mA"):
        load_rig(path)
    assert load_rig("hydmag", {"alfa46.current_limit": "740 mA"}).alfa46.values.current_limit == 0.74


def test_an_empty_file_is_called_empty(tmp_path):
    path = tmp_path / "seq.yaml"
    path.write_text("# nothing yet\n")
    with pytest.raises(RigError, match=r"seq\.yaml: it is empty, expected a map of keys"):
        load_sequence(path, default="hydmag")


@pytest.mark.parametrize(
    "name, sentence",
    [
        ("demmo", r"there is no sequence 'demmo'; did you mean 'demo'\?"),
        ("no/such.yaml", "there is no such file"),
        ("/", "/: it is a folder, expected a file"),
    ],
)
def test_unknown_names_are_refused(name, sentence):
    with pytest.raises(RigError, match=sentence):
        find_of_rigs("sequences", name)


def rig_command(*arguments, cwd):
    return subprocess.run([sys.executable, "-m", "rig_nodes", *arguments], cwd=cwd, text=True, capture_output=True, timeout=60)


@pytest.mark.parametrize("verb", ["simulate", "run"])
@pytest.mark.parametrize(
    "arguments, sentence",
    [
        (["nothing"], "there is no sequence 'nothing'"),
        (["full"], "full: it is a folder, expected a file"),
        (["demo", "--set", "alfa46.t12=200 mA"], "is a current, expected a time"),
        (["demo", "--rig", "other"], "there is no rig 'other'"),
        (["demo", "--seed", "99999999999999999999999"], "expected a whole number from 0"),
        (
            ["demo", "--set", "load_pump.displacement=1 cm3/rev"],
            "demo.yaml:12: load torque 80 Nm: the load pump holds at most 4.479 Nm",
        ),  # 25 MPa * 1 cm3 / 2 pi + 0.5 Nm
        (["demo", "--out", "full"], "exists and is not an empty folder"),
    ],
)
def test_the_command_line_says_one_sentence_and_ends_with_2(tmp_path, monkeypatch, capsys, verb, arguments, sentence):
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "mine.txt").write_text("mine")
    monkeypatch.chdir(tmp_path)
    assert main([verb, *arguments]) == 2
    said = capsys.readouterr().err
    assert sentence in said and len(said.strip().splitlines()) == 1
    assert sorted(p.name for p in tmp_path.rglob("*")) == ["full", "mine.txt"], "nothing half-written"


@pytest.mark.parametrize("verb", ["simulate", pytest.param("run", marks=pytest.mark.campaign)])
def test_a_folder_in_use_is_refused_before_the_plant_is_compiled(tmp_path, monkeypatch, verb):
    cache, full = tmp_path / "cache", tmp_path / "full"
    cache.mkdir(mode=0o700)
    full.mkdir()
    (full / "mine.txt").write_text("mine")
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(cache))
    done = rig_command(verb, "demo", "--out", "full", cwd=tmp_path)
    assert done.returncode == 2 and "exists and is not an empty folder" in done.stderr
    assert not list(cache.glob("engine_*")), "the rig's plant was compiled"


@pytest.mark.parametrize(
    "arguments, before",
    [
        (["simulate", "demo", "--controller", ""], "--controller"),
        (["run", "demo", "--rig="], "--rig"),
        (["controller", "check", " "], "check"),
        (["simulate", ""], "rig simulate"),
        (["sweep", "demo", "--vary", "", "--out", "x"], "--vary"),
    ],
)
def test_an_empty_argument_stands_for_no_default(arguments, before, capsys):
    assert main(arguments) == 2
    assert f"what follows '{before}' is empty" in capsys.readouterr().err


@pytest.mark.parametrize("rig", ["hydmag", "clutch_bench"])
def test_the_kernels_step_is_named_as_in_the_file(rig):
    with pytest.raises(RigError, match="^setting step=50 us: there is no value 'step'; did you mean 'kernel.step'\\?$"):
        load_rig(rig, {"step": "50 us"})


def test_ctrl_c_is_answered_by_one_sentence_even_before_the_command_has_begun(tmp_path):
    """The launcher holds Ctrl-C back until the command can answer."""

    def held_back():
        signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        os.kill(os.getpid(), signal.SIGINT)

    done = subprocess.run(
        [sys.executable, "-m", "rig_nodes", "validate"],
        cwd=tmp_path,
        text=True,
        capture_output=True,
        timeout=60,
        preexec_fn=held_back,
    )
    assert (done.returncode, done.stdout) == (130, "")
    assert done.stderr == "rig: interrupted by Ctrl-C; what was begun is not finished\n"


class FakeBench:
    """A bench whose readings are set by the test, and which refuses gears while the test sets a reason."""

    def __init__(self):
        self.values, self.calls, self.is_ready, self.refuse = {"n_wej": 0.0, "n_wyj": 0.0}, [], True, None

    def ready(self):
        return self.is_ready

    def reading(self, signal):
        return self.values[signal]

    def shift_done(self):
        return True

    def order_gear(self, gear):
        if self.refuse:
            raise RigError(self.refuse)
        self.calls.append(("gear", gear))

    def __getattr__(self, name):
        return lambda *values: self.calls.append((name, *values))


def runner(tmp_path, steps, bench):
    path = tmp_path / "s.yaml"
    path.write_text(f"description: x\nready: {{timeout: 1 s}}\nsteps: {steps}\n")
    return SequenceRunner(load_sequence(path, default="hydmag"), bench, load_rig("hydmag"))


def test_readiness_gate_ends_with_a_sentence(tmp_path):
    bench = FakeBench()
    bench.is_ready = False
    walk = runner(tmp_path, "[{wait: {for: 1 s}}]", bench)
    assert not walk.poll(0.0)
    with pytest.raises(SequenceFailed, match="not ready within 1 s"):
        walk.poll(1.1)


def test_a_wait_that_does_not_come_true_says_what_it_saw(tmp_path):
    bench = FakeBench()
    walk = runner(tmp_path, "[{wait: {until: {signal: n_wej, above: 100 rpm}, timeout: 2 s}}]", bench)
    assert not walk.poll(0.0) and not walk.poll(1.9)
    with pytest.raises(SequenceFailed, match="did not come true within 2 s; n_wej is 0 rpm"):
        walk.poll(2.1)


def test_a_wait_whose_condition_does_not_hold_says_that(tmp_path):
    bench = FakeBench()
    walk = runner(tmp_path, "[{wait: {until: {signal: n_wej, above: 100 rpm}, hold: 1 s, timeout: 2 s}}]", bench)
    bench.values["n_wej"] = 20
    assert not walk.poll(0.0) and not walk.poll(0.9)
    bench.values["n_wej"] = 0
    assert not walk.poll(1.0)
    with pytest.raises(SequenceFailed, match="did not stay true for 1 s within 2 s; n_wej is 0 rpm"):
        walk.poll(2.1)


@pytest.mark.parametrize("gear", ["N", "neutral", "0", "ii"])
def test_a_sequence_names_a_gear_as_the_command_line_does(tmp_path, gear):
    path = tmp_path / "seq.yaml"
    path.write_text(changed(DEMO, "to: II", f"to: {gear}"))
    shifts = [step for step in load_sequence(path, default="hydmag").steps if step.kind == "shift"]
    assert (shifts[1].value, shifts[1].text) == ((2, "shift to II") if gear == "ii" else (0, "shift to neutral"))


def test_hold_starts_again_when_the_condition_is_lost(tmp_path):
    bench = FakeBench()
    walk = runner(tmp_path, "[{wait: {until: {signal: n_wej, above: 100 rpm}, hold: 1 s, timeout: 9 s}}]", bench)
    for t, n, done in ((0, 0, False), (1, 20, False), (1.8, 0, False), (2, 20, False), (2.9, 20, False), (3, 20, True)):
        bench.values["n_wej"] = n
        assert walk.poll(t) is done


def test_repeats_and_refused_orders(tmp_path):
    bench = FakeBench()
    walk = runner(tmp_path, "[{repeat: {times: 2, steps: [{shift: {to: II}}, {shift: {to: I}}]}}]", bench)
    t = 0.0
    while not walk.poll(t):
        t += 0.1
    assert [c for c in bench.calls if c[0] == "gear"] == [("gear", 2), ("gear", 1)] * 2
    bench.refuse = "shift refused: gear II is already ordered"
    with pytest.raises(SequenceFailed, match="already ordered"):
        runner(tmp_path, "[{shift: {to: II}}]", bench).poll(0.0)


# this pump holds 637 Nm, but at rest 500 Nm need a setting of 499.5 Nm / (40 cm3 / 2 pi) / 1.32 = 59.4 MPa
SMALL_PUMP = {"load_pump.displacement": "40 cm3/rev", "load_pump.pressure_limit": "100 MPa"}


def test_a_setpoint_that_the_rig_refuses_fails_the_sequence_at_once(tmp_path):
    path = tmp_path / "s.yaml"
    path.write_text("description: x\nsteps:\n  - load: {torque: 500 Nm}\n  - wait: {for: 30 s}\n")
    run = simulate(load_rig("hydmag", SMALL_PUMP), load_sequence(path, default="hydmag"), tmp_path / "run")
    assert run["end"]["state"] == "failed" and run["duration_s"] < 0.1
    assert (
        "s.yaml:3: load torque 500 Nm needs too much of the relief valve at this speed: load_pump.relief_pressure of 59 4"
        in (run["end"]["reason"])
        and "expected 0 to 40 000 000 Pa" in run["end"]["reason"]
    )


class FakeOutputs:
    """Takes the events of the rig's queue at a time that the test sets."""

    def __init__(self):
        self.rig, self.events = SimpleNamespace(time_ns=0, time=0.0, safe=False), []

    def event(self, topic, name, text, value):
        self.events.append((self.rig.time_ns * 1e-9, text, value))


def test_refused_commands_are_one_event_per_reason_and_second_however_they_mix(tmp_path):
    outputs = FakeOutputs()
    told = []
    commands = Commands(outputs, lambda text, t: told.append(text))

    def refuse(sample, why):
        raise RigError(f"valve command for sample {sample} refused: {why}")

    for sample in range(2500):
        outputs.rig.time_ns = sample * 1_000_000
        commands.put("/controller/command", refuse, sample, f"duty must be 0 to 1, found [{sample * 0.5:g}, nan, 0.0]")
        commands.put("/controller/command", lambda: None)  # a valid command in between
        if sample == 1200:
            commands.put("/controller/command", refuse, sample, "level 7 is neither")
        commands.apply()
    events = [(t, text.partition(" more")[0], value) for t, text, value in outputs.events]
    assert [t for t, *_ in events] == pytest.approx([0.0, 1.0, 1.2, 2.0])
    assert [value for *_, value in events] == [1, 1000, 1, 1000]
    assert events[1][1].endswith("sample 1000 refused: duty must be 0 to 1, found [500, nan, 0.0] (1000 times")
    outputs.rig.time_ns = 4_000_000_000
    commands.apply()
    assert outputs.events[-1][2] == 499 and sum(value for *_, value in outputs.events) == 2501
    outputs.rig.time_ns = 6_000_000_000
    commands.apply()
    assert len(outputs.events) == 5 and commands.refused["/controller/command"] == 2501
    assert [text.partition(" refused: ")[2] for text in told] == [
        "duty must be 0 to 1, found [0, nan, 0.0]",
        "level 7 is neither",
    ], "each reason is one line on the terminal"


def test_urgent_calls_come_before_the_others_and_in_their_own_order():
    commands, done = Commands(FakeOutputs()), []
    commands.put("/motor/command", done.append, "speed")
    commands.put_first("/rig/reset", lambda: done.append("reset"))
    commands.put_first("/rig/e_stop", lambda: done.append("e_stop"))
    commands.apply()
    assert done == ["reset", "e_stop", "speed"], "an emergency stop behind a reset holds"


HOSTILE = "\x1b[2J\x9b31m\u202e\r\nrig: all is well"


def shown(capsys):
    """Returns the output on the terminal; fails when it contains a control sequence."""
    out, err = capsys.readouterr()
    obeyed = [c for c in out + err if not c.isprintable() and c != "\n"]
    assert not obeyed, f"{obeyed} in {out + err!r}"
    return out + err


@pytest.mark.parametrize(
    "arguments",
    [
        [HOSTILE],
        ["simulate", HOSTILE],
        ["simulate", f"{HOSTILE}.yaml"],
        ["simulate", "demo", f"--{HOSTILE}"],
        ["simulate", "demo", "--set", f"alfa46.{HOSTILE}=1"],
        ["simulate", "demo", "--with", f"{HOSTILE}=1"],
        ["simulate", "demo", "--rig", "\udcff\udcfe"],
        ["simulate", "demo", "--out", HOSTILE * 20],
    ],
)
def test_control_characters_of_arguments_do_not_reach_the_terminal(arguments, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(arguments) == 2
    output = shown(capsys)
    assert len(output.splitlines()) == 1 and output.startswith("rig: ") and "\\u" in output


def test_control_characters_of_files_and_of_the_environment_do_not_reach_the_terminal(capsys, tmp_path, monkeypatch):
    name = f"seq{HOSTILE.replace('/', '')}.yaml"
    path, words = tmp_path / name, '"' + HOSTILE.encode("unicode_escape").decode() + '"'
    for text in (
        changed(DEMO, "ready:", f"{words}:"),
        changed(DEMO, "speed: 1500 rpm", f"speed: {words}"),
        changed(DEMO, "signal: n_wej", f"signal: {words}"),
        changed(DEMO, "to: II", f"to: {words}"),
    ):
        path.write_text(text)
        assert main(["simulate", str(path), "--out", str(tmp_path / "run")]) == 2
        output = shown(capsys)
        assert len(output.splitlines()) == 1 and output.count("[2J") == 2, "once of the name, once of what is wrong"
    # the lines that a run prints about its steps, and its end
    path.write_text(
        f'description: x\nparameters: {{p: {words}}}\nsteps:\n  - wait: {{for: 1 ms}}\n  - controller: {{"a\\eb${{p}}": 1}}\n'
    )
    assert main(["simulate", str(path), "--out", str(tmp_path / "run")]) == 1
    assert "\\u001bb" in shown(capsys)
    monkeypatch.setenv("ROS_DOMAIN_ID", HOSTILE)
    assert main(["replay", "nothing", "--keep-domain"]) == 2
    shown(capsys)


def test_lines_of_progress_and_pages_keep_their_form(capsys):
    stream = Shown(sys.stdout)
    print("\r50 %", end="", file=stream)
    print("a\tb\nc\x07\rd\x9b", "\u00b5 \u00b0C", file=stream)
    assert capsys.readouterr().out == "\r50 %a\tb\nc\\u0007\\rd\\u009b \u00b5 \u00b0C\n"


def test_a_name_that_several_rigs_have_and_a_file_of_no_rig_need_the_rig(tmp_path):
    with pytest.raises(RigError, match="several rigs have a sequence 'demo': .*hydmag, .*three_speed"):
        load_sequence("demo")
    path = tmp_path / "own.yaml"
    path.write_text("description: own\nsteps:\n  - motor: {speed: 100 rpm}\n")
    with pytest.raises(RigError, match="own.yaml: the sequence names no rig and stands in no rig's folder"):
        load_sequence(path)
    assert load_sequence(path, default="three_speed").rig == "three_speed"


def test_the_age_of_the_commands_is_read_while_the_rig_takes_others():
    rig = Rig(load_rig("hydmag"), controller="external", level="duty")
    over, failed = threading.Event(), []

    def read():
        try:
            while not over.is_set():
                assert rig.command_age >= 0.0
        except Exception as error:
            failed.append(error)

    reader, before = threading.Thread(target=read), sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    try:
        reader.start()
        for _ in range(3000):
            rig.set_duty(rig.sample, [0.0] * 3, [0.0] * 3, 0, False)
            rig.advance_samples(1)
    finally:
        over.set()
        reader.join()
        sys.setswitchinterval(before)
    assert failed == []
