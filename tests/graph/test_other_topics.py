# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Topics beyond the rig's own, of users' nodes, /rosout and /diagnostics, in the bag as they appear or chosen by pattern."""

from collections import Counter
from unittest.mock import MagicMock

import pytest
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.task import Future
from rig_msgs.msg import Setpoint
from running_graph import Client, Graph
from std_msgs.msg import Float64, String, UInt64

from rig_nodes.analysis.lost import what_was_lost
from rig_nodes.bags.reader import Bag
from rig_nodes.base.config import load_yaml
from rig_nodes.cli.main import main
from rig_nodes.nodes.other_topics import OtherTopics
from rig_nodes.nodes.processes.recording_options import TopicChoice
from rig_nodes.nodes.processes.result import facts_of, lost_messages
from rig_nodes.nodes.replay import obstacle, offered
from rig_nodes.view.convert import make_view

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
FAST = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)


def until_recorded(user, publisher) -> None:
    user.until(publisher.get_subscription_count, f"the recorder on {publisher.topic_name}")


def mixed_in_quality(user) -> None:
    """One topic in four qualities, each offered when the recorder listens to those before; and an order of the rig's."""
    senders = []
    kept = QoSProfile(depth=50, durability=LATCHED.durability)
    for number, profile in enumerate((kept, QoSProfile(depth=50), FAST, kept)):
        sender = user.node.create_publisher(String, "/user/mixed", profile)
        if sender.qos_profile.durability == LATCHED.durability:
            sender.publish(String(data=f"{number} at once"))
        until_recorded(user, sender)
        senders.append(sender)
    for repeated in range(3):
        for number, sender in enumerate(senders):
            sender.publish(String(data=f"{number} {repeated}"))
            sender.publish(String(data="the same"))
    order = user.node.create_publisher(Setpoint, "/motor/command", FAST)
    until_recorded(user, order)
    for _ in range(10):  # best effort: the first may come before the recorder knows its sender
        order.publish(Setpoint(value=12.5))
        user.executor.spin_until_future_complete(Future(), 0.02)


def time_of(message):
    """Returns the stamp of a message [s]."""
    return message.header.stamp.sec + message.header.stamp.nanosec * 1e-9


REAL_TIME = pytest.param(None, marks=(pytest.mark.against_the_clock, pytest.mark.campaign))  # the recorder is the same in both


@pytest.fixture(scope="module", params=[REAL_TIME, 1.0], ids=["real time", "lockstep"])
def bag(request, tmp_path_factory):
    """The bag of a run during which a user's nodes published."""
    graph = Graph(tmp_path_factory.mktemp("graph") / "others", speed=request.param, recording=("--exclude", "/secret/.*"))
    user = Client(graph.domain)
    try:
        states = user.listen("/rig/state")
        user.until(lambda: states, "a rig")
        note = user.node.create_publisher(String, "/user/note", LATCHED)
        note.publish(String(data="before anybody listened"))
        fast = user.node.create_publisher(UInt64, "/user/fast", FAST)
        secret = user.node.create_publisher(String, "/secret/note", 10)
        hidden = user.node.create_publisher(String, "/user/_hidden", 10)
        until_recorded(user, note)
        until_recorded(user, fast)
        before, numbers = time_of(states[-1]), [*range(50, 55)]
        for number in numbers:
            fast.publish(UInt64(data=number))
        later = user.node.create_publisher(Float64, "/user/later", 10)  # appears when the others are recorded already
        until_recorded(user, later)
        later.publish(Float64(data=2.5))
        mixed_in_quality(user)
        user.node.declare_parameter("of_the_users_own", 1)
        user.node.get_logger().info("a line of the user's own")  # a rig without faults logs no line itself
        seen = len(states)
        user.until(lambda: len(states) > seen + 200, "a second more")
        assert secret.get_subscription_count() == hidden.get_subscription_count() == 0
        user.until(lambda: later.wait_for_all_acked(), "the recorder's receipt")
        graph.close()
        made = Bag(graph.folder)
        made.sent, made.facts = (before, time_of(states[-1]), numbers), facts_of(graph.folder)
        yield made
    finally:
        user.close()
        graph.close() if graph.supervisor.end is None else None


def test_every_topic_of_the_domain_is_in_the_bag_at_the_time_at_which_it_came(bag):
    before, after, numbers = bag.sent
    assert [message.data for _, message in bag.messages("/user/note")] == ["before anybody listened"]
    assert [message.data for _, message in bag.messages("/user/later")] == [2.5]
    fast = list(bag.messages("/user/fast"))
    assert {message.data for _, message in fast} <= set(numbers) and fast
    assert all(before - 0.1 < time * 1e-9 < after + 0.1 for time, _ in fast)
    assert bag.counts["/diagnostics"] > 2 and bag.counts["/rosout"] >= 1 and bag.counts["/parameter_events"] >= 1
    assert not {"/clock", "/secret/note", "/user/_hidden"} & set(bag.counts)


def test_a_topic_in_several_qualities_of_service_is_recorded_in_full_and_not_twice(bag):
    """What the third publisher offers best effort may get lost on its way."""
    stored = Counter(message.data for _, message in bag.messages("/user/mixed"))
    fast = [stored.pop(f"2 {k}", 0) for k in range(3)]
    assert 9 <= stored.pop("the same") <= 12 and any(fast) and max(fast) == 1
    assert stored == {"0 at once": 1, "3 at once": 1} | {f"{n} {k}": 1 for n in (0, 1, 3) for k in range(3)}
    assert {message.value for _, message in bag.messages("/motor/command")} == {12.5}
    (why,) = [text for _, topic, name, text, _ in bag.events() if name == "command_refused"]
    assert "/motor/command: a publisher offers a weaker quality of service (reliability) than the device needs" in why


def test_rosbag2_is_told_their_types_and_offers_and_no_loss_is_claimed_for_them(bag):
    assert bag.check() == [] and lost_messages(bag, bag.facts) == {} and bag.facts["recorder"]["unrecorded"] == {}
    topics = load_yaml(bag.path.parent / "metadata.yaml")["rosbag2_bagfile_information"]["topics_with_message_count"]
    stored = {topic["topic_metadata"]["name"]: topic["topic_metadata"] for topic in topics}
    assert stored["/user/fast"]["type"] == "std_msgs/msg/UInt64"
    assert stored["/user/fast"]["offered_qos_profiles"][0]["reliability"] == "best_effort"
    assert stored["/user/note"]["offered_qos_profiles"][0]["durability"] == "transient_local"
    assert stored["/user/later"]["type_description_hash"].startswith("RIHS01_")


def test_report_view_and_replay_take_such_a_bag(bag, capsys):
    folder = bag.path.parent
    assert main(["report", str(folder)]) == 0
    assert "messages lost: 0" in capsys.readouterr().out
    assert make_view(folder).path.stat().st_size > 1000
    assert [obstacle(bag, topic) for topic in ("/user/note", "/user/fast", "/rosout", "/diagnostics")] == [""] * 4
    assert offered(bag, "/user/fast").reliability == ReliabilityPolicy.BEST_EFFORT
    assert offered(bag, "/user/note").durability == DurabilityPolicy.TRANSIENT_LOCAL


def test_a_type_that_cannot_be_loaded_is_named_once():
    node = MagicMock()
    node.get_topic_names_and_types.return_value = [
        ("/odd/one", ["no_such_package/msg/Thing"]),
        ("/odd/two", ["std_msgs/msg/String", "std_msgs/msg/Bool"]),
    ]
    others = OtherTopics(node, {"/motor/state": None}, TopicChoice(), MagicMock())
    for _ in range(3):
        others.look_soon()
        others.look()
    assert set(others.unrecorded) == {"/odd/one", "/odd/two"}
    assert "no_such_package" in others.unrecorded["/odd/one"]
    assert "several types" in others.unrecorded["/odd/two"]
    assert node.get_logger().warning.call_count == 2 and not node.create_subscription.called


def test_what_comes_later_on_a_topic_and_cannot_be_received_is_named_and_is_a_loss():
    """A second type, and another node on a topic of the rig that the recorder gets beside DDS."""
    node = MagicMock()
    one, other = MagicMock(node_name="rig", qos_profile=FAST), MagicMock(node_name="stranger", qos_profile=FAST)
    types = {"/mine": ["std_msgs/msg/String"], "/motor/state": ["rig_msgs/msg/MotorState"]}
    offers = {name: [one] for name in types}
    node.get_topic_names_and_types.side_effect = lambda: list(types.items())
    node.get_publishers_info_by_topic.side_effect = offers.get
    others = OtherTopics(node, {"/motor/state": None}, TopicChoice(), MagicMock())
    others.look()
    assert others.unrecorded == {}
    types["/mine"], offers["/motor/state"] = ["std_msgs/msg/Bool", "std_msgs/msg/String"], [one, other]
    others.look_soon()
    others.look()
    assert others.unrecorded == {
        "/mine": "it is sent with the type std_msgs/msg/Bool too; only messages of type std_msgs/msg/String are recorded",
        "/motor/state": "it is sent by rig, stranger; in lockstep only the messages of the rig's own node are recorded",
    }
    lost = what_was_lost({"unrecorded_topics": others.unrecorded})
    assert lost.startswith(
        "not recorded in full (--exclude leaves a topic out): /mine: it is sent with the type std_msgs/msg/Bool too"
    )


@pytest.mark.parametrize(
    "topics, exclude, taken",
    [
        (None, None, ["/rosout", "/camera/left", "/parameter_events"]),
        ("/camera/.*", None, ["/camera/left"]),
        (None, "/camera/.*", ["/rosout", "/parameter_events"]),
        ("/camera/.*|/rosout", "/camera/left", ["/rosout"]),
    ],
)
def test_patterns_choose_by_the_whole_name(topics, exclude, taken):
    choice = TopicChoice(topics, exclude)
    names = ["/rosout", "/camera/left", "/parameter_events", "/clock", "/controller/shift/_action/feedback"]
    assert [name for name in names if choice.takes(name)] == taken


@pytest.mark.parametrize("option", ["--topics", "--exclude"])
def test_a_wrong_pattern_starts_nothing(option, tmp_path, capsys):
    assert main(["run", "demo", "--out", str(tmp_path / "run"), option, "/camera/["]) == 2
    error = capsys.readouterr().err
    assert f"{option} /camera/[: is no regular expression" in error and len(error.splitlines()) == 1
    assert not (tmp_path / "run").exists()
