# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""`rig replay` as a user starts it: the messages that reach another process over DDS, its control and its end."""

import itertools
import json
import math
import os
import pty
import re
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
import rclpy
from builtin_interfaces.msg import Duration, Time
from mcap.reader import make_reader
from mcap.writer import Writer
from rclpy.duration import Infinite
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile
from rosbag2_interfaces.srv import Burst, GetRate, IsPaused, Pause, Play, PlayNext, Resume, Seek, SetRate, Stop, TogglePaused
from rosgraph_msgs.msg import Clock
from running_graph import BRIEF, Client
from std_msgs.msg import String
from streams import Streams

from rig_nodes.bags import cdr
from rig_nodes.bags.definitions import installed
from rig_nodes.bags.opened import OpenedBags
from rig_nodes.bags.reader import Bag
from rig_nodes.base.errors import RigError
from rig_nodes.cli.main import main
from rig_nodes.controllers.ros.domain import allocate, environment
from rig_nodes.nodes.message_class import message_class
from rig_nodes.nodes.qos import read_overrides

SAMPLE = Path(__file__).parents[2] / "bags" / "sample"
PATIENCE = 60.0
TICK = 5_000_000  # ns, the default period of /clock
LATCHED = "- history: keep_last\n  depth: 1\n  reliability: reliable\n  durability: transient_local\n"


@pytest.fixture
def domain():
    with allocate() as domain:
        yield domain


class Replay:
    """`rig replay` in a process of its own."""

    def __init__(self, domain, bag, *arguments, stdin=subprocess.DEVNULL, patience=PATIENCE):
        command = [sys.executable, "-P", "-m", "rig_nodes", "replay", str(bag), *map(str, arguments)]
        self.process = subprocess.Popen(
            command,
            stdin=stdin,
            stdout=subprocess.PIPE,
            text=True,
            stderr=subprocess.STDOUT,
            start_new_session=True,
            env=environment(domain),
        )
        self.output = ""
        self._limit = threading.Timer(patience, self.process.kill)  # a hung replay must not hang the tests
        self._limit.start()

    def until(self, text):
        """Reads the output up to a line with this text."""
        for line in self.process.stdout:
            self.output += line
            if text in line:
                return
        raise AssertionError(f"'{text}' was never printed:\n{self.output}")

    def end(self, code=0):
        """Waits for the end and checks the exit code; returns the output."""
        rest, _ = self.process.communicate()
        self._limit.cancel()
        self.output += rest
        assert self.process.returncode == code, self.output
        return self.output


def replayed(domain, folder, path, *arguments, patience=PATIENCE):
    """Replays a bag to a listener in another process; returns [number, hash] by topic as received, the clock, and the output."""
    out = folder / "received.json"
    with OpenedBags([path]) as bag:
        topics = {**bag.types, "/clock": "rosgraph_msgs/msg/Clock"}
    command = [sys.executable, "-P", str(Path(__file__).with_name("listener.py")), str(out)]
    listener = subprocess.Popen(
        [*command, *(f"{topic}={kind}" for topic, kind in topics.items())],
        env=environment(domain) | {"PYTHONPATH": str(Path(__file__).parent)},
    )
    output = Replay(domain, path, "--wait", len(topics) - 1, *arguments, patience=patience).end()
    assert listener.wait(60) == 0
    received = json.loads(out.read_text())
    received["topics"].pop("/clock")
    return received["topics"], received["clock"], output


def held(path):
    """Returns [number, hash] by topic of a bag in the order of time, and its length [ns]."""
    streams = Streams()
    with OpenedBags([path]) as bag:
        for _, (topic, data) in bag.timeline(bag.types):
            streams.add(topic, bag.types[topic], data)
        assert bag.first == 0
        return streams.found(), bag.last


def check_once_and_in_order(domain, folder, path, rate, **options):
    expected, length = held(path)
    topics, clock, output = replayed(domain, folder, path, "--rate", rate, **options)
    assert topics == expected
    assert clock == list(range(0, length + 1, TICK))
    assert f"{sum(count for count, _ in expected.values())} messages in" in output
    assert all(re.search(rf"^  {topic} +{count}$", output, re.M) for topic, (count, _) in expected.items())
    assert rate == "max" or float(re.search(r"messages in ([\d.]+) s", output).group(1)) >= round(length * 1e-9 / rate, 2) - 0.01
    return output


@pytest.mark.parametrize("rate", [*(pytest.param(rate, marks=pytest.mark.campaign) for rate in (1, 10)), "max"])
def test_another_process_gets_the_whole_bag_in_order(domain, tmp_path, rate):
    check_once_and_in_order(domain, tmp_path, SAMPLE, rate)


@pytest.mark.campaign
@pytest.mark.parametrize("rate", ["max", 10, 1])
def test_another_process_gets_ten_minutes_in_order(domain, ten_minutes, tmp_path, rate):
    print(check_once_and_in_order(domain, tmp_path, ten_minutes, rate, patience=3600.0))


@pytest.fixture(scope="module")
def ten_minutes(tmp_path_factory):
    """Folder of a run of ten minutes at 600 rpm in gear I."""
    folder = tmp_path_factory.mktemp("long")
    text = BRIEF.read_text(encoding="utf-8")
    (folder / "long.yaml").write_text(text.replace("300 rpm}", "600 rpm}").replace("wait: {for: 200 ms}", "wait: {for: 600 s}"))
    assert main(["simulate", str(folder / "long.yaml"), "--out", str(folder / "whole")]) == 0
    return folder / "whole"


@pytest.fixture
def foreign(tmp_path):
    """A bag as other programs make it: plain ROS types, a latched topic, a clock, unknown and unequal types."""
    path = tmp_path / "foreign.mcap"
    text = installed("std_msgs/msg/String").text
    with open(path, "wb") as file:
        writer = Writer(file)
        writer.start(profile="ros2")
        channels = {}
        for topic, name, definition, encoding in [
            ("/chatter", "std_msgs/msg/String", text, "cdr"),
            ("/about", "std_msgs/msg/String", text, "cdr"),
            ("/clock", "rosgraph_msgs/msg/Clock", installed("rosgraph_msgs/msg/Clock").text, "cdr"),
            ("/elsewhere", "their_msgs/msg/Thing", "int32 a\n", "cdr"),
            ("/older", "std_msgs/msg/Bool", "int8 data\n", "cdr"),
            ("/web", "Thing", "int32 a\n", "json"),
        ]:
            schema = writer.register_schema(name, "ros2msg", definition.encode())
            profile = {"offered_qos_profiles": LATCHED} if topic == "/about" else {}
            channels[topic] = writer.register_channel(topic, encoding, schema, profile)

        def add(topic, ms, data):
            writer.add_message(channels[topic], 10**18 + ms * 10**6, data, 10**18 + ms * 10**6)

        add("/about", 0, cdr.encode_any("std_msgs/msg/String", {"data": "what this is"}))
        for i in range(20):
            add("/chatter", 10 * i, cdr.encode_any("std_msgs/msg/String", {"data": f"{i}"}))
        for topic in ("/clock", "/elsewhere", "/older", "/web"):
            add(topic, 50, b"\0\1\0\0" + bytes(8))
            add(topic, 60, b"\0\1\0\0" + bytes(8))
        writer.finish()
    return path


@pytest.fixture
def user(domain):
    client = Client(domain)
    yield client
    client.close()


def type_of(topic):
    return message_class(Bag(SAMPLE).types[topic])


def listen(user, kind, topic, latched=False):
    """Returns a list that grows with the messages of a topic."""
    messages = []
    durability = DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE
    user.node.create_subscription(kind, topic, messages.append, QoSProfile(depth=1000, durability=durability))
    return messages


def test_a_foreign_bag_from_its_middle_with_its_latched_topic_and_a_sentence_for_each_one_left_out(domain, user, foreign):
    chatter, clock = listen(user, String, "/chatter"), listen(user, Clock, "/clock")
    replay = Replay(domain, foreign, "--start", 0.1, "--paused", "--wait", 1)
    user.until(lambda: clock, "the clock")
    about = listen(user, String, "/about", latched=True)
    user.until(lambda: about, "the latched message of a late subscriber")
    assert about[0].data == "what this is" and not chatter
    user.call(Resume, "/rig_replay/resume")
    user.until(lambda: len(chatter) == 10, "the second half")
    output = replay.end(3)
    assert [int(message.data) for message in chatter] == list(range(10, 20))
    stamps = [message.clock.sec * 1000 + message.clock.nanosec // 10**6 - 10**12 for message in clock]
    assert stamps == sorted(stamps) and stamps[0] == 100 and 180 <= stamps[-1] <= 190
    for topic, why in [
        ("/clock", "a clock of its own"),
        ("/elsewhere", "their_msgs/msg/Thing is not installed"),
        ("/older", "another version of std_msgs/msg/Bool"),
        ("/web", "encoded as json"),
    ]:
        assert re.search(rf"^rig: {topic}: 2 messages are left out: .*{why}", output, re.M), output


def test_a_recorded_clock_is_not_lost_when_the_replay_has_its_own(domain, foreign):
    assert "/clock: 2 messages are left out" in Replay(domain, foreign, "--topics", "/chatter,/clock", "--rate", "max").end()


MANY = 5600  # 5000 fill the queue of a receiver that keeps all, and the others are taken slower than a receiver is waited for


@pytest.mark.parametrize("deaf", [False, True])
def test_a_slow_receiver_holds_it_up_whatever_another_one_does_which_is_given_up(domain, user, tmp_path, deaf):
    with open(tmp_path / "many.mcap", "wb") as file:
        writer = Writer(file)
        writer.start(profile="ros2")
        schema = writer.register_schema("std_msgs/msg/String", "ros2msg", installed("std_msgs/msg/String").text.encode())
        channels = [writer.register_channel(topic, "cdr", schema) for topic in ("/deaf", "/slow")]
        for number in range(MANY):
            for channel in channels:
                writer.add_message(channel, number, cdr.encode_any("std_msgs/msg/String", {"data": f"{number}"}), number)
        writer.finish()
    everything, received = QoSProfile(depth=1, history=HistoryPolicy.KEEP_ALL), []

    def take(message):
        received.append(int(message.data))
        if len(received) < MANY - 5000 + 100:
            time.sleep(0.01)

    user.node.create_subscription(String, "/slow", take, everything)
    other = rclpy.create_node("deaf", context=user.context)  # no executor takes its messages
    if deaf:
        other.create_subscription(String, "/deaf", print, everything)
    replay = Replay(domain, tmp_path / "many.mcap", "--rate", "max", "--wait", 1 + deaf)
    user.until(lambda: len(received) == MANY, "all messages")
    output = replay.end(3 if deaf else 0)
    other.destroy_node()
    assert received == list(range(MANY))
    given_up = re.findall(r"^a receiver of (\S+) took too little in 5 s: it is given up", output, re.M)
    assert given_up == ["/deaf"] * deaf


def stamps_ms(samples):
    return [message.header.stamp.sec * 1000 + message.header.stamp.nanosec // 10**6 for message in samples]


def test_the_services_of_rosbag2_control_it(domain, user):
    clock = listen(user, Clock, "/clock")
    replay = Replay(domain, SAMPLE, "--paused", "--topics", "/motor/state", "--start", 0.5)
    samples = user.listen("/motor/state")

    def ask(kind, name, **fields):
        return user.call(kind, f"/rig_replay/{name}", again=10.0, **fields)  # twice would be two messages

    for number in (1, 2, 3):
        assert ask(PlayNext, "play_next").success
        user.until(lambda: len(samples) == number, f"message {number}")
    assert stamps_ms(samples) == [500, 505, 510]
    user.until(lambda: clock[-1].clock.nanosec == 510_000_000, "the clock of the third")
    count = len(clock)
    user.until(lambda: len(clock) > count, "the clock, repeated for those who come during the pause")
    assert clock[-1].clock.nanosec == 510_000_000 and ask(IsPaused, "is_paused").paused

    assert ask(Burst, "burst", num_messages=7).actually_burst == 7
    user.until(lambda: len(samples) == 10, "seven at once")
    assert stamps_ms(samples)[-1] == 545 and ask(IsPaused, "is_paused").paused

    assert not ask(Seek, "seek", time=Time(sec=9)).success
    assert ask(Seek, "seek", time=Time(nanosec=100_000_000)).success and ask(Burst, "burst", num_messages=2).actually_burst == 2
    user.until(lambda: len(samples) == 12, "two messages where it jumped to")
    assert stamps_ms(samples)[-2:] == [100, 105]

    assert [ask(SetRate, "set_rate", rate=rate).success for rate in (0.0, -1.0, 101.0, 0.05)] == [False, False, False, True]
    assert ask(GetRate, "get_rate").rate == 0.05
    ask(TogglePaused, "toggle_paused")
    user.until(lambda: len(samples) > 14, "the replay to go on")
    assert not ask(PlayNext, "play_next").success and not ask(Play, "play").success
    assert ask(Burst, "burst", num_messages=1).actually_burst == 0
    ask(Pause, "pause")

    assert ask(SetRate, "set_rate", rate=math.inf).success
    ask(Seek, "seek", time=Time(sec=1))
    before = len(samples)
    part = {"start_offset": Time(sec=1), "playback_duration": Duration(nanosec=200_000_000)}
    assert ask(Play, "play", **part).success
    user.until(lambda: len(samples) == before + 40, "the part that was asked for")
    assert stamps_ms(samples)[-40:] == list(range(1000, 1200, 5))
    output = replay.end()
    assert int(re.search(r"/motor/state +(\d+)", output).group(1)) == len(samples)
    assert "9.000 s is refused: the bag goes from 0.000 s to" in output and "rate 101 is refused" in output


def test_two_pieces_a_span_patterns_and_another_name_reach_a_receiver_once_and_in_order(domain, user, tmp_path):
    assert main(["bag", "cut", str(SAMPLE), "--to", "1", "--out", str(tmp_path / "early")]) == 0
    assert main(["bag", "cut", str(SAMPLE), "--from", "1", "--out", str(tmp_path / "late")]) == 0
    named = user.node.create_subscription(type_of("/gearbox/state"), "/again/gearbox", (again := []).append, 1000)
    (tmp_path / "qos.yaml").write_text("/gearbox/state: {depth: 500, deadline: {sec: 3, nsec: 0}}")
    replay = Replay(
        domain,
        tmp_path / "late",
        tmp_path / "early",
        *("--start", 0.5, "--duration", 1, "--regex", "/motor/.*|/gearbox/state", "--exclude-regex", ".*command"),
        *("--remap", "/gearbox/state:=/again/gearbox", "--delay", 0.2, "--paused", "--wait", 2),
        *("--qos", tmp_path / "qos.yaml"),
    )
    samples = user.listen("/motor/state")
    replay.until("paused at")
    (info,) = user.node.get_publishers_info_by_topic("/again/gearbox")
    assert info.qos_profile.deadline.nanoseconds == 3 * 10**9
    user.call(TogglePaused, "/rig_replay/toggle_paused")
    output = replay.end()
    user.until(lambda: len(samples) == len(again) == 200, "both topics")
    stamps = [message.header.stamp.sec * 1000 + message.header.stamp.nanosec // 10**6 for message in samples]
    assert stamps == list(range(500, 1500, 5)) and named is not None
    assert "/motor/command" not in output


def test_stop_ends_it(domain, user):
    replay = Replay(domain, SAMPLE, "--paused")
    replay.until("paused at")
    user.call(Stop, "/rig_replay/stop")
    assert "stopped at" in replay.end()


def test_a_loop_begins_again_and_ctrl_c_ends_it_with_its_counts(domain, user):
    clock = listen(user, Clock, "/clock")
    replay = Replay(domain, SAMPLE, "--loop", "--start", 2.5, "--topics", "/rig/state,/rig/run_info")

    def jumps():
        times = [message.clock.sec + 1e-9 * message.clock.nanosec for message in clock]
        return [later for earlier, later in itertools.pairwise(times) if later < earlier]

    user.until(lambda: len(jumps()) >= 2, "two jumps of the clock")
    os.killpg(replay.process.pid, signal.SIGINT)
    output = replay.end(130)
    assert jumps()[:2] == [2.5, 2.5]
    passes = int(re.search(r"(\d+) passes", output).group(1))
    assert int(re.search(r"/rig/run_info +(\d+)", output).group(1)) == passes >= 3
    assert "Traceback" not in output


def test_keys_of_the_terminal_steer_it(domain):
    terminal, other = pty.openpty()
    replay = Replay(domain, SAMPLE, "--paused", "--topics", "/rig/state", stdin=other)
    os.close(other)
    replay.until("paused at 0.000 s")
    os.write(terminal, b"\x1b[C\x1b[A\x1bOA")
    replay.until("rate 1.21")
    os.write(terminal, b"\x1b[B")
    replay.until("rate 1.09")
    os.write(terminal, b" ")
    replay.until("going on at 0.000 s")
    os.write(terminal, b" ")
    replay.until("paused at")
    os.write(terminal, b"q")
    output = replay.end()
    os.close(terminal)
    assert "space: pause" in output and int(re.search(r"/rig/state +(\d+)", output).group(1)) >= 1


@pytest.mark.against_the_clock  # the command searches the domain for a short time only
def test_a_second_clock_in_the_domain_is_refused_however_late_it_is_seen(domain, user):
    user.node.create_publisher(Clock, "/clock", 10)
    assert "another node publishes /clock" in Replay(domain, SAMPLE, "--loop").end(2)


def test_a_clock_that_comes_while_it_plays_ends_it(domain, user):
    replay = Replay(domain, SAMPLE, "--loop")
    replay.until("subscriptions are connected")
    user.node.create_publisher(Clock, "/clock", 10)
    assert "another node publishes /clock" in replay.end(2)


@pytest.mark.parametrize(
    "arguments, sentence",
    [
        (["no_such_bag"], "no_such_bag: there is no such file or folder"),
        ([__file__], "does not begin as an MCAP file"),
        ([SAMPLE, "--rate", "0"], "0 is no rate; give 0.01 to 100, or max"),
        ([SAMPLE, "--rate", "101"], "101 is no rate"),
        ([SAMPLE, "--start", "9"], f"the bag is {Bag(SAMPLE).timeline()[-1][0] * 1e-9:.3f} s long"),
        ([SAMPLE, "--start", "-1"], "-1 is no time"),
        ([SAMPLE, "--start", "2", "--until", "1"], "--until 1: the replay begins at 2 s"),
        ([SAMPLE, "--duration", "0"], "--duration 0: give a time above 0 s"),
        ([SAMPLE, "--topics", "/motor/m_we"], "topic in the bag '/motor/m_we'; did you mean '/motor/m_wej'"),
        ([SAMPLE, "--topics", "/motor/command", "--start", "1"], "nothing is left to replay after 1 s"),
        ([SAMPLE, "--clock", "0"], "0 is no frequency"),
    ],
)
def test_bad_input_is_one_sentence(arguments, sentence, capfd, monkeypatch):
    monkeypatch.setattr(os, "environ", os.environ.copy())
    assert main(["replay", *map(str, arguments)]) == 2
    error = capfd.readouterr().err
    assert sentence in error and error.count("\n") == 1


@pytest.mark.parametrize(
    "text, sentence",
    [
        (
            "/motor/state: {reliability: good}",
            "reliability is good; expected system_default (0) or reliable (1) or best_effort (2)",
        ),
        ("/motor/state: {liveliness: 7}", "liveliness is 7; expected system_default (0) or automatic (1) or manual_by_topic (3)"),
        ("/motor/state: {depth: -1}", "depth is -1; expected a whole number"),
        ("/motor/state: {deadline: 3}", "deadline is 3; expected 'sec' and 'nsec'"),
        ("/motor/state: {lifespan: {sec: 1}}", "lifespan is {'sec': 1}; expected 'sec' and 'nsec'"),
        ("/motor/state: {lifespan: {sec: 1.5, nsec: 0}}", "expected 'sec' and 'nsec', whole numbers from 0, or infinite"),
        ("/motor/state: {avoid_ros_namespace_conventions: 1}", "is 1; expected true or false"),
        ("/motor/state: {qos: 1}", "field of a profile 'qos'"),
        ("- 1", "expected topics with fields"),
    ],
)
def test_a_wrong_quality_of_service_is_one_sentence(text, sentence, tmp_path):
    (tmp_path / "qos.yaml").write_text(text)
    with pytest.raises(RigError, match=re.escape(sentence)):
        read_overrides(tmp_path / "qos.yaml")


DOCUMENTED = """
/motor/state:
  history: {keep_all}
  depth: 0
  reliability: {reliable}
  durability: {volatile}
  deadline: {{sec: 0, nsec: 0}}
  lifespan: {{sec: 9223372036, nsec: 854775807}}
  liveliness: {automatic}
  liveliness_lease_duration: infinite
  avoid_ros_namespace_conventions: false
/of/another/bag: {{depth: 10}}
"""
WORDS = {"keep_all": "keep_all", "reliable": "reliable", "volatile": "volatile", "automatic": "system_default"}
NUMBERS = {"keep_all": 2, "reliable": 1, "volatile": 2, "automatic": 0}


@pytest.mark.parametrize("values", [WORDS, NUMBERS], ids=["words", "numbers"])
def test_the_profiles_that_rosbag2_documents_are_taken(values, tmp_path, domain):
    (tmp_path / "qos.yaml").write_text(DOCUMENTED.format(**values))
    found = read_overrides(tmp_path / "qos.yaml")["/motor/state"]
    profile = QoSProfile(depth=1, **{name: value for name, value in found.items() if name != "depth"})
    assert (profile.history, profile.durability) == (HistoryPolicy.KEEP_ALL, DurabilityPolicy.VOLATILE)
    assert profile.deadline.nanoseconds == 0 and profile.lifespan == profile.liveliness_lease_duration == Infinite
    if values is WORDS:
        output = Replay(domain, SAMPLE, "--rate", "max", "--topics", "/motor/state", "--qos", tmp_path / "qos.yaml").end(0)
        assert output.count("names topics that are not in the bag: /of/another/bag") == 1 and "518 messages in" in output


@pytest.mark.parametrize("unknown", ["unknown", 3])
def test_a_recorded_profile_whose_history_was_not_known_is_taken(unknown, tmp_path):
    (tmp_path / "qos.yaml").write_text(f"/motor/state: {{history: {unknown}, depth: 0}}")
    assert read_overrides(tmp_path / "qos.yaml") == {"/motor/state": {"history": HistoryPolicy.SYSTEM_DEFAULT}}


def test_a_damaged_bag_is_replayed_less_its_damage_which_is_told_and_counted_as_lost(domain, tmp_path):
    data = bytearray((SAMPLE / "sample_0.mcap").read_bytes())
    with open(SAMPLE / "sample_0.mcap", "rb") as file:
        chunks = make_reader(file).get_summary().chunk_indexes
    middle = chunks[len(chunks) // 2]
    data[middle.chunk_start_offset + middle.chunk_length // 2] ^= 1
    path = tmp_path / "sample_0.mcap"
    path.write_bytes(data)
    output = Replay(domain, path, "--rate", "max").end(3)
    assert re.search(r"^rig: .*is damaged, only what is whole of it is replayed: a chunk .* at byte \d+ of", output, re.M)
    left = sum(Bag(path, recover=True).counts.values())
    assert f"{left} messages in" in output and 0 < left < sum(Bag(SAMPLE).counts.values())
    path.write_bytes(data[:100])
    assert "holds no messages (" in Replay(domain, path).end(2)
