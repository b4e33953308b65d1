# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""What is missing of a run, in words, from the ``run`` part of its report; `rig run` and `rig report` say it."""

from __future__ import annotations

from ..base import printable

NAMED = 4  # topics that a sentence names


def what_was_lost(run: dict) -> str:
    """Return one sentence on what is missing of a run, from the ``run`` part of its report; empty when nothing is."""
    losses = []
    if run.get("lost"):
        topics = _object(run, "lost_by_topic")
        losses.append(f"{run['lost']} messages did not reach the bag{f': {_named(topics)}' if topics else ''}")
    if unreadable := _object(run, "unreadable"):
        losses.append(f"{sum(unreadable.values())} messages could not be stored: {_named(unreadable)}")
    if unrecorded := _object(run, "unrecorded_topics"):
        named = [f"{topic}: {why}" for topic, why in list(unrecorded.items())[:NAMED]]
        more = f"; and {len(unrecorded) - NAMED} topics more" if len(unrecorded) > NAMED else ""
        losses.append(f"not recorded in full (--exclude leaves a topic out): {'; '.join(named)}{more}")
    if isinstance(clocks := run.get("other_clocks"), list) and clocks:
        losses += map(printable, clocks)
    if run.get("recovered"):
        losses.append(f"the bag is damaged: {run['recovered']}")
    if (behind := _object(run, "behind")).get("times"):
        times = "once" if behind["times"] == 1 else f"{behind['times']} times"
        losses.append(
            f"the rig fell behind real time by more than {1e3 * behind['limit_s']:g} ms {times}, by up to "
            f"{behind['longest_s']:.2f} s"
        )
    return "; ".join(losses)


def _object(run: dict, key: str) -> dict:
    """Return an object in a report; an empty one where others have written something else in its place."""
    value = run.get(key)
    return value if isinstance(value, dict) else {}


def _named(counts: dict[str, int]) -> str:
    """Name the topics that lost most, and give the number of the others."""
    most = sorted(counts.items(), key=lambda item: -item[1])
    more = f" and {len(most) - NAMED} topics more" if len(most) > NAMED else ""
    return ", ".join(f"{topic} {count}" for topic, count in most[:NAMED]) + more
