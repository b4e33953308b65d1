# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Heads that tell channels of one name apart, for files with groups; the readers of MDF, MAT and TDMS use it."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import replace

from ..foreign import Channel


def apart(found: Sequence[tuple[Sequence[str], Channel]]) -> list[Channel]:
    """Put the group in front of heads that are there more than once: ``ECU/n_wyj``.

    Parameters
    ----------
    found : sequence of (sequence of str, Channel)
        Channels, each with as many names of its group: the best one first, "" for none, the last one different for every channel.

    Returns
    -------
    list of Channel
        The channels, each with a head of its own.
    """
    same = defaultdict(list)
    for number, (_, channel) in enumerate(found):
        same[channel.head].append(number)
    out = [channel for _, channel in found]
    for numbers in same.values():
        if len(numbers) < 2:
            continue
        kinds = zip(*(found[n][0] for n in numbers))
        names = next(names for names in kinds if all(names) and len(set(names)) == len(names))
        for n, name in zip(numbers, names):
            out[n] = replace(out[n], head=f"{name}/{out[n].head}")
    return out
