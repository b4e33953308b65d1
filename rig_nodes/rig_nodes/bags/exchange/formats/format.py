# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a format is, and which one a file has, by its content; a file of another is refused with the way to one that is read.

bags.exchange.foreign asks it before it reads a file; report and compare ask whether a file is a run's.
"""

from __future__ import annotations

import re
import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from ....base import Group, RigError

if TYPE_CHECKING:
    from ..foreign import Foreign, Form

FORMATS = Group("formats", "format", __package__, "FORMAT")
LOOKED_AT = 1 << 16  # bytes of the beginning

_SIGNALS = (
    "import takes measured signals; decode the frames to signals first, e.g. with CANalyzer or asammdf and rig.dbc, as MDF or CSV"
)
_UNPACK = "unpack it, and import the file in it"
# first bytes of formats that are not read, with what they are and the remedy
_OTHERS = {
    b"LOGG": ("a CAN log of Vector (BLF)", _SIGNALS),
    b"TDSh": ("the index of a TDMS file", "import the .tdms beside it"),
    b"PARE": ("Parquet with encryption", "write it without encryption"),
    b"\x1f\x8b": ("packed by gzip", _UNPACK),
    b"BZh": ("packed by bzip2", _UNPACK),
    b"\xfd7zXZ\0": ("packed by xz", _UNPACK),
    b"7z\xbc\xaf": ("a 7-Zip archive", _UNPACK),
    b"Rar!": ("a RAR archive", _UNPACK),
    b"\x28\xb5\x2f\xfd": ("packed by zstd", _UNPACK),
    b"ARROW1": ("an Arrow (Feather) file", "write the table as Parquet"),
    b"\x93NUMPY": ("an array of NumPy", "save it with its names and units as CSV or Parquet"),
    b"\x89MCAP": ("a bag, which is a run already", "name it to rig report, rig view or rig compare"),
    b"SQLite format 3": ("an SQLite file (a bag of rosbag2, or a database)", "convert a bag by 'ros2 bag convert' to MCAP"),
    b"%PDF": ("a PDF document", "export the numbers as CSV"),
    b"|CF,": ("an imc FAMOS file", "export it as MDF, Parquet or CSV"),
}
ARCHIVE = b"PK\x03\x04"
_OLE, _HDF5 = b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1", b"\x89HDF\r\n\x1a\n"
# beginnings of text formats that are no table, by a pattern of their first lines
_TEXTS = (
    (r"\s*(//.*\s+)*date\s.*\s+base\s+(hex|dec)\s+timestamps", "a CAN trace of Vector (ASC)", _SIGNALS),
    (r"\s*\(\d+\.\d+\)\s+\S+\s+[0-9A-Fa-f]{3,8}#", "a CAN log of candump", _SIGNALS),
    (r"(\s*\(\d[\d. :-]*\))?\s*\w*can\w*\s+[0-9A-Fa-f]{3,8}\s+\[\d+\]", "a CAN log of candump", _SIGNALS),
    (r"# Created by Octave", "Octave's own text format", "save it with '-v7' or '-v6'"),
    (r";\s*\$FILEVERSION=", "a CAN trace of PEAK (TRC)", _SIGNALS),
    (r"LabVIEW Measurement", "a LabVIEW measurement file (LVM)", "save it as TDMS, or as text without its heads"),
    (r"(DIAEXTENDED|#BEGINGLOBALHEADER)", "the header of a DIAdem data set", "export the data set as TDMS or CSV"),
    (r"\s*<\?xml[^>]*>\s*(<!--.*?-->\s*)?<usi:tdm", "the description of a TDM data set", "export the data set as TDMS"),
    (r"\s*<(\?xml|!DOCTYPE|html|table)", "XML or HTML", "save the table as CSV or xlsx"),
    (r'\s*(\[\s*)?\{\s*("|\})|\s*\[\s*\[', "JSON", "write the table as CSV or Parquet"),
    (r"\s*BO_ |\s*VERSION \"", "a CAN database", "import takes measured signals"),
)


def is_loggers_file(name: str) -> bool:
    """Return True for the name of a file that is imported, and of none that belongs to a run."""
    return Path(name).is_file() and not name.lower().endswith((".mcap", ".mcap.zstd", ".db3", ".yaml", ".json"))


@dataclass(frozen=True)
class Format:
    """A format of files that is read. Each is one file of this folder, which ends with ``FORMAT = Format(...)``.

    Parameters
    ----------
    called : str
        What a file of it is, for errors: ``a workbook``.
    fits : callable
        fits(path, head) returns True for a file of it, by its path and its first LOOKED_AT bytes.
    read : callable
        read(path, form) returns the file's channels; ``form`` is what is known of how its texts are written.
    ending : str
        Ending of the files of it whose content has no mark, e.g. ``.mat``; empty for a format that always has one.
    damage : tuple of types
        What ``read`` raises for a damaged file; packages that read files raise errors of many classes.
    """

    called: str
    fits: Callable[[Path, bytes], bool]
    read: Callable[[Path, Form], Foreign]
    ending: str = ""
    damage: tuple[type[Exception], ...] = (Exception,)

    def channels(self, path: Path, form: Form) -> Foreign:
        """Return what ``read`` does; RigError, in one sentence, for a damaged file."""
        try:
            return self.read(path, form)
        except (RigError, MemoryError):
            raise
        except self.damage as error:
            raise damaged(path, self.called, error) from None


def damaged(path: Path, called: str, error: Exception) -> RigError:
    """Return the error on a file that is not what it begins as."""
    return RigError(f"{path}: cannot be read as {called} ({f'{type(error).__name__}: {error}'.strip().splitlines()[0]})")


def format_of(path: Path) -> Format:
    """Return the format of a file.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    Format
        One of this folder, or one that another package adds.

    Raises
    ------
    RigError
        When it is something else, with the remedy, or a package that adds a format is at fault.
    """
    with open(path, "rb") as file:
        head = file.read(LOOKED_AT)
    own = {name: FORMATS.own_module(name).FORMAT for name in FORMATS.own}
    for one in own.values():
        if one.fits(path, head):
            return one
    for point in FORMATS.added().values():
        found = FORMATS.load(point, Format)
        if found.fits(path, head):
            return found
    _refuse_others(path, head)
    if head[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return own["text"]
    if _HDF5 in head[:1024] or b"\0" in head[:4096]:
        for one in own.values():
            if one.ending and path.suffix.lower() == one.ending:
                return one
        if _HDF5 in head[:1024]:
            raise RigError(f"{path}: is HDF5 of another program; export its signals as MDF, Parquet or CSV")
        raise RigError(
            f"{path}: is not text, although its ending is {path.suffix}, and none of the formats that are read "
            f"({', '.join(one.called for one in own.values())}); export it from its program as one of them"
        )
    text = head.decode("latin-1").removeprefix("\xef\xbb\xbf")
    for pattern, what, remedy in _TEXTS:
        if re.match(pattern, text, re.DOTALL if "<!--" in pattern else 0):
            raise RigError(f"{path}: is {what}; {remedy}")
    return own["text"]


def _refuse_others(path: Path, head: bytes) -> None:
    """Refuse a file of a format that is known and not read; ``head`` is its beginning."""
    for begin, (what, remedy) in _OTHERS.items():
        if head.startswith(begin):
            raise RigError(f"{path}: is {what}; {remedy}")
    if head.startswith(ARCHIVE):
        names, mimetype = in_archive(path)
        if "xl/workbook.bin" in names:
            raise RigError(f"{path}: is a binary workbook of Excel (.xlsb); save it as .xlsx")
        if b"opendocument.spreadsheet" in mimetype:
            raise RigError(f"{path}: is a workbook of LibreOffice (.ods); save it as .xlsx or CSV")
        raise RigError(f"{path}: is an archive; {_UNPACK}")
    if head.startswith(_OLE):
        locked = "E\0n\0c\0r\0y\0p\0t".encode("latin-1") in head
        raise RigError(
            f"{path}: is {'a workbook of Excel with a password' if locked else 'a workbook of Excel 97 (.xls)'}; save it as .xlsx"
            + " without one" * locked
        )


def in_archive(path: Path) -> tuple[set[str], bytes]:
    """Return the names in a ZIP archive, and its MIME type where it states one; RigError for a damaged one."""
    try:
        with zipfile.ZipFile(path) as archive:
            names = set(archive.namelist())
            return names, archive.read("mimetype")[:100] if "mimetype" in names else b""
    except (zipfile.BadZipFile, OSError, RuntimeError, KeyError) as error:
        raise RigError(f"{path}: is a damaged archive or workbook ({error})") from None
