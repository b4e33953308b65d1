# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A controller behind a UDP port: the same bits with any order of starts, with lost frames, and for every way in which it ends."""

import re
import select
import signal
import socket
import subprocess
import sys
import threading
import time

import pytest

from rig_nodes.bags.reader import Bag
from rig_nodes.base.errors import RigError
from rig_nodes.cli.run_arguments import step_timeout
from rig_nodes.controllers import ControllerFailed, ControllerOutputs, Status, load_controller
from rig_nodes.controllers.examples.alfa46 import Alfa46
from rig_nodes.controllers.udp.frames import BYE, HELLO, Client, NoFrame, pack, text, unpack
from rig_nodes.runs.rig import Rig
from rig_nodes.runs.rig_base import RigStatus
from rig_nodes.runs.sequence import load_sequence
from rig_nodes.runs.simulation import advance_with, simulate

from .conftest import ALFA46_C, C_FRAME, CONTROLLERS, INCLUDE, RECORD, SANITIZE, STRICT, ask

ZERO = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0))


@pytest.fixture
def port():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        return free.getsockname()[1]


@pytest.fixture(scope="module")
def c_program(tmp_path_factory):
    program = tmp_path_factory.mktemp("udp") / "alfa46_udp"
    flags = [flag for flag in STRICT if flag not in ("-std=c99", "-pedantic")]
    source = CONTROLLERS / "examples" / "udp_main.c"
    subprocess.run(["cc", "-std=gnu99", *flags, "-o", program, source, ALFA46_C, "-lm"], check=True)
    return program


@pytest.fixture
def program(port, request):
    """Starts the example of a language; it is ended after the test."""
    started = []

    def start(language):
        if language == "c":
            command = [request.getfixturevalue("c_program")]
        else:
            command = [sys.executable, "-m", "rig_nodes.controllers.examples.alfa46_udp"]
        started.append(subprocess.Popen([*command, "127.0.0.1", str(port)], stderr=subprocess.PIPE, text=True))
        return started[-1]

    yield start
    for process in started:
        process.kill()
        process.communicate()


@pytest.fixture
def thread(port):
    """Serves a controller from a thread of this process."""
    clients = []

    def start(controller, to=None, levels=("duty", "current")):
        client = Client(controller, "127.0.0.1", to or port, levels)
        client.thread = threading.Thread(target=client.serve, kwargs={"once": True}, daemon=True)
        client.thread.start()
        clients.append(client)
        return client

    yield start
    for client in clients:
        client.thread.join(10.0)


class Steady:
    """A controller that gives 0.5 on the first output and the ordered gear."""

    ended = 0

    def initialize(self, info):
        self.info, self.steps = info, []

    def step(self, inputs):
        self.steps.append(inputs.sample)
        return ControllerOutputs([0.5, 0.0, 0.0], gear=inputs.gear_request)

    def terminate(self):
        self.ended += 1


@pytest.fixture
def plug(port, config):
    made = load_controller(f"udp:{port}", config)
    made.reports = []
    made.say = made.reports.append
    yield made
    made.close()


# ---- the same bits


@pytest.fixture(scope="module")
def built_in(config, tmp_path_factory):
    folder = tmp_path_factory.mktemp("built-in")
    simulate(config, load_sequence("sample"), folder)
    return Bag(folder).canonical_hash()


@pytest.mark.parametrize("language", ["c", "python"])
@pytest.mark.parametrize("first", ["rig", "controller"])
def test_every_topic_is_that_of_the_built_in_controller(config, port, program, built_in, tmp_path, language, first):
    if first == "controller":
        program(language)
    plug = load_controller(f"udp:{port}", config)
    if first == "rig":
        program(language)
    plug.wait(20.0)
    run = simulate(config, load_sequence("sample"), tmp_path / "run", controller=plug)
    assert run["end"]["state"] == "ended", run["end"]["reason"]
    assert Bag(tmp_path / "run").canonical_hash() == built_in


class Lossy(threading.Thread):
    """A relay between controller and rig that drops every 29th frame, sends every 13th twice and repeats every 17th later."""

    def __init__(self, rig_port):
        super().__init__(daemon=True)
        self.inside, self.outside = (socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2))
        self.outside.bind(("127.0.0.1", 0))
        self.inside.connect(("127.0.0.1", rig_port))
        self.port, self.over, self.lost, self.count = self.outside.getsockname()[1], False, 0, 0

    def run(self):
        peer, old = None, {}
        while not self.over:
            for ready in select.select([self.inside, self.outside], [], [], 0.05)[0]:
                if ready is self.outside:
                    data, peer = ready.recvfrom(4096)
                    send = self.inside.send
                else:
                    try:
                        data = ready.recv(4096)
                    except ConnectionRefusedError:
                        continue
                    send = lambda data: self.outside.sendto(data, peer)  # noqa: E731
                self.count += 1
                if self.count % 29 == 0 and unpack(data)[0] != BYE:
                    self.lost += 1
                    continue
                send(data)
                if self.count % 13 == 0:
                    send(data)
                if self.count % 17 == 0 and ready in old:
                    send(old[ready])
                old[ready] = data


def test_lost_doubled_and_late_frames_change_nothing(config, port, plug, thread):
    proxy = Lossy(port)
    proxy.start()
    client = thread(Alfa46(), proxy.port)
    plug.wait(20.0)
    other = load_controller("alfa46", config)
    for sample in range(1500):
        if sample == 10:
            plug.order(1)
            other.order(1)
        current = (0.0001 * sample, 0.0, 0.0)
        mine = plug.step(sample, current, [1.0, 2.0, 3.0, 4.0])
        assert mine == other.step(sample, current, [1.0, 2.0, 3.0, 4.0]), sample
    assert proxy.lost > 50
    plug.close()
    client.thread.join(10.0)
    proxy.over = True


# ---- begin and end


def test_it_gets_what_every_controller_gets(plug, thread, config):
    user = Steady()
    thread(user)
    plug.wait(20.0)
    plug.order(2)
    assert plug.step(7, (0.1, 0.2, 0.3), [1.0, 2.0, 3.0, 4.0]).command == (0.5, 0.0, 0.0)
    assert plug.gear == 2 and user.steps == [7]
    assert dict(user.info.parameters) == plug.info.parameters
    assert (user.info.period, user.info.level, user.info.command_high) == (1e-3, "duty", 1.0)
    plug.close()


def test_a_python_controller_that_refuses_says_why_to_the_rig(plug, thread):
    class Refusing(Steady):
        def initialize(self, info):
            raise KeyError("t13")

    client = Client(Refusing(), "127.0.0.1", plug._port)
    raised = []
    other = threading.Thread(target=lambda: raised.append(pytest.raises(KeyError, client.serve)), daemon=True)
    other.start()
    with pytest.raises(RigError, match="one has come and is not used: it refuses: initialize failed: KeyError: 't13'"):
        plug.wait(20.0)
    other.join(10.0)
    assert raised and sum("is not used: it refuses" in text for text in plug.reports) == 1


def test_an_end_of_the_run_ends_the_waiting(plug, program):
    plug.stopped = lambda: True
    plug.wait(None)
    plug.stopped = lambda: False
    process = program("python")
    plug.wait(20.0)
    plug.pace(None)
    ask(plug)
    process.send_signal(signal.SIGSTOP)
    plug.stopped = lambda: True
    with pytest.raises(ControllerFailed, match="sample 1: the run was ended"):
        ask(plug, 1)


@pytest.mark.parametrize(("text", "step", "come"), [("3", 3.0, 3.0), ("0.1", 0.1, 2.0), ("90", 90.0, 60.0), ("none", None, None)])
def test_a_step_timeout_bounds_the_waiting_too(text, step, come):
    assert step_timeout(text) == (step, come)


def test_in_real_time_waiting_is_told_too(plug, port):
    plug.pace(0.1, real_time=True)
    sample = 0
    while not plug.reports and sample < 60_000:
        assert ask(plug, sample) is None
        sample += 1
    assert plug.reports == [f"waiting for controller on udp {port}, 1 s"]
    assert plug.awaited() == (
        f"no controller has come on udp {port}; start it, or see that it sends to port {port} of this machine"
    )


def test_waiting_is_told_and_has_an_end(plug, port):
    with pytest.raises(RigError, match=f"udp:{port}: none has come within 1.1 s; start it, or see"):
        plug.wait(1.1)
    assert plug.reports == [f"waiting for controller on udp {port}, 1 s"]


def test_a_killed_controller_is_seen_at_the_next_sample(plug, program, config):
    process = program("python")
    plug.wait(20.0)
    rig = Rig(config, controller="external")
    for _ in range(5):
        advance_with(rig, plug)
    process.kill()
    process.wait()
    advance_with(rig, plug)
    assert rig.status == RigStatus.TRIPPED and re.search("sample 5: no program listens at its port any more$", rig.reason)


def test_a_controller_that_is_stopped_says_goodbye(plug, program):
    process = program("python")
    plug.wait(20.0)
    ask(plug)
    process.send_signal(signal.SIGINT)
    process.wait(20.0)
    with pytest.raises(ControllerFailed, match="sample 1: it has left: the controller was stopped") as failure:
        ask(plug, 1)
    assert failure.value.status == Status.FATAL


def test_after_its_end_another_may_come(plug, program):
    """As in a rig that is operated by hand: after the reset it continues with a controller that was restarted."""
    first = program("python")
    plug.wait(20.0)
    ask(plug)
    first.kill()
    first.wait()
    with pytest.raises(ControllerFailed):
        ask(plug, 1)
    program("python")
    assert ask(plug, 2) is not None
    assert sum("is here" in text for text in plug.reports) == 2


def test_a_controller_that_hangs_is_overdue(plug, program):
    process = program("python")
    plug.wait(20.0)
    plug.pace(0.3)
    ask(plug)
    process.send_signal(signal.SIGSTOP)
    with pytest.raises(ControllerFailed, match=r"sample 1: no answer for 0.3 s \(--step-timeout\)"):
        ask(plug, 1)


def test_without_a_step_timeout_it_may_stand_in_a_debugger(plug, program):
    process = program("python")
    plug.wait(20.0)
    plug.pace(None)
    ask(plug)
    process.send_signal(signal.SIGSTOP)
    reports = []
    plug.say = lambda text: (reports.append(text), process.send_signal(signal.SIGCONT))  # continues when that was reported
    assert ask(plug, 1) is not None
    assert reports == [f"waiting for controller on {plug.name.replace(':', ' ')}, 1 s"]


def test_in_real_time_nobody_waits_and_a_controller_comes_back(plug, program):
    """Without an answer a sample is discarded, and the rig trips by the age of its commands, after 100 ms."""
    plug.pace(0.1, real_time=True)
    assert ask(plug) is None, "nobody has come yet"
    process = program("python")
    sample = 1
    while (answer := ask(plug, sample)) is None and sample < 30_000:
        sample += 1
    assert answer is not None
    process.send_signal(signal.SIGSTOP)
    assert [ask(plug, sample + n) for n in range(1, 5)] == [None] * 4
    process.send_signal(signal.SIGCONT)
    sample += 5
    while (answer := ask(plug, sample)) is None and sample < 60_000:
        sample += 1
    assert answer is not None
    assert sum("no answer for 100 ms" in text for text in plug.reports) == 1


def test_a_controller_of_another_level_is_sent_away(plug, port):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.settimeout(5.0)
        other.connect(("127.0.0.1", port))
        other.send(pack(HELLO, 0, 0, 2, 0, ""))
        with pytest.raises(RigError, match="one has come and is not used: this run is at level duty") as refusal:
            plug.wait(20.0)  # ends with the error after a second
        assert refusal.value.exit_code == 1
        assert plug.awaited() == f"one has come on udp {port} and is not used: {plug.refused}"
        kind, _, _, (why,) = unpack(other.recv(2048))
    assert kind == BYE and text(why) == "this run is at level duty, the controller's is current; choose with --level"
    assert plug.reports == [f"a controller was sent away from udp {port}: {text(why)}"]


def named(*own):
    """Returns a steady controller with these transducers, signals and settings."""
    wants, signals, settings = own

    def step(self, inputs):
        return ControllerOutputs([inputs.settings.get("held", 0.5), 0.0, 0.0], signals={"twice": 2.0})

    return type("Named", (Steady,), {"wants": wants, "signals": signals, "settings": settings, "step": step})()


@pytest.mark.parametrize(
    ("own", "why"),
    [
        ((("p_9",), (), {}), "transducer 'p_9'; "),
        ((("p_p", "p_p"), (), {}), "wants has the name 'p_p' twice, expected each name once"),
        (((), ("a b",), {}), "signals is {'a b': '-'}, expected up to 64 names"),
        (((), (), {"held": float("nan")}), "settings is {'held': nan}, expected a map of names"),
    ],
)
def test_names_that_cannot_be_had_are_said_to_both_sides(plug, thread, capsys, own, why):
    client = thread(named(*own))
    with pytest.raises(RigError, match="one has come and is not used: controller .*: "):
        plug.wait(0.3)
    assert [text.partition(": ")[0] for text in plug.reports if why in text] == [
        f"a controller was sent away from {plug.name.replace(':', ' ')}"
    ]
    assert not client.running and f"message of the rig: controller {plug.name}: " in capsys.readouterr().err
    plug.close()


def test_a_controller_that_comes_later_names_the_same(plug, thread, config):
    """The bag has its columns already, and values that were set stay set."""
    thread(named(("p_p",), ("twice",), {"held": 0.25}))
    plug.wait(20.0)
    plug.set_value("held", 0.75)
    assert plug.step(0, *ZERO, [4e6]).command[0] == 0.75 and plug.signal_values == (2.0,)
    plug._send(BYE, plug._peer, values=["go"])
    plug._leave()  # as when the controller was killed
    other, same = named((), (), {}), named(("p_p",), ("twice",), {"held": 0.25})
    thread(other)
    with pytest.raises(RigError, match="one has come and is not used: it names other"):
        plug.wait(0.3)
    assert "it names other transducers, signals or settings than the controller before it" in plug.reports[-1]
    thread(same)
    plug.wait(20.0)
    assert plug.step(1, *ZERO, [4e6]).command[0] == 0.75
    plug.close()


def test_one_that_comes_in_real_time_gets_what_it_wants_from_then_on(plug, thread):
    plug.pace(0.1, real_time=True)
    thread(named(("p_p",), (), {}))
    sample, answer = 0, None
    while answer is None and sample < 30_000:
        answer = plug.step(sample, *ZERO, [4e6] * len(plug.wants))
        sample += 1
    assert answer is not None and plug.wants == ("p_p",)
    plug.close()


def test_one_rig_has_one_controller(plug, thread, port):
    thread(Steady())
    plug.wait(20.0)
    ask(plug)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.settimeout(5.0)
        other.connect(("127.0.0.1", port))
        other.send(pack(HELLO, 0, 0, 3, 0, ""))
        assert ask(plug, 1) is not None
        ask(plug, 2)
        kind, _, _, (why,) = unpack(other.recv(2048))
        assert kind == BYE and text(why) == "another controller is at work"
    plug.close()


@pytest.mark.parametrize(
    ("data", "why"),
    [
        (b"hello", "5 bytes are less than a header"),
        (b"x" * 40, "does not begin with RIG1"),
        (pack(HELLO, 0, 0, 1, 0, "")[:-1], "kind 1 has 47 bytes and says 48, expected 48"),
        (pack(HELLO, 0, 0, 1, 0, "")[:6] + b"\x0a\x00" + pack(HELLO, 0, 0, 1, 0, "")[8:], "no kind 10"),
    ],
)
def test_what_is_no_frame_is_ignored_and_said(plug, thread, port, data, why):
    with pytest.raises(NoFrame, match=why):
        unpack(data)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.sendto(data, ("127.0.0.1", port))
    thread(Steady())
    plug.wait(20.0)
    assert ask(plug).command == (0.5, 0.0, 0.0)
    assert any(why in report for report in plug.reports)
    plug.close()


def frame_of_version(version):
    hello = pack(HELLO, 0, 0, 1, 0, "")
    return hello[:4] + version.to_bytes(2, "little") + hello[6:]


@pytest.mark.parametrize(
    ("data", "sentence"),
    [
        (
            frame_of_version(2),
            "it uses version 2 of the protocol, this side uses 3: both need the rig_udp.py or rig_udp.h of the same rig",
        ),
        (
            pack(HELLO, 0, 0, 1, 0, "0123456789abcdef"),
            "it was made for the record 0123456789abcdef of another rig, this one's is .*; "
            "write rig_record.h anew with ./rig export record --rig hydmag -o rig_record.h, and compile it again",
        ),
    ],
)
def test_a_controller_of_another_version_or_record_is_sent_away(plug, port, data, sentence):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        for _ in range(3):
            other.sendto(data, ("127.0.0.1", port))
        with pytest.raises(RigError, match=f"one has come and is not used: {sentence}"):
            plug.wait(20.0)
    assert sum("sent away" in report for report in plug.reports) == 1
    plug.close()


def test_an_answer_that_no_valve_can_be_given_is_an_error(plug, thread):
    class Mad(Steady):
        def step(self, inputs):
            return ControllerOutputs([float("nan"), 0.0, 0.0])

    thread(Mad())
    plug.wait(20.0)
    with pytest.raises(ControllerFailed, match=r"command\[0\] is nan") as failure:
        ask(plug)
    assert failure.value.status == Status.ERROR


def test_a_port_that_is_taken_or_none_is_refused(plug, port, config):
    with pytest.raises(RigError, match="the port cannot be taken .*is another rig running"):
        load_controller(f"udp:{port}", config)
    for spec in ("udp:here", "udp:0", "udp:65536"):
        with pytest.raises(RigError, match="expected udp:PORT"):
            load_controller(spec, config)


def test_the_c_example_is_clean_under_the_sanitizers(tmp_path, port, config):
    source, program = CONTROLLERS / "examples" / "udp_main.c", tmp_path / "alfa46_udp"
    subprocess.run(["cc", "-std=gnu99", *SANITIZE, f"-I{INCLUDE}", "-o", program, source, ALFA46_C, "-lm"], check=True)
    process = subprocess.Popen([program, "127.0.0.1", str(port)], stderr=subprocess.PIPE, text=True)
    for gears in ((1, 2), (2,)):  # two runs with one program
        plug = load_controller(f"udp:{port}", config)
        plug.wait(20.0)
        for sample, gear in enumerate(gears):
            plug.order(gear)
            for n in range(1500):
                ask(plug, 1500 * sample + n)
        assert plug.gear == 2
        plug.close()
    process.send_signal(signal.SIGTERM)
    error = process.communicate(timeout=10)[1]
    assert process.returncode == 0 and error == ""


def test_a_c_program_whose_controller_refuses_says_why_and_fails(tmp_path, port, plug):
    refusing = C_FRAME.replace("(void)info;", 'strcpy(info->message, "no t12"); return RIG_ERROR;').replace("STEP", "")
    (tmp_path / "mine.c").write_text("#include <string.h>\n" + refusing)
    sources = [CONTROLLERS / "examples" / "udp_main.c", tmp_path / "mine.c"]
    subprocess.run(["cc", "-std=gnu99", f"-I{INCLUDE}", f"-I{RECORD}", "-o", tmp_path / "mine", *sources], check=True)
    process = subprocess.Popen([tmp_path / "mine", "127.0.0.1", str(port)], stderr=subprocess.PIPE, text=True)
    with pytest.raises(RigError, match="one has come and is not used: it refuses: no t12"):
        plug.wait(20.0)
    assert process.communicate(timeout=10)[1] == "the controller refuses: no t12\n" and process.returncode == 1


UNITS = """
  static const char *const units[] = {"rad/s", "rad/s", "Pa", "Pa"};
  for (uint32_t k = 0; k < 4; k++)
    if (strcmp(info->transducers[k].unit, units[k])) { strcpy(info->message, info->transducers[k].name); return RIG_ERROR; }
"""


def test_a_c_program_gets_the_transducers_with_their_units(tmp_path, port, plug):
    (tmp_path / "mine.c").write_text("#include <string.h>\n" + C_FRAME.replace("(void)info;", UNITS).replace("STEP", ""))
    sources = [CONTROLLERS / "examples" / "udp_main.c", tmp_path / "mine.c"]
    subprocess.run(["cc", "-std=gnu99", f"-I{INCLUDE}", f"-I{RECORD}", "-o", tmp_path / "mine", *sources], check=True)
    process = subprocess.Popen([tmp_path / "mine", "127.0.0.1", str(port)])
    plug.wait(20.0)
    assert ask(plug).command == (0.0, 0.0, 0.0)
    process.kill()
    process.wait()


def test_what_the_rig_says_again_and_again_a_program_says_once(port, config, c_program):
    """At the wrong level, for example, the program is refused every second."""
    errors = {}
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as rig:
        rig.settimeout(10.0)
        rig.bind(("127.0.0.1", port))
        commands = {"c": [c_program], "python": [sys.executable, "-m", "rig_nodes.controllers.examples.alfa46_udp"]}
        for language, command in commands.items():
            process = subprocess.Popen(
                [*command, "127.0.0.1", str(port)], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
            )
            for words in ("no", "no"):  # the program asks again after a second
                _, peer = rig.recvfrom(2048)
                rig.sendto(pack(BYE, 0, 0, words), peer)
            _, peer = rig.recvfrom(2048)
            process.kill()
            errors[language] = process.communicate()[1]
    assert errors == dict.fromkeys(commands, "message of the rig: no\n")


@pytest.mark.parametrize("language", ["c", "python"])
def test_a_rig_that_began_anew_is_greeted_at_once(port, program, language):
    """A rig turns down each frame that it finds of a session before it, and there may be many."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as rig:
        rig.settimeout(10.0)
        rig.bind(("127.0.0.1", port))
        program(language)

        def greeted():
            while (came := rig.recvfrom(2048)) and unpack(came[0])[0] != HELLO:
                pass
            return came[1]

        peer, began = greeted(), time.monotonic()
        for _ in range(20):
            rig.sendto(pack(BYE, 5, 0, "another run; send HELLO"), peer)
        for _ in range(10):
            greeted()
        assert time.monotonic() - began < 6.0, "each refusal of another session cost a second"
