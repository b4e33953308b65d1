# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The facts that a run over ROS leaves in addition to its bag: counts, lateness, cost, and whether anything was lost.

`rig run`, `rig report` and the tests use it once all processes have ended.
"""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Protocol

from ...bags import LIBRARY_OF_RUN, OFFERED, Bag, BagWriter, OpenedBags, files_of_run, offered_by, profiles_of_today, read_metadata
from ...base import RigError
from ...rig import Topic, catalogue, installed_topics
from ...runs import FOLLOWING
from .recording_options import SECOND_CLOCK
from .supervisor import MODULES, End, processes_of

RUN_INFO = "rig_msgs/msg/RunInfo"
COST = {"cpu_s", "wall_s", "max_rss_mb"}  # what each process writes beside its own facts


class RecordedRun(Protocol):
    """What is asked of a run's bag: a Bag in memory, or what was gathered of its pieces."""

    recovered: str

    def gaps(self) -> dict[str, int]:
        """As Bag.gaps."""

    def gap_of_last_life(self, topic: str) -> int:
        """As Bag.gap_of_last_life."""

    def distinct(self, topic: str, last_life: bool = False) -> int:
        """As Bag.distinct."""

    def run_info(self) -> dict:
        """As Bag.run_info."""

    def events(self) -> list[tuple[float, str, str, str, float]]:
        """As Bag.events."""


def facts_of(folder: Path) -> dict[str, dict]:
    """Return what each process wrote about itself at its end, by its name; killed processes and files cut off are missing."""
    facts = {}
    for name in MODULES:
        with suppress(OSError, ValueError, RecursionError):
            fact = json.loads((folder / "logs" / f"{name}.json").read_text(encoding="utf-8"))
            if isinstance(fact, dict) and fact.keys() >= COST:
                facts[name] = fact
    return facts


def join_pieces(folder: Path) -> None:
    """Make one bag of the pieces that killed and restarted recorders left.

    It does nothing with one piece, with those that metadata.yaml lists, as a recorder that was not killed leaves them, and in a
    folder that takes no more files, which are read as they are. The pieces are removed when the whole bag is written. What was lost
    between them stays lost and is counted as lost.
    """
    # <name>_0.mcap, <name>_1.mcap, ...
    try:
        pieces = files_of_run(folder)
    except RigError:
        return  # no bag at all, which open_bag reports
    if len(pieces) < 2 or {piece.name for piece in pieces} <= set(_listed(folder)) or not os.access(folder, os.W_OK):
        return
    joined = folder / "joined"
    sent: set[tuple[str, bytes]] = set()  # messages on latched topics
    with OpenedBags(pieces[:1]) as first:
        of_rig = first.bag([topic for topic, ros_type in first.types.items() if ros_type == RUN_INFO]).catalogue.all_topics
    with BagWriter(joined, pieces[0].stem.rpartition("_")[0], topics=of_rig, library=LIBRARY_OF_RUN) as writer:
        end: dict[str, str] = {}
        for piece in pieces:
            with OpenedBags([piece]) as bag:
                end = bag.pieces[-1].end
                offered = {topic: profiles_of_today(bag.channel(topic)[2].get(OFFERED, "")) for topic in bag.types}
                latched = {topic for topic, profiles in offered.items() if offered_by(profiles).latched}
                for time, (topic, data) in bag.timeline(bag.types):
                    # a latched message that was sent again to a later subscriber is already there
                    if topic in latched:
                        if (topic, data) in sent:
                            continue
                        sent.add((topic, data))
                    writer.write(topic, bag.types[topic], data, time, offered[topic])
        if end:
            writer.end(**end)
    for piece in pieces:
        piece.unlink()
    for path in joined.iterdir():
        os.replace(path, folder / path.name)
    joined.rmdir()


def _listed(folder: Path) -> list[str]:
    """Return the files that metadata.yaml lists; none when it cannot be read."""
    try:
        return read_metadata(folder).files
    except RigError:
        return []


def end_of(facts: dict[str, dict], shifts: bool) -> End:
    """Return how a run without a supervisor ended, from what its processes left.

    Parameters
    ----------
    facts : dict of str to dict
        What :func:`facts_of` returned.
    shifts : bool
        Whether the rig has a shift controller.

    Returns
    -------
    End
        State and reason.
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
    if container["interrupted"]:
        return End("interrupted", container["reason"])
    return (
        End("tripped", container["reason"], trip=container["trip"])
        if container["trip"] not in FOLLOWING
        else End("failed", container["reason"])
    )


def open_bag(folder: Path) -> Bag:
    """Return the bag of a run; when the recorder was killed, the part of it that is whole."""
    return Bag(folder, recover=True)


def lost_messages(bag: RecordedRun, facts: dict[str, dict]) -> dict[str, int]:
    """Return the number of messages that were published but are not in the bag, by topic; topics without losses are left out.

    What the recorder left out on purpose (pauses, the time before the kept seconds, topics that were not chosen) is not lost.

    The counts of a killed process are unknown; there the gaps in the sequence numbers count. For topics outside the
    catalogue the number of sent messages is unknown; there only the messages count that reached the recorder and found its
    queue full.
    """
    published: dict[str, int] = {}
    for fact in facts.values():
        if "published" in fact:
            published.update(fact["published"])
    own = _topics_of(bag)
    lost = {topic: count for topic, count in bag.gaps().items() if topic in own}
    for topic, count in published.items():
        # for a process that was started again, the count is that of its last life
        missing = count - bag.distinct(topic, last_life=True)
        whole = lost.get(topic, 0) - bag.gap_of_last_life(topic) + max(0, missing)
        if whole:
            lost[topic] = whole
        else:
            lost.pop(topic, None)
    for topic, count in facts.get("recorder", {}).get("left_out", {}).items():
        lost[topic] = max(0, lost.get(topic, 0) - count)
    lost = {topic: count for topic, count in lost.items() if count}
    overflow = facts.get("recorder", {}).get("overflow", {})
    return lost | {topic: count for topic, count in overflow.items() if topic not in own}


def _topics_of(bag: RecordedRun) -> dict[str, Topic]:
    """Return the topics of a bag's rig; when the bag does not name its rig, those of all installed rigs."""
    try:
        return catalogue(bag.run_info()["configuration"]).all_topics
    except (RigError, KeyError, TypeError, ValueError):
        return installed_topics()


def run_part(bag: RecordedRun, folder: Path, record: dict, end: End, restarts: Sequence[dict] = ()) -> dict:
    """Return the ``run`` part of the report.

    Parameters
    ----------
    bag : RecordedRun
        The run's bag.
    folder : Path
        The run's folder.
    record : dict
        The bag's own record of how it was made.
    end : End
        How the run ended.
    restarts : sequence of dict
        The supervisor's list of restarted processes.

    Returns
    -------
    dict
        Plain data.
    """
    facts = facts_of(folder)
    container = facts.get("container", {})
    clocks = [text for *_, name, text, _ in bag.events() if name == SECOND_CLOCK]  # all that a killed container leaves
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
        "other_clocks": container.get("other_clocks", clocks),
        "left_out": facts.get("recorder", {}).get("left_out", {}),
        "stamps_ahead": facts.get("recorder", {}).get("ahead", {}),
        "ticks": container.get("ticks"),
        "overruns": container.get("overruns"),
        "lateness_ms": container.get("lateness_ms"),
        "behind": container.get("behind"),
        "speed_factor": container.get("speed_factor"),
        "real_time_priority": container.get("real_time_priority"),
        "processes": processes,
        "restarts": [{key: restart[key] for key in ("process", "how", "t")} for restart in restarts],
        "end": end.plain(),
    }
    if bag.recovered:
        run["recovered"] = bag.recovered
    return run
