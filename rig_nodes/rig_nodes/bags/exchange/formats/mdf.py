# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The format of MDF files (versions 2, 3 and 4), whose channels have their own times.

A sample that the file marks invalid, or gives a status text in place of a value, is missing.
"""

from __future__ import annotations

import gc
import logging
import sys
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ....base import UNITS, RigError, optional
from ..cells import text_cells
from ..foreign import Channel, Foreign, Form
from ..provenance import KEY, read_provenance
from ..units import unit_of
from .format import Format, damaged
from .heads import apart

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from ....base import Floats

ALL_INVALID, SOME_INVALID = 1, 2  # flags of a channel: none of its samples is valid, and a bit in each record tells which are
TO_TEXT, RANGES_TO_TEXT = 7, 8  # conversions of MDF 4 from values and from ranges of values to texts
AXES = {2: "an angle", 3: "a distance", 4: "a number of samples"}  # what the master of a group can be, beside a time
FRAMES = ("CAN_DataFrame", "CAN_RemoteFrame", "CAN_ErrorFrame", "LIN_Frame", "FLX_Frame", "ETH_Frame")


def read_mdf(path: Path, _form: Form) -> Foreign:
    """Read an MDF file.

    Parameters
    ----------
    path : Path
        The file.
    _form : Form
        Form of text, which this format does not need.

    Returns
    -------
    Foreign
        Its channels; the head of one whose name is there more than once begins with its group.

    Raises
    ------
    RigError
        When the file cannot be used; the error is one sentence.
    """
    package = optional("asammdf", "mdf")
    logging.getLogger("asammdf").setLevel(logging.CRITICAL)  # what it has to say is said here
    found: list[tuple[list[str], Channel]] = []
    provenance, has_frames, start, refusal = None, False, None, None
    with _quiet():
        try:
            with package.MDF(path) as file:
                start = file.header.start_time.timestamp()
                # only MDF 4 has attachments, and asammdf's property raises an error for the others
                for number, attachment in enumerate(file.attachments if file.version >= "4" else ()):
                    if attachment.file_name == f"{KEY}.json":
                        provenance = read_provenance(file.extract_attachment(number)[0])
                for group in file.virtual_groups:
                    found += _group(path, file, group)
                has_frames = any(name.startswith(FRAMES) for name in file.channels_db)
        except Exception as error:  # it is gone when _quiet collects what asammdf has left
            refusal = damaged(path, FORMAT.called, error)
    if refusal:
        raise refusal
    if has_frames and all(channel.name.startswith(FRAMES) for _, channel in found):
        raise RigError(
            f"{path}: holds frames of a bus and no signals; decode it with the bus's database first, e.g. "
            "asammdf.MDF(FILE).extract_bus_logging({'CAN': [('BUS.dbc', 0)]}).save('decoded.mf4')"
        )
    if not any(channel.kind == "numbers" for _, channel in found):
        raise RigError(f"{path}: holds no channel of numbers")
    return Foreign(path, apart(found), provenance=provenance, start=start)


@contextmanager
def _quiet() -> Iterator[None]:
    """Keep asammdf's own errors from the terminal, which files that it could not open raise when they are deleted."""
    hook, sys.unraisablehook = sys.unraisablehook, lambda _: None
    try:
        yield
        gc.collect()
    finally:
        sys.unraisablehook = hook


def _group(path: Path, file: Any, group: int) -> Iterator[tuple[list[str], Channel]]:
    """Yield the channels of a group that shares its times, each with the names by which it can be told from others."""
    places = [(number, channel) for number, them in file.included_channels(group)[group].items() for channel in them]
    for number in {place[0] for place in places}:
        _check_whole(file.groups[number], number, file.original_name.stat().st_size)
    without = _checked(file, places) if file.version >= "4" else set()
    signals = file.select([(None, *place) for place in places], ignore_value2text_conversions=True, copy_master=False)
    for place, one in zip(places, signals):
        values = np.asarray(one.samples)
        if values.ndim != 1 or values.dtype.kind not in "fiubSU" or len(values) < 2:
            continue
        block = file.groups[place[0]].channels[place[1]]
        is_text, invalid = values.dtype.kind in "SU", one.invalidation_bits
        values = _texts(values) if is_text else values.astype(float)
        if invalid is not None:
            values[np.asarray(invalid, bool)] = "" if is_text else np.nan
        if file.version >= "4" and not is_text:
            if place in without:
                values[:] = np.nan
            if (is_status := _statuses(block.conversion)) is not None:
                values[is_status(np.asarray(file.get(None, *place, raw=True).samples))] = np.nan
        over, factor = _axis(file, group, one)
        times = None if over else np.asarray(one.timestamps, float) * factor
        unit = unit_of(one.unit or "") or one.unit or ""
        content = text_cells(one.name, values.tolist(), path) if is_text else values
        yield _names(file, place, one), Channel(one.name, one.name, unit, content, times, over)


def _texts(values: np.ndarray) -> np.ndarray:
    """Return texts without what fills them up; bytes are UTF-8, or Latin-1 as in MDF 2 and 3."""
    if values.dtype.kind == "S":
        try:
            values = np.char.decode(values, "utf-8")
        except UnicodeDecodeError:
            values = np.char.decode(values, "latin-1")
    return np.char.strip(values, " \0")


def _check_whole(group: Any, number: int, length: int) -> None:
    """Raise ValueError for a group with fewer records than it states; asammdf fills them up with what the memory held before."""
    block, parts = group.channel_group, list(group.get_data_blocks())
    size = block.samples_byte_nr + getattr(block, "invalidation_bytes_nr", 0)
    is_short = group.sorted and sum(one.original_size for one in parts) < block.cycles_nr * size
    if is_short or any(one.address + one.compressed_size > length for one in parts):
        raise ValueError(f"group {number + 1} holds fewer records than the {block.cycles_nr} that it states; the file is cut off")


def _checked(file: Any, places: list[tuple[int, int]]) -> set[tuple[int, int]]:
    """Return the channels of MDF 4 without a valid sample; ValueError for records whose form would crash asammdf.

    Flags for bits that the records do not have crash it too; they are taken away.
    """
    out = set()
    for group, number in places:
        block, record = file.groups[group].channels[number], file.groups[group].channel_group
        if block.byte_offset + (block.bit_offset + block.bit_count + 7) // 8 > record.samples_byte_nr > 0 or not (
            record.samples_byte_nr + record.invalidation_bytes_nr
        ):
            raise ValueError(f"the records of group {group + 1} are shorter than their channels")
        if block.flags & ALL_INVALID:
            out.add((group, number))
        if not record.invalidation_bytes_nr:
            block.flags &= ~(ALL_INVALID | SOME_INVALID)
    return out


def _statuses(conversion: Any) -> Callable[[np.ndarray], np.ndarray] | None:
    """Return which raw values are statuses such as "sensor error": those with a text, where the other values have a formula.

    A conversion to texts only is an enumeration, e.g. of gears, whose numbers are values.
    """
    if conversion is None or conversion.conversion_type not in (TO_TEXT, RANGES_TO_TEXT):
        return None
    blocks = conversion.referenced_blocks
    if isinstance(blocks.get("default_addr"), (bytes, type(None))):
        return None
    texts = [name.partition("_")[2] for name, block in blocks.items() if name.startswith("text_") and isinstance(block, bytes)]
    if conversion.conversion_type == TO_TEXT:
        spans = [(conversion[f"val_{n}"], conversion[f"val_{n}"]) for n in texts]
    else:
        spans = [(conversion[f"lower_{n}"], conversion[f"upper_{n}"]) for n in texts]

    def among(raw: Floats) -> np.ndarray:
        out = np.zeros(len(raw), bool)
        for low, high in spans:
            # the upper end of a range belongs to it for whole numbers only
            out |= (raw >= low) & ((raw <= high) if raw.dtype.kind in "iu" or low == high else (raw < high))
        return out

    return among


def _axis(file: Any, group: int, one: Any) -> tuple[str, float]:
    """Return over what a group was recorded, empty for times, and the factor of its times to s."""
    kind = one.master_metadata[1] if one.master_metadata else 1
    number = file.masters_db.get(group)
    if number is None:
        return "no times", 1.0
    master = file.groups[group].channels[number]
    stated = (master.conversion.unit if master.conversion else "") or getattr(master, "unit", "") or "s"
    stated = stated.decode("latin-1") if isinstance(stated, bytes) else stated
    unit = unit_of(stated)
    if kind in AXES or unit is None or UNITS[unit][0] != "time":
        return f"{AXES.get(kind, 'a quantity')} ('{master.name}' in {stated})", 1.0
    return "", UNITS[unit][1]


def _names(file: Any, place: tuple[int, int], one: Any) -> list[str]:
    """Return what may tell a channel from others of its name: its group's name, its source, its group's comment; and its place."""
    block = file.groups[place[0]].channel_group
    source = getattr(block, "acq_source", None)
    candidates = [
        getattr(block, "acq_name", ""),
        source.name if source else "",
        one.source.name if one.source else "",
        getattr(block, "comment", ""),
    ]
    lines = [(text or "").strip() for text in candidates]
    return [*("" if "\n" in text else text for text in lines), f"group {place[0] + 1}", f"group {place[0] + 1}.{place[1]}"]


FORMAT = Format("MDF of version 2.00 to 4.20", lambda _path, head: head.startswith((b"MDF     ", b"UnFinMF")), read_mdf)
