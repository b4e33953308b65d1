# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A rig whose recorder is controlled from another process: paused, split, asked for its last seconds."""

import pytest
from rosbag2_interfaces.srv import IsPaused, Pause, Resume, Snapshot, SplitBagfile
from running_graph import Client, Graph

from rig_nodes.bags.reader import Bag
from rig_nodes.cli.main import main
from rig_nodes.nodes.processes.result import facts_of, lost_messages
from rig_nodes.view.convert import make_view

OPTIONS = ("--start-paused", "--keep-last", "1", "--compression-mode", "file", "--own-topics", "/motor/.*|/instruments/.*|/rig/.*")


def now(states):
    return states[-1].header.stamp.sec + 1e-9 * states[-1].header.stamp.nanosec


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """Folder of a run, and the simulated times at which its recorder was resumed, asked for a snapshot and paused."""
    graph = Graph(tmp_path_factory.mktemp("graph") / "steered", speed=1.0, recording=OPTIONS)
    user = Client(graph.domain)
    try:
        states = user.listen("/rig/state")

        def pass_time(seconds):
            until = now(states) + seconds
            user.until(lambda: now(states) > until, f"{seconds} s of the rig")

        user.until(lambda: states, "a rig")
        assert user.call(IsPaused, "/recorder/is_paused").paused
        user.service(Snapshot, "/recorder/snapshot"), user.service(SplitBagfile, "/recorder/split_bagfile")
        user.call(Resume, "/recorder/resume")
        assert not user.call(IsPaused, "/recorder/is_paused").paused
        resumed = now(states)
        pass_time(1.5)
        assert user.call(Snapshot, "/recorder/snapshot", again=10.0).success
        asked = now(states)
        pass_time(0.5)
        user.call(SplitBagfile, "/recorder/split_bagfile", again=10.0)
        pass_time(1.5)
        user.call(Pause, "/recorder/pause")
        paused = now(states)
        pass_time(0.5)
        assert graph.close().state == "ended" or graph.supervisor.end.reason == "stopped"
        yield graph.folder, resumed, asked, paused
    finally:
        user.close()
        graph.close() if graph.supervisor.end is None else None


def test_what_was_asked_for_is_in_the_bag_and_nothing_is_lost(recorded, capsys):
    folder, resumed, asked, paused = recorded
    bag, facts = Bag(folder), facts_of(folder)
    times = [time * 1e-9 for time, topic, _ in bag.timeline(["/motor/state"])]
    first = [t for t in times if t <= asked + 0.5 and t < paused - 1.2]
    last = times[len(first) :]
    # the bounds allow for the delay of a request on a busy machine
    assert resumed - 0.5 < first[0] and 0.9 < first[-1] - first[0] < 1.1 and abs(first[-1] - asked) < 0.5
    assert 0.9 < last[-1] - last[0] < 1.1 and abs(last[-1] - paused) < 0.5
    assert "/gearbox/state" not in bag.counts and "/instruments/hmg4000" in bag.counts and bag.run_info()
    assert lost_messages(bag, facts) == {}
    left_out = facts["recorder"]["left_out"]
    assert left_out["/motor/state"] + bag.counts["/motor/state"] == facts["container"]["published"]["/motor/state"]
    assert main(["bag", "check", str(folder)]) == 0 and "whole" in capsys.readouterr().out


def test_its_packed_files_are_one_run_to_report_and_view(recorded, capsys):
    folder, *_ = recorded
    assert len(list(folder.glob("*.mcap.zstd"))) == 2 and not list(folder.glob("*.mcap"))
    assert main(["report", str(folder)]) == 0
    assert "messages lost: 0" in capsys.readouterr().out
    assert make_view(folder).path.stat().st_size > 1000
