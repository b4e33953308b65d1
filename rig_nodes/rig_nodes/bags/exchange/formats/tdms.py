# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The format of TDMS files of LabVIEW, DIAdem and FlexLogger, whose channels have their own times.

A channel has its times from the properties of its waveform, or from a channel of times in its group.
"""

from __future__ import annotations

import logging
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ....base import UNITS, RigError, optional
from ..cells import text_cells
from ..foreign import CUT, Channel, Foreign, Form
from ..units import split_head, unit_of
from .format import Format
from .heads import apart

if TYPE_CHECKING:
    from ....base import Floats

UNITS_AT = ("unit_string", "NI_UnitDescription", "Unit", "unit")  # properties that hold the unit
TIME_NAMES = ("t", "time", "times", "timestamp", "timestamps", "zeit", "czas")


def read_tdms(path: Path, _form: Form) -> Foreign:
    """Read a TDMS file.

    Parameters
    ----------
    path : Path
        The file.
    _form : Form
        Form of text, which this format does not need.

    Returns
    -------
    Foreign
        Its channels; ``start`` is the earliest start of a waveform.

    Raises
    ------
    RigError
        When the file cannot be used; the error is one sentence.
    """
    package = optional("nptdms", "mdf")
    package.log.log_manager.set_level(logging.CRITICAL)  # what it has to say is said here
    file = package.TdmsFile.read(path)
    is_cut = file.file_status.incomplete_final_segment
    starts = [start for group in file.groups() for one in group.channels() if (start := _start(one)) is not None]
    start = min(starts, default=None)
    found = [pair for group in file.groups() for pair in _group(path, group, start or 0)]
    if not any(channel.kind == "numbers" for _, channel in found):
        raise RigError(f"{path}: holds no channel of numbers")
    return Foreign(path, apart(found), start=None if start is None else start * 1e-9, notes=[CUT] if is_cut else [])


def _group(path: Path, group: Any, start: int) -> list[tuple[list[str], Channel]]:
    columns = [one for one in group.channels() if one.dtype is not None and np.dtype(one.dtype).kind in "fiubMO" and len(one) > 1]
    axis = next((one for one in columns if _is_axis(one)), None)
    out = []
    for one in columns:
        if one is axis or _is_dates(one):
            continue
        stated = _stated(one)
        name, unit = (one.name, unit_of(stated) or stated) if stated else split_head(one.name)
        times, over = _times(one, axis, start)
        values = text_cells(one.name, list(one[:]), path) if one.dtype.kind == "O" else np.asarray(one[:]).astype(float)
        out.append(([group.name, one.path], Channel(one.name, name, unit, values, times, over)))
    return out


def _stated(one: Any) -> str:
    return next((str(one.properties[name]) for name in UNITS_AT if one.properties.get(name)), "")


def _is_dates(one: Any) -> bool:
    return np.dtype(one.dtype).kind == "M"


def _unit(one: Any) -> str:
    return unit_of(_stated(one) or split_head(one.name)[1]) or ""


def _is_axis(one: Any) -> bool:
    """Return True for a channel of times: dates, or numbers that grow and have a unit of time or its name."""
    if _is_dates(one) or np.dtype(one.dtype).kind == "O":
        return _is_dates(one)
    unit = _unit(one)
    is_named = not unit and split_head(one.name)[0].lower() in TIME_NAMES
    return (is_named or UNITS.get(unit, ("",))[0] == "time") and bool(np.all(np.diff(np.asarray(one[:]).astype(float)) > 0.0))


def _start(one: Any) -> int | None:
    """Return the date of the first value [ns since 1970]; None for a channel without one, or with the zero of LabVIEW, 1904."""
    date = np.asarray(one[:1])[0] if one.dtype is not None and len(one) and _is_dates(one) else one.properties.get("wf_start_time")
    found = int(date.astype("datetime64[ns]").astype(np.int64)) if isinstance(date, np.datetime64) else 0
    return found if found > 0 else None


def _times(one: Any, axis: Any, start: int) -> tuple[Floats | None, str]:
    """Return the times [s] of a channel, from the file's ``start`` [ns] where it has dates; or over what else it is recorded."""
    if axis is not None and len(axis) == len(one):
        if _is_dates(axis):
            return np.array((np.asarray(axis[:]).astype("datetime64[ns]").astype(np.int64) - start) * 1e-9, float), ""
        return np.asarray(axis[:], float) * UNITS[_unit(axis) or "s"][1], ""
    step, stated = float(one.properties.get("wf_increment") or 0.0), str(one.properties.get("wf_xunit_string") or "s")
    if not step > 0.0:
        return None, ""
    unit = unit_of(stated)
    if unit is None or UNITS[unit][0] != "time":
        return None, f"'{one.properties.get('wf_xname') or 'x'}' in {stated}"
    late = ((_start(one) or start) - start) * 1e-9
    offset = float(one.properties.get("wf_start_offset") or 0.0)
    return np.array(late + (offset + step * np.arange(len(one))) * UNITS[unit][1], float), ""


FORMAT = Format("TDMS", lambda _path, head: head.startswith(b"TDSm"), read_tdms)
