# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Numbers and rows of text files are read as they are meant, cell by cell, or refused with what they could mean."""

from __future__ import annotations

import numpy as np
import pytest
from small import ROWS, SECONDS, measured, rpm, table

from rig_nodes.bags.exchange.profile import read_profile
from rig_nodes.base.errors import RigError
from rig_nodes.cli.main import main

POINTS = [one.replace(",", ".") for one in SECONDS]
TAKEN = "columns: {M_wej: M_wej, n_wej: n_wej}\n"


def speeds(text, one, other):
    """The text with the speeds 1500 and 1501 rpm written in another form."""
    for number, form in (("1500", one), ("1501", other)):
        for sign in ".,":
            text = text.replace(f"{number}{sign}000", form)
    return text


def cell(text):
    """The text of a file whose first input speed is written so."""
    return table().replace("1500,000", text, 1)


GROUPED = {
    "blank": ("1 500,000", "1 501,000"),
    "no-break space": ("1\u00a0500,000", "1\u00a0501,000"),
    "narrow no-break space": ("1\u202f500,0", "1\u202f501,0"),
    "thin space, no decimals": ("1\u2009500", "1\u2009501"),
    "apostrophe": ("1'500,0", "1'501,0"),
    "typographic apostrophe": ("1\u2019500", "1\u2019501"),
    "point that a decimal follows": ("1.500,0", "1.501,0"),
    "exponent": ("+1,5E+03", "1,501e3"),
    "exponent of Fortran": ("1,5D+03", "0,1501d4"),
    "blanks around": ("  1500 ", " +1501  "),
}


@pytest.mark.parametrize("forms", GROUPED.values(), ids=GROUPED)
def test_grouped_thousands_and_exponents_are_numbers(forms, tmp_path):
    assert rpm(measured(tmp_path, speeds(table(), *forms))) == pytest.approx([1500.0, 1501.0])


@pytest.mark.parametrize(
    "text, form",
    [(speeds(table(), "1.500", "1.501"), "'1.500'"), (speeds(table(POINTS, sep="\t", decimal="."), "1,500", "1,501"), "'1,500'")],
    ids=["point beside commas", "comma beside points"],
)
def test_a_number_with_two_readings_is_refused_with_both_and_taken_when_a_profile_says_which(text, form, tmp_path):
    with pytest.raises(
        RigError, match=rf"line 2 has {form} in column 'n_wej .rpm.', which is 1500 if .* groups thousands, and 1.5 if"
    ):
        measured(tmp_path, text)
    sign = form[2]
    assert rpm(measured(tmp_path, text, profile=f'thousands: "{sign}"\n{TAKEN}')) == pytest.approx([1500.0, 1501.0])


def test_one_cell_with_both_signs_settles_what_the_point_means_in_the_whole_file(tmp_path):
    text = speeds(table(), "1.500", "1.501").replace("1085,250", "1.085,250")
    assert rpm(measured(tmp_path, text)) == pytest.approx([1500.0, 1501.0])


def test_a_file_of_which_no_cell_shows_the_decimal_sign_is_refused(tmp_path):
    lines = ["M_wej [Nm];n_wej [rpm];M_wyj [Nm];n_wyj [rpm];p1 [bar];p2 [bar]", *(["1.250;1.500;2.125;1.085;3.500;4.125"] * 50)]
    with pytest.raises(RigError, match="'1.250' in column 'M_wej .Nm.', which is 1250 if '.' groups thousands, and 1.25 if"):
        measured(tmp_path, "\n".join(["# Sample rate: 1 kHz", *lines]))
    found = measured(tmp_path, "\n".join(["# Sample rate: 1 kHz", *lines]), profile=f'decimal: "."\n{TAKEN}')
    assert found.channels["M_wej"][0] == 1.25


@pytest.mark.parametrize(
    "text", ["1500.5", "1.5", "1_500", "\uff11\uff15\uff10\uff10", "0x5DC", "1500 rpm", "ERR", "inf", "1.50.0", "15 00", "1,5,0"]
)
def test_a_cell_that_is_no_number_is_refused_with_line_and_column(text, tmp_path):
    with pytest.raises(
        RigError, match=r"line 2 has '.*' in column 'n_wej \[rpm\]' where a number with decimal ',' is expected; if it"
    ):
        measured(tmp_path, cell(text))


@pytest.mark.parametrize("text", ["1.#QNAN", "-1,#IND", "#NV", "#DIV/0!", "*****", "OVERRANGE", "n/a", "NaN(ind)", "-", "null"])
def test_words_for_no_value_count_as_missing_and_are_named(text, tmp_path):
    found = measured(tmp_path, table().replace("1501,000", text, 1))
    assert f"cells that hold no number count as missing: '{text}' once" in found.notes
    assert any("1 of 2400 values are missing" in note for note in found.notes) and rpm(found, 3) == pytest.approx([1500] * 3)


@pytest.mark.parametrize("text", ["-999", "-999,0", '"-999"'])
@pytest.mark.parametrize("beside", ["", "n/a"])
def test_a_number_that_stands_for_no_value_is_none_in_every_form_and_beside_words(text, beside, tmp_path):
    lines = table().splitlines()
    lines[3] = lines[3].replace("1500,000", text)
    lines[10] = lines[10].replace("1501,000", beside or "1501,000")
    found = measured(tmp_path, "\n".join(lines), profile=f'missing: ["-999"]\n{TAKEN}')
    assert found.about["missing"] == 1 + bool(beside) and np.isfinite(found.channels["n_wej"]).all()


def test_a_minus_sign_of_typographers_is_one(tmp_path):
    found = measured(tmp_path, table().replace(";10,250;", ";\u221210,250;", 1))
    assert found.channels["M_wej"][:2].tolist() == [-10.25, 11.25]


SPLIT = {
    "blanks, names behind #": "# " + table(POINTS, sep="   ", decimal=".").replace(" [", "_["),
    "blanks, units apart": table(POINTS, sep="  ", decimal="."),
    "blanks at the beginning": "\n".join("   " + line for line in table(sep="  ").splitlines()),
    "quoted cells between commas": "\n".join(",".join(f'"{one}"' for one in line.split(";")) for line in table().splitlines()),
    "some cells quoted": table().replace("1500,000", '"1500,000"'),
    "delimiters at the end": "\n".join(line + ";" for line in table().splitlines()),
    "a line of types": "t;M_wej;n_wej;M_wyj;n_wyj;p1;p2\nf8;f8;f8;f8;f8;f8;f8\ns;Nm;1/min;Nm;1/min;bar;bar\n"
    + table().partition("\n")[2],
}


@pytest.mark.parametrize("text", SPLIT.values(), ids=SPLIT)
def test_columns_are_found_between_blanks_and_in_quotes(text, tmp_path):
    found = measured(tmp_path, text, name="a.txt", profile="columns: {M_wej: M_wej, n_wej: n_wej, p2: p2}\n")
    assert (found.t0, found.period) == (3.0, 1e-3) and rpm(found) == pytest.approx([1500.0, 1501.0])
    assert found.channels["p2"][:2] == pytest.approx([0.125e5, 1.125e5])


@pytest.mark.parametrize(
    "text, rows, note",
    [
        (table()[:-20], ROWS - 1, "line 401 ends before its last column and was left out"),
        (table().rstrip("\n")[:-2], ROWS - 1, "line 401 is cut in its last number and was left out"),
        (table().rstrip("\n"), ROWS, None),
        (table() + "Max;75,44;1500,0;80,57;1085,0;23,4;0,1\n", ROWS, "line 402 is no row of values and was left out: 'Max;75"),
        (table() + "\nEnd of measurement\n", ROWS, "lines 402 to 403 are no rows of values and were left out: 'End of"),
        (table() + "\x1a", ROWS, None),
        (table() + "\0" * 300, ROWS, None),
    ],
    ids=["cut row", "cut number", "whole", "footer", "text", "Ctrl-Z", "padding"],
)
def test_what_is_behind_the_values_is_left_out_and_said(text, rows, note, tmp_path):
    found = measured(tmp_path, text)
    assert len(found.channels["n_wej"]) == rows and not np.isnan(found.channels["p2"]).any()
    assert (note is None and not found.notes) or any(note in one for one in found.notes)


@pytest.mark.parametrize(
    "text, sentence",
    [
        (table().replace(";", ","), "line 2 has 14 fields where the header names 7; where ',' is between columns it cannot"),
        (table().replace("1500,000", "1500;000", 1), "line 2 has 8 fields where the header names 7"),
        ("\n".join(table().splitlines()[1:]), "has no line with the names of its columns above the values in line 1"),
    ],
    ids=["commas for both", "one field too many", "no names"],
)
def test_rows_that_do_not_fit_the_names_are_refused(text, sentence, tmp_path):
    with pytest.raises(RigError, match=sentence):
        measured(tmp_path, text)


def test_a_refused_number_leaves_a_profile_in_which_it_can_be_settled(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a.csv").write_text(speeds(table(), "1.500", "1.501"))
    assert main(["import", "a.csv", "--rig", "hydmag", "--out", "run"]) == 2
    assert "a.profile.yaml is written for it, which --profile takes" in capsys.readouterr().err
    text = (tmp_path / "a.profile.yaml").read_text()
    assert "which is 1500 if '.' groups thousands" in text
    (tmp_path / "a.profile.yaml").write_text(text.replace('decimal: ","', 'decimal: ","\nthousands: "."'))
    assert main(["import", "a.csv", "--profile", "a.profile.yaml", "--out", "run"]) == 0


@pytest.mark.parametrize(
    "text, sentence",
    [
        ('time: {period: "?"}\ncolumns: {p1: p1}', "p.yaml:1: the period is still '.'; write the time between rows"),
        ('decimal: "?"\ncolumns: {p1: p1}', "p.yaml:1: decimal is still '.'"),
        ('thousands: "x"\ncolumns: {p1: p1}', "p.yaml:1: thousands is 'x', expected '.', ',', a blank or an apostrophe"),
        ('decimal: "."\nthousands: "."\ncolumns: {p1: p1}', "p.yaml:2: thousands is '.', expected .* not the decimal sign"),
    ],
)
def test_what_a_proposal_left_open_is_asked_for(text, sentence, tmp_path):
    (tmp_path / "p.yaml").write_text(text)
    with pytest.raises(RigError, match=sentence):
        read_profile(tmp_path / "p.yaml")


def test_a_missing_unit_is_asked_for_in_a_proposal(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a.csv").write_text(table().replace("p1 [bar]", "p1"))
    assert main(["import", "a.csv", "--rig", "hydmag"]) == 2
    assert "column 'p1' has no unit" in (error := capsys.readouterr().err) and "a.profile.yaml is written for it" in error
    assert '"p1": {signal: p1, unit: "?"}  # the file has no unit: is it MPa?' in (tmp_path / "a.profile.yaml").read_text()
    assert main(["import", "a.csv", "--profile", "a.profile.yaml"]) == 2
    assert "unit is still '?'" in capsys.readouterr().err


def test_a_proposal_leaves_a_period_open_that_the_file_does_not_state(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text = table(head="").replace("M_wej [Nm]", "Moment wej. [Nm]").replace("n_wej [rpm]", "Obroty wej. [rpm]")
    for name, line, proposed in (("a", "", '{period: "?"}'), ("b", "# Okres: 0,5 ms\n", "{period: 0.5 ms}  # from line 1")):
        (tmp_path / f"{name}.csv").write_text(line + text)
        assert main(["import", f"{name}.csv"]) == 0
        assert f"time: {proposed}" in (tmp_path / f"{name}.profile.yaml").read_text()
