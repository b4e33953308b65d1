# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The files of a bag: which of a folder belong to it, in which order, and how a packed one is unpacked.

The readers use it; whoever opens a bag sees one run, however many files it has.
"""

from __future__ import annotations

import json
import re
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import wraps
from pathlib import Path
from typing import TypeVar

import zstandard

from ..base import BagError, read_yaml
from . import limits
from .mcap_file import not_sqlite
from .old_form import topic_of_today

PIECE = 1 << 23  # bytes of messages that are in memory at a time where a bag is read in pieces, some 8 s of a run
PACKED = ".zstd"
LEFT_OUT = "left_out"  # key of metadata.yaml's custom data: messages per topic that were left out on purpose, as JSON
AT_END = "left_out_at_end"  # of these, the messages after the last one of their topic that was stored
_BLOCK = 1 << 20
_PROFILES = re.compile(r"^( *)(offered_qos_profiles:)[ ]*\n((?:\1[ -].*\n)+)", re.MULTILINE)
_NUMBERED = re.compile(r"(.*)_\d+")
T = TypeVar("T")


def accessible(found: Callable[[Path], T]) -> Callable[[Path], T]:
    """Make BagError of what the system refuses while a function looks for the files of a bag, as in a folder without access."""

    @wraps(found)
    def looked(path: Path) -> T:
        try:
            return found(path)
        except OSError as error:
            raise BagError(f"{error.filename or path}: cannot be read ({error.strerror})") from None

    return looked


@accessible
def files_of_run(path: Path) -> list[Path]:
    """Return the MCAP files of a run in their order: the file itself, or those of the folder, also packed with zstd.

    Parameters
    ----------
    path : Path
        The run's folder or one of its files.

    Raises
    ------
    BagError
        When there is no such file, or several that are not the numbered pieces of one bag.
    """
    if path.is_file():
        return [path]
    if not path.is_dir():
        raise BagError(f"{path}: there is no such file or folder; give the folder of a run or its .mcap file")
    files = in_order([*path.glob("*.mcap"), *path.glob(f"*.mcap{PACKED}")])
    names = {found[1] if (found := _NUMBERED.fullmatch(_stem(file))) else file.name for file in files}
    if not files and any(path.glob("*.db3*")):
        raise BagError(f"{path}: {not_sqlite(path)}")
    if not files or (len(files) > 1 and len(names) > 1):
        held = ", ".join(sorted(f.name for f in files)) or "none"
        raise BagError(f"{path}: a run's folder holds one bag of .mcap files, this one holds {held}; name the file itself")
    return files


def in_order(files: list[Path]) -> list[Path]:
    """Return files by the numbers at the end of their names; one that is there plain and packed counts once, packed."""
    packed = {file.name for file in files if file.suffix == PACKED}
    found = [file for file in files if f"{file.name}{PACKED}" not in packed]
    return sorted(found, key=lambda file: (len(file.name.removesuffix(PACKED)), file.name))


@dataclass(frozen=True)
class Metadata:
    """The contents of a bag's metadata.yaml.

    Attributes
    ----------
    files : list of str
        Names of its files.
    counts : dict of str to int
        Messages per topic.
    left_out : dict of str to int
        Messages per topic that the recorder left out on purpose.
    left_out_at_end : dict of str to int
        Of these, the messages after the last one of their topic that was stored, which leave no hole in sequence numbers.
    """

    files: list[str] = field(default_factory=list)
    counts: dict[str, int] = field(default_factory=dict)
    left_out: dict[str, int] = field(default_factory=dict)
    left_out_at_end: dict[str, int] = field(default_factory=dict)


def read_metadata(folder: Path) -> Metadata:
    """Return the contents of a folder's metadata.yaml; nothing when there is no such file, BagError when it is not valid.

    The topics' qualities of service are not read: they are three quarters of the text, whose reading takes 40 ms.
    """
    path = folder / "metadata.yaml"
    try:
        if not path.is_file():
            return Metadata()
        if path.stat().st_size > limits.YAML:
            raise BagError(f"{path}: is of {path.stat().st_size} bytes, larger than the {limits.YAML} that are read")
        text = _PROFILES.sub(lambda found: found[1] + found[2] + "\n" * (1 + found[3].count("\n")), path.read_text("utf-8"))
        information = read_yaml(path, text)["rosbag2_bagfile_information"]
        # only names within the folder, as rosbag2 writes them
        names = [Path(str(name)).name for name in information["relative_file_paths"]]
        entries = information["topics_with_message_count"]
        counts: Counter[str] = Counter()
        for entry in entries:  # a topic of several types has an entry for each of them
            name = entry["topic_metadata"]["name"]
            if isinstance(name, str):  # one without quotes may be a number or nothing to YAML
                counts[topic_of_today(name)] += int(entry["message_count"])
        custom = information.get("custom_data") or {}
        left_out = [
            {str(topic): int(count) for topic, count in json.loads(custom.get(key, "{}")).items()} for key in (LEFT_OUT, AT_END)
        ]
        return Metadata(names, counts, *left_out)
    except (OSError, TypeError, LookupError, ValueError, ArithmeticError, AttributeError, RecursionError) as error:
        raise BagError(f"{path}: is no description of a bag ({type(error).__name__}: {error})") from None


@contextmanager
def plain(file: Path) -> Iterator[Path]:
    """Give the file itself, or what it holds in a temporary folder when it is packed."""
    if file.suffix != PACKED:
        yield file
        return
    with tempfile.TemporaryDirectory(prefix="rig-bag-") as folder:
        yield _unpacked(file, Path(folder, file.stem))


def pack(file: Path) -> Path:
    """Replace a file by one packed with zstd, as rosbag2 names it, and return that; an OSError is passed on.

    The plain file stays until the packed one is whole.
    """
    out = file.with_name(f"{file.name}{PACKED}")
    part = file.with_name(f".{file.name}.part")
    try:
        with open(file, "rb") as source, open(part, "wb") as sink:
            zstandard.ZstdCompressor().copy_stream(source, sink, size=file.stat().st_size)
        part.replace(out)
    except zstandard.ZstdError as error:  # as in bags.mcap_writer
        raise MemoryError(str(error)) from error
    finally:
        part.unlink(missing_ok=True)
    file.unlink()
    return out


def _stem(file: Path) -> str:
    return file.name.removesuffix(PACKED).removesuffix(".mcap")


def _unpacked(file: Path, out: Path) -> Path:
    most = limits.UNPACKED + limits.EXPANSION * file.stat().st_size
    size = 0
    try:
        with open(file, "rb") as packed, open(out, "wb") as sink:
            with zstandard.ZstdDecompressor(max_window_size=limits.CHUNK).stream_reader(packed, read_across_frames=True) as stream:
                while block := stream.read(_BLOCK):
                    size += len(block)
                    if size > most:
                        raise BagError(f"{file}: unpacks to more than {most} bytes, {limits.EXPANSION} for each byte of the file")
                    sink.write(block)
    except (zstandard.ZstdError, OSError) as error:
        raise BagError(f"{file}: cannot be unpacked ({error}); expected a file that rosbag2 packed with zstd") from None
    return out
