# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Reader of rosbag2's sqlite3 files: it writes their content into an MCAP file, which bags.index reads; bags.opened uses it.

The tables are those of all versions of rosbag2: topics, messages and, since Iron, message_definitions.
"""

from __future__ import annotations

import sqlite3
from collections import Counter
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

from ..base import BagError, RigError
from .definitions import installed
from .metadata import OFFERED
from .writer import BagWriter, MessageRefused

_TOPIC = ("id", "name", "type", "serialization_format", OFFERED, "type_description_hash")


def from_sqlite(file: Path, folder: Path) -> tuple[Path, list[str]]:
    """Write what an sqlite3 file holds into an MCAP file.

    A topic whose type has no definition, neither in the file nor installed, is written without one; its messages stay bytes.

    Parameters
    ----------
    file : Path
        The sqlite3 file, which is only read.
    folder : Path
        Folder of the MCAP file.

    Returns
    -------
    path : Path
        The MCAP file.
    faults : list of str
        One sentence for each fault: rows that cannot be read, messages that cannot be stored.

    Raises
    ------
    BagError
        When it is no sqlite3 bag.
    """
    faults: list[str] = []
    try:
        # a file beside it holds what a killed recorder had not moved into the table; without one nothing is written beside it
        still = "" if file.with_name(f"{file.name}-wal").exists() else "&immutable=1"
        with closing(sqlite3.connect(f"{file.absolute().as_uri()}?mode=ro{still}", uri=True)) as store:
            store.text_factory = lambda data: data.decode("utf-8", "surrogateescape")
            topics, definitions = _topics(store), _definitions(store)
            with BagWriter(folder, file.stem, topics={}, library="rosbag2 sqlite3") as writer:
                for topic in topics.values():
                    _describe(writer, topic, definitions)
                faults += _copy(store, writer, {number: (topic["name"], topic["type"]) for number, topic in topics.items()})
    except (sqlite3.Error, KeyError, ValueError) as error:
        if "malformed" in str(error):
            raise BagError(
                f"{file}: is cut or damaged ({error}); fetch it again, or save what is left with sqlite3's .recover"
            ) from None
        raise BagError(
            f"{file}: cannot be read as an sqlite3 bag ({type(error).__name__}: {error}); expected one of "
            "`ros2 bag record -s sqlite3`"
        ) from None
    return writer.path, faults


def _topics(store: sqlite3.Connection) -> dict[int, dict[str, str]]:
    """Return the topics by their numbers; columns that a version does not have are empty."""
    there = [row[1] for row in store.execute("PRAGMA table_info(topics)")]
    columns = [name for name in _TOPIC if name in there]
    rows = (dict(zip(columns, row)) for row in store.execute(f"SELECT {', '.join(columns)} FROM topics ORDER BY id"))
    return {row["id"]: {name: str(row.get(name) or "") for name in _TOPIC} for row in rows}


def _definitions(store: sqlite3.Connection) -> dict[str, str]:
    """Return the definitions in the file by type; none for a version that stores none."""
    if not store.execute("SELECT 1 FROM sqlite_master WHERE type = 'table' AND name = 'message_definitions'").fetchone():
        return {}
    rows = store.execute("SELECT topic_type, encoding, encoded_message_definition FROM message_definitions")
    return {ros_type: text for ros_type, encoding, text in rows if encoding == "ros2msg" and text}


def _describe(writer: BagWriter, topic: dict[str, str], definitions: dict[str, str]) -> None:
    ros_type, text = topic["type"], definitions.get(topic["type"], "")
    try:
        text = text or installed(ros_type).text
    except RigError:
        pass  # its messages are passed through as bytes
    about = {OFFERED: topic[OFFERED], "topic_type_hash": topic["type_description_hash"]}
    encoding = f"{topic['serialization_format'] or 'cdr'}/{'ros2msg' if text else ''}"
    writer.describe(topic["name"], ros_type, encoding, text, about)


def _rows(store: sqlite3.Connection, refused: Counter[str]) -> Iterator[tuple]:
    """Yield topic, time and data of all messages in order of time; count in ``refused`` those that cannot be read."""
    done = 0
    try:
        for row in store.execute("SELECT topic_id, timestamp, data FROM messages ORDER BY timestamp, id"):
            yield row
            done += 1
        return
    except sqlite3.DatabaseError:
        pass  # a page is damaged: the rest is read message by message, as far as the index of times reaches
    for place, (message,) in enumerate(store.execute("SELECT id FROM messages ORDER BY timestamp, id").fetchall()):
        if place < done:
            continue
        try:
            row = store.execute("SELECT topic_id, timestamp, data FROM messages WHERE id = ?", (message,)).fetchone()
        except sqlite3.DatabaseError:
            row = None
        if row is None:
            refused["unknown topics"] += 1
        else:
            yield row


def _copy(store: sqlite3.Connection, writer: BagWriter, topics: dict[int, tuple[str, str]]) -> list[str]:
    """Write all messages; return the faults met."""
    refused: Counter[str] = Counter()
    faults = []
    try:
        for number, time, data in _rows(store, refused):
            if number not in topics or not isinstance(data, bytes) or not isinstance(time, int):
                refused[topics[number][0] if number in topics else f"topic {number}, which is not described"] += 1
                continue
            name, ros_type = topics[number]
            try:
                writer.write(name, ros_type, data, time)
            except MessageRefused:
                refused[name] += 1
    except sqlite3.Error as error:
        faults.append(f"its messages cannot be read to the end ({error})")
    return [*faults, *(f"{count} messages of {name} cannot be read" for name, count in refused.items())]
