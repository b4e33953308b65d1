# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Record of the rig that a bag is of, in today's form.

When the bag does not record its rig, the one installed rig that has most of the bag's topics is used. The readers of bags use
this module, and so do reports, which hold a bag's record. Nothing here needs the rig's own folder, which may no longer exist.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from functools import lru_cache

from ..base import installed, with_bases
from . import limits
from .old_form import record_of_today

MOST_NAMED = 5  # topics in an error


def rig_record(configuration: Mapping | None, topics: Collection[str] = ()) -> Mapping:
    """Return the record of a rig, with its structure.

    Parameters
    ----------
    configuration : mapping or None
        The record in a bag or a report, of any age.
    topics : collection of str
        Topics of the bag; they select an installed rig when the record has no structure.

    Returns
    -------
    mapping
        The record in today's form.

    Raises
    ------
    TypeError or ValueError
        When the record is invalid, or there is none and the topics do not tell which rig it is.
    """
    record = record_of_today(configuration or {})
    if "structure" not in record:
        return _installed(_like(frozenset(topics)))
    for name, listed in record["structure"].items():
        if isinstance(listed, (list, tuple)) and len(listed) > limits.LISTED:
            raise ValueError(f"{len(listed)} {name}, more than the {limits.LISTED} that are read")
    return record


def holds_rig(configuration: Mapping | None) -> bool:
    """Return True when a bag's or a report's record has a rig's structure or is in the form of an earlier version."""
    return "structure" in record_of_today(configuration or {})


def _like(topics: frozenset[str]) -> str:
    """Return the installed rig with most of these topics, among equals the one on which the others are based."""
    shared = {name: len(topics & _topics(name)) for name in installed("rigs")}
    like = [name for name, count in shared.items() if count and count == max(shared.values())]
    like = [name for name in like if not any(path.parent.name in like for path, _ in with_bases(name)[1:])]
    if len(like) != 1:
        held = ", ".join(sorted(topics)[:MOST_NAMED]) or "there are none"
        raise ValueError(f"there is none, and its topics ({held}) are those of {', '.join(like) or 'no installed rig'}")
    return like[0]


@lru_cache(maxsize=64)
def _topics(name: str) -> frozenset[str]:
    from ..rig import load_rig  # imported here, because the modules that read a rig depend on bags

    return frozenset(load_rig(name).catalogue.all_topics)


@lru_cache(maxsize=8)
def _installed(name: str) -> Mapping:
    from ..rig import load_rig

    return load_rig(name).as_dict()
