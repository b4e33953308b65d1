# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Sequence numbers of messages: their holes are the messages that a recorder lost, their order is that of sending.

The readers of bags use it. A number counts the messages of a topic from 0, and its high bits the earlier starts of the publisher.
"""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

import numpy as np

from ..base import BagError, RigError
from . import limits

if TYPE_CHECKING:
    from .reader import Bag

MOST_COPIES = 3  # messages with one number that may be copies of one; more are of a sender that does not count
LIFE_BITS = 32  # low bits count messages; the bits above count earlier starts of the publisher


class Numbers:
    """Sequence numbers, first and last stamps of the topics of a bag, gathered piece by piece.

    Numbers that follow each other are kept as one span, so that a long bag takes no more memory than a short one.

    Attributes
    ----------
    firsts : dict of str to int
        First stamp of each topic with counted messages [ns].
    lasts : dict of str to int
        Its latest stamp [ns].
    refused : dict of str to BagError
        Why the numbers of a topic cannot be read; of such a topic neither gaps nor disorder are known.
    """

    def __init__(self) -> None:
        self.firsts: dict[str, int] = {}
        self.lasts: dict[str, int] = {}
        self.refused: dict[str, BagError] = {}
        self._spans: dict[str, list[np.ndarray]] = {}  # rows (first number, number after the last one)
        self._totals, self._back = Counter[str](), Counter[str]()  # messages, and those behind a later one
        self._newest: dict[str, int] = {}

    def add(self, piece: Bag) -> None:
        """Take those of the next piece, or of a whole bag."""
        for topic in piece.counted():
            try:
                stamps, seqs = piece.numbers_of(topic)
            except BagError as error:
                self.refused.setdefault(topic, error)
                continue
            spans, known = _spans_of(seqs), self._spans.setdefault(topic, [])
            if known and known[-1][-1, 1] == spans[0, 0] and spans[0, 0] % (1 << LIFE_BITS):
                known[-1][-1, 1] = spans[0, 1]
                spans = spans[1:]
            if len(spans):
                known.append(spans)
            self.firsts[topic] = min(self.firsts.get(topic, limits.LAST), int(stamps.min()))
            self.lasts[topic] = max(self.lasts.get(topic, 0), int(stamps.max()))
            back = np.count_nonzero(seqs[1:] < seqs[:-1]) + (int(seqs[0]) < self._newest.get(topic, 0))
            self._totals[topic] += len(seqs)
            self._back[topic] += int(back)
            self._newest[topic] = int(seqs[-1])

    def disorder(self, bag: Bag) -> list[str]:
        """Return a sentence for each topic whose messages are there twice or not in the order in which they were sent.

        Only topics that one node of the rig sends can have such a fault: of several senders each has numbers of its own, and
        latched messages are sent again to each new receiver. ``bag`` is one of the pieces, which knows its rig.
        """
        found = []
        for topic in self._understood():
            total, back, held = self._totals[topic], self._back[topic], self.distinct(topic, False) or 0
            twice, same = total - held, held == 1 and total > MOST_COPIES  # a program of others may not count its messages
            if not (twice or back) or same or not has_one_sender(bag, topic):
                continue
            faults = [f"{twice} of {total} messages are there twice"] * bool(twice)
            faults += [f"{back} of {total} messages come behind later ones"] * bool(back)
            found.append(f"{topic}: {' and '.join(faults)}")
        return found

    def gaps(self, begun_late: bool) -> dict[str, int]:
        """Return what Bag.gaps does; ``begun_late`` is True for a bag that begins later than its run."""
        found = {}
        for topic in self._understood():
            lives = self._lives(topic)
            lost = sum(_holes(life) for life in lives) - (int(lives[0][0, 0]) if begun_late else 0)
            if lost:
                found[topic] = lost
        return found

    def gap_of_last_life(self, topic: str) -> int:
        """Return what Bag.gap_of_last_life does; 0 for a topic without counted messages."""
        return _holes(self._lives(topic)[-1]) if topic in self._spans else 0

    def distinct(self, topic: str, last_life: bool) -> int | None:
        """Return what Bag.distinct does; None for a topic without counted messages."""
        if topic not in self._spans:
            return None
        return sum(_held(life) for life in self._lives(topic)[-1 if last_life else 0 :])

    def check(self) -> None:
        """Raise the BagError on the first topic whose numbers cannot be read."""
        for error in self.refused.values():
            raise error

    def _understood(self) -> list[str]:
        return [topic for topic in self._spans if topic not in self.refused]

    def _lives(self, topic: str) -> list[np.ndarray]:
        """Return the spans of each start of a publisher, counted from 0 on, in order and without overlap."""
        spans = np.concatenate(self._spans[topic])
        spans = spans[np.argsort(spans[:, 0], kind="stable")]
        reached = np.maximum.accumulate(spans[:, 1])
        begins = np.concatenate([[True], spans[1:, 0] > reached[:-1]])
        ends = np.concatenate([begins[1:], [True]])
        joined = np.stack([spans[begins, 0], reached[ends]], axis=1)
        life = joined[:, 0] >> LIFE_BITS
        return [joined[life == number] - (number << LIFE_BITS) for number in np.unique(life).tolist()]


def _spans_of(seqs: np.ndarray) -> np.ndarray:
    """Return the spans of numbers that follow each other within one start of the publisher."""
    breaks = (seqs[1:] != seqs[:-1] + 1) | (seqs[1:] & ((1 << LIFE_BITS) - 1) == 0)
    return np.stack([seqs[np.concatenate([[True], breaks])], seqs[np.concatenate([breaks, [True]])] + 1], axis=1)


def _held(spans: np.ndarray) -> int:
    """Count the numbers in spans that do not overlap."""
    return int((spans[:, 1] - spans[:, 0]).sum())


def _holes(spans: np.ndarray) -> int:
    """Count the numbers from 0 to the highest that are in none of the spans."""
    return int(spans[-1, 1]) - _held(spans)


def has_one_sender(bag: Bag, topic: str) -> bool:
    """Return True for a topic that only one node of the bag's rig sends, each message once."""
    try:
        known = bag.catalogue.all_topics.get(topic)
    except RigError:
        return False
    return known is not None and known.qos == "measurement" and not known.node.endswith("_device")


def lives_of(seqs: np.ndarray) -> list[np.ndarray]:
    """Return the sequence numbers of each start of a publisher, from 0 on."""
    life = seqs >> LIFE_BITS
    return [seqs[life == number] & ((1 << LIFE_BITS) - 1) for number in np.unique(life).tolist()]


def holes(seqs: np.ndarray) -> int:
    """Count the numbers from 0 to the highest that are missing."""
    growing = bool(np.all(seqs[1:] > seqs[:-1]))  # as nearly always; sorting out repeated ones takes longer
    return int(seqs.max()) + 1 - (len(seqs) if growing else len(np.unique(seqs)))
