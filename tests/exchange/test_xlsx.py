# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Workbooks: the table of a sheet with its lines of names and units, dates as times, and cells that say there is no value."""

from __future__ import annotations

import datetime

import numpy as np
import openpyxl
import pytest

from rig_nodes.bags.exchange.foreign import read_foreign
from rig_nodes.bags.reader import Bag
from rig_nodes.base.errors import RigError
from rig_nodes.cli.main import main

N = 200
T = np.arange(N) * 0.01
TORQUE, PRESSURE = 10.0 + np.round(np.sin(5.0 * T), 4), 2.0 + np.round(np.cos(T), 4)
BEGIN = datetime.datetime(2026, 11, 26, 23, 59, 59)
COLUMNS = "columns: {Moment: M_wej, Druck: p1}\n"


def written(path, *sheets, hidden=()):
    """Writes a workbook of (name, rows)."""
    book = openpyxl.Workbook()
    book.remove(book.active)
    for name, rows in sheets:
        sheet = book.create_sheet(name)
        for row in rows:
            sheet.append(row)
        sheet.sheet_state = "hidden" if name in hidden else "visible"
    book.save(path)
    return path


def table(times=T, torque=TORQUE, pressure=PRESSURE):
    return [list(row) for row in zip(times if isinstance(times, list) else times.tolist(), torque, pressure)]


def imported(path, profile):
    (path.parent / "p.yaml").write_text("rig: hydmag\n" + profile)
    return main(["import", str(path), "--profile", str(path.parent / "p.yaml"), "--out", str(path.parent / "run")])


def test_a_sheet_with_heads_units_dates_and_a_footer_is_read_and_named(tmp_path, capsys):
    dates = [BEGIN + datetime.timedelta(seconds=float(t)) for t in T]
    rows = [["Prüfstand 3"], ["Datum", BEGIN], [], ["Zeit", "Moment", "Druck", "Bemerkung"], [None, "[Nm]", "[bar]", None]]
    rows += [[*row, "ok"] for row in table(dates)] + [[], ["Messung fertig"]]
    path = written(tmp_path / "x.xlsx", ("Deckblatt", [["Kunde", "A"], ["Nr.", 5]]), ("Messung", rows))
    assert imported(path, "time: Zeit\n" + COLUMNS) == 0
    out = capsys.readouterr().out
    assert "note: read from the sheet 'Messung'" in out and "row 207 is no row of values and was left out: 'Messung fertig'" in out
    rows = Bag(tmp_path / "run").logger()
    assert (rows.t0, rows.period) == (0.0, pytest.approx(0.01)) and np.allclose(rows.channels["M_wej"], TORQUE)
    assert np.allclose(rows.channels["p1"], 1e5 * PRESSURE)


def test_the_rigs_own_heads_need_no_profile_and_error_cells_are_missing(tmp_path, capsys):
    heads = ["t [s]", "M_wej [Nm]", "n_wej [rpm]", "M_wyj [Nm]", "n_wyj [rpm]", "p1 [bar]", "p2 [bar]"]
    rows = [[t, *[a] * 6] for t, a in zip(T.tolist(), TORQUE.tolist())]
    rows[50][1], rows[60][1] = "#DIV/0!", None
    path = written(tmp_path / "x.xlsm", ("A", [heads, *rows]))
    assert main(["import", str(path), "--rig", "hydmag", "--out", str(tmp_path / "run")]) == 0
    assert f"2 of {6 * N} values are missing" in capsys.readouterr().out
    torque = Bag(tmp_path / "run").logger().channels["M_wej"]
    assert np.flatnonzero(np.isnan(torque)).tolist() == [50, 60] and torque[0] == TORQUE[0]


def test_dates_beside_times_unnamed_columns_and_averages_are_read_for_what_they_are(tmp_path, capsys):
    dates = [BEGIN + datetime.timedelta(seconds=float(t)) for t in T]
    rows = [[one.date(), one.time(), a, p] for one, a, p in zip(dates, TORQUE, PRESSURE)]
    path = written(tmp_path / "x.xls", ("A", [["Datum", "Zeit", "Moment [Nm]", "Druck [bar]"], *rows, ["Mittel", None, 1.0, 2.0]]))
    (tmp_path / "other").mkdir()
    head = [None, "Moment [Nm]", "Druck [bar]"]
    for one in (path, written(tmp_path / "other" / "x.xlsx", ("A", [head, *table(times=dates)]))):
        assert imported(one, COLUMNS) == 0
        assert "left out: 'Datum'" not in (out := capsys.readouterr().out) and out.count("time 0 of the run is 2026-11-26") == 1
        rows = Bag(one.parent / "run").logger()
        assert rows.period == pytest.approx(0.01) and np.allclose(rows.channels["M_wej"], TORQUE)


def test_a_small_table_on_the_first_sheet_is_not_taken_for_the_recording(tmp_path):
    info = [["a", "b"], *[[float(k), 2.0] for k in range(4)]]
    path = written(tmp_path / "x.xlsx", ("Info", info), ("Daten", [["t [s]", "M_wej [Nm]", "p1 [bar]"], *table()]))
    assert read_foreign(path).notes == ["read from the sheet 'Daten'; others with tables are 'Info', for 'sheet' in a profile"]


def test_texts_of_three_decimals_are_read_as_the_other_columns_show(tmp_path):
    rows = [[f"{t:.3f}".replace(".", ","), f"{a:.4f}".replace(".", ","), p] for t, a, p in table(times=(T + 3.0).tolist())]
    assert imported(written(tmp_path / "x.xlsx", ("A", [["t [s]", "Moment [Nm]", "Druck [bar]"], *rows])), COLUMNS) == 0
    assert Bag(tmp_path / "run").logger().t0 == 3.0


def test_another_sheet_is_taken_when_a_profile_names_it(tmp_path, capsys):
    heads = ["Zeit [s]", "Moment [Nm]", "Druck [bar]"]
    path = written(
        tmp_path / "x.xlsx", ("one", [heads, *table()]), ("two", [heads, *table(torque=2.0 * TORQUE)]), ("old", [heads, *table()]),
        hidden=("old",),
    )  # fmt: skip
    assert "read from the sheet 'one'; others with tables are 'two', for 'sheet' in a profile" in read_foreign(path).notes[0]
    assert imported(path, "sheet: two\n" + COLUMNS) == 0
    assert np.allclose(Bag(tmp_path / "run").logger().channels["M_wej"], 2.0 * TORQUE)
    assert imported(path, "sheet: tow\n" + COLUMNS) == 2
    assert "there is no sheet 'tow'; did you mean 'two'" in capsys.readouterr().err


def test_numbers_as_text_are_read_by_their_signs_and_a_proposal_names_the_sheet(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    rows = [[t, f"{a:.4f}".replace(".", ","), f"{p:.4f}".replace(".", ",")] for t, a, p in table()]
    path = written(tmp_path / "x.xlsx", ("Messung", [["Zeit [s]", "Moment [Nm]", "Druck [bar]"], *rows]))
    assert main(["import", "x.xlsx", "--rig", "hydmag"]) == 0
    assert 'sheet: "Messung"' in (tmp_path / "x.profile.yaml").read_text() and "nothing is imported yet" in capsys.readouterr().out
    assert imported(path, COLUMNS) == 0
    assert np.allclose(Bag(tmp_path / "run").logger().channels["p1"], 1e5 * PRESSURE)


def test_a_truth_value_is_no_number(tmp_path):
    rows = [[t, a, True if n == 5 else p] for n, (t, a, p) in enumerate(table())]
    path = written(tmp_path / "x.xlsx", ("A", [["t [s]", "Moment [Nm]", "Druck [bar]"], *rows]))
    with pytest.raises(RigError, match=r"has 'True' in column 'Druck \[bar\]' where a number is expected"):
        read_foreign(path).channels[2].values


def test_two_columns_of_one_head_are_told_apart(tmp_path):
    path = written(tmp_path / "x.xlsx", ("A", [["t [s]", "p [bar]", "p [bar]"], *table()]))
    assert [one.head for one in read_foreign(path).channels] == ["t [s]", "column 2/p [bar]", "column 3/p [bar]"]


@pytest.mark.parametrize(
    "rows, sentence",
    [
        ([["a", "b"], ["c", "d"]], "no sheet has a table of numbers; formulas have values only after Excel or LibreOffice"),
        ([], "no sheet has a table of numbers"),
        (table(), "sheet 'A' has no rows of values below a row of names"),
    ],
    ids=["text", "empty", "no heads"],
)
def test_a_workbook_without_a_table_is_refused_in_one_sentence(rows, sentence, tmp_path):
    with pytest.raises(RigError, match=sentence) as refusal:
        read_foreign(written(tmp_path / "x.xlsx", ("A", rows)))
    assert "\n" not in str(refusal.value)


def test_a_damaged_workbook_is_refused_in_one_sentence(tmp_path):
    path = written(tmp_path / "x.xlsx", ("A", [["t", "p"], *table()]))
    data = path.read_bytes()
    at = data.index(b"xl/worksheets/sheet1.xml") + 200
    path.write_bytes(data[:at] + bytes(200) + data[at + 200 :])
    with pytest.raises(RigError, match="cannot be read as a workbook"):
        read_foreign(path)
