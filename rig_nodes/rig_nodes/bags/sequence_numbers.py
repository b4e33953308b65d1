# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Sequence numbers of messages, whose holes are the messages that a recorder lost; used by bags.reader.

A number counts the messages of a topic from 0, and its high bits the earlier starts of the publisher.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from . import limits

if TYPE_CHECKING:
    from .reader import Bag

LIFE_BITS = 32  # low bits count messages; the bits above count earlier starts of the publisher


class Numbers:
    """Sequence numbers and first stamps of the topics of a bag, gathered piece by piece.

    Attributes
    ----------
    firsts : dict of str to int
        First stamp of each topic with counted messages [ns].
    """

    def __init__(self) -> None:
        self.firsts: dict[str, int] = {}
        self._seqs: dict[str, list[np.ndarray]] = {}

    def add(self, piece: Bag) -> None:
        """Take those of the next piece, or of a whole bag."""
        for topic, stamps, seqs in piece.counted():
            self._seqs.setdefault(topic, []).append(seqs)
            self.firsts[topic] = min(self.firsts.get(topic, limits.LAST), int(stamps.min()))

    def gaps(self, begun_late: bool) -> dict[str, int]:
        """Return what Bag.gaps does; ``begun_late`` is True for a bag that begins later than its run."""
        found = {}
        for topic, seqs in self._seqs.items():
            lives = lives_of(np.concatenate(seqs))
            lost = sum(holes(life) for life in lives) - (int(lives[0].min()) if begun_late else 0)
            if lost:
                found[topic] = lost
        return found


def lives_of(seqs: np.ndarray) -> list[np.ndarray]:
    """Return the sequence numbers of each start of a publisher, from 0 on."""
    life = seqs >> LIFE_BITS
    return [seqs[life == number] & ((1 << LIFE_BITS) - 1) for number in np.unique(life)]


def holes(seqs: np.ndarray) -> int:
    """Count the numbers from 0 to the highest that are missing."""
    growing = bool(np.all(seqs[1:] > seqs[:-1]))  # as nearly always; sorting out repeated ones takes longer
    return int(seqs.max()) + 1 - (len(seqs) if growing else len(np.unique(seqs)))
