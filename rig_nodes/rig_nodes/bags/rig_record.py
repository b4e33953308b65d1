# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Which rig a bag is of: what its record says, in today's form, or the installed rig that its topics are most like.

Used by the readers of bags, and by reports, which hold a bag's record. Nothing here asks for the rig's own folder, which may
be gone.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from functools import lru_cache

from ..config.names import DEFAULT_RIG, installed
from . import limits
from .old_form import record_of_today


def rig_record(configuration: Mapping | None, topics: Collection[str] = ()) -> Mapping:
    """The record of a rig, with its structure.

    configuration: what a bag or a report says, of any age; topics: of the bag, by which an installed rig is taken where that
    says nothing of its structure. Raises TypeError or ValueError for a record that is none.
    """
    record = record_of_today(configuration or {})
    if "structure" not in record:
        return _installed(_like(frozenset(topics)))
    for name, listed in record["structure"].items():
        if isinstance(listed, (list, tuple)) and len(listed) > limits.LISTED:
            raise ValueError(f"{len(listed)} {name}, more than the {limits.LISTED} that are read")
    return record


def says_rig(configuration: Mapping | None) -> bool:
    """What a bag or a report says has a rig's structure in it, or is of a rig of before."""
    return "structure" in record_of_today(configuration or {})


def _like(topics: frozenset[str]) -> str:
    """The installed rig with most of these topics, the default one among equals."""
    names = [DEFAULT_RIG, *(name for name in installed("rigs") if name != DEFAULT_RIG)]
    return max(names, key=lambda name: len(topics & _topics(name)))


@lru_cache(maxsize=64)
def _topics(name: str) -> frozenset[str]:
    from ..testbench.configuration import load_rig  # here, as all that reads a rig stands above bags

    return frozenset(load_rig(name).catalogue.all_topics)


@lru_cache(maxsize=8)
def _installed(name: str) -> Mapping:
    from ..testbench.configuration import load_rig

    return load_rig(name).as_dict()
