# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Bags as users have them, read as one: folders with several pieces, files packed with zstd, sqlite3, several bags at once.

The replay and `rig bag` use it. Everything is read by BagIndex; what is no plain MCAP file is first turned into one in a temporary
folder, sqlite3 by the package rosbags.
"""

from __future__ import annotations

import heapq
import tempfile
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import ExitStack
from operator import itemgetter
from pathlib import Path

from ..errors import BagError, RigError
from . import limits
from .definitions import installed
from .index import BagIndex
from .mcap_file import Contents
from .metadata import profile_text, read_profile
from .pieces import PACKED, Metadata, in_order, plain, read_metadata
from .reader import Bag

KINDS = (".mcap", ".db3")


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
    """

    def __init__(self, paths: Sequence[str | Path]) -> None:
        """Open the bags.

        Parameters
        ----------
        paths : sequence of str or Path
            Folders or files.

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
        self._damage: list[str] = []
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

    def channel(self, topic: str) -> tuple[str, str, dict[str, str]]:
        """Return a topic's encoding as ``message/definition``, its definition and the metadata of its channel."""
        return next(piece for piece in self.pieces if topic in piece.types).channel(topic)

    def timeline(
        self, topics: Collection[str], begin: int = 0, end: int = limits.LAST + 1
    ) -> Iterator[tuple[int, tuple[str, bytes]]]:
        """Yield log time [ns], and topic with bytes, of the messages of some topics from ``begin`` to before ``end`` [ns]."""
        rows = (piece.timeline(topics, begin, end) for piece in self._held)
        return heapq.merge(*rows, key=itemgetter(0))

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
        streams = {topic: next(piece for piece in self.pieces if topic in piece.types).empty(topic) for topic in self.types}
        for place, (time, (topic, data)) in enumerate(self.timeline(topics, begin, end)):
            streams[topic].times.append(time)
            streams[topic].payloads.append(data)
            streams[topic].places.append(place)
        contents = Contents(dict(enumerate(streams.values())), list(self.damage), self.pieces[0].library)
        return Bag.of(self.files[0], contents, columns)

    def lost(self, held: Counter[str]) -> dict[str, int]:
        """Return how many messages per topic the bags' own counts exceed those that were read."""
        expected = {topic: max(self.counts.get(topic, 0), self.stated[topic]) for topic in {**self.counts, **self.stated}}
        return {topic: count - held[topic] for topic, count in expected.items() if count > held[topic]}

    def _open(self, path: Path) -> None:
        files, problems, about = files_of(path)
        self._damage += problems
        self.stated.update(about.counts)
        self.left_out.update(about.left_out)
        self.holes.update(about.left_out)
        self.holes.subtract(about.left_out_at_end)
        opened = 0
        for file in files:
            try:
                self._add(self._stack.enter_context(BagIndex(self._plain(file))))
                self.files.append(file)
                opened += 1
            except BagError as error:
                if len(files) == 1:
                    raise
                self._damage.append(str(error))
        if not opened:
            raise BagError(f"{path}: nothing of it can be read ({'; '.join(self._damage)})")

    def _add(self, piece: BagIndex) -> None:
        self.pieces.append(piece)
        if len(self.pieces) == 1:
            self.types, self.counts = dict(piece.types), dict(piece.counts)
            return
        for topic, ros_type in piece.types.items():
            if self.types.setdefault(topic, ros_type) != ros_type:
                raise RigError(f"{piece.path}: topic {topic} holds {ros_type}, in another piece or bag {self.types[topic]}")
            self.counts[topic] = self.counts.get(topic, 0) + piece.counts[topic]

    def _plain(self, file: Path) -> Path:
        """Return the file itself, or a temporary MCAP file with its content."""
        file = self._stack.enter_context(plain(file))
        if file.suffix != ".db3":
            return file
        return _from_sqlite(file, Path(self._stack.enter_context(tempfile.TemporaryDirectory(prefix="rig-bag-"))))


def files_of(path: Path) -> tuple[list[Path], list[str], Metadata]:
    """Return the files of a bag in their order, one sentence for each that is missing, and the contents of metadata.yaml.

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
        return [path], [], Metadata()
    if not path.is_dir():
        raise BagError(f"{path}: there is no such file or folder; give the folder of a bag or one of its files")
    found = in_order([file for file in path.iterdir() if file.name.removesuffix(PACKED).endswith(KINDS)])
    problems, about = [], Metadata()
    try:
        about = read_metadata(path)
        listed = [path / name for name in about.files]
        problems = [f"{file} is missing, which metadata.yaml lists" for file in listed if not file.is_file()]
        found = [file for file in listed if file.is_file()] + [file for file in found if file not in listed]
    except RigError as error:
        problems = [str(error)]
    if not found:
        raise BagError(f"{path}: holds no bag; expected .mcap or .db3 files, also packed as {PACKED}")
    return found, problems, about


def _from_sqlite(file: Path, folder: Path) -> Path:
    """Write the messages of an sqlite3 file into an MCAP file of the folder and return it."""
    try:
        from rosbags.rosbag2.storage_sqlite3 import Sqlite3Reader
    except ImportError:
        raise RigError(f"{file}: reading sqlite3 bags needs the package rosbags; install it with 'pip install rosbags'") from None
    from .writer import BagWriter

    reader = Sqlite3Reader(file)
    try:
        reader.open()
        try:
            with BagWriter(folder, file.stem, topics={}) as writer:
                for connection in reader.connections:
                    qos = _class(connection.ext.offered_qos_profiles)
                    about = {"offered_qos_profiles": profile_text(qos), "topic_type_hash": connection.digest or ""}
                    text = connection.msgdef.data or installed(connection.msgtype).text
                    encoding = f"{connection.ext.serialization_format or 'cdr'}/ros2msg"
                    writer.describe(connection.topic, connection.msgtype, encoding, text, about, qos)
                for connection, time, data in reader.messages(reader.connections):
                    writer.write(connection.topic, connection.msgtype, bytes(data), time)
        finally:
            reader.close()
    except BagError:
        raise
    except Exception as error:  # sqlite raises one class per fault, rosbags has further ones
        problem = f"{type(error).__name__}: {error}".strip().splitlines()[0]
        raise BagError(
            f"{file}: cannot be read as an sqlite3 bag ({problem}); expected one of `ros2 bag record -s sqlite3`"
        ) from None
    return writer.path


def _class(profiles: Sequence) -> str:
    """Return the class of catalogue.QOS for the profiles as rosbags gives them."""
    if any(profile.durability.name == "TRANSIENT_LOCAL" for profile in profiles):
        return "latched"
    return "best_effort" if profiles and all(p.reliability.name == "BEST_EFFORT" for p in profiles) else "measurement"


def class_of(about: dict[str, str]) -> str:
    """Return the class of catalogue.QOS in which a channel with this metadata was offered."""
    offered = read_profile(about.get("offered_qos_profiles", ""))
    return "latched" if offered.latched else "measurement" if offered.reliable else "best_effort"
