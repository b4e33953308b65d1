# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Work on whole bags for `rig bag`: count what is there, hash the content, write a part of it or several bags as one."""

from __future__ import annotations

import hashlib
import heapq
import os
import shutil
import struct
from collections import Counter
from collections.abc import Collection, Iterator
from contextlib import suppress
from dataclasses import dataclass
from itertools import groupby, repeat
from operator import itemgetter
from pathlib import Path

from .. import __version__
from ..base import RigError
from . import limits
from .cdr import stamp_and_seq
from .metadata import OFFERED, offered_by, profiles_of_today
from .opened import RUN_INFO, OpenedBags
from .reader import Bag
from .run_end import CUT_OFF, OF_COPY
from .sequence_numbers import Numbers, has_one_sender
from .writer import BagWriter

# not the name of the recorder: its bags begin and end with their run, these may not
LIBRARY = f"{OF_COPY}{__version__}"
OWN_LIBRARIES = ("rig_nodes ", OF_COPY)  # of the project's bags, in which times of publishing are log times
_PIECE = 16 << 20  # bytes of messages read at once
_MESSAGE = struct.Struct("<QQ")


@dataclass(frozen=True)
class Kept:
    """What was read: messages per topic, messages per topic that are known to be lost, and a sentence per fault.

    ``unread`` is True when something could not be read that may have held messages which nothing counts; ``twice`` is the number of
    messages that a copy does not have because they are there already.
    """

    counts: dict[str, int]
    lost: dict[str, int]
    damage: list[str]
    unread: bool = False
    twice: int = 0

    @property
    def whole(self) -> bool:
        """True when nothing was lost."""
        return not self.lost and not self.damage


def count(bags: OpenedBags) -> Kept:
    """Read every message and return what is there and what is lost."""
    held = Counter(topic for _, (topic, _) in bags.timeline(bags.types))
    return _kept(bags, held)


def check(bags: OpenedBags) -> Kept:
    """Do what :func:`count` does, check what lies outside of the chunks too, and look at sequence numbers and blocks of samples."""
    kept = count(bags)
    lost, damage = Counter(kept.lost), list(kept.damage)
    numbers, whole, false = Numbers(), _of_rig(bags), {}
    refused: dict[str, str] = {}  # by topic, why its numbers cannot be read
    for piece in bags.pieces:
        for part in Bag.pieces(piece.path, _PIECE, recover=True):
            numbers.add(part)
            for topic, fault in part.false_blocks().items():
                false.setdefault(topic, fault)
        for topic, error in numbers.refused.items():  # to those of earlier pieces come those of this one
            refused.setdefault(topic, str(error).removeprefix(f"{piece.path}: "))
        if not piece.damage:
            damage += part.damage
    damage += [*refused.values(), *numbers.disorder(whole), *false.values()]
    # a bag may begin later than its run, unless its recorder counted what it left out; an early end leaves no hole in the numbers
    for topic, holes in numbers.gaps(begun_late=not bags.left_out).items():
        lost[topic] = max(lost[topic], holes - bags.holes[topic])
    return Kept(kept.counts, dict(+lost), damage, kept.unread or bool(refused))


class AsSent:
    """Puts the messages of a rig that have the same log time as they were sent: each once, and in the order of their numbers."""

    def __init__(self, bags: OpenedBags) -> None:
        """Find the topics of the bags' rig; those of others stay as they are."""
        whole = _of_rig(bags)
        try:
            self._known = set(bags.types) & whole.catalogue.all_topics.keys()
        except RigError:
            self._known = set()
        self._numbered = {topic for topic in self._known if has_one_sender(whole, topic) and whole.is_counted(topic)}

    def rows(
        self, timeline: Iterator[tuple[int, tuple[str, bytes]]], twice: Counter[str]
    ) -> Iterator[tuple[int, tuple[str, bytes]]]:
        """Yield the messages of a timeline, as OpenedBags.timeline does; count by topic those that were there twice."""
        for time, group in groupby(timeline, itemgetter(0)):
            rows = [row for _, row in group]
            if len(rows) > 1:
                rows = self._put(rows, twice)
            yield from ((time, row) for row in rows)

    def _put(self, rows: list[tuple[str, bytes]], twice: Counter[str]) -> list[tuple[str, bytes]]:
        kept = list(dict.fromkeys(rows)) if self._known.issuperset(topic for topic, _ in rows) else self._each_once(rows)
        twice.update(Counter(topic for topic, _ in rows) - Counter(topic for topic, _ in kept))
        for name, count in Counter(topic for topic, _ in kept).items():
            if count > 1 and name in self._numbered:
                places = [place for place, (topic, _) in enumerate(kept) if topic == name]
                with suppress(ValueError):  # one that has no number leaves them as they are
                    in_order = sorted((kept[place] for place in places), key=lambda row: stamp_and_seq(row[1])[1])
                    for place, row in zip(places, in_order):
                        kept[place] = row
        return kept

    def _each_once(self, rows: list[tuple[str, bytes]]) -> list[tuple[str, bytes]]:
        met: set[tuple[str, bytes]] = set()
        return [row for row in rows if row[0] not in self._known or not (row in met or met.add(row))]


def _of_rig(bags: OpenedBags) -> Bag:
    """Return a bag with what the bags record about their rig."""
    return bags.bag([topic for topic, ros_type in bags.types.items() if ros_type == RUN_INFO])


def left_out(bags: OpenedBags) -> list[str]:
    """Return a sentence for each thing in some bags that a copy of them does not have, and for what it takes in place of it."""
    found = [f"{what} is not copied" for piece in bags.pieces for what in piece.beside]
    if any(not piece.library.startswith(OWN_LIBRARIES) for piece in bags.pieces):
        found.append("the times of publishing and the numbers of the file's records are not copied; log times take their place")
    for name in bags.types:
        if problem := offered_by(bags.channel(name)[2].get(OFFERED, "")).problem:
            found.append(f"{name}: its quality of service cannot be read ({problem}); the default takes its place")
    return found


def content_hash(bags: OpenedBags) -> tuple[dict[str, str], Kept]:
    """Return a SHA-256 per topic over type, log times and bytes in order of time, and ``all`` over these; and what was read.

    It depends neither on the container nor on chunks, compression, pieces or the order between topics.
    """
    digests = {topic: hashlib.sha256(f"{topic} {bags.types[topic]}\n".encode()) for topic in sorted(bags.types)}
    held: Counter[str] = Counter()
    for time, (topic, data) in bags.timeline(bags.types):
        held[topic] += 1
        digests[topic].update(_MESSAGE.pack(time, len(data)) + data)
    hashes = {topic: digest.hexdigest() for topic, digest in digests.items() if held[topic]}
    text = "".join(f"{topic} {value}\n" for topic, value in hashes.items())
    return {**hashes, "all": hashlib.sha256(text.encode()).hexdigest()}, _kept(bags, held)


def write(
    bags: OpenedBags,
    out: Path,
    topics: Collection[str] | None = None,
    begin: int = 0,
    end: int = limits.LAST + 1,
    as_sent: bool = False,
) -> tuple[Path, Kept]:
    """Write the messages of some topics and times into a new bag, in order of log time.

    Parameters
    ----------
    bags : OpenedBags
        The source.
    out : Path
        Folder to make.
    topics : collection of str, optional
        Topics to write; all by default.
    begin, end : int
        Log times [ns] from ``begin`` to before ``end``. Latched messages of before are written at ``begin``, for without the rig's
        description none of its signals has a name.
    as_sent : bool
        True to put the rig's messages in order (AsSent).

    Returns
    -------
    (Path, Kept)
        The new file, with the messages written and those lost among all of the source.

    Raises
    ------
    RigError
        When the folder exists or cannot be written; nothing is left of it then.
    """
    if os.path.lexists(out):
        raise RigError(f"{out}: is there already; name another folder or remove it")
    part = out.with_name(f".{out.name}.{os.getpid()}")  # two that make the same one do not meet
    held, twice = Counter[str](), Counter[str]()
    try:
        with BagWriter(part, out.name, topics={}, library=LIBRARY) as writer:
            for topic in bags.types:
                if topics is None or topic in topics:
                    describe(writer, bags, topic)
            given = set[tuple[str, bytes]]()
            latched = [name for name in bags.types if offered_by(bags.channel(name)[2].get(OFFERED, "")).latched]
            rows = _together([counted(timeline, held) for timeline in bags.timelines()], twice)
            for time, (topic, data) in AsSent(bags).rows(rows, twice) if as_sent else rows:
                if topic in latched:
                    if (topic, data) in given and bags.types[topic].startswith("rig_msgs/"):
                        twice[topic] += 1  # of another part of the same run
                        continue
                    given.add((topic, data))
                    time = max(begin, time)  # when a subscriber that came at the beginning would get it
                if begin <= time < end and (topics is None or topic in topics):
                    writer.write(topic, bags.types[topic], data, time)
            if topics is None and begin == 0 and end > bags.last:  # a part has no end of a run
                ended, cut_off = bags.end(of_damaged=True)
                if cut_off:
                    writer.end(CUT_OFF, cut_off)
                elif ended is not None:
                    writer.end(ended.state, ended.reason)
        os.replace(part, out)
    except OSError as error:
        raise RigError(f"{out}: cannot be made ({error.strerror}); name a folder that can be written") from None
    finally:
        shutil.rmtree(part, ignore_errors=True)
    kept = _kept(bags, held)
    return out / writer.path.name, Kept(writer.counts, kept.lost, kept.damage, kept.unread, twice.total())


def _together(
    timelines: list[Iterator[tuple[int, tuple[str, bytes]]]], twice: Counter[str]
) -> Iterator[tuple[int, tuple[str, bytes]]]:
    """Yield the messages of several bags in order of time; what several hold alike once, as parts of one run that overlap do.

    What one bag holds several times stays so. ``twice`` counts what is left out, by topic.
    """
    if len(timelines) == 1:
        yield from timelines[0]
        return
    marked = [zip(timeline, repeat(number)) for number, timeline in enumerate(timelines)]
    for time, group in groupby(heapq.merge(*marked, key=lambda one: one[0][0]), lambda one: one[0][0]):
        there, met = Counter[tuple[str, bytes]](), Counter[tuple[int, tuple[str, bytes]]]()
        for (_, row), number in group:
            met[number, row] += 1
            if met[number, row] > there[row]:
                there[row] += 1
                yield time, row
            else:
                twice[row[0]] += 1


def describe(writer: BagWriter, bags: OpenedBags, topic: str) -> None:
    """Prepare a topic of some bags in a new one, with the definition and the quality of service that they recorded."""
    encoding, text, about = bags.channel(topic)
    if OFFERED in about:
        about = {**about, OFFERED: profiles_of_today(about[OFFERED])}
    writer.describe(topic, bags.types[topic], encoding, text, about, bags.topic_of(topic))


def counted(timeline: Iterator[tuple[int, tuple[str, bytes]]], held: Counter[str]) -> Iterator[tuple[int, tuple[str, bytes]]]:
    """Yield the messages of a timeline and count them by topic in ``held``."""
    for row in timeline:
        held[row[1][0]] += 1
        yield row


def _kept(bags: OpenedBags, held: Counter[str]) -> Kept:
    return Kept({topic: held[topic] for topic in bags.types}, bags.lost(held), bags.damage, bool(bags.damage))
