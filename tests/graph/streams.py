# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Number and hash of the messages of topics in their order, to compare sent messages with received ones."""

import hashlib

from rig_nodes.bags import cdr
from rig_nodes.bags.definitions import installed


class Streams:
    """Messages per topic, in the order in which they are added; the padding of DDS at their ends is left out."""

    def __init__(self):
        self.total = 0
        self._counts, self._hashes, self._definitions = {}, {}, {}

    def add(self, topic, ros_type, data):
        if topic not in self._counts:
            self._counts[topic], self._hashes[topic] = 0, hashlib.sha256()
            self._definitions[topic] = installed(ros_type)
        data = cdr.exact(self._definitions[topic], data)
        self._hashes[topic].update(len(data).to_bytes(8, "little") + data)
        self._counts[topic] += 1
        self.total += 1

    def found(self):
        """Returns [number, hash] by topic."""
        return {topic: [count, self._hashes[topic].hexdigest()] for topic, count in self._counts.items()}
