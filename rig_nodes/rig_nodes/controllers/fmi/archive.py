# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The limits of an FMU's archive: everything is checked before anything of it is written or interpreted.

controllers.fmi.importer uses it. The limits stand in docs/how_to/fmu.md.
"""

from __future__ import annotations

import stat
import zipfile
import zlib
from pathlib import Path, PurePosixPath
from xml.parsers import expat

from ...base import RigError, printable

DESCRIPTION = "modelDescription.xml"
MOST_FILES = 10_000
MOST_BYTES = 1 << 30  # unpacked size of all files together
MOST_RATIO = 200  # unpacked to packed size of a file that is larger than SMALL
SMALL = 1 << 20
MOST_XML = 32 << 20  # bytes of modelDescription.xml
MOST_ELEMENTS, MOST_DEPTH = 1_000_000, 50  # number and depth of its elements
LONGEST_NAME, LONGEST_PART = 1000, 255  # bytes
METHODS = {zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED}  # all methods that FMI allows; others unpack without a bound


def unpack(path: Path, folder: Path) -> None:
    """Check an FMU and unpack it into a folder.

    Parameters
    ----------
    path : Path
        The FMU.
    folder : Path
        An existing folder.

    Raises
    ------
    RigError
        Before anything is written, when a check fails; the sentence does not name the FMU.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            _check_files(archive)
            _check_description(archive.read(DESCRIPTION))
            if damaged := archive.testzip():
                raise RigError(f"it is damaged at '{printable(damaged)}'")
            archive.extractall(folder)
    except (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, ValueError) as error:
        raise RigError(f"it is no whole zip archive: {printable(error)}") from None
    except OSError as error:
        raise RigError(f"it cannot be read or unpacked: {error.strerror or printable(error)}") from None


def _check_files(archive: zipfile.ZipFile) -> None:
    entries = archive.infolist()
    if len(entries) > MOST_FILES:
        raise RigError(f"its archive has {len(entries)} entries, expected at most {MOST_FILES}")
    files, folders = set(), set()
    for entry in entries:
        name = printable(entry.orig_filename)
        if why := _wrong_name(entry.orig_filename):
            raise RigError(f"its archive has the entry '{name}', {why}; expected paths inside the FMU")
        kind = stat.S_IFMT(entry.external_attr >> 16)
        if kind not in (0, stat.S_IFREG, stat.S_IFDIR):
            what = "a symbolic link" if kind == stat.S_IFLNK else "no ordinary file"
            raise RigError(f"its archive's entry '{name}' is {what}; expected files and folders")
        if entry.flag_bits & 1:
            raise RigError(f"its archive's entry '{name}' is encrypted")
        if entry.compress_type not in METHODS:
            raise RigError(f"its archive's entry '{name}' is packed by a method that FMI does not allow; expected deflate")
        if entry.file_size > SMALL and entry.file_size > MOST_RATIO * entry.compress_size:
            raise RigError(
                f"its archive's entry '{name}' unpacks to {entry.file_size / max(1, entry.compress_size):.0f} "
                f"times its size, expected at most {MOST_RATIO} times"
            )
        inside = PurePosixPath(entry.orig_filename)
        if inside in files:
            raise RigError(f"its archive has the entry '{name}' twice")
        (folders if entry.is_dir() else files).add(inside)
        folders.update(inside.parents)
    if both := files & folders:
        raise RigError(f"its archive has '{printable(min(both))}' as a file and as a folder")
    size = sum(entry.file_size for entry in entries)
    if size > MOST_BYTES:
        raise RigError(f"its archive unpacks to {size / 1e6:.0f} MB, expected at most {MOST_BYTES / 1e6:.0f} MB")
    if PurePosixPath(DESCRIPTION) not in files:
        raise RigError(f"its archive has no {DESCRIPTION}")
    xml = archive.getinfo(DESCRIPTION).file_size
    if xml > MOST_XML:
        raise RigError(f"its {DESCRIPTION} has {xml / 1e6:.0f} MB, expected at most {MOST_XML / 1e6:.0f} MB")


def _wrong_name(name: str) -> str:
    """Return why a path may not stand in an archive; empty when it may."""
    parts = name.split("/")
    if name.startswith("/") or name[1:2] == ":":
        return "an absolute path"
    if ".." in parts:
        return "which leads out of it"
    if "\\" in name or not name.isprintable():
        return "with a character that no path in an FMU has"
    if len(name.encode()) > LONGEST_NAME or max(len(part.encode()) for part in parts) > LONGEST_PART:
        return "which is too long"
    return ""


def _check_description(xml: bytes) -> None:
    """Raise RigError unless a tree can be made of the XML: no document type (and so no entities), bounded depth."""
    parser = expat.ParserCreate()
    depth = elements = 0

    def doctype(*_: object) -> None:
        raise RigError(f"its {DESCRIPTION} has a document type declaration (DOCTYPE), which an FMU must not have")

    def start(*_: object) -> None:
        nonlocal depth, elements
        depth, elements = depth + 1, elements + 1
        if depth > MOST_DEPTH:
            raise RigError(f"its {DESCRIPTION} is nested deeper than {MOST_DEPTH} elements")
        if elements > MOST_ELEMENTS:
            raise RigError(f"its {DESCRIPTION} has more than {MOST_ELEMENTS} elements")

    def end(*_: object) -> None:
        nonlocal depth
        depth -= 1

    parser.StartDoctypeDeclHandler, parser.StartElementHandler, parser.EndElementHandler = doctype, start, end
    try:
        parser.Parse(xml, True)
    except (expat.ExpatError, LookupError, ValueError) as error:
        raise RigError(f"its {DESCRIPTION} is no well-formed XML: {printable(error)}") from None
