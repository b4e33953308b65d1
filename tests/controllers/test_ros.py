# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A controller that is a ROS 2 node: the same bits with any order of starts, every way in which it ends, wrong answers."""

import itertools
import re
import signal
import threading
from types import SimpleNamespace

import pytest
from rclpy.context import Context
from rclpy.duration import Duration
from rclpy.experimental import EventsExecutor
from rclpy.task import Future
from rig_msgs.msg import ControllerAnswer, ControllerReady, ControllerStart, ControllerStep

from rig_nodes.bags import cdr
from rig_nodes.bags.reader import Bag
from rig_nodes.base.errors import RigError
from rig_nodes.controllers import ControllerFailed, ControllerInputs, ControllerOutputs, Status, load_controller
from rig_nodes.controllers.ros.node import ControllerNode
from rig_nodes.controllers.ros.topics import NoAnswer, pack_step, unpack_answer
from rig_nodes.rig.configuration import load_rig
from rig_nodes.runs import conformance
from rig_nodes.runs.conformance import Check
from rig_nodes.runs.rig import Rig
from rig_nodes.runs.rig_base import RigStatus
from rig_nodes.runs.sequence import load_sequence
from rig_nodes.runs.simulation import advance_with, simulate

from .conftest import ask
from .test_thesis_trace import SETTINGS, currents_are_those_of_the_thesis

NUMBERS = itertools.count()


@pytest.fixture(scope="module")
def example(ros_program):
    """Starts one node that serves run after run; returns the name of its topics."""
    ros_program("example")
    return "example"


@pytest.fixture
def plug(config, ros_domain):
    """A plug on topics of its own whose sentences are kept."""
    name = f"mine_{next(NUMBERS)}"
    made = load_controller(f"ros:{name}", config)
    made.topics_name, made.reports = name, []
    made.say = made.reports.append
    yield made
    made.close()


class Steady:
    """A controller that gives 0.5 on the first output and the ordered gear; ``out`` may hold another answer."""

    out = None

    def __init__(self):
        self.ended, self.begun, self.over = 0, threading.Event(), threading.Event()

    def initialize(self, info):
        self.info, self.steps = info, []
        self.begun.set()

    def step(self, inputs):
        self.steps.append(inputs)
        return self.out or ControllerOutputs([0.5, 0.0, 0.0], gear=inputs.gear_request)

    def terminate(self):
        self.ended += 1
        self.over.set()


@pytest.fixture
def thread(ros_domain):
    """Serves a controller from a thread of this process; returns the node."""
    nodes = []

    def start(controller, name, levels=("duty", "current")):
        context = Context()
        context.init(args=[], initialize_logging=False)
        node, over = ControllerNode(controller, levels, name, context=context), []
        executor = EventsExecutor(context=context)
        executor.add_node(node)

        def spin():
            while not over:
                executor.spin_until_future_complete(Future(), 0.02)

        worker = threading.Thread(target=spin)
        worker.start()
        nodes.append((node, executor, over, worker, context))
        return node

    yield start
    for node, executor, over, worker, context in nodes:
        over.append(True)
        worker.join()
        executor.remove_node(node)
        node.destroy_node()
        context.shutdown()


# ---- the same bits


def test_the_currents_are_those_of_the_thesis(example):
    plug = load_controller(f"ros:{example}", load_rig("hydmag", SETTINGS), "current")
    plug.wait(20.0)
    currents_are_those_of_the_thesis(plug)


def test_the_verb_takes_it_and_the_bag_is_that_of_the_built_in_controller(config, example, tmp_path):
    from rig_nodes.cli.main import main

    simulate(config, load_sequence("sample"), tmp_path / "built-in")
    assert main(["simulate", "sample", "--controller", f"ros:{example}", "--out", str(tmp_path / "ros")]) == 0
    assert Bag(tmp_path / "ros").canonical_hash() == Bag(tmp_path / "built-in").canonical_hash()


def test_the_conformance_set_takes_it(config, example, monkeypatch):
    """Only the first items are checked; the later ones test the interface itself and are the same for every plug."""
    monkeypatch.setattr(conformance, "DESK_SAMPLES", 1700)  # into the second shift
    items = list(itertools.islice(Check(f"ros:{example}", config).items(), 3))
    assert [(item.name, item.ok) for item in items] == [("loads", True), ("answers", True), ("at rest", True)]


def test_what_it_asks_for_reaches_it_and_what_it_records_comes_back(config, thread):
    user = Steady()
    user.out = SimpleNamespace(command=[0, 0, 0], setpoint=None, gear=0, shifting=False, flags=0, signals={"slip": 1.5, "state": 2})
    thread(user, "asking")
    plug = load_controller("ros:asking?wants=M_wej,p_p&settings=gain:2.0&signals=slip:rad/s,state", config)
    plug.wait(20.0)
    plug.order(2)
    plug.set_value("gain", 3.5)
    plug.step(7, (0.1, 0.2, 0.3), [1.0, 2.0, 3.0, 4.0], [55.0, 4e6])
    (seen,) = user.steps
    assert (seen.sample, seen.time, seen.gear_request, seen.current) == (7, 0.007, 2, (0.1, 0.2, 0.3))
    assert (seen.n_wej, seen.n_wyj, seen.p1, seen.p2) == (1.0, 2.0, 3.0, 4.0)
    assert seen.others == {"M_wej": 55.0, "p_p": 4e6} and seen.settings == {"gain": 3.5}
    assert plug.signals == {"slip": "rad/s", "state": "-"} and plug.signal_values == (1.5, 2.0)
    assert dict(user.info.parameters) == plug.info.parameters
    assert (user.info.period, user.info.level, user.info.command_high) == (1e-3, "duty", 1.0)
    user.out.signals = {"slip": 1.5}
    with pytest.raises(ControllerFailed, match="sample 8: status error: KeyError: 'state'"):
        plug.step(8, (0.1, 0.2, 0.3), [1.0, 2.0, 3.0, 4.0], [55.0, 4e6])


@pytest.mark.parametrize("others", [{}, {"a": 1.5}, {"a": 1.5, "b": -2.5}])
@pytest.mark.parametrize("settings", [{}, {"c": 3.5}])
def test_the_bytes_are_those_of_the_messages(others, settings):
    """The rig packs and unpacks by its own code, the test by the definitions of the messages."""
    inputs = ControllerInputs(2**40, 0.25, 2, (1.0, 2.0, 3.0), (4.0, 5.0, 6.0, 7.0), others, settings)
    data = pack_step(3, 4, 2**33, inputs)
    assert data == cdr.encode_any(
        "rig_msgs/msg/ControllerStep",
        ControllerStep(
            session=3,
            controller=4,
            seq=2**33,
            sample=2**40,
            time=0.25,
            current=[1.0, 2.0, 3.0],
            measured=[4.0, 5.0, 6.0, 7.0],
            gear_request=2,
            others=list(others.values()),
            settings=list(settings.values()),
        ),
    )
    answer = ControllerAnswer(
        session=5,
        controller=6,
        seq=7,
        status=2,
        gear=1,
        shifting=True,
        flags=3,
        command=[0.5] * 3,
        setpoint=list(others.values()),
        signals=list(settings.values()),
        message="nie ma prędkości",
    )
    data = cdr.encode_any("rig_msgs/msg/ControllerAnswer", answer)
    assert unpack_answer(data) == (
        5,
        6,
        7,
        2,
        1,
        True,
        3,
        (0.5,) * 3,
        tuple(others.values()),
        tuple(settings.values()),
        "nie ma prędkości",
    )
    for length in range(len(data)):
        with pytest.raises(NoAnswer):
            unpack_answer(data[:length])


# ---- begin and end


def test_waiting_is_told_and_has_an_end(plug, ros_domain):
    with pytest.raises(RigError, match=f"none has come within 1.1 s; start its node in .*ROS_DOMAIN_ID={ros_domain}"):
        plug.wait(1.1)
    assert plug.reports == [f"waiting for controller on ROS topic /{plug.topics_name}/answer in domain {ros_domain}, 1 s"]


def test_a_controller_that_comes_later_is_waited_for_and_its_death_is_seen_at_once(plug, ros_program, config):
    timer = threading.Timer(0.2, lambda: processes.append(ros_program(plug.topics_name)))
    processes = []
    plug.stopped = lambda: True
    plug.wait(None)  # the end of the run ends the wait
    plug.stopped = lambda: False
    timer.start()
    plug.wait(20.0)
    rig = Rig(config, controller="external")
    rig.set("oil", 4.0e6, True)
    plug.order(1)
    for _ in range(400):
        advance_with(rig, plug)
    assert max(rig.coil_currents()) > 0.05
    processes[0].kill()
    processes[0].wait()
    advance_with(rig, plug)
    assert rig.status == RigStatus.TRIPPED
    assert rig.reason == f"controller {plug.name}, sample 400: its process has ended"
    rig.advance_samples(100)
    assert max(rig.coil_currents()) < 0.02, "no coil is driven"
    # as in a rig that is operated by hand: after the reset it continues with a controller that was restarted
    rig.reset()
    again = ros_program(plug.topics_name)
    plug.wait(20.0)
    assert ask(plug, rig.sample) is not None
    again.send_signal(signal.SIGINT)
    assert again.wait(10.0) == 130
    with pytest.raises(ControllerFailed, match="it has left: the controller was stopped") as failure:
        ask(plug, rig.sample + 1)
    assert failure.value.status == Status.FATAL


def test_a_controller_that_stands_still_is_waited_for_or_overdue(plug, ros_program, config):
    """With --step-timeout none it may be stopped in a debugger, and the answers are the same; with a limit this ends the run."""
    process = ros_program(plug.topics_name)
    plug.wait(20.0)
    plug.pace(None)
    other = load_controller("alfa46", config)
    for controller in (plug, other):
        controller.order(1)
    for sample in range(300):
        if sample == 200:
            process.send_signal(signal.SIGSTOP)
            reports = []
            # the controller continues when the rig has reported that it waits
            plug.say = lambda text: (reports.append(text), process.send_signal(signal.SIGCONT))
        current = (0.001 * sample, 0.0, 0.0)
        assert plug.step(sample, current, [1.0, 2.0, 3.0, 4.0]) == other.step(sample, current, [1.0, 2.0, 3.0, 4.0])
    assert len(reports) == 1 and re.match(r"waiting for controller on ROS topic /\S+/answer in domain \d+, 1 s", reports[0])
    plug.pace(0.3)
    process.send_signal(signal.SIGSTOP)
    with pytest.raises(ControllerFailed, match=r"sample 300: no answer for 0.3 s \(--step-timeout\)") as failure:
        ask(plug, 300)
    assert failure.value.status == Status.FATAL
    process.send_signal(signal.SIGCONT)
    plug.wait(20.0)
    assert ask(plug, 301) is not None, "it begins anew"


def test_in_real_time_nobody_waits_and_a_controller_comes_back(plug, ros_program, ros_domain):
    """Without an answer a sample is discarded, and the rig trips by the age of its commands, after 100 ms."""
    plug.pace(0.1, real_time=True)
    sample = 0
    while not plug.reports and sample < 60_000:
        assert ask(plug, sample) is None, "nobody has come yet"
        sample += 1
    place = f"ROS topic /{plug.topics_name}/answer in domain {ros_domain}"
    assert plug.reports == [f"waiting for controller on {place}, 1 s"]
    assert plug.awaited() == (
        f"no controller has come on {place}; start its node in the same ROS domain "
        f"(export ROS_DOMAIN_ID={ros_domain} in both terminals)"
    )
    process = ros_program(plug.topics_name)
    while ask(plug, sample) is None and sample < 30_000:
        sample += 1
    assert sample < 30_000
    process.send_signal(signal.SIGSTOP)
    assert [ask(plug, sample + n) for n in range(1, 5)] == [None] * 4
    process.send_signal(signal.SIGCONT)
    sample += 5
    while ask(plug, sample) is None and sample < 60_000:
        sample += 1
    assert sample < 60_000
    assert sum("no answer for 100 ms" in text for text in plug.reports) == 1


def test_a_controller_of_another_level_is_not_used_and_the_end_of_a_run_reaches_its_own(plug, thread, config):
    user, wrong = Steady(), Steady()
    thread(wrong, plug.topics_name, ("current",))
    with pytest.raises(RigError, match="one has come and is not used: this run is at level duty") as refusal:
        first = load_controller(plug.name, config)
        first.say = plug.reports.append
        first.wait(20.0)  # ends with the error after a second
    assert refusal.value.exit_code == 1
    (why,) = [text for text in plug.reports if "not used" in text]
    assert why.endswith("is not used: this run is at level duty, the controller's is current; choose with --level")
    thread(user, plug.topics_name)
    plug.wait(20.0)
    assert ask(plug).command == (0.5, 0.0, 0.0)
    second = Steady()
    thread(second, plug.topics_name)
    sample = 1
    while not any("another controller is at work" in text for text in plug.reports) and sample < 10_000:
        ask(plug, sample)
        sample += 1
    assert sample < 10_000 and not second.steps
    plug.close()
    assert user.over.wait(10.0)
    assert user.ended == 1 and not wrong.ended


def test_a_refusal_displaces_no_other_nodes_ready(plug, thread):
    """Both messages arrive before the rig reads them, the refusal as the last one."""
    controller = Steady()
    user, wrong = thread(controller, plug.topics_name), thread(Steady(), plug.topics_name, ("current",))
    plug.other_side.open()
    assert controller.begun.wait(20.0)
    user.announce(ControllerReady.READY)
    assert user._ready.wait_for_all_acked(Duration(seconds=10.0))
    wrong.session = plug.other_side.session  # set here, because the node may not have received the run's session yet
    wrong.announce(ControllerReady.REFUSES, "again")
    assert wrong._ready.wait_for_all_acked(Duration(seconds=10.0))
    plug.wait(20.0)
    assert ask(plug).command == (0.5, 0.0, 0.0)


def test_the_goodbye_of_a_rig_before_ends_no_run(plug, thread):
    user = Steady()
    node = thread(user, plug.topics_name)
    plug.wait(20.0)
    node.on_start(ControllerStart(session=plug.other_side.session ^ 1, over=True))
    assert ask(plug).command == (0.5, 0.0, 0.0) and not user.ended


def test_a_node_says_what_it_needs_and_serves_on_when_its_end_of_a_run_fails(plug, thread, config):
    class Needing(Steady):
        settings = {"gain": 2.0}

        def terminate(self):
            super().terminate()
            raise ValueError("no such file")

    user = Needing()
    thread(user, plug.topics_name)
    with pytest.raises(RigError, match=r"it needs gain; start the rig with ros:NAME\?settings=gain:VALUE"):
        plug.wait(1.0)
    for gain in (3.0, 4.0):
        user.over.clear()
        run = load_controller(f"{plug.name}?settings=gain:{gain}", config)
        run.wait(20.0)
        assert ask(run).command == (0.5, 0.0, 0.0) and user.steps[0].settings == {"gain": gain}
        run.close()
        assert user.over.wait(10.0)


# ---- wrong answers


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ({"command": [float("nan"), 0.0, 0.0]}, r"command\[0\] is nan, expected 0 to 1"),
        ({"command": [0.5, 0.0]}, "command has 2 numbers, expected 3"),
        ({"setpoint": [0.5]}, "setpoint has 1 numbers, expected 3"),
        ({"gear": 7}, "gear is 7, expected 0"),
        ({"status": 9}, "status is 9, expected 0"),
        ({"status": 2, "message": "no speed"}, "status error: no speed"),
    ],
)
def test_an_answer_that_no_valve_can_be_given_is_an_error(plug, thread, monkeypatch, change, why):
    node = thread(Steady(), plug.topics_name)
    compute = node.compute

    def wrong(step):
        answer = compute(step)
        for name, value in change.items():
            setattr(answer, name, value)
        return answer

    monkeypatch.setattr(node, "compute", wrong)
    plug.wait(20.0)
    with pytest.raises(ControllerFailed, match=f"sample 0: {why}") as failure:
        ask(plug)
    assert failure.value.status == Status.ERROR


@pytest.mark.parametrize(("name", "value"), [("gear", 258), ("flags", 256), ("status", 256), ("gear", -1)])
def test_a_number_that_a_message_cannot_hold_is_not_sent_as_another_one(plug, thread, name, value):
    user = Steady()
    user.out = ControllerOutputs([0.5, 0.0, 0.0])
    setattr(user.out, name, value)
    thread(user, plug.topics_name)
    plug.wait(20.0)
    with pytest.raises(ControllerFailed, match=f"sample 0: status error: ValueError: {name} is {value}, expected 0 to 255"):
        ask(plug)


def test_a_long_text_of_a_controller_that_refuses_or_leaves_is_shortened(plug, thread, config):
    """It goes to the terminal, and into the reason with which a run ends."""

    class Talking(Steady):
        talks = True

        def initialize(self, info):
            super().initialize(info)
            if self.talks:
                raise ValueError("no " * 100_000)

    user = Talking()
    node = thread(user, plug.topics_name)
    with pytest.raises(RigError, match="one has come and is not used: initialize failed: ValueError: no no ") as refusal:
        plug.wait(20.0)
    user.talks = False
    run = load_controller(plug.name, config)
    run.wait(20.0)
    assert ask(run).command == (0.5, 0.0, 0.0)
    node.announce(ControllerReady.LEAVES, "gone " * 100_000)
    assert node._ready.wait_for_all_acked(Duration(seconds=10.0))
    with pytest.raises(ControllerFailed, match="it has left: gone gone") as failure:
        for sample in range(1, 1000):
            ask(run, sample)
    run.close()
    assert max(len(text) for text in (str(refusal.value), str(failure.value), *plug.reports)) < 1500


def test_answers_to_other_steps_and_bytes_that_are_none_are_not_used(plug, thread, monkeypatch):
    node = thread(Steady(), plug.topics_name)
    compute = node.compute

    def wrong(step):
        if step.sample == 1:
            node._answer.publish(bytes(12))
        if step.sample == 2:
            node._answer.publish(
                ControllerAnswer(session=step.session, controller=node.number, seq=step.seq + 5, command=[1.0] * 3)
            )
        if step.sample == 3:
            node._answer.publish(
                ControllerAnswer(session=step.session + 1, controller=node.number, seq=step.seq, command=[1.0] * 3)
            )
        return compute(step)

    monkeypatch.setattr(node, "compute", wrong)
    plug.wait(20.0)
    for sample in range(5):
        assert ask(plug, sample).command == (0.5, 0.0, 0.0)


@pytest.mark.parametrize(
    ("spec", "why"),
    [
        ("ros:9lives", "'9lives' is no name of topics"),
        ("ros:my__box", "'my__box' is no name of topics"),
        ("ros:?timing=soon", "timing is 'soon', expected lockstep or free"),
        ("ros:?speed=2", "unknown option 'speed'; known are timing, wants, settings, signals"),
        ("ros:?wants=torque", "transducer 'torque'; "),
        ("ros:?settings=gain", "setting 'gain' has no first value; expected e.g. gain:2.0"),
        ("ros:?signals=a-b", "expected up to 64 names"),
        ("ros:?wants=p_p,p_p", "wants has the name 'p_p' twice, expected each name once"),
        ("ros:?settings=gain:1,gain:2", "settings has the name 'gain' twice"),
        ("ros:?signals=slip,slip:rad/s", "signals has the name 'slip' twice"),
    ],
)
def test_what_is_no_specification_is_refused(config, spec, why):
    with pytest.raises(RigError, match=re.escape(why)):
        load_controller(spec, config)


def test_one_rig_has_the_topics(plug, config, ros_domain):
    plug.pace(1.0)
    with pytest.raises(RigError, match=f"another rig uses these topics in ROS domain {ros_domain}"):
        load_controller(plug.name, config).pace(1.0)


def test_a_domain_that_is_none_is_refused(config, ros_domain, monkeypatch):
    monkeypatch.setenv("ROS_DOMAIN_ID", "lab")
    with pytest.raises(RigError, match="ROS_DOMAIN_ID is 'lab', expected a number from 0 to 232"):
        load_controller("ros:", config).pace(1.0)


# ---- by its own clock


def test_free_running_nobody_waits_and_silence_is_the_safe_state(config, ros_program, ros_domain):
    """test_free_running.py measures how the delay affects a shift."""
    process = ros_program("dying")
    plug, reports = load_controller("ros:dying?timing=free", config), []
    plug.say = reports.append
    plug.wait(20.0)
    here = f"controller on ROS topic /dying/answer in domain {ros_domain} is here"
    # an answer may be here before the message of whose it is
    assert [text.removesuffix(f" (process {process.pid})") for text in reports if "is here" in text] == [here]
    assert plug.level == "current"
    rig = Rig(config, controller="external", level=plug.level)
    plug.order(1)
    for _ in range(300):
        advance_with(rig, plug)
    assert rig.status != RigStatus.TRIPPED and rig.measurement("I_zr_p1") > 0.1
    process.kill()
    process.wait()
    newest = rig.sample
    while rig.status != RigStatus.TRIPPED and rig.sample < 1000:
        sample = rig.sample
        newest = sample if advance_with(rig, plug) else newest
    # the held command may have been some samples old when it arrived
    assert 50 <= rig.sample - newest <= 103 and "older than 100 ms" in rig.reason
    assert any("its process has ended" in text for text in reports)
    rig.advance_samples(200)
    assert rig.measurement("I_zr_p1") < 0.005
    plug.close()
