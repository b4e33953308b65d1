# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Only the columns that are asked for are converted; what the others hold is named and spoils nothing."""

from __future__ import annotations

from decimal import Decimal

import numpy as np
import pytest
from small import HEADS, ROWS, measured, rpm, table, values

from rig_nodes.base.errors import RigError
from rig_nodes.cli.main import main

K = np.arange(ROWS)
TAKEN = "columns: {M_wej: M_wej, n_wej: n_wej}\n"


@pytest.mark.parametrize(
    "others, note",
    [
        ({"Status": lambda k: "OK"}, "1 column was left out: 'Status' (text)"),
        ({"Remark": lambda k: "Start" if k == 7 else ""}, "1 column was left out: 'Remark' (text)"),
        ({"Limit": lambda k: "OVERRANGE" if k % 2 else "#NV"}, "1 column was left out: 'Limit'"),
        ({"id": lambda k: str(2**60 + k)}, "1 column was left out: 'id'"),
        ({"a": lambda k: "x7", "b": lambda k: "1.500"}, "2 columns were left out: 'a' (text), 'b'"),
    ],
    ids=["status", "remark", "words", "large numbers", "several"],
)
def test_a_column_that_nobody_asked_for_spoils_no_text_file(others, note, tmp_path):
    found = measured(tmp_path, table(**others))
    assert rpm(found) == pytest.approx([1500.0, 1501.0]) and note in found.notes


def test_a_quote_that_is_not_closed_swallows_no_rows(tmp_path):
    found = measured(tmp_path, table(Bemerkung=lambda k: '"auf' if k == 100 else ""))
    assert len(found.channels["n_wej"]) == ROWS and not np.isnan(found.channels["n_wej"]).any()


def test_a_gap_in_a_slower_column_is_counted(tmp_path):
    found = measured(tmp_path, table(**{"I_zr_p1 [mA]": lambda k: "" if k % 10 or 100 < k < 200 else "5,0"}))
    assert np.isnan(found.channels["I_zr_p1"]).sum() == 99
    assert f"99 of {7 * ROWS} values are missing: 0 were bridged by straight lines, 99 in gaps over 2 ms stay empty" in found.notes


def test_texts_in_front_of_the_times_are_no_head(tmp_path):
    lines = table().splitlines()
    found = measured(tmp_path, "\n".join([f"Status;{lines[0]}", *(f"OK;{line}" for line in lines[1:])]))
    assert len(found.channels["n_wej"]) == ROWS


@pytest.mark.parametrize(
    "profile, names", [("gear: Gang\n", ("I", "II")), ("gear: {column: Gang, values: {eins: I, zwei: II}}\n", ("eins", "zwei"))]
)
def test_an_ordered_gear_may_be_a_text(profile, names, tmp_path):
    text = table(Gang=lambda k: names[k > 100])
    found = measured(tmp_path, text, profile=profile + TAKEN)
    assert [(round(t, 3), what) for t, _, what, _, _ in found.events] == [(3.101, "gear_was"), (3.101, "shift_ordered")]
    if names[0] == "eins":
        with pytest.raises(
            RigError, match=r"line 2 orders the gear eins; gears are .* names others, e.g. gear: \{column: Gang, values"
        ):
            measured(tmp_path, text, profile="gear: Gang\n" + TAKEN)


def test_a_proposal_names_texts_and_reads_the_rest(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text = table(Status=lambda k: "OK", Gang=lambda k: "II" if k > 100 else "I").replace("n_wej [rpm]", "Drehzahl Antrieb [1/min]")
    (tmp_path / "a.csv").write_text(text.replace("1500,000", "ERR", 1))
    assert main(["import", "a.csv"]) == 0
    proposed = (tmp_path / "a.profile.yaml").read_text()
    assert "# \"Status\": text, 'OK'" in proposed and 'gear: {column: "Gang"}' in proposed
    assert '"Drehzahl Antrieb [1/min]": {signal: n_wej, unit: "rpm"}  # line 2 has \'ERR\'' in proposed


@pytest.mark.parametrize("head", ["Öltemperatur", "Oeltemperatur 1", "OilTemp", "Temperatura oleju"])
def test_an_oil_temperature_is_found_by_its_name(head, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text = table(**{f"{head} [°C]": lambda k: "40,0"}).replace("n_wej [rpm]", "Drehzahl Antrieb [1/min]")
    (tmp_path / "a.csv").write_text(text)
    assert main(["import", "a.csv"]) == 0
    assert f'"{head} [°C]": {{signal: T_oil, unit: "degC"}}' in (tmp_path / "a.profile.yaml").read_text()


@pytest.mark.parametrize(
    "head", ["Gangwechselzeit [ms]", "Gang aktuell", "Soll-Druck 1 [bar]", "Tank pressure 1 [bar]", "Input speed setpoint [rpm]"]
)
def test_what_a_proposal_cannot_know_is_a_comment_in_it(head, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text = table(**{head: lambda k: "1,0"}).replace("p1 [bar]", "x [bar]").replace("n_wej [rpm]", "y [rpm]")
    (tmp_path / "a.csv").write_text(text)
    assert main(["import", "a.csv"]) == 0
    assert f'\n  # "{head}": {{signal: ?' in (tmp_path / "a.profile.yaml").read_text()


@pytest.mark.parametrize("head", ["x [%]", "Druck #2 [bar]", "a // b [bar]"])
def test_signs_of_comments_may_stand_in_heads(head, tmp_path):
    found = measured(tmp_path, table().replace("p1 [bar]", head), profile=f'columns: {{"{head}": {{signal: p1, unit: bar}}}}\n')
    assert found.channels["p1"][0] == pytest.approx(23.5e5)


def test_blanks_in_lines_with_tabs_group_thousands(tmp_path):
    assert rpm(measured(tmp_path, table(sep="\t").replace("1501,000", "1 501,000"))) == pytest.approx([1500.0, 1501.0])


def test_a_number_for_no_value_is_none_in_parquet_too(pa, tmp_path):
    speeds = [1500.0, -999.0, *[1500.0] * (ROWS - 2)]
    pa.parquet.write_table(pa.table({"t [s]": K * 1e-3, "n_wej [rpm]": speeds}), tmp_path / "a.parquet")
    found = measured(tmp_path, (tmp_path / "a.parquet").read_bytes(), "a.parquet", 'missing: ["-999"]\ncolumns: {n_wej: n_wej}\n')
    assert found.about["missing"] == 1 and rpm(found) == pytest.approx([1500.0, 1500.0])


@pytest.fixture(scope="module")
def pa():
    pytest.importorskip("pyarrow.parquet")
    import pyarrow

    return pyarrow


def parquet(pa, folder, others, profile=None, orders=None, times=True):
    """The measurement of a Parquet file with the usual columns, some of them replaced or added."""
    from pyarrow.parquet import write_table

    columns = {"t [s]": 3 + K / 1000} if times else {}
    columns |= {head: [values(k)[n] for k in range(ROWS)] for n, head in enumerate(HEADS)}
    write_table(pa.table(columns | others), folder / "a.parquet")
    return measured(folder, (folder / "a.parquet").read_bytes(), "a.parquet", profile, orders)


UNUSED = {
    "large whole numbers": (lambda pa: pa.array(2**60 + K), "'x'"),
    "unsigned": (lambda pa: pa.array([2**63 + k for k in range(ROWS)], pa.uint64()), "'x'"),
    "lists": (lambda pa: pa.array([[1.0, 2.0]] * ROWS), "'x' (list<element: double>)"),
    "bytes": (lambda pa: pa.array([b"a"] * ROWS), "'x' (binary)"),
    "nothing": (lambda pa: pa.nulls(ROWS), "'x' (no values)"),
    "categories": (lambda pa: pa.array(["a", "b"] * (ROWS // 2)).dictionary_encode(), "'x' (text)"),
    "decimals": (lambda pa: pa.array([Decimal("1.5")] * ROWS), "'x'"),
    "views of texts": (lambda pa: pa.array(["a"] * ROWS, pa.string_view()), "'x' (text)"),
    "map": (lambda pa: pa.array([[("a", 1)]] * ROWS, pa.map_(pa.string(), pa.int32())), "'x' (map<string, int32"),
}


@pytest.mark.parametrize("make, named", UNUSED.values(), ids=UNUSED)
def test_no_type_of_an_unused_parquet_column_is_a_fault_and_each_is_named(make, named, pa, tmp_path):
    found = parquet(pa, tmp_path, {"x": make(pa)})
    assert rpm(found) == pytest.approx([1500.0, 1501.0])
    assert any(note.startswith(f"1 column was left out: {named}") for note in found.notes)


USED = {
    "decimals": lambda pa: pa.array([None, *[Decimal("10.25")] * (ROWS - 1)]),
    "categories of numbers": lambda pa: pa.array([10.25] * ROWS).dictionary_encode(),
    "texts that leave the decimal sign open": lambda pa: pa.array(["10.250", *["10.25"] * (ROWS - 1)]),
    "texts with decimal commas": lambda pa: pa.array(["10,25"] * ROWS),
    "half precision": lambda pa: pa.array(np.full(ROWS, 10.25, np.float16)),
}


@pytest.mark.parametrize("make", USED.values(), ids=USED)
def test_a_parquet_column_that_is_used_is_converted(make, pa, tmp_path):
    assert parquet(pa, tmp_path, {"M_wej [Nm]": make(pa)}).channels["M_wej"].tolist() == [10.25] * ROWS


def test_a_parquet_file_may_have_its_times_as_decimals_or_texts_and_heads_that_are_there_twice(pa, tmp_path):
    texts = [f"{3 + k / 1000:.3f}" for k in range(ROWS)]
    for times in (pa.array([Decimal(one) for one in texts]), pa.array(texts)):
        found = parquet(pa, tmp_path, {"t [s]": times, "other": pa.array(["0.5"] * ROWS)})
        assert (found.t0, found.period) == (3.0, 1e-3)
    twice = pa.table([3 + K / 1000, K, K * 2.0], ["t [s]", "p1 [bar]", "p1 [bar]"])
    pa.parquet.write_table(twice, tmp_path / "b.parquet")
    found = measured(tmp_path, (tmp_path / "b.parquet").read_bytes(), "b.parquet", "columns: {'column 3/p1 [bar]': p1}\n")
    assert np.allclose(found.channels["p1"], 2e5 * K)


@pytest.mark.parametrize("form", ["{:.1f}", "0{}", "{},0"])
def test_a_gear_may_be_written_with_decimals(form, tmp_path):
    text = table(Gang=lambda k: form.format(1 + (k > 100)))
    for profile in ("gear: Gang\n", f"gear: {{column: Gang, values: {{'{form.format(1)}': II, '{form.format(2)}': I}}}}\n"):
        found = measured(tmp_path, text, profile=profile + TAKEN)
        assert [gear for *_, gear in found.events] == ([1.0, 2.0] if "values" not in profile else [2.0, 1.0])


def test_cells_and_heads_with_line_breaks_are_read(tmp_path):
    remark = table(Bemerkung=lambda k: '"Start;\n""heiss"""' if k == 100 else '12" Rohr' if k == 5 else "")
    found = measured(tmp_path, remark.replace("M_wej [Nm]", '"M_wej\n[Nm]"', 1))
    assert len(found.channels["M_wej"]) == ROWS and rpm(found) == pytest.approx([1500.0, 1501.0])
    assert "2 cells have a line break in quotes, which is counted as no line here" in found.notes


def test_fields_of_a_struct_are_columns_and_a_list_is_refused_with_its_type(pa, tmp_path):
    struct = pa.StructArray.from_arrays([pa.array(K / 2.0)], ["M [Nm]"])
    found = parquet(pa, tmp_path, {"run": struct}, profile="columns: {run.M: M_wyj, n_wej: n_wej}\n")
    assert np.array_equal(found.channels["M_wyj"], K / 2.0)
    with pytest.raises(RigError, match="column 'M_wej .Nm.' is of type list<element: double>, of which no numbers can be made"):
        parquet(pa, tmp_path, {"M_wej [Nm]": pa.array([[1.0]] * ROWS)})
    with pytest.raises(RigError, match="row 1 has '1.500' in column 'n_wej .rpm.', which is 1500 if"):
        parquet(pa, tmp_path, {"n_wej [rpm]": pa.array(["1.500", "1.501"] * (ROWS // 2))})


NS = 1710460799900000000
TIMES = {
    "timestamps": lambda pa: {"ts": pa.array(NS + K * 1000000, pa.timestamp("ns"))},
    "timestamps with a zone": lambda pa: {"ts": pa.array(NS // 1000 + K * 1000, pa.timestamp("us", tz="Europe/Warsaw"))},
    "whole nanoseconds": lambda pa: {"stamp": pa.array(NS + K * 1000000)},
    "durations": lambda pa: {"dt": pa.array(K * 1000, pa.duration("us"))},
    "dates and times of day": lambda pa: {
        "date": pa.array([19796 + int(k > 99) for k in K], pa.date32()),
        "time": pa.array((86399900 + K).astype(np.int32) % 86400000, pa.time32("ms")),
    },
    "texts": lambda pa: {"time": pa.array([f"2024-03-14T10:00:{3 + k / 1000:06.3f}Z" for k in range(ROWS)])},
}


@pytest.mark.parametrize("make", TIMES.values(), ids=TIMES)
def test_times_of_every_parquet_type_count_from_the_first_row(make, pa, tmp_path):
    found = parquet(pa, tmp_path, make(pa), orders="0.1:I-II", times=False)
    assert (found.t0, found.period) == (0.0, 1e-3) and len(found.channels["n_wej"]) == ROWS
    assert found.events[-1][0] == pytest.approx(0.1)


def test_a_gear_in_categories_of_parquet_is_an_order(pa, tmp_path):
    gears = pa.array(["I"] * 200 + ["II"] * 200).dictionary_encode()
    found = parquet(pa, tmp_path, {"Gang": gears}, profile="gear: Gang\n" + TAKEN)
    assert [what for _, _, what, _, _ in found.events] == ["gear_was", "shift_ordered"]
