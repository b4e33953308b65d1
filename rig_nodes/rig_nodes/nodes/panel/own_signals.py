# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the controller that is plugged in publishes beside its outputs: signals of its own, under names of its own.

nodes.panel.panel uses it. They are no signals of the rig's catalogue, because each controller has others.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from ...bags import cdr
from ...controllers import own_signals
from ...rig import OWN

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from .tracks import Tracks


class OwnSignals:
    """The signals of one controller, none before it has named them.

    Attributes
    ----------
    described : list of dict
        Each signal as the page is told of it; its name begins with OWN, so that it is none of the rig's.
    newest : dict of str to float
        Newest value of each, by that name.
    """

    def __init__(self) -> None:
        self.described: list[dict[str, Any]] = []
        self.newest: dict[str, float] = {}

    def take(self, taken: Mapping[str, list[bytes]], tracks: Tracks) -> bool:
        """Take new messages, and give the tracks the values of those that are shown; return True when the signals are others."""
        named = self._names(taken.get(own_signals.CHANNELS, []))
        tracks.also = {one["name"] for one in self.described}
        for t, rows in self._rows(taken.get(own_signals.BLOCK, [])):
            for one, values in zip(self.described, rows.T):
                known = np.isfinite(values)
                if known.any():
                    tracks.put(one["name"], t[known], values[known])
                    self.newest[one["name"]] = float(values[known][-1])
        return named

    def _names(self, messages: list[bytes]) -> bool:
        try:
            lists = [cdr.decode("rig_msgs/msg/ChannelList", data) for data in messages]
        except ValueError:
            return False
        if not lists:
            return False
        text = "Signal of the controller's own"
        described = [
            {"name": f"{OWN}{name}", "unit": unit, "text": text, "states": {}}
            for name, unit in zip(lists[-1].names, lists[-1].units)
        ]
        changed, self.described = described != self.described, described
        if changed:
            self.newest = {}
        return changed

    def _rows(self, messages: list[bytes]) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """The times (n,) [s] and values (n, signals) of each block that fits the names."""
        for data in messages:
            try:
                block = cdr.decode("rig_msgs/msg/SampleBlock", data)
                rows = np.reshape(block.data, (block.rows, len(self.described)))
            except ValueError:
                continue  # of a user's node, or of names that have not come yet
            if rows.size and math.isfinite(block.period):
                yield cdr.stamp(data) * 1e-9 + block.period * np.arange(block.rows), rows
