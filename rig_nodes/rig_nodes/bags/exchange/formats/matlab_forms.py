# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Finds channels in the variables of a MAT file, in the forms in which Simulink and measurement programs store them.

These are vectors and matrices, structs of vectors, Simulink's structure with time (To Workspace, scope), ControlDesk's X and Y,
catman's Channel_N_Data with its header, and asammdf's DGM_ and DG_. matlab.py reads the file.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from ....base import UNITS
from ..cells import text_cells
from ..foreign import Channel
from ..stamps import unit_of_numbers
from ..units import TIME_UNITS, split_head, time_unit_of, unit_of

if TYPE_CHECKING:
    from ....base import Floats

    Found = Iterator[tuple[list[str], Channel]]

# names of times; not T, which is a temperature or a torque
TIMES = ("t", "time", "Time", "times", "TIME", "timestamps", "timestamp", "tout")
UNIT, LABELS = ("unit", "Unit", "units", "Units"), ("label", "Name", "name")
_ASAMMDF = re.compile(r"(DGM?)(\d+)_(.+)")
_CATMAN = re.compile(r"(.*?)(\d+)_Data")


def channels_of(tree: Mapping[str, Any]) -> Found:
    """Yield the channels of all variables, each with names by which it can be told from others of its head.

    Parameters
    ----------
    tree : mapping
        Variables by name: dict for a struct, list for an array of structs or a cell array, array, text, number or object.

    Yields
    ------
    (list of str, Channel)
        Names and channel.
    """
    tree = dict(tree)
    yield from _of_asammdf(tree)
    yield from _of_catman(tree)
    lengths = {len(column) for value in tree.values() if (column := _vector(value)) is not None}
    for name, value in tree.items():
        column = _vector(value)
        if column is not None:
            plain, unit = split_head(name)
            yield [name], Channel(name, "time" if name == "tout" else plain, unit, column)
        elif (texts := _texts(value)) is not None and len(texts) in lengths:
            yield [name], Channel(name, name, "", text_cells(name, texts, f"variable {name}"))
        elif isinstance(value, np.ndarray):
            yield from _of_matrix(name, value)
        else:
            yield from _inside(name, value)


def _vector(value: object) -> Floats | None:
    if isinstance(value, np.ndarray) and value.dtype.kind in "fiub" and value.ndim == 1 and len(value) > 1:
        return value.astype(float)
    return None


def _texts(value: object) -> list[str] | None:
    """Return the texts of a cell array or a matrix of signs; None for anything else."""
    if isinstance(value, np.ndarray) and value.dtype.kind == "U" and value.ndim == 1:
        value = value.tolist()
    return value if isinstance(value, list) and value and all(isinstance(one, str) for one in value) else None


def _grow(values: Floats | None) -> bool:
    return values is not None and len(values) > 1 and bool(np.all(np.diff(values) > 0.0))


def _text(value: object) -> str:
    return value if isinstance(value, str) else ""


def _first(struct: Mapping, names: tuple[str, ...]) -> Any:
    return next((struct[name] for name in names if name in struct), None)


def _of_matrix(name: str, values: np.ndarray) -> Found:
    """Yield the columns of a matrix, or its rows where they are longer; the first of them is the times when it grows."""
    if values.ndim != 2 or values.dtype.kind not in "fiub" or min(values.shape) < 2:
        return
    columns = (values if values.shape[0] < values.shape[1] else values.T).astype(float)
    times = columns[0] if _grow(columns[0]) else None
    for number, column in enumerate(columns, 1):
        if number > 1 or times is None:
            head = f"{name}[{number}]"
            yield [head], Channel(head, head, "", column, times)


def _inside(path: str, value: Any, times: Floats | None = None) -> Found:
    """Yield the channels of a struct, or of each element of a list, over the ``times`` of the struct around it if it has none."""
    if isinstance(value, list):
        for number, one in enumerate(value, 1):
            yield from _inside(f"{path}[{number}]", one, times)
    elif isinstance(value, dict):
        if "signals" in value:
            yield from _of_signals(path, value)
        elif "X" in value and "Y" in value:
            yield from _of_controldesk(path, value)
        else:
            yield from _of_struct(path, value, times)


def _of_signals(path: str, struct: Mapping) -> Found:
    """Yield the columns of Simulink's structure with time: the signals of To Workspace, of a scope's axes, or of root ports."""
    times = _vector(struct.get("time"))
    signals = struct["signals"]
    for number, one in enumerate(signals if isinstance(signals, list) else [signals], 1):
        if not isinstance(one, dict) or not isinstance(values := one.get("values"), np.ndarray) or values.dtype.kind not in "fiub":
            continue
        place = f"{path}.signals[{number}].values" if isinstance(signals, list) else f"{path}.signals.values"
        rows = len(times) if times is not None else values.shape[0]
        if values.ndim > 1 and values.shape[-1] == rows != values.shape[0]:  # a matrix at each time
            values = values.reshape(-1, rows, order="F").T
        if values.ndim > 2 or values.ndim == 0 or values.shape[0] != rows or rows < 2:
            continue
        label = _text(one.get("label")).strip()
        columns = values.astype(float).reshape(rows, -1).T
        for k, column in enumerate(columns, 1):
            head = place if len(columns) == 1 else f"{place}[{k}]"
            name, unit = split_head(label) if label and len(columns) == 1 else (head, "")
            yield [head], Channel(head, name, unit, column, times)


def _of_controldesk(path: str, struct: Mapping) -> Found:
    """Yield the signals of dSPACE's recording: Y(k).Data over the X that Y(k).XIndex names."""
    axes, signals = ([one] if isinstance(one, dict) else one for one in (struct["X"], struct["Y"]))
    for number, one in enumerate(signals if isinstance(signals, list) else [], 1):
        column = _vector(one.get("Data")) if isinstance(one, dict) else None
        if column is None:
            continue
        index = one.get("XIndex", 1)
        axis = axes[int(index) - 1] if isinstance(axes, list) and np.ndim(index) == 0 and 1 <= int(index) <= len(axes) else {}
        times, over = _times_of(axis)
        head = _text(one.get("Name")) or f"{path}.Y[{number}]"
        stated = _text(one.get("Unit"))
        name, unit = (head, unit_of(stated) or stated) if stated else split_head(head)
        fits = times is not None and len(times) == len(column)
        yield [f"{path}.Y[{number}]"], Channel(head, name, unit, column, times if fits else None, over)


def _times_of(axis: object) -> tuple[Floats | None, str]:
    """Return the times [s] of an X of ControlDesk, or what else it is."""
    if not isinstance(axis, dict) or (values := _vector(axis.get("Data"))) is None:
        return None, ""
    stated = _text(axis.get("Unit")) or "s"
    unit = unit_of(stated)
    if unit is None or UNITS[unit][0] != "time":
        return None, f"'{_text(axis.get('Name')) or 'X'}' in {stated}"
    return values * UNITS[unit][1], ""


def _of_struct(path: str, struct: Mapping, around: Floats | None) -> Found:
    """Yield the vectors of a struct, with the times of the one that is named t or time if they fit, and what is in its structs."""
    units, names = (struct[one] if isinstance(struct.get(one), dict) else {} for one in ("units", "names"))
    own = _text(_first(struct, UNIT))
    vectors = {name: column for name, value in struct.items() if (column := _vector(value)) is not None}
    axis = next((name for name in TIMES if _grow(vectors.get(name))), None)
    times = around
    if axis is not None:
        times = vectors.pop(axis)
        times = times * _factor(units.get(axis), times)
    for name, column in vectors.items():
        plain, unit = split_head(name)
        fits = times is not None and len(times) == len(column)
        stated = _text(units.get(name)) or own
        alone = fits and len(vectors) == 1 and not names  # a struct for each signal, which then has the signal's name
        label = _text(_first(struct, LABELS)) if alone else ""
        head = str(names.get(name, f"{path}.{name}"))
        shown = label or (path if alone else str(names.get(name, plain if not stated else name)))
        yield [f"{path}.{name}"], Channel(head, shown, str(stated or unit), column, times if fits else None)
    for name, value in struct.items():
        if name not in vectors and name != axis and name not in ("units", "names"):
            if (texts := _texts(value)) is not None and times is not None and len(texts) == len(times):
                yield [f"{path}.{name}"], Channel(f"{path}.{name}", name, "", text_cells(name, texts, f"variable {path}"), times)
            elif isinstance(value, np.ndarray) and value.ndim == 2:
                yield from _columns(f"{path}.{name}", value, times)
            else:
                yield from _inside(f"{path}.{name}", value, times)


def _columns(path: str, values: np.ndarray, times: Floats | None) -> Found:
    """Yield the columns of a matrix in a struct, over the struct's times where they fit."""
    if times is None or len(times) not in values.shape:
        yield from _of_matrix(path, values)
        return
    if values.dtype.kind in "fiub":
        rows = values if values.shape[0] == len(times) else values.T
        for number, column in enumerate(rows.T.astype(float), 1):
            yield [f"{path}[{number}]"], Channel(f"{path}[{number}]", f"{path}[{number}]", "", column, times)


def _factor(unit: object, values: Floats) -> float:
    """Return the factor of times to s, by their unit or, without one, by their size (days of MATLAB, ms since 1970)."""
    return TIME_UNITS[time_unit_of(_text(unit)) or unit_of_numbers(values)]


def _of_asammdf(tree: dict[str, Any]) -> Found:
    """Yield, and take out of the tree, the channels DGn_NAME over the times DGMn_NAME."""
    found = {name: match for name in tree if (match := _ASAMMDF.fullmatch(name)) and isinstance(tree[name], np.ndarray)}
    masters = {match[2]: _vector(tree[name]) for name, match in found.items() if match[1] == "DGM"}
    for name, match in found.items():
        if match[2] in masters:
            column, times = _vector(tree.pop(name)), masters[match[2]]
            if match[1] == "DG" and column is not None:
                fits = _grow(times) and times is not None and len(times) == len(column)
                plain, unit = split_head(match[3])
                yield [f"DG{match[2]}", name], Channel(match[3], plain, unit, column, times if fits else None)


def _of_catman(tree: dict[str, Any]) -> Found:
    """Yield, and take out of the tree, the channels N_Data with name and unit in N_Header, over the time channel before them."""
    times: Floats | None = None
    for name in [name for name in tree if _CATMAN.fullmatch(name)]:
        match = _CATMAN.fullmatch(name)
        header = tree.get(f"{name.removesuffix('Data')}Header")
        column = _vector(tree[name])
        if match is None or column is None or not isinstance(header, dict) or "SignalName" not in header:
            continue
        del tree[name], tree[f"{name.removesuffix('Data')}Header"]
        head, stated = _text(header["SignalName"]).strip() or name, _text(header.get("Unit")).strip()
        unit = unit_of(stated) or stated
        if UNITS.get(unit, ("",))[0] == "time" and _grow(column):
            times = column * UNITS[unit][1]
            continue
        fits = times is not None and len(times) == len(column)
        yield [f"{match[1]}{match[2]}"], Channel(head, head, unit, column, times if fits else None)
