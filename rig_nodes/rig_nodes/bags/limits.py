# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Limits on what a bag may demand of its reader; anything beyond them is refused before it is built in memory.

The writer keeps to the same limits. Real bags stay far below: the project's bags have chunks of 4 MiB, 60 topics and definitions
of 2 kB.
"""

from __future__ import annotations

MIB = 1 << 20
CHUNK = 256 * MIB  # bytes of an unpacked chunk; a message that is too large for it is refused by the writer
EXPANSION = 200  # unpacked bytes per byte of the file, beyond UNPACKED; a chunk that packs better is written as it is
UNPACKED = 64 * MIB
DESCRIPTIONS = 10_000  # channels, and message definitions
RECORD = MIB  # bytes of the description of a channel or of a message definition
TEXTS = 32 * MIB  # bytes of all message definitions
LAST = 2**31 * 1_000_000_000 - 1  # ns; the seconds of ROS times are int32

LINES, LINE = 2_000, 4_000  # lines of a message definition without comments; characters of a line
FIELDS, DEPTH = 2_000, 32  # of a message with everything it contains; each message of an array counts separately
LISTS = MIB  # bytes of a message with sequences of messages or texts; for others only the limit of a chunk holds
JSON, JSON_DEPTH = 8 * MIB, 32  # bytes; nesting levels of lists and objects
YAML = MIB // 2  # bytes of metadata.yaml, 20 times the size of the project's
LISTED = 500  # entries of each section of a rig, such as bodies or devices
PROFILES = 20_000  # characters of a topic's quality of service, enough for 50 publishers
FILLED = 1 << 28  # values of missing rows of a logger that are filled, 2 GB; half an hour of a run with a pause


def deeper(value: object, levels: int) -> bool:
    """Return True when lists and objects of JSON are nested deeper than ``levels``."""
    if not isinstance(value, (dict, list)):
        return False
    items = value.values() if isinstance(value, dict) else value
    return levels == 0 or any(deeper(item, levels - 1) for item in items)
