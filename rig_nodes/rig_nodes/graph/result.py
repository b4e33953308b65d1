# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a run over ROS leaves beside its bag: counts, lateness, cost, and whether anything was lost.

Used by `rig run`, `rig report` and the tests once all processes have ended.
"""

from __future__ import annotations

import json
import os
from pathlib import Path

from ..bags.metadata import read_profile
from ..bags.reader import Bag
from ..bags.writer import BagWriter
from ..catalogue import Topic, catalogue, installed_topics
from ..errors import RigError
from .supervisor import MODULES, End, processes_of

NAMED = 4  # topics of a sentence


def facts_of(folder: Path) -> dict[str, dict]:
    """What each process wrote about itself at its end, by name; killed ones are missing."""
    facts = {}
    for name in MODULES:
        path = folder / "logs" / f"{name}.json"
        if path.is_file():
            facts[name] = json.loads(path.read_text(encoding="utf-8"))
    return facts


def join_pieces(folder: Path) -> None:
    """One bag of the pieces that recorders left which were killed and started again; nothing to do with one piece.

    The pieces are removed when the whole is written. What was lost in between stays lost and is counted as such.
    """
    # <name>_0.mcap, <name>_1.mcap, ...
    pieces = sorted(folder.glob("*.mcap"), key=lambda path: (len(path.name), path.name))
    if len(pieces) < 2:
        return
    joined = folder / "joined"
    sent: set[tuple[str, bytes]] = set()  # on latched topics
    of_rig = Bag(pieces[0], recover=True).catalogue.all_topics
    with BagWriter(joined, pieces[0].stem.rpartition("_")[0], topics=of_rig) as writer:
        for piece in pieces:
            bag = Bag(piece, recover=True)
            classes = {topic: _class_of(bag, topic) for topic in bag.counts}
            for time, topic, data in bag.timeline():
                # what is sent again to whoever comes later is already there
                if classes[topic] == "latched":
                    if (topic, data) in sent:
                        continue
                    sent.add((topic, data))
                writer.write(topic, bag.types[topic], data, time, classes[topic])
    for piece in pieces:
        piece.unlink()
    for path in joined.iterdir():
        os.replace(path, folder / path.name)
    joined.rmdir()


def _class_of(bag: Bag, topic: str) -> str:
    """Class of catalogue.QOS in which a topic of a bag was offered."""
    offered = read_profile(bag.channel(topic)[2].get("offered_qos_profiles", ""))
    return "latched" if offered.latched else "measurement" if offered.reliable else "best_effort"


def end_of(facts: dict[str, dict], shifts: bool) -> End:
    """How a run without a supervisor ended, from what its processes left.

    facts: as of :func:`facts_of`; shifts: the rig has a shift controller.
    """
    container, outcome = facts.get("container"), facts.get("sequencer", {}).get("outcome")
    if outcome is not None and not outcome["success"]:
        return End("failed", outcome["text"])
    lost = [name for name in processes_of(shifts) if name not in facts]
    if container is None or lost:
        what = f"{', '.join(lost)} left no counts, as a process that was killed"
        if container and container["reason"]:
            what += f"; safe state: {container['reason']}"
        return End("failed", what)
    if not container["reason"]:
        return End("ended", "the sequence ended" if outcome else "stopped")
    return End("interrupted" if container["interrupted"] else "failed", container["reason"])


def open_bag(folder: Path) -> Bag:
    """The bag of a run, what is whole of it when the recorder was killed."""
    return Bag(folder, recover=True)


def lost_messages(bag: Bag, facts: dict[str, dict]) -> dict[str, int]:
    """Messages published but not in the bag, by topic; topics without any left out.

    The counts of a killed process are unknown: there the gaps in the sequence numbers count. Of topics beyond the
    catalogue nobody knows how many were sent: only those count that reached the recorder and found its queue full.
    """
    published: dict[str, int] = {}
    for fact in facts.values():
        if "published" in fact:
            published.update(fact["published"])
    own = _topics_of(bag)
    lost = {topic: count for topic, count in bag.gaps().items() if topic in own}
    for topic, count in published.items():
        # of a process that was started again, the count is that of its last life
        missing = count - bag.distinct(topic, last_life=True)
        whole = lost.get(topic, 0) - bag.gap_of_last_life(topic) + max(0, missing)
        if whole:
            lost[topic] = whole
        else:
            lost.pop(topic, None)
    overflow = facts.get("recorder", {}).get("overflow", {})
    return lost | {topic: count for topic, count in overflow.items() if topic not in own}


def _topics_of(bag: Bag) -> dict[str, Topic]:
    """The topics of the rig of a bag; where it does not say which that is, of all installed ones."""
    try:
        return catalogue(bag.run_info()["configuration"]).all_topics
    except (RigError, KeyError, TypeError, ValueError):
        return installed_topics()


def what_was_lost(run: dict) -> str:
    """What is missing of a run in one sentence, from the ``run`` part of its report; empty when nothing is."""
    said = []
    if run.get("lost"):
        topics = run.get("lost_by_topic")
        said.append(f"{run['lost']} messages did not reach the bag{f': {_named(topics)}' if topics else ''}")
    if unreadable := run.get("unreadable"):
        said.append(f"{sum(unreadable.values())} messages could not be stored: {_named(unreadable)}")
    if run.get("recovered"):
        said.append(f"the bag is damaged: {run['recovered']}")
    behind = run.get("behind")
    if behind and behind["times"]:
        times = "once" if behind["times"] == 1 else f"{behind['times']} times"
        said.append(
            f"the rig fell behind real time by more than {1e3 * behind['limit_s']:g} ms {times}, by up to "
            f"{behind['longest_s']:.2f} s"
        )
    return "; ".join(said)


def _named(counts: dict[str, int]) -> str:
    """The topics that lost most, the rest as a number."""
    most = sorted(counts.items(), key=lambda item: -item[1])
    more = f" and {len(most) - NAMED} topics more" if len(most) > NAMED else ""
    return ", ".join(f"{topic} {count}" for topic, count in most[:NAMED]) + more


def run_part(bag: Bag, folder: Path, record: dict, end: End, restarts: list[dict] = ()) -> dict:
    """The ``run`` part of the report. record: what the bag itself says about its making; restarts: the supervisor's."""
    facts = facts_of(folder)
    container = facts.get("container", {})
    lost = lost_messages(bag, facts)
    processes = {
        name: {"cpu_percent": 100.0 * fact["cpu_s"] / fact["wall_s"], "max_rss_mb": fact["max_rss_mb"]}
        for name, fact in facts.items()
    }
    controller = facts.get("alfa46", {}).get("controller")
    if controller is not None:
        controller = {**controller, "delay": container.get("delay", 1)}
    run = {
        **record,
        "mode": "run",
        "controller": controller,
        "duration_s": container.get("time_s"),
        "lost": sum(lost.values()),
        "lost_by_topic": lost,
        "refused_commands": container.get("refused"),
        "unreadable": facts.get("recorder", {}).get("unreadable", {}),
        "unrecorded_topics": facts.get("recorder", {}).get("unrecorded", {}),
        "stamps_ahead": facts.get("recorder", {}).get("ahead", {}),
        "ticks": container.get("ticks"),
        "overruns": container.get("overruns"),
        "lateness_ms": container.get("lateness_ms"),
        "behind": container.get("behind"),
        "speed_factor": container.get("speed_factor"),
        "real_time_priority": container.get("real_time_priority"),
        "processes": processes,
        "restarts": [{key: restart[key] for key in ("process", "how", "t")} for restart in restarts],
        "end": {"state": end.state, "reason": end.reason},
    }
    if bag.recovered:
        run["recovered"] = bag.recovered
    return run
