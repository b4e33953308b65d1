# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""How much of anything a bag may ask of its reader: what goes beyond is refused before it is made.

Real bags stay far below: ours have chunks of 4 MiB, 60 topics and definitions of 2 kB.
"""

from __future__ import annotations

MIB = 1 << 20
CHUNK = 64 * MIB  # bytes of a chunk, unpacked; so also of a message
EXPANSION = 200  # bytes unpacked for each byte of the file, beyond one chunk; zstd makes 4 of ours
DESCRIPTIONS = 10_000  # of channels, and of message definitions
RECORD = MIB  # bytes of the description of a channel or of a message definition
TEXTS = 32 * MIB  # bytes of all message definitions
LAST = 2**31 * 1_000_000_000 - 1  # ns; the seconds of ROS times are int32

LINES, LINE = 2_000, 4_000  # of a message definition, comments apart; characters of one
FIELDS, DEPTH = 2_000, 32  # of a message with all that it contains, each of an array of messages for itself
LISTS = MIB  # bytes of a message that holds sequences of messages or texts; others are only held to a chunk
JSON, JSON_DEPTH = 8 * MIB, 32  # bytes; lists and objects within each other
YAML = MIB // 2  # bytes of metadata.yaml, 20 of ours
LISTED = 500  # bodies, devices and the like of a rig, of each
PROFILES = 20_000  # characters of the quality of service of a topic: 50 publishers


def deeper(value: object, levels: int) -> bool:
    """Lists and objects of JSON go deeper within each other than so many levels."""
    if not isinstance(value, (dict, list)):
        return False
    items = value.values() if isinstance(value, dict) else value
    return levels == 0 or any(deeper(item, levels - 1) for item in items)
