# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A message dropped on purpose, so that a test can check that a loss is counted; `rig run` and the container use it."""

from __future__ import annotations

from ...base import RigError
from ...rig import Catalogue


def parse_drop(text: str | None, known: Catalogue) -> tuple[str, int] | None:
    """Return ("topic", sequence number) of ``TOPIC:N``.

    Parameters
    ----------
    text : str or None
        The option's text; None drops nothing.
    known : Catalogue
        The rig's catalogue.

    Returns
    -------
    tuple or None
        The topic and the number.

    Raises
    ------
    RigError
        When the text is not of this form or the topic is unknown.
    """
    if text is None:
        return None
    topic, _, number = text.rpartition(":")
    if topic not in known.all_topics or not number.isdecimal():
        raise RigError(f"--drop {text}: expected a topic of the catalogue and a number, like /rig/state:100")
    return topic, int(number)
