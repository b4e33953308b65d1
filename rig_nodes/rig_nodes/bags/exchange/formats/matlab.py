# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The format of MAT files: of version 4 to 7 by scipy and of version 7.3 by h5py, as a tree of structs, lists, arrays and texts.

matlab_forms.py finds the channels in the tree.
"""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np

from ....base import RigError, optional
from ..foreign import Foreign, Form
from ..provenance import KEY, read_provenance
from .format import Format
from .heads import apart
from .matlab_forms import channels_of

HDF5 = b"\x89HDF\r\n\x1a\n"
DEEPEST = 30  # structs in each other
# how MATLAB writes an object's values as plain structs and arrays, by class; NAME is the variable
DATASET = (
    "for k = 1:NAME.numElements, e = NAME{k}; s.(matlab.lang.makeValidName(e.Name)) = struct('t', e.Values.Time, 'y', "
    "squeeze(e.Values.Data)); end, save('new.mat', '-struct', 's')"
)
REMEDIES = {
    "Simulink.SimulationData.Dataset": DATASET,
    "Simulink.SimulationOutput": "d = NAME.logsout; " + DATASET.replace("NAME", "d"),
    "timeseries": "s = struct('t', NAME.Time, 'y', squeeze(NAME.Data)); save('new.mat', 's')",
    "timetable": "s = table2struct(NAME, 'ToScalar', true); s.t = seconds(NAME.Properties.RowTimes); save('new.mat', 's')",
    "table": "s = table2struct(NAME, 'ToScalar', true); save('new.mat', 's')",
    "datetime": "t = seconds(NAME - NAME(1)); save('new.mat', 't', '-append')",
}
ANY = "s = struct('t', NAME.t, 'y', NAME.y); save('new.mat', 's'), with its own names of times and values"


class Opaque:
    """An object of a class of MATLAB, which only MATLAB reads; ``kind`` is the class, empty where the file does not tell it."""

    def __init__(self, kind: str) -> None:
        self.kind = kind


def read_matlab(path: Path, _form: Form) -> Foreign:
    """Read a MAT file.

    Parameters
    ----------
    path : Path
        The file.
    _form : Form
        Form of text, which this format does not need.

    Returns
    -------
    Foreign
        Its channels.

    Raises
    ------
    RigError
        When the file cannot be used; the error is one sentence.
    """
    with open(path, "rb") as file:
        is_hdf5 = HDF5 in file.read(1024)
    tree = _version_73(path) if is_hdf5 else _version_7(path)
    own = tree.pop(KEY.replace(".", "_"), None)
    provenance = read_provenance(own.get("json")) if isinstance(own, dict) else None
    channels = apart(list(channels_of(tree)))
    objects = list(_objects(tree))
    if objects and len(channels) < 2:  # what else is there is at most the times
        name, kind = objects[0]
        line = REMEDIES.get(kind, ANY).replace("NAME", name)
        raise RigError(f"{path}: '{name}' is {_named(kind)}, which only MATLAB can read; there, write its values by {line}")
    if not channels:
        raise RigError(f"{path}: holds no vector of numbers and no struct of such vectors")
    notes = [f"'{name}' was left out; it is {_named(kind)}, which only MATLAB can read" for name, kind in objects]
    return Foreign(path, channels, provenance=provenance, notes=notes)


def _named(kind: str) -> str:
    return f"an object of class {kind}" if kind else "an object"


def _objects(tree: object, name: str = "") -> Any:
    """Yield name and class of each object in a tree."""
    if isinstance(tree, Opaque):
        yield name, tree.kind
    elif isinstance(tree, dict):
        for key, value in tree.items():
            yield from _objects(value, f"{name}.{key}" if name else key)
    elif isinstance(tree, list):
        for number, value in enumerate(tree, 1):
            yield from _objects(value, f"{name}({number})")


# ---- version 4 to 7


def _version_7(path: Path) -> dict[str, Any]:
    from scipy.io import loadmat

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of objects, which are refused here in a sentence
        found = loadmat(path, squeeze_me=True, struct_as_record=True)
    tree = {name: _plain(value) for name, value in found.items() if not name.startswith("__")}
    if isinstance(unnamed := tree.pop("None", None), Opaque):  # scipy takes the name of an object for a part of it
        tree[_part(found["None"], "s0") or "object"] = unnamed
    return tree


def _plain(value: Any, depth: int = 0) -> Any:
    """Return a value of scipy as dict, list, array, text or Opaque."""
    from scipy.io.matlab import MatlabFunction, MatlabObject, MatlabOpaque

    if depth > DEEPEST or isinstance(value, (MatlabFunction, MatlabObject, MatlabOpaque)):
        return Opaque(_class_of(value))
    if isinstance(value, np.void) and value.dtype.names:
        return {name: _plain(value[name], depth + 1) for name in value.dtype.names}
    if isinstance(value, np.ndarray):
        if value.dtype.names:
            parts = [_plain(one, depth + 1) for one in value.ravel()]
            return parts[0] if value.ndim == 0 else parts
        if value.dtype == object:
            parts = [_plain(one, depth + 1) for one in value.ravel()]
            return parts[0] if value.ndim == 0 else parts
    return str(value) if isinstance(value, (str, np.str_)) else value


def _class_of(value: Any) -> str:
    """Return the class of an object of scipy as far as the file tells it."""
    return str(getattr(value, "classname", "")) or _part(value, "s2")


def _part(value: Any, name: str) -> str:
    """Return a text of scipy's record of an object; empty where there is none."""
    names = value.dtype.names if isinstance(value, np.ndarray) else None
    text = value.ravel()[0][name] if names and name in names and value.size else ""
    text = text.decode("latin-1") if isinstance(text, bytes) else str(text)
    return text if text.isprintable() else ""


# ---- version 7.3


def _version_73(path: Path) -> dict[str, Any]:
    h5py = optional("h5py", "mdf")
    with h5py.File(path, "r") as file:
        return {name: _of_hdf5(h5py, file, value) for name, value in file.items() if not name.startswith("#")}


def _of_hdf5(h5py: Any, file: Any, node: Any, depth: int = 0) -> Any:
    """Return a group or data set of HDF5, with MATLAB's attributes, as dict, list, array, text or Opaque."""
    kind = node.attrs.get("MATLAB_class", b"")
    kind = kind.decode("latin-1") if isinstance(kind, bytes) else str(kind)
    if depth > DEEPEST or "MATLAB_object_decode" in node.attrs:
        return Opaque(kind)
    if isinstance(node, h5py.Group):
        fields = {name: value for name, value in node.items() if not name.startswith("#")}
        arrays = [value for value in fields.values() if isinstance(value, h5py.Dataset) and "MATLAB_class" not in value.attrs]
        if fields and len(arrays) == len(fields) and all(one.dtype.kind == "O" for one in arrays):  # an array of structs
            rows = {name: _referred(h5py, file, value, depth) for name, value in fields.items()}
            return [dict(zip(rows, them)) for them in zip(*rows.values())]
        return {name: _of_hdf5(h5py, file, value, depth + 1) for name, value in fields.items()}
    if "MATLAB_empty" in node.attrs:
        return "" if kind == "char" else np.zeros(0)
    if kind == "char":
        return "".join(map(chr, np.asarray(node[()]).ravel()))
    if node.dtype.kind == "O":
        parts = _referred(h5py, file, node, depth)
        return parts if kind == "cell" else Opaque(kind)
    if node.dtype.kind not in "fiub":
        return Opaque(kind)
    values = np.squeeze(np.asarray(node[()]).T)  # MATLAB's columns are rows in HDF5
    return values if values.ndim else values[()]


def _referred(h5py: Any, file: Any, node: Any, depth: int) -> list:
    found = [one for one in np.asarray(node[()]).T.ravel(order="F") if isinstance(one, h5py.Reference)]
    return [_of_hdf5(h5py, file, file[one], depth + 1) for one in found]


FORMAT = Format("a MAT file", lambda _path, head: head.startswith((b"MATLAB 5.0 MAT", b"MATLAB 7.3 MAT")), read_matlab, ".mat")
