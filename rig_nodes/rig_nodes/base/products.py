# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The kinds of files that are written beside runs, and how an older one of each is told from a file of somebody else.

Only an older product of the same kind is replaced, so that no option and no call can destroy a recording, a rig or a user's file.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from .atomic import MAKER
from .errors import RigError

MARK = MAKER.encode()
HEAD = 4096  # bytes from the beginning of a file in which its mark stands
_SVG = re.compile(  # how the charts and the pictures of drivelines begin
    rb'<svg xmlns="http://www.w3.org/2000/svg" (viewBox="[\d ]+" width="\d+" height="\d+" font-family="sans-serif" font-size="12">'
    rb'|width="\d+" height="\d+" viewBox="[\d ]+">\n<style>)'
)


class Kind(NamedTuple):
    """A kind of file: the endings of its name, and whether a file's beginning and path show that the rig wrote it."""

    endings: tuple[str, ...]
    own: Callable[[bytes, Path], bool]


def _begins(*beginnings: bytes) -> Callable[[bytes, Path], bool]:
    return lambda head, path: head.startswith(beginnings)


def _marked(beginning: bytes) -> Callable[[bytes, Path], bool]:
    return lambda head, path: head.startswith(beginning) and MARK in head


def _pdf(head: bytes, path: Path) -> bool:
    return head.startswith(b"%PDF-") and path.read_bytes().endswith(b"%" + MARK + b"\n")


def _fmu(head: bytes, path: Path) -> bool:
    import zipfile

    try:
        with zipfile.ZipFile(path) as archive, archive.open("modelDescription.xml") as file:
            return b'generationTool="' + MARK in file.read(HEAD)
    except (zipfile.BadZipFile, KeyError, OSError, RuntimeError, NotImplementedError):
        return False


KINDS = {
    "page": Kind((".html", ".htm"), _marked(b"<!DOCTYPE html>")),
    "pdf": Kind((".pdf",), _pdf),
    "png": Kind((".png",), _marked(b"\x89PNG\r\n")),
    "picture": Kind((".png", ".svg"), lambda head, path: head.startswith((b"\x89PNG\r\n", b"<?xml")) and MARK in head),
    "rrd": Kind((".rrd",), lambda head, path: head.startswith(b"RRF") and b"virtual_rig" in head),
    "json": Kind((".json",), _begins(b'{\n  "generator": "' + MARK + b'",\n')),  # of write_json
    "svg": Kind((".svg",), lambda head, path: bool(_SVG.match(head))),
    "plotjuggler": Kind((".xml",), _marked(b"<?xml")),
    "foxglove": Kind((".json",), lambda head, path: path.read_bytes().endswith(b'"layout": "Tab!rig"\n}\n')),
    "fmu": Kind((".fmu",), _fmu),
    "controller-fmu": Kind((".fmu",), _fmu),
    "dbc": Kind((".dbc",), lambda head, path: head.startswith(b"VERSION ") and b"BU_: RIG CONTROLLER" in head),
    "registers": Kind((".csv", ".md"), _begins(b"address,name,access,type,", b"| address | name | access | type |")),
    "record": Kind((".h",), lambda head, path: b"#define RIG_RECORD_H" in head),
}
NEVER = Kind((), lambda head, path: False)  # a file that is there is never replaced; the verb looks at the ending


def check_product(what: str, path: Path, kind: Kind) -> None:
    """Refuse to replace a file that is no older product of a kind.

    Parameters
    ----------
    what : str
        The file and what named it, for the error.
    path : Path
        The file, which need not exist.
    kind : Kind
        What will be written.

    Raises
    ------
    RigError
        When it exists and is something else.
    OSError
        When it cannot be read.
    """
    if not path.is_file():  # whoever writes says what is wrong with a folder or a device
        return
    with path.open("rb") as file:
        head = file.read(HEAD)
    if kind is NEVER:
        raise RigError(f"{what}: it exists; remove it first, or name another file")
    if not kind.own(head, path):
        raise RigError(f"{what}: it exists and is no older file of this kind; remove it, or choose another name")
