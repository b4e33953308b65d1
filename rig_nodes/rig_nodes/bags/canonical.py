# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The canonical hash of a bag of any length, which is read piece by piece; re-runs use it."""

from __future__ import annotations

import hashlib
import struct
from pathlib import Path

from .opened import OpenedBags
from .pieces import PIECE
from .reader import Bag


def canonical_hash(source: Path | str) -> dict[str, str]:
    """Return what Bag.canonical_hash does.

    Parameters
    ----------
    source : Path or str
        The run's folder or its .mcap file.

    Returns
    -------
    dict of str to str
        Hexadecimal digest by topic, and of all topics under ``all``.

    Raises
    ------
    BagError
        When the bag is damaged or missing.
    """
    digests, counts, newest, mixed = {}, dict[str, int](), dict[str, int](), set[str]()
    for piece in Bag.pieces(source, PIECE):
        for topic, ros_type in piece.types.items():
            digest = digests.setdefault(topic, hashlib.sha256(f"{topic} {ros_type}\n".encode()))
            for seq, stamp, data in piece.entries(topic, counts.get(topic, 0)):
                if seq < newest.get(topic, 0):
                    mixed.add(topic)
                newest[topic] = seq
                digest.update(struct.pack("<QqQ", seq, stamp, len(data)) + data)
            counts[topic] = counts.get(topic, 0) + piece.counts[topic]
    hashes = {topic: digests[topic].hexdigest() for topic in sorted(digests)}
    if mixed:  # messages of later pieces belong before those of earlier ones
        with OpenedBags([source]) as opened:
            hashes |= {topic: opened.bag([topic]).canonical_hash([topic])[topic] for topic in mixed}
    text = "".join(f"{topic} {value}\n" for topic, value in hashes.items())
    return {**hashes, "all": hashlib.sha256(text.encode()).hexdigest()}
