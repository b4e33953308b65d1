# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Bags as users have them, read as one: folders with several pieces, files packed with zstd, sqlite3, several bags at once.

The replay, the view and `rig bag` use it. Everything is read by BagIndex; what is no plain MCAP file is first turned into one in a
temporary folder.
"""

from __future__ import annotations

import heapq
import tempfile
from collections import Counter
from collections.abc import Callable, Collection, Container, Iterator, Sequence
from contextlib import ExitStack
from itertools import pairwise
from operator import itemgetter
from pathlib import Path

from ..base import BagError, RigError
from . import limits
from .index import BagIndex, joined_spans
from .mcap_file import StillWritten
from .messages import in_short, nothing_in
from .pieces import PACKED, Metadata, accessible, in_order, plain, read_metadata
from .reader import Bag
from .records import ENCODING, Contents
from .run_end import CUT_OFF, EVENTS, STATE, RunEnd, cut_off, end_of_run
from .sqlite_bag import from_sqlite

BAG_SUFFIXES = (".mcap", ".db3")
OF_ROS = ("/rosout", "/diagnostics", "/parameter_events")  # topics of every ROS 2 graph, which nobody expects among signals
RUN_INFO = "rig_msgs/msg/RunInfo"


class OpenedBags:
    """One or several bags as one, in order of log time; messages of equal time keep the order of bags, pieces and file.

    Attributes
    ----------
    path : str
        What was opened, for sentences.
    pieces : list of BagIndex
        The files.
    files : list of Path
        The files as they are in the folder; those of ``pieces`` are unpacked.
    types : dict of str to str
        Message type per topic.
    counts : dict of str to int
        Messages per topic by the bags' own counts.
    first, last : int
        Log times of the first and the last message [ns].
    spans : list of (int, int)
        First and last log time [ns] of each stretch between holes in time (index.HOLE).
    notes : list of str
        One sentence for each thing that is no fault of the messages: a renamed file, metadata that cannot be read.
    """

    def __init__(self, paths: Sequence[str | Path], growing: bool = False) -> None:
        """Open the bags.

        Parameters
        ----------
        paths : sequence of str or Path
            Folders or files.
        growing : bool
            True to read a bag that is still being written up to its present end.

        Raises
        ------
        BagError
            When nothing of a bag can be read, or two pieces hold a topic with different types.
        """
        self.path = ", ".join(map(str, paths))
        self.pieces: list[BagIndex] = []
        self.files: list[Path] = []
        self.stated: Counter[str] = Counter()  # messages per topic by metadata.yaml
        self.left_out: Counter[str] = Counter()  # messages per topic that the recorder left out on purpose, by metadata.yaml
        self.holes: Counter[str] = Counter()  # of these, messages that leave a hole in the sequence numbers
        self.notes: list[str] = []
        self._growing = growing
        self._damage: list[str] = []
        self._starts = 0  # bags that were opened
        self._bag_of: list[int] = []  # the bag of each piece, counted from 0
        self._on_damage: Callable[[str], None] = lambda _: None
        self._stack = ExitStack()
        try:
            for path in paths:
                self._open(Path(path))
        except BaseException:
            self._stack.close()
            raise
        self._held = [piece for piece in self.pieces if any(piece.counts.values())]
        self.first = min((piece.first for piece in self._held), default=0)
        self.last = max((piece.last for piece in self._held), default=0)
        self.spans = joined_spans([span for piece in self._held for span in piece.spans()])

    def __enter__(self) -> OpenedBags:
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    @property
    def damage(self) -> list[str]:
        """One sentence per fault met so far."""
        several = len(self.pieces) > 1
        named = [f"{piece.path.name}: {text}" if several else text for piece in self.pieces for text in piece.damage]
        return self._damage + named

    @property
    def on_damage(self) -> Callable[[str], None]:
        """Called with every fault that is met later."""
        return self._on_damage

    @on_damage.setter
    def on_damage(self, action: Callable[[str], None]) -> None:
        self._on_damage = action
        for piece in self.pieces:
            piece.on_damage = action

    @property
    def length(self) -> int:
        """Time of the bag without its holes [ns]."""
        return sum(last - first for first, last in self.spans)

    @property
    def holes_in_time(self) -> list[str]:
        """One sentence for each hole in time, which the replay jumps over and no option counts."""
        return [
            f"no message between {before / 1e9:.3f} s and {after / 1e9:.3f} s, {(after - before) / 86_400e9:.0f} days, which a "
            "replay jumps over and no option counts"
            for (_, before), (after, _) in pairwise(self.spans)
        ]

    @property
    def main_span(self) -> tuple[int, int]:
        """First and last log time [ns] of the longest stretch between holes in time."""
        return max(self.spans, key=lambda span: span[1] - span[0], default=(0, 0))

    def time_at(self, seconds: float) -> int:
        """Return the log time [ns] so many seconds after the first message, holes in time not counted."""
        left = round(seconds * 1e9)
        for first, last in self.spans:
            if left <= last - first:
                return first + left
            left -= last - first
        return self.last + left

    def topic_of(self, name: str) -> str:
        """Return the topic of a channel; it is the name unless one topic has several types."""
        return self._piece(name).topic_of(name)

    def not_understood(self, name: str) -> str:
        """Return why the messages of a channel are bytes to the rig; empty for those of ROS 2 with a definition."""
        encoding = self.channel(name)[0]
        if encoding == ENCODING:
            return ""
        form, _, language = encoding.partition("/")
        definition = f"a definition in {language}" if language else "no definition"
        return f"its messages are {form or 'of no stated encoding'}, with {definition}"

    def not_of(self, known: Container[str]) -> list[str]:
        """Return the topics with messages that are not among the known ones of a rig, nor of every ROS 2 graph, with reasons."""
        others = [name for name in self.types if self.counts[name] and name not in known and name not in OF_ROS]
        return [f"{name} ({why})" if (why := self.not_understood(name)) else name for name in others]

    def end(self, of_damaged: bool = False) -> tuple[RunEnd | None, str]:
        """Return how the run ended, as far as the bag shows it, and a sentence when the bag was cut off before that.

        Parameters
        ----------
        of_damaged : bool
            True for the sentence also of a damaged bag, whose damage says it otherwise.
        """
        if self._starts > 1:
            return None, ""  # several bags together are no run
        last = self.pieces[-1]
        if recorded := RunEnd.of(last.end):
            return recorded, recorded.reason if recorded.state == CUT_OFF else ""
        bag = self.bag([topic for topic, ros_type in self.types.items() if topic in (STATE, EVENTS) or ros_type == RUN_INFO])
        if last.writer:
            return end_of_run(bag), f"the run went on at {bag.recorded_to / 1e9:.3f} s, up to which {last.writer} had written it"
        return end_of_run(bag), "" if self.damage and not of_damaged else cut_off(bag)

    def check_began(self) -> None:
        """Raise BagError when no message can be read that is later than time 0."""
        if not self.last:
            for _ in self.timeline(self.types):
                pass  # what is at fault is met when it is read
            raise BagError(f"{self.files[0]}: {nothing_in(self.damage, self.pieces[0].library)}")

    def _piece(self, name: str) -> BagIndex:
        return next(piece for piece in self.pieces if name in piece.types)

    def channel(self, topic: str) -> tuple[str, str, dict[str, str]]:
        """Return a topic's encoding as ``message/definition``, its definition and the metadata of its channel."""
        return self._piece(topic).channel(topic)

    def timeline(
        self, topics: Collection[str], begin: int = 0, end: int = limits.LAST + 1
    ) -> Iterator[tuple[int, tuple[str, bytes]]]:
        """Yield log time [ns], and topic with bytes, of the messages of some topics from ``begin`` to before ``end`` [ns]."""
        rows = (piece.timeline(topics, begin, end) for piece in self._held)
        return heapq.merge(*rows, key=itemgetter(0))

    def timelines(self) -> list[Iterator[tuple[int, tuple[str, bytes]]]]:
        """Return the whole timeline of each of the bags that were opened."""
        each: list[list[BagIndex]] = [[] for _ in range(self._starts)]
        for number, piece in zip(self._bag_of, self.pieces):
            if piece in self._held:
                each[number].append(piece)
        return [heapq.merge(*(one.timeline(self.types) for one in pieces), key=itemgetter(0)) for pieces in each]

    def bag(
        self, topics: Collection[str], begin: int = 0, end: int = limits.LAST + 1, columns: dict[str, list[str]] | None = None
    ) -> Bag:
        """Return the messages of these topics as a bag; it lists all topics but holds no message of the others.

        Parameters
        ----------
        topics : collection of str
            Topics to read.
        begin, end : int
            Log times [ns] from ``begin`` to before ``end``.
        columns : dict of str to list of str, optional
            Columns of loggers by topic, for a stretch of time that does not hold their lists.

        Returns
        -------
        Bag
            The messages.
        """
        streams = {topic: self._piece(topic).empty(topic) for topic in self.types}
        for place, (time, (topic, data)) in enumerate(self.timeline(topics, begin, end)):
            streams[topic].times.append(time)
            streams[topic].payloads.append(data)
            streams[topic].places.append(place)
        last = self.pieces[-1]
        contents = Contents(dict(enumerate(streams.values())), list(self.damage), last.library, last.end)
        return Bag.of(self.files[0], contents, columns)

    def lost(self, held: Counter[str]) -> dict[str, int]:
        """Return how many messages per topic the bags' own counts exceed those that were read."""
        lost = +Counter({name: count - held[name] for name, count in self.counts.items()})
        for piece in self.pieces:
            lost |= Counter(piece.unread)
        found = Counter[str]()  # by topic, of which one may have several types and thus names
        for name in {*self.types, *lost}:
            found[self.topic_of(name) if name in self.types else name] += held[name] + lost[name]
        for topic, count in self.stated.items():
            lost[topic] += max(0, count - found[topic])
        return dict(+lost)

    def _open(self, path: Path) -> None:
        files, problems, notes, about = files_of(path)
        self._starts += 1
        self._damage += problems
        self.notes += notes
        self.stated.update(about.counts)
        self.left_out.update(about.left_out)
        self.holes.update(about.left_out)
        self.holes.subtract(about.left_out_at_end)
        opened = 0
        for file in files:
            try:
                piece = self._stack.enter_context(BagIndex(self._plain(file), self._growing))
                self._add(piece)
                self.files.append(file)
                opened += 1
                if piece.writer:
                    self.notes.append(f"{file.name} is still being written by {piece.writer}; this is what it held until now")
            except StillWritten:
                raise
            except BagError as error:
                if len(files) == 1:
                    raise
                self._damage.append(str(error))
        if not opened:
            raise BagError(f"{path}: nothing of it can be read ({in_short(self._damage)})")

    def _add(self, piece: BagIndex) -> None:
        self.pieces.append(piece)
        self._bag_of.append(self._starts - 1)
        if len(self.pieces) == 1:
            self.types, self.counts = dict(piece.types), dict(piece.counts)
            return
        for topic, ros_type in piece.types.items():
            if self.types.setdefault(topic, ros_type) != ros_type:
                raise RigError(f"{piece.path}: topic {topic} holds {ros_type}, in another piece or bag {self.types[topic]}")
            if not self._piece(topic).empty(topic).same_as(piece.empty(topic)):
                raise RigError(f"{piece.path}: topic {topic} holds another form of {ros_type} than in another piece or bag")
            self.counts[topic] = self.counts.get(topic, 0) + piece.counts[topic]

    def _plain(self, file: Path) -> Path:
        """Return the file itself, or a temporary MCAP file with its content."""
        file = self._stack.enter_context(plain(file))
        if file.suffix != ".db3":
            return file
        made, faults = from_sqlite(file, Path(self._stack.enter_context(tempfile.TemporaryDirectory(prefix="rig-bag-"))))
        self._damage += faults
        return made


@accessible
def files_of(path: Path) -> tuple[list[Path], list[str], list[str], Metadata]:
    """Return the files of a bag in their order, a sentence for each that is missing, notes, and the contents of metadata.yaml.

    A file that metadata.yaml lists is not missing when another one is there in its place: it was renamed.

    Parameters
    ----------
    path : Path
        Folder or file.

    Raises
    ------
    BagError
        When there is none.
    """
    if path.is_file():
        return [path], [], [], Metadata()
    if not path.is_dir():
        raise BagError(f"{path}: there is no such file or folder; give the folder of a bag or one of its files")
    found = in_order([file for file in path.iterdir() if file.name.removesuffix(PACKED).endswith(BAG_SUFFIXES)])
    problems, notes, about = [], [], Metadata()
    try:
        about = read_metadata(path)
        listed = [path / name for name in about.files]
        missing = [file for file in listed if not file.is_file()]
        others = [file for file in found if file not in listed]
        if len(missing) > len(others):
            problems = [f"{file} is missing, which metadata.yaml lists" for file in missing]
        else:
            renamed = dict(zip(missing, others))
            notes = [f"{old.name} is not there, which metadata.yaml lists; {new.name} is read" for old, new in renamed.items()]
            listed = [renamed.get(file, file) for file in listed]
        found = [file for file in listed if file.is_file()] + [file for file in found if file not in listed]
    except RigError as error:
        notes = [f"{error}; the bag is read without it"]
    if not found:
        raise BagError(f"{path}: holds no bag; expected .mcap or .db3 files, also packed as {PACKED}")
    return found, problems, notes, about
