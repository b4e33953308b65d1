# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""MAT files of all versions, in the forms of Simulink, ControlDesk, catman and asammdf, are read by the names of their paths."""

from __future__ import annotations

import struct
import warnings

import h5py
import numpy as np
import pytest
from scipy.io import savemat

from rig_nodes.bags.exchange.foreign import read_foreign
from rig_nodes.bags.reader import Bag
from rig_nodes.base.errors import RigError
from rig_nodes.cli.main import main

N = 300
T = np.arange(N) * 2e-3
A, B, C = 10.0 + np.sin(5.0 * T), 2.0 + np.cos(3.0 * T), 50.0 + np.sin(T)
TABLE = np.column_stack([A, B, C])

FORMS = {
    "structure with time": (
        {"simout": {"time": T, "signals": {"values": TABLE, "dimensions": 3.0, "label": "bench"}, "blockName": "m/Out"}},
        "simout.signals.values[{}]",
    ),
    "scope with axes": (
        {"s": {"time": T, "signals": [{"values": A, "label": "Moment"}, {"values": TABLE[:, 1:], "label": ""}]}},
        ("Moment", "s.signals[2].values[1]", "s.signals[2].values[2]"),
    ),
    "matrices of signals": (
        {"s": {"time": T, "signals": {"values": TABLE.T.reshape(3, 1, N), "label": ""}}},
        "s.signals.values[{}]",
    ),
    "structs in each other": (
        {"run": {"time": T, "units": {"time": "s"}, "torque": {"in": A, "deep": {"out": B}}, "p": C}},
        ("run.torque.in", "run.torque.deep.out", "run.p"),
    ),
    "To File": ({"ans": np.vstack([T, TABLE.T])}, ("ans[2]", "ans[3]", "ans[4]")),
    "array with times": ({"x": np.column_stack([T, TABLE])}, ("x[2]", "x[3]", "x[4]")),
    "ControlDesk": (
        {
            "exp": {
                "X": [{"Name": "time", "Data": T * 1e3, "Unit": "ms"}],
                "Y": [{"Name": name, "Data": one, "XIndex": 1.0, "Unit": "Nm"} for name, one in zip("abc", TABLE.T)],
            }
        },
        ("a", "b", "exp.Y[3]|c"),
    ),
    "a struct for each signal": (
        {name: {"t": T, "y": one, "unit": "Nm"} for name, one in zip(("foo", "bar", "baz"), TABLE.T)},
        ("foo.y", "bar", "baz.y"),
    ),
    "structs in structs": (
        {"run": {"rig": {"time": T, "m": A, "n": B}, "more": [{"t": T, "p": C}, {"t": T, "p": A}]}},
        ("run.rig.m", "n", "run.more[1].p"),
    ),
    "matrix in a struct": ({"run": {"t": T, "u": TABLE}}, "run.u[{}]"),
    "catman": (
        {
            "Channel_1_Data": T,
            "Channel_1_Header": {"SignalName": "Zeit  1 - Standardmessrate", "Unit": "s"},
            **{f"Channel_{n}_Data": one for n, one in enumerate(TABLE.T, 2)},
            **{f"Channel_{n}_Header": {"SignalName": f"Moment {n}", "Unit": "Nm"} for n in (2, 3, 4)},
        },
        ("Moment 2", "Moment 3", "Moment 4"),
    ),
    "asammdf": ({"DGM0_timestamps": T, "DG0_a": A, "DG0_b": B, "DGM1_timestamps": T, "DG1_a": C}, ("DG0/a", "b", "DG1/a")),
}


def to_hdf5(place, name, value):
    """Writes a value as MATLAB does in version 7.3: arrays transposed, an array of structs as references for each field."""
    if isinstance(value, dict):
        group = place.create_group(name)
        for key, inner in value.items():
            to_hdf5(group, key, inner)
        group.attrs["MATLAB_class"] = np.bytes_("struct")
    elif isinstance(value, list):
        group, store = place.create_group(name), place.file.require_group("#refs#")
        for key in value[0]:
            refs = []
            for one in value:
                where = f"r{len(store)}"
                to_hdf5(store, where, one.get(key, ""))
                refs.append([store[where].ref])
            group.create_dataset(key, data=np.array(refs, h5py.ref_dtype))
        group.attrs["MATLAB_class"] = np.bytes_("struct")
    elif isinstance(value, str):
        text = place.create_dataset(name, data=np.array([[ord(c)] for c in value] or [[0]], np.uint16))
        text.attrs["MATLAB_class"] = np.bytes_("char")
        if not value:
            text.attrs["MATLAB_empty"] = 1
    else:
        place.create_dataset(name, data=np.atleast_2d(value) if np.ndim(value) < 2 else np.asarray(value).T)
        place[name].attrs["MATLAB_class"] = np.bytes_("double")


def written(folder, tree, version):
    path = folder / "x.mat"
    if version == "7.3":
        with h5py.File(path, "w", userblock_size=512) as file:
            for name, value in tree.items():
                to_hdf5(file, name, value)
        head = b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\0\2IM"
        path.write_bytes(head.ljust(512, b"\0") + path.read_bytes()[512:])
    else:
        listed = {name: _cells(value) for name, value in tree.items()}
        savemat(path, listed, format=version, long_field_names=version == "5", oned_as="column")
    return path


def _cells(value):
    """Returns a tree in which each list of dicts is an array of structs."""
    if isinstance(value, dict):
        return {key: _cells(inner) for key, inner in value.items()}
    if isinstance(value, list):
        keys = list(dict.fromkeys(key for one in value for key in one))
        out = np.zeros((1, len(value)), [(key, object) for key in keys])
        for n, one in enumerate(value):
            for key in keys:
                out[0, n][key] = one.get(key, "")
        return out
    return value


def imported(path, names, profile=""):
    columns = ", ".join(f"'{name}': {{signal: {one}, unit: Nm}}" for name, one in zip(names, ("M_wej", "M_wyj")))
    (path.parent / "p.yaml").write_text(f"rig: hydmag\n{profile}columns: {{{columns}, '{names[2]}': {{signal: p1, unit: bar}}}}\n")
    return main(["import", str(path), "--profile", str(path.parent / "p.yaml"), "--out", str(path.parent / "run")])


@pytest.mark.parametrize("version", ["5", "7.3"])
@pytest.mark.parametrize("form", FORMS)
@pytest.mark.filterwarnings("error")
def test_a_mat_file_of_this_form_is_read_by_paths_and_has_its_own_times(form, version, tmp_path):
    tree, names = FORMS[form]
    names = [names.format(n) for n in (1, 2, 3)] if isinstance(names, str) else [name.partition("|")[2] or name for name in names]
    assert imported(written(tmp_path, tree, version), names) == 0
    rows = Bag(tmp_path / "run").logger()
    assert rows.period == 2e-3 and np.allclose(rows.channels["M_wej"], A)
    assert np.allclose(rows.channels["M_wyj"], B) and np.allclose(rows.channels["p1"], 1e5 * C)


def test_a_file_of_version_4_and_simulinks_tout_are_read(tmp_path):
    assert imported(written(tmp_path, {"tout": T, "u": TABLE}, "4"), [f"u[{n}]" for n in (1, 2, 3)], "time: tout\n") == 0
    assert Bag(tmp_path / "run").logger().period == 2e-3


def test_times_in_a_struct_may_be_days_of_matlab(tmp_path):
    tree = {"s": {"time": 740_000.0 + 5.0 * T / 86400.0, "a": A, "b": B, "c": C}}
    assert imported(written(tmp_path, tree, "5"), list("abc")) == 0
    assert Bag(tmp_path / "run").logger().period == pytest.approx(0.01, rel=1e-5)


@pytest.mark.parametrize("nested", [False, True])
def test_a_cell_array_of_texts_may_be_the_ordered_gear(nested, tmp_path):
    tree = {
        "t": T,
        "a": A,
        "b": B,
        "c": C,
        "gang": np.array(["I"] * 100 + ["II"] * 200, object),
        "who": np.array(["x", "y"], object),
    }
    savemat(tmp_path / "x.mat", {"s": tree} if nested else tree)
    assert imported(tmp_path / "x.mat", list("abc"), "gear: gang\n") == 0
    assert [name for _, _, name, _, _ in Bag(tmp_path / "run").events()] == ["gear_was", "shift_ordered"]


def test_what_is_recorded_over_another_quantity_is_refused(tmp_path, capsys):
    tree = {
        "exp": {"X": {"Name": "phi", "Data": T, "Unit": "deg"}, "Y": [{"Name": name, "Data": A, "XIndex": 1.0} for name in "abc"]}
    }
    assert imported(written(tmp_path, tree, "5"), list("abc")) == 2
    assert "'a' is recorded over 'phi' in deg and not over time" in capsys.readouterr().err


def test_a_name_that_two_structs_have_is_refused_with_both_paths(tmp_path, capsys):
    tree = {name: {"t": T, "y": A, "z": B} for name in ("foo", "bar", "baz")}
    assert imported(written(tmp_path, tree, "5"), ["foo.y", "y", "z"]) == 2
    assert "'y' is there 3 times, as 'foo.y', 'bar.y', 'baz.y'; name one of these" in capsys.readouterr().err


def with_object(folder, version, kind, name="ts", **tree):
    """Writes a file with vectors and one object of a class of MATLAB."""
    path = written(folder, {"tout": T, **tree}, version)
    if version == "7.3":
        with h5py.File(path, "a") as file:
            file.create_dataset(name, data=np.zeros((1, 6), np.uint32)).attrs.update(
                {"MATLAB_class": np.bytes_(kind), "MATLAB_object_decode": 3}
            )
        return path

    def element(number, data):
        return struct.pack("<II", number, len(data)) + data + bytes(-len(data) % 8)

    inner = element(6, struct.pack("<II", 13, 0)) + element(5, struct.pack("<ii", 6, 1)) + element(1, b"") + element(6, bytes(24))
    texts = b"".join(element(1, text.encode()) for text in (name, "MCOS", kind))
    with open(path, "ab") as file:
        file.write(element(14, element(6, struct.pack("<II", 17, 0)) + texts + element(14, inner)))
    return path


@pytest.mark.parametrize("version", ["5", "7.3"])
@pytest.mark.parametrize(
    "kind, line",
    [
        ("timeseries", "s = struct('t', ts.Time, 'y', squeeze(ts.Data)); save('new.mat', 's')"),
        ("timetable", "s = table2struct(ts, 'ToScalar', true); s.t = seconds(ts.Properties.RowTimes)"),
        ("Simulink.SimulationData.Dataset", "for k = 1:ts.numElements, e = ts{k};"),
        ("Simulink.SimulationOutput", "d = ts.logsout; for k = 1:d.numElements"),
        ("my.Class", "s = struct('t', ts.t, 'y', ts.y)"),
    ],
)
def test_an_object_is_answered_with_the_line_of_matlab_that_helps(kind, line, version, tmp_path, capsys):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert main(["import", str(with_object(tmp_path, version, kind)), "--rig", "hydmag"]) == 2
    error = capsys.readouterr().err
    assert f"'ts' is an object of class {kind}, which only MATLAB can read; there, write its values by " in error
    assert line in error and error.count("\n") == 1


def test_an_object_beside_signals_is_left_out_with_a_note(tmp_path, capsys):
    path = with_object(tmp_path, "5", "timeseries", a=A, b=B, c=C)
    assert imported(path, list("abc"), "time: tout\n") == 0
    assert "note: 'ts' was left out; it is an object of class timeseries, which only MATLAB can read" in capsys.readouterr().out


@pytest.mark.parametrize(
    "content", [b"MATLAB 5.0 MAT-file".ljust(128, b"\1") * 3, b"\x89HDF\r\n\x1a\n" + bytes(900)], ids=["5", "7.3"]
)
def test_a_damaged_file_is_refused_in_one_sentence(content, tmp_path):
    (tmp_path / "x.mat").write_bytes(content)
    with pytest.raises(RigError, match="x.mat: cannot be read as a MAT file"):
        read_foreign(tmp_path / "x.mat")
