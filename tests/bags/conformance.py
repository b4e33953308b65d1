# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The files of MCAP's conformance set, built from what their names say; test_conformance.py uses it.

A name is a content and the features of the file, for example TenMessages-ch-st: chunks and statistics. ``PUBLISHED`` is the
SHA-256 over names and SHA-256s of the published files.
"""

import itertools
import struct
import zlib

from crafted import MAGIC, chunk, record, text

PUBLISHED = "eabcfbf8e6525dd4022cb979a3d1793443a31f427cc163be4ddb98e295cd8d01"
DATA = b"\x01\x02\x03"
BEHIND = b"\x01\xff\xff"  # what the feature "pad" adds to most records
SCHEMA, CHANNEL, MESSAGE, CHUNK, ATTACHMENT, METADATA = 3, 4, 5, 6, 9, 12
MESSAGE_INDEX, CHUNK_INDEX, ATTACHMENT_INDEX, STATISTICS, METADATA_INDEX, SUMMARY_OFFSET = 7, 8, 10, 11, 13, 14
FEATURES = ("ax", "ch", "chx", "mdx", "mx", "pad", "rch", "rsh", "st", "sum")

# content -> schemas, channels, messages as (sequence, log time, publish time), attachments, metadata
FOO = text(text("foo") + text("bar"))
EXAMPLE = struct.pack("<H", 1) + text("Example") + text("c") + text(b"\x04\x05\x06")
OF_EXAMPLE = struct.pack("<HH", 1, 1) + text("example") + text("a") + FOO
TIMES = (0, 2, 1, 3, 3, 5, 4, 7, 8, 9)
CONTENTS = {
    "NoData": ((), (), (), (), ()),
    "OneMessage": ((EXAMPLE,), (OF_EXAMPLE,), ((10, 2, 1),), (), ()),
    "OneSchemalessMessage": ((), (struct.pack("<HH", 1, 0) + text("example") + text("text") + text(b""),), ((10, 2, 1),), (), ()),
    "TenMessages": ((EXAMPLE,), (OF_EXAMPLE,), tuple((n, time, time) for n, time in enumerate(TIMES)), (), ()),
    "OneAttachment": ((), (), (), ("myFile",), ()),
    "OneMetadata": ((), (), (), (), ("myMetadata",)),
}


def names():
    """Returns the names of all files of the set: each content with every set of features that it can have."""
    found = []
    for content, (schemas, channels, messages, attachments, metadata) in CONTENTS.items():
        for count in range(len(FEATURES) + 1):
            for chosen in itertools.combinations(FEATURES, count):
                has = set(chosen)
                possible = (
                    has >= ({"ch"} if has & {"chx", "mx"} else set())
                    and (messages or not has & {"ch", "chx", "mx"})
                    and (schemas or "rsh" not in has)
                    and (channels or "rch" not in has)
                    and (attachments or "ax" not in has)
                    and (metadata or "mdx" not in has)
                    and (has & {"chx", "rsh", "rch", "mdx", "ax", "st"} or "sum" not in has)
                )
                if possible:
                    found.append("-".join([content, *chosen]))
    return found


def built(name):
    """Returns the bytes of a file of the set."""
    content, *features = name.split("-")
    schemas, channels, messages, attachments, metadata = CONTENTS[content]
    behind = BEHIND if "pad" in features else b""

    def put(opcode, body):
        return record(opcode, body + behind)

    within = record if "ch" in features else put  # nothing is added within a chunk
    data = [within(SCHEMA, schema) for schema in schemas] + [within(CHANNEL, channel) for channel in channels]
    entries, at = b"", sum(map(len, data))
    for sequence, log_time, publish_time in messages:
        entries += struct.pack("<QQ", log_time, at)
        data.append(record(MESSAGE, struct.pack("<HIQQ", 1, sequence, log_time, publish_time) + DATA))
        at += len(data[-1])
    times = [log_time for _, log_time, _ in messages] or [0]
    file = MAGIC + put(1, text("") + text(""))
    chunk_indices = []
    if "ch" in features:
        begin, packed = len(file), chunk(b"".join(data), first=min(times), last=max(times))
        file += packed
        offsets, index = b"", b""
        if "mx" in features:
            offsets, index = struct.pack("<HQ", 1, len(file)), put(MESSAGE_INDEX, struct.pack("<H", 1) + text(entries))
        file += index
        place = struct.pack("<QQQQ", min(times), max(times), begin, len(packed)) + text(offsets)
        chunk_indices.append(place + struct.pack("<Q", len(index)) + text("") + struct.pack("<QQ", at, at))
    else:
        file += b"".join(data)
    attachment_indices, metadata_indices = [], []
    for attachment in attachments:
        body = struct.pack("<QQ", 2, 1) + text(attachment) + text("application/octet-stream") + struct.pack("<Q", len(DATA)) + DATA
        whole = put(ATTACHMENT, body + struct.pack("<I", zlib.crc32(body)))
        about = struct.pack("<QQQQQ", len(file), len(whole), 2, 1, len(DATA))
        attachment_indices.append(about + text(attachment) + text("application/octet-stream"))
        file += whole
    for title in metadata:
        whole = put(METADATA, text(title) + FOO)
        metadata_indices.append(struct.pack("<QQ", len(file), len(whole)) + text(title))
        file += whole
    file += record(15, struct.pack("<I", zlib.crc32(file)))
    counts = b"".join(struct.pack("<HQ", 1, len(messages)) for _ in channels)
    statistics = (
        struct.pack("<QHIII", len(messages), len(schemas), len(channels), len(attachments), len(metadata))
        + struct.pack("<IQQ", len(chunk_indices) or int("ch" in features), min(times), max(times))
        + text(counts)
    )
    summary, start, groups = b"", len(file), b""
    for feature, opcode, bodies in (
        ("rsh", SCHEMA, schemas),
        ("rch", CHANNEL, channels),
        ("st", STATISTICS, [statistics]),
        ("mdx", METADATA_INDEX, metadata_indices),
        ("ax", ATTACHMENT_INDEX, attachment_indices),
        ("chx", CHUNK_INDEX, chunk_indices),
    ):
        group = b"".join(put(opcode, body) for body in bodies) if feature in features else b""
        if group:
            groups += put(SUMMARY_OFFSET, struct.pack("<BQQ", opcode, start + len(summary), len(group)))
            summary += group
    offsets_at = start + len(summary) if "sum" in features else 0
    footer = struct.pack("<BQQQ", 2, 20, start if summary else 0, offsets_at)
    summary += groups if "sum" in features else b""
    return file + summary + footer + struct.pack("<I", zlib.crc32(summary + footer)) + MAGIC
