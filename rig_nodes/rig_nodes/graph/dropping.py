# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A message dropped on purpose, so that a test can see that a loss is counted; used by `rig run` and the container."""

from __future__ import annotations

from ..catalogue import Catalogue
from ..errors import RigError


def parse_drop(text: str | None, known: Catalogue) -> tuple[str, int] | None:
    """("topic", sequence number) of ``TOPIC:N``; RigError when it is not that. known: the catalogue of the rig."""
    if text is None:
        return None
    topic, _, number = text.rpartition(":")
    if topic not in known.all_topics or not number.isdecimal():
        raise RigError(f"--drop {text}: expected a topic of the catalogue and a number, like /rig/state:100")
    return topic, int(number)
