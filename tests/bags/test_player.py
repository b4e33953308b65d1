# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The player without ROS under a clock of the test's own: the due messages, their times and their order."""

import math

import pytest
from ruamel.yaml import YAML

from rig_nodes.bags.metadata import FOREVER, PROFILES, offered_by, profile_text, profiles_of_today
from rig_nodes.bags.player import BATCH, CLOCK, STRIDE, Played, Player
from rig_nodes.bags.reader import Bag

MS = 1_000_000
T0 = 5_000 * MS
TIMES = [T0 + ms * MS for ms in (0, 0, 3, 10, 10, 10, 24, 40)]
END = TIMES[-1] + 1
STEP = 0.001


def recorded(times):
    """Returns the function that begins a pass over messages at these times; each message is its number."""
    return lambda first, end: ((time, number) for number, time in enumerate(times) if first <= time < end)


class Run:
    """A player that is called at every millisecond of a made-up wall clock."""

    def __init__(self, **options):
        self.now = 100.0
        first = options.pop("first", T0)
        held = [(TIMES[number], number) for number in options.pop("early", ())]
        early = lambda at: [row for row in held if row[0] < at]  # noqa: E731
        self.player = Player(Played(recorded(TIMES), first, END, early), period=10 * MS, **options)
        self.taken = []  # (wall time since the start [ms], number or CLOCK, recorded time since T0 [ms])

    def drive(self, ms):
        """Advances wall time; returns the messages that become due in it, with their times."""
        before = len(self.taken)
        for _ in range(round(ms) + 1):
            wall = round((self.now - 100.0) * 1e3)
            self.taken += [(wall, number, (time - T0) // MS) for number, time in self.player.take(self.now)]
            self.now += STEP
        return self.taken[before:]


def numbers(taken):
    return [number for _, number, _ in taken if number != CLOCK]


def clocks(taken):
    return [time for _, number, time in taken if number == CLOCK]


def test_everything_comes_once_in_recorded_order_at_its_time_and_behind_its_clock():
    run = Run()
    taken = run.drive(60)
    assert taken == [
        (0, CLOCK, 0),
        (0, 0, 0),
        (0, 1, 0),
        (3, 2, 3),
        (10, CLOCK, 10),
        (10, 3, 10),
        (10, 4, 10),
        (10, 5, 10),
        (20, CLOCK, 20),
        (24, 6, 24),
        (30, CLOCK, 30),
        (40, CLOCK, 40),
        (40, 7, 40),
    ]
    assert run.player.finished and run.player.passes == 1 and run.player.behind == 0.0


@pytest.mark.parametrize("rate", [0.1, 2.0, 10.0])
def test_the_rate_divides_the_times(rate):
    run = Run(rate=rate)
    taken = run.drive(40 / rate + 2)
    assert numbers(taken) == list(range(8))
    for wall, _, time in taken:
        assert 0 <= wall - time / rate < 1.01


def test_max_waits_for_nothing_but_hands_out_no_more_than_a_batch():
    times = [T0 + i * MS for i in range(3 * BATCH)]
    player = Player(Played(recorded(times), T0, times[-1] + 1), rate=math.inf)
    taken = []
    while not player.finished:
        assert player.wait(7.0) == 0.0
        batch = player.take(7.0)
        assert 0 < len(batch) <= BATCH
        taken += batch
    assert [number for number, _ in taken if number != CLOCK] == list(range(3 * BATCH))
    assert [time for _, time in taken] == sorted(time for _, time in taken)


def test_a_pause_takes_no_recorded_time_and_the_clock_stands():
    run = Run()
    run.drive(5)
    run.player.pause()
    assert run.drive(500) == [] and run.player.wait(run.now) == math.inf and run.player.clock == T0
    run.player.resume(run.now)
    resumed = round((run.now - 100.0) * 1e3)
    taken = run.drive(60)
    assert numbers(taken) == [3, 4, 5, 6, 7]
    assert taken[0][0] - resumed == pytest.approx(10 - 5, abs=1)


def test_paused_from_the_start_gives_the_clock_and_what_holds_from_before():
    run = Run(first=T0 + 5 * MS, early=[1], paused=True)
    assert run.drive(50) == [(0, CLOCK, 5), (0, 1, 0)]
    run.player.resume(run.now)
    assert numbers(run.drive(60)) == [3, 4, 5, 6, 7]


def test_a_single_message_comes_with_its_clock_and_needs_a_pause():
    run = Run(paused=True)
    run.drive(1)
    steps = []
    for _ in range(5):
        assert run.player.play_next() and run.player.wait(run.now) == 0.0
        steps.append([(number, time) for _, number, time in run.drive(3)])
    assert steps == [[(0, 0)], [(1, 0)], [(CLOCK, 3), (2, 3)], [(CLOCK, 10), (3, 10)], [(4, 10)]]
    assert not run.player.pass_over
    for _ in range(3):
        run.player.play_next()
    assert numbers(run.drive(3)) == [5, 6, 7] and run.player.finished
    running = Run()
    running.drive(1)
    assert not running.player.play_next() and numbers(running.drive(0)) == []


def test_after_single_messages_the_rest_keeps_its_distance():
    run = Run(paused=True)
    run.drive(1)
    for _ in range(6):
        run.player.play_next()
        run.drive(1)
    run.player.resume(run.now)
    resumed = round((run.now - 100.0) * 1e3)
    taken = run.drive(40)
    assert numbers(taken) == [6, 7] and clocks(taken) == [20, 30, 40]
    assert taken[-1][0] - resumed == pytest.approx(40 - 10, abs=1)


@pytest.mark.parametrize("paused", [False, True])
def test_a_jump_goes_on_at_its_time_with_the_clock_and_what_holds_there(paused):
    run = Run(early=[2])
    run.drive(45)
    assert run.player.finished
    for target, rest in ((10, [2, 3, 4, 5, 6, 7]), (1, [2, 3, 4, 5, 6, 7]), (24, [2, 6, 7])):
        run.player.paused = paused
        run.player.seek(T0 + target * MS)
        assert run.player.clock == T0 + target * MS and not run.player.finished
        taken = run.drive(2)
        assert taken[0][1:] == (CLOCK, target)
        run.player.resume(run.now)
        begun = round((run.now - 100.0) * 1e3)
        taken += run.drive(45)
        assert numbers(taken) == rest
        assert taken[-1][0] - begun == pytest.approx(40 - target - (0 if paused else 3), abs=1)
    assert run.player.passes == 1


def test_after_a_jump_in_a_loop_the_next_pass_begins_where_the_first_did():
    run = Run(loop=True, first=T0 + 3 * MS)
    run.drive(1)
    run.player.seek(T0 + 24 * MS)
    assert numbers(run.drive(16 + 10 + 21))[:6] == [6, 7, 2, 3, 4, 5] and run.player.passes == 2


def test_a_part_is_played_from_its_first_time_to_before_its_end():
    run = Run(paused=True)
    run.drive(1)
    run.player.play(T0 + 10 * MS, T0 + 24 * MS, run.now)
    assert numbers(run.drive(60)) == [3, 4, 5] and run.player.finished and not run.player.paused


def test_another_rate_counts_from_where_the_replay_is():
    run = Run(rate=0.5)
    run.drive(8)  # 4 ms of the recording
    run.player.rate = 2.0
    changed = round((run.now - 100.0) * 1e3)
    taken = run.drive(30)
    assert numbers(taken) == [3, 4, 5, 6, 7]
    assert taken[-1][0] - changed == pytest.approx((40 - 4) / 2, abs=1)
    run.player.seek(T0)
    run.player.rate = math.inf
    assert numbers(run.drive(0)) == list(range(8))


def test_a_loop_repeats_the_pass_one_clock_period_later_and_the_clock_jumps_back():
    run = Run(loop=True, first=T0 + 10 * MS, early=[0])
    taken = run.drive(2 * 40 + 5)
    one = [0, 3, 4, 5, 6, 7]
    assert numbers(taken) == one + one + [0, 3, 4, 5]
    assert clocks(taken) == [10, 20, 30, 40, 10, 20, 30, 40, 10]
    assert [wall for wall, number, _ in taken if number == 0] == [0, 40, 80]
    assert not run.player.finished and run.player.passes == 3


def test_single_messages_go_on_into_the_next_pass():
    run = Run(loop=True, paused=True)
    run.drive(1)
    for _ in range(10):
        run.player.play_next()
    assert numbers(run.drive(1)) == [0, 1, 2, 3, 4, 5, 6, 7, 0, 1]


def test_a_stall_is_not_made_up_for_and_is_told():
    times = [T0 + ms * MS for ms in range(3000)]
    player = Player(Played(recorded(times), T0, times[-1] + 1))
    player.take(0.0)
    burst = player.take(2.0)
    assert max(time for _, time in burst) == T0 + round(STRIDE * 1e3) * MS
    assert player.behind == pytest.approx(2.0 - STRIDE)
    assert [number for number, _ in player.take(2.0015) if number != CLOCK] == [51]


@pytest.mark.parametrize("loop", [False, True])
def test_a_hole_in_time_is_jumped_over_and_takes_one_clock_period(loop):
    far = 20_000 * 86_400 * 1000 * MS
    times = [T0, T0 + 3 * MS, T0 + far, T0 + far + 20 * MS]
    player = Player(Played(recorded(times), T0, times[-1] + 1), period=10 * MS, loop=loop, hole=86_400 * 1000 * MS)
    taken = []
    for wall in range(100):
        due = player.take(wall * STEP)
        taken += [(wall, number, time) for number, time in due]
        assert not due or player.lateness(due[-1][1], wall * STEP) < 0.002, "what came before the hole is not late by it"
    messages = [(wall, number) for wall, number, _ in taken if number is not CLOCK]
    expected = [(0, 0), (3, 1), (13, 2), (33, 3), *([(43, 0), (46, 1), (56, 2), (76, 3), (86, 0), (89, 1)] if loop else ())]
    assert [number for _, number in messages[: len(expected)]] == [number for _, number in expected]
    assert loop or len(messages) == len(expected)
    assert all(abs(wall - due) <= 1 for (wall, _), (due, _) in zip(messages, expected))
    assert len(taken) < 40, "the clock is not published through the hole"
    seeking = Player(Played(recorded(times), T0, times[-1] + 1), period=10 * MS, hole=86_400 * 1000 * MS)
    seeking.seek(T0 + far // 2)
    assert [number for wall in range(20) for number, _ in seeking.take(wall * STEP) if number is not CLOCK] == [2]


def test_lateness_counts_from_when_a_message_was_due():
    player = Player(Played(recorded(TIMES), T0, END), rate=2.0)
    player.take(50.0)
    player.take(50.004)  # recorded time 8 ms: message 2 at 3 ms was due at 1.5 ms
    assert player.lateness(TIMES[2], 50.005) == pytest.approx(0.005 - 0.0015)


def test_wait_tells_when_the_next_thing_is_due():
    player = Player(Played(recorded(TIMES), T0, END), rate=0.5)
    assert player.wait(0.0) == 0.0
    player.take(0.0)
    assert player.wait(0.0) == pytest.approx(0.006)
    assert player.wait(0.004) == pytest.approx(0.002)
    assert player.wait(0.5) == 0.0


def test_the_timeline_of_a_bag_is_by_time_and_within_a_time_as_written(tmp_path, messages, write_run):
    write_run(tmp_path)
    written = sorted(((ns, topic, data) for topic, ns, data in messages(0.35)), key=lambda row: row[0])
    assert Bag(tmp_path).timeline() == written
    some = ["/rig/state", "/controller/command"]
    assert Bag(tmp_path).timeline(some) == [row for row in written if row[1] in some]


def test_profiles_of_every_rosbag2_are_read():
    recorded = offered_by(profile_text("command"))
    assert recorded.reliable and not recorded.latched and recorded.deadline_ns == 100_000_000
    assert offered_by(profile_text("latched")).latched
    numbers_of_humble = (
        "- history: 1\n  depth: 10\n  reliability: 2\n  durability: 1\n  deadline:\n    sec: 9223372036\n    nsec: 854775807\n"
    )
    old = offered_by(numbers_of_humble)
    assert not old.reliable and old.latched and old.deadline_ns == 0
    assert offered_by(numbers_of_humble + profile_text("measurement")).reliable
    assert offered_by("").reliable and not offered_by("").latched
    for text in (
        "best effort, please",
        "- 7",
        "x" * 30_000,
        "[" * 200,
        '- {depth: !!int ""}',
        "- {deadline: {sec: 0, nsec: !!int ''}}",
    ):
        assert offered_by(text).problem and offered_by(text).reliable, "what cannot be read is a fault of no message"
    partial = offered_by("- reliability: best_effort\n")
    assert not partial.reliable and partial.problem == "it gives no durability"
    assert offered_by(profile_text("latched").replace("\n", "\\n")).latched, "ends of lines may be escaped"


def test_recorded_profiles_are_written_in_words_and_what_is_missing_is_the_default():
    for qos in PROFILES:
        assert profiles_of_today(profile_text(qos)) == profile_text(qos)
    assert profiles_of_today("") == "[]\n"
    numbers = "- {history: 2, depth: 3, reliability: 2, durability: 1, deadline: {sec: 1, nsec: 5}, liveliness: 3}\n"
    (read,) = YAML(typ="safe").load(profiles_of_today(numbers))
    assert read == {
        "history": "keep_all",
        "depth": 3,
        "reliability": "best_effort",
        "durability": "transient_local",
        "deadline": {"sec": 1, "nsec": 5},
        "lifespan": FOREVER,
        "liveliness": "manual_by_topic",
        "liveliness_lease_duration": FOREVER,
        "avoid_ros_namespace_conventions": False,
    }
    for text in ("best effort, please", "- {history: 9}", "- {depth: -1}", "- {reliability: [1]}"):
        assert profiles_of_today(text) == profile_text("measurement"), text
