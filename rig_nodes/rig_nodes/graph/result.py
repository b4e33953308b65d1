"""What a run over ROS leaves beside its bag: counts, lateness, cost, and whether anything was lost.

Used by `rig run`, `rig report` and the tests once all processes have ended.
"""

from __future__ import annotations

import json
import os
from pathlib import Path

from ..bags.reader import Bag
from ..bags.writer import BagWriter
from ..catalogue import GEARBOX, catalogue
from .supervisor import MODULES, End, processes_of


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
    # <name>.mcap, <name>-2.mcap, ...
    pieces = sorted(folder.glob("*.mcap"), key=lambda path: (len(path.name), path.name))
    if len(pieces) < 2:
        return
    joined = folder / "joined"
    with BagWriter(joined, pieces[0].stem) as writer:
        for piece in pieces:
            bag = Bag(piece, recover=True)
            for time, topic, data in bag.timeline():
                # what is sent again to whoever comes later is already there
                if piece == pieces[0] or catalogue().all_topics[topic].qos != "latched":
                    writer.write(topic, bag.types[topic], data, time)
    for piece in pieces:
        piece.unlink()
    for path in joined.iterdir():
        os.replace(path, folder / path.name)
    joined.rmdir()


def end_of(facts: dict[str, dict], kind: str = GEARBOX) -> End:
    """How a run without a supervisor ended, from what its processes left. facts: as of :func:`facts_of`; kind: of the rig.
    """
    container, outcome = facts.get("container"), facts.get("sequencer", {}).get("outcome")
    if outcome is not None and not outcome["success"]:
        return End("failed", outcome["text"])
    lost = [name for name in processes_of(kind) if name not in facts]
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

    The counts of a killed process are unknown: there the gaps in the sequence numbers count.
    """
    published: dict[str, int] = {}
    for fact in facts.values():
        if "published" in fact:
            published.update(fact["published"])
    lost = bag.gaps()
    for topic, count in published.items():
        # of a process that was started again, the count is that of its last life
        missing = count - bag.distinct(topic, last_life=True)
        whole = lost.get(topic, 0) - bag.gap_of_last_life(topic) + max(0, missing)
        if whole:
            lost[topic] = whole
        else:
            lost.pop(topic, None)
    return lost


def run_part(bag: Bag, folder: Path, record: dict, end: End, restarts: list[dict] = ()) -> dict:
    """The ``run`` part of the report. record: what the bag itself says about its making; restarts: the supervisor's."""
    facts = facts_of(folder)
    container = facts.get("container", {})
    lost = lost_messages(bag, facts)
    processes = {name: {"cpu_percent": 100.0 * fact["cpu_s"] / fact["wall_s"], "max_rss_mb": fact["max_rss_mb"]}
                 for name, fact in facts.items()}
    controller = facts.get("alfa46", {}).get("controller")
    if controller is not None:
        controller = {**controller, "delay": container.get("delay", 1)}
    run = {**record, "mode": "run", "controller": controller,
           "duration_s": container.get("time_s"), "lost": sum(lost.values()),
           "lost_by_topic": lost, "refused_commands": container.get("refused"),
           "stamps_ahead": facts.get("recorder", {}).get("ahead", {}), "ticks": container.get("ticks"),
           "overruns": container.get("overruns"), "lateness_ms": container.get("lateness_ms"),
           "speed_factor": container.get("speed_factor"), "real_time_priority": container.get("real_time_priority"), "processes": processes,
           "restarts": [{key: restart[key] for key in ("process", "how", "t")} for restart in restarts],
           "end": {"state": end.state, "reason": end.reason}}
    if bag.recovered:
        run["recovered"] = bag.recovered
    return run
