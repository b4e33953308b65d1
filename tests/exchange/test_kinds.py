# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a file is is decided by its content; what is something else than its ending says is read, or refused with the way out."""

from __future__ import annotations

import io
import struct
import zipfile

import can
import numpy as np
import pyarrow as pa
import pyarrow.parquet
import pytest
from nptdms import ChannelObject, TdmsWriter

from rig_nodes.bags.exchange.foreign import read_foreign
from rig_nodes.bags.reader import Bag
from rig_nodes.base.errors import RigError
from rig_nodes.cli.main import main

T = np.arange(300) * 2e-3
TORQUE, PRESSURE = 10.0 + np.sin(5.0 * T), 2.0 + np.cos(T)


def packed(**files):
    made = io.BytesIO()
    with zipfile.ZipFile(made, "w") as archive:
        for name, text in files.items():
            archive.writestr(name.replace("__", "/"), text)
    return made.getvalue()


def trace(ending):
    """Returns a CAN log as python-can writes it."""

    def write(folder):
        with can.Logger(folder / f"made{ending}") as log:
            for k in range(3):
                log(can.Message(arbitration_id=0x101, data=bytes(8), timestamp=1.0 + k, channel=0, is_extended_id=False))
        return (folder / f"made{ending}").read_bytes()

    return write


FRAMES = "import takes measured signals; decode the frames to signals first"
ANOTHER = {
    "Vector's trace as .asc": ("x.asc", trace(".asc"), "is a CAN trace of Vector (ASC); " + FRAMES),
    "candump": ("x.log", trace(".log"), "is a CAN log of candump; " + FRAMES),
    "candump's terminal": ("x.txt", "  can0  101   [8]  00 01 02 03 04 05 06 07\n", "is a CAN log of candump; " + FRAMES),
    "BLF": ("x.blf", trace(".blf"), "is a CAN log of Vector (BLF); " + FRAMES),
    "PEAK": ("x.trc", trace(".trc"), "is a CAN trace of PEAK (TRC); " + FRAMES),
    "LabVIEW": ("x.lvm", "LabVIEW Measurement\t\nWriter_Version\t2\n", "is a LabVIEW measurement file (LVM); save it as TDMS"),
    "DIAdem": (
        "x.dat",
        "DIAEXTENDED  {@:ENGLISH\n#BEGINGLOBALHEADER\n",
        "is the header of a DIAdem data set; export the data set as",
    ),
    "TDM": (
        "x.tdm",
        '<?xml version="1.0"?>\n<usi:tdm xmlns:usi="x">',
        "is the description of a TDM data set; export the data set as TDMS",
    ),
    "HTML as .xls": ("x.xls", "<html><table><tr><td>1</td>", "is XML or HTML; save the table as CSV or xlsx"),
    "old Excel": ("x.xlsx", b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1" + bytes(600), "is a workbook of Excel 97 (.xls); save it as .xlsx"),
    "xlsb": (
        "x.xlsx",
        packed(xl__workbook="", **{"xl__workbook.bin": "x"}),
        "is a binary workbook of Excel (.xlsb); save it as .xlsx",
    ),
    "LibreOffice": (
        "x.ods",
        packed(mimetype="application/vnd.oasis.opendocument.spreadsheet"),
        "is a workbook of LibreOffice (.ods)",
    ),
    "archive": ("x.csv", packed(a="1;2"), "is an archive; unpack it"),
    "half an archive": ("x.xlsx", b"PK\x03\x04 and no more", "is a damaged archive or workbook"),
    "gzip": ("x.csv", b"\x1f\x8b\x08\0\0\0", "is packed by gzip; unpack it"),
    "HDF5": ("x.h5", b"\x89HDF\r\n\x1a\n" + bytes(600), "is HDF5 of another program; export its signals as MDF, Parquet or CSV"),
    "a bag": ("x.csv", b"\x89MCAP0\r\n", "is a bag, which is a run already; name it to rig report"),
    "index of TDMS": ("x.tdms", b"TDSh" + bytes(40), "is the index of a TDMS file; import the .tdms beside it"),
    "FAMOS": ("x.dat", b"|CF,2,1,1;|CK,1,3,1,1;", "is an imc FAMOS file; export it as MDF, Parquet or CSV"),
    "unknown": (
        "x.d97",
        bytes(range(256)),
        "is not text, although its ending is .d97, and none of the formats that are read (a MAT file",
    ),
    "JSON": ("x.json", '{"t":{"0":' + "1.0," * 50_000 + "}}", "is JSON; write the table as CSV or Parquet"),
    "one long line": ("x.txt", "a" * 200_000, "no row of numbers is among its first 1 lines"),
    "empty": ("x.tdms", b"", "is empty"),
    "damaged TDMS": ("x.tdms", struct.pack("<4sIIQQ", b"TDSm", 0x0E, 4713, 100, 100) + b"\xff" * 200, "cannot be read as TDMS"),
}


@pytest.mark.parametrize("case", ANOTHER.values(), ids=ANOTHER)
def test_a_file_of_another_kind_is_refused_with_the_way_out(case, tmp_path, capfd):
    name, content, sentence = case
    content = content(tmp_path) if callable(content) else content
    (tmp_path / name).write_bytes(content.encode() if isinstance(content, str) else content)
    assert main(["import", str(tmp_path / name), "--rig", "hydmag", "--out", str(tmp_path / "run")]) == 2
    error = capfd.readouterr().err
    assert f"{name}: {sentence}" in error and error.count("\n") == 1 and not (tmp_path / "run").exists()


def test_content_and_not_the_ending_decides_how_a_file_is_read(tmp_path):
    rows = "".join(f"{t:.3f};{a:.6f}\n" for t, a in zip(T, TORQUE))
    (tmp_path / "text.dat").write_text("t [s];M_wej [Nm]\n" + rows)
    pa.parquet.write_table(pa.table({"t [s]": T, "M_wej [Nm]": TORQUE}), tmp_path / "table.csv")
    for name in ("text.dat", "table.csv"):
        found = read_foreign(tmp_path / name).channels
        assert [one.name for one in found] == ["t", "M_wej"] and found[1].values == pytest.approx(TORQUE, abs=1e-6)


def tdms(path, *channels):
    with TdmsWriter(path) as file:
        file.write_segment([ChannelObject(group, name, values, about) for group, name, values, about in channels])
    return path


def wave(unit, step=2e-3, **more):
    return {"wf_increment": step, "wf_start_offset": 0.0, "wf_samples": 300, "unit_string": unit, **more}


def test_tdms_has_its_times_from_waveforms_dates_or_a_channel_of_times(tmp_path, capsys):
    begin = np.datetime64("2026-11-26T10:00:00.5")
    path = tdms(
        tmp_path / "x.tdms",
        ("bench", "Moment", TORQUE, wave("Nm", wf_start_time=begin)),
        ("late", "Druck", PRESSURE[:200], wave("bar", wf_start_time=begin + np.timedelta64(200, "ms"))),
        ("own", "Zeit", T * 1e3, {"unit_string": "ms"}),
        ("own", "Last [Nm]", TORQUE, {}),
        ("dated", "Datum", begin + (T * 1e6).astype("timedelta64[us]"), {}),
        ("dated", "Strom", PRESSURE, {"NI_UnitDescription": "mA"}),
    )
    (tmp_path / "p.yaml").write_text("rig: hydmag\ncolumns: {Moment: M_wej, Druck: p1, Last: M_wyj, Strom: I_zr_p1}\n")
    assert main(["import", str(path), "--profile", str(tmp_path / "p.yaml"), "--out", str(tmp_path / "run")]) == 0
    rows = Bag(tmp_path / "run").logger()
    assert (rows.t0, rows.period) == (0.0, 2e-3) and np.array_equal(rows.channels["M_wej"], TORQUE)
    assert np.allclose(rows.channels["M_wyj"], TORQUE) and np.allclose(rows.channels["I_zr_p1"], PRESSURE * 1e-3)
    assert np.isnan(rows.channels["p1"][:100]).all() and np.allclose(rows.channels["p1"][100:], 1e5 * PRESSURE[:200])
    assert main(["export", "mf4", str(tmp_path / "run"), "--out", str(tmp_path / "x.mf4")]) == 0
    import asammdf

    with asammdf.MDF(tmp_path / "x.mf4") as file:
        assert file.header.start_time.isoformat().startswith("2026-11-26T10:00:00.5")


def test_tdms_over_an_angle_of_one_name_in_two_groups_or_cut_off_is_not_taken_silently(tmp_path, capfd):
    path = tdms(tmp_path / "a.tdms", ("g", "M_wej", TORQUE, wave("Nm", wf_xunit_string="deg", wf_xname="phi")))
    found = read_foreign(path).channels[0]
    assert found.times is None and found.over == "'phi' in deg"
    path = tdms(tmp_path / "b.tdms", ("ECU", "n", TORQUE, wave("rpm")), ("bench", "n", TORQUE, wave("rpm")))
    assert [one.head for one in read_foreign(path).channels] == ["ECU/n", "bench/n"]
    path.write_bytes(path.read_bytes()[:-1000])
    assert read_foreign(path).notes == ["the file is cut off; what it holds until there was taken"]
    assert "WARNING" not in capfd.readouterr().err
    gears = ["I"] * 100 + ["II"] * 200
    found = read_foreign(tdms(tmp_path / "d.tdms", ("g", "M_wej", TORQUE, wave("Nm")), ("g", "gear", gears, wave(""))))
    assert [one.kind for one in found.channels] == ["numbers", "text"] and found.channels[1].texts() == gears
    assert np.array_equal(found.channels[1].times, found.channels[0].times)
    with pytest.raises(RigError, match="holds no channel of numbers"):
        read_foreign(tdms(tmp_path / "c.tdms", ("g", "text", ["a", "b"], {})))
