# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Calculations of a rig's folder: their tables, the rows that use their cells, the verb, and refusals of faulty ones."""

import json

import numpy as np
import pytest

from rig_nodes.base.errors import RigError
from rig_nodes.cli.main import main
from rig_nodes.rig.configuration import load_rig
from rig_nodes.runs.calculations import Table, calculations_of
from rig_nodes.studies.validation import own_rows
from rig_nodes.studies.validation.which_rows import rows_file

CODE = '''\
"""Calculations of a rig for tests."""
from rig_nodes.runs.calculations import Table


def ratios(config):
    """Ratios by the teeth.

    More.
    """
    sun, ring = config.structure.planetary_sets[0].teeth
    return Table("ratios by hand", {"gear": "", "load": "kg", "ratio": "-"}, [("1", 2.0, 1 + ring / sun), ("3", 2.0, 1.0)])


def motor_work(config, recording):
    """Work of the motor in the run."""
    turned = recording["motor_work"][-1]
    return Table("work", {"work": "kJ", "end": "s"}, [(float(turned), float(recording.t[-1]))])


CALCULATIONS = {"ratios": ratios, "motor_work": motor_work}
'''
ROWS = """\
rows:
  - {id: ratio, text: ratio of gear 1, source: by hand, role: predict, calculation: ratios, where: {gear: 1, load: 2 kg},
     column: ratio, printed: 2.8 -, low: 2.79 -, high: 2.81 -}
  - {id: work, text: work of the motor, source: assumed, role: predict, sequence: short, calculation: motor_work, column: work,
     low: 1 J, high: 1 kJ}
"""
SHORT = "description: the motor alone\nsteps:\n  - motor: {speed: 300 rpm}\n  - wait: {for: 500 ms}\n"


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "rig.yaml").write_text("description: as three_speed, with calculations\nbase: three_speed\n")
    (tmp_path / "calculations.py").write_text(CODE)
    (tmp_path / "validation.yaml").write_text(ROWS)
    (tmp_path / "sequences").mkdir()
    (tmp_path / "sequences" / "short.yaml").write_text(SHORT)
    return tmp_path


def test_rows_take_cells_of_tables_and_a_run_is_made_with_the_signals_that_a_calculation_reads(folder, capsys):
    assert main(["validate", "--rig", str(folder), "--jobs", "1", "--json", "-"]) == 0
    rows = {row["id"]: row for row in json.loads(capsys.readouterr().out)["rows"]}
    assert rows["ratio"]["value"] == pytest.approx(2.8) and rows["ratio"]["verdict"] == "inside"
    assert 1.0 < rows["work"]["value"] < 1000.0 and rows["work"]["verdict"] == "inside"


def test_a_calculation_follows_the_values_of_its_rig_and_gives_the_same_on_the_bag(folder, tmp_path, capsys):
    assert main(["calculate", "--rig", str(folder)]) == 0
    listed = capsys.readouterr().out
    assert "Ratios by the teeth." in listed and "More" not in listed and "motor_work" in listed
    assert main(["calculate", "ratios", "--rig", str(folder), "--json", "-"]) == 0
    table = json.loads(capsys.readouterr().out)
    assert table["columns"] == {"gear": "", "load": "kg", "ratio": "-"} and table["rows"][0] == ["1", 2.0, pytest.approx(2.8)]
    run = tmp_path / "run"
    assert main(["simulate", "short", "--rig", str(folder), "--out", str(run)]) == 0
    capsys.readouterr()
    assert main(["calculate", "motor_work", "--rig", str(folder), "--run", str(run), "--json", "-"]) == 0
    work = json.loads(capsys.readouterr().out)["rows"][0][0]
    rows = own_rows.load_rows(rows_file(folder), folder, load_rig(folder))
    (in_memory,) = own_rows.measure_rows(load_rig(folder), folder, rows[1:])
    assert in_memory[0] == pytest.approx(work * 1e3, rel=2e-2)  # a bag's state topic has a value every 5 ms, memory one every 1 ms


def test_a_table_is_checked_and_gives_cells_in_si():
    table = Table("t", {"name": "", "length": "mm", "speed": "rpm"}, [("a", 0.01, np.float64(10.0)), ("b", 0.02, None)])
    assert table.cell({"length": 10}, "speed") == table.cell({"length": "1e-2 m"}, "speed") == 10.0
    assert table.cell({"name": "b"}, "speed") is None
    assert table.in_units()[0] == ["a", 10.0, pytest.approx(95.49, abs=0.01)]
    for where, column, sentence in (
        ({"name": "c"}, "speed", "0 rows have {'name': 'c'}, expected exactly one"),
        ({}, "speed", "2 rows have any value"),
        ({"nam": "a"}, "speed", "there is no column 'nam'; did you mean 'name'"),
        ({"name": "a"}, "name", "the column name holds words"),
        ({"length": "1 s"}, "speed", "expected a length"),
    ):
        with pytest.raises(RigError, match=sentence):
            table.cell(where, column)
    for columns, rows, sentence in (
        ({"a": "furlong"}, [], "column a has the unknown unit 'furlong'"),
        ({"a": "m"}, [(1.0, 2.0)], "row 0 has 2 cells, expected 1: a"),
        ({"a": "m"}, [("x",)], "row 0: a is 'x', expected a number"),
        ({"a": ""}, [(1.0,)], "row 0: a is 1.0, expected words"),
    ):
        with pytest.raises(RigError, match=sentence):
            Table("t", columns, rows)


@pytest.mark.parametrize(
    "old, new, sentence",
    [
        ("CALCULATIONS = {", "OTHERS = {", r"calculations.py: has no CALCULATIONS; list the functions in it"),
        ("def ratios(config):", "def ratios(config:", r"calculations.py:5: is not Python"),
        ('"ratios": ratios', '"ratios": ratio', r"calculations.py:20: ratio is no function of this file; did you mean 'ratios'"),
        ('"ratios": ratios', "ratios: ratios", r"calculations.py:20: an entry of CALCULATIONS is a name in quotes"),
        ("def ratios(config):", "def ratios():", r"calculations.py:5: ratios has 0 parameters, expected config"),
        ("1 + ring / sun", "1 + ring / 0", r"calculations.py:11: calculation ratios: ZeroDivisionError"),
        ("import Table", "import NoTable", r"calculations.py:2: ImportError"),
        ('return Table("ratios by hand"', 'return ("ratios by hand"', r"calculation ratios returns .*, expected a Table"),
        ('"load": "kg"', '"load": "ounce"', r"calculations.py:11: calculation ratios: column load has the unknown unit 'ounce'"),
    ],
)
def test_a_wrong_file_is_one_sentence_with_its_place(folder, old, new, sentence):
    assert old in CODE
    (folder / "calculations.py").write_text(CODE.replace(old, new))
    with pytest.raises(RigError, match=sentence):
        calculations_of(folder)["ratios"].table(load_rig(folder))


@pytest.mark.parametrize(
    "old, new, sentence",
    [
        ("calculation: ratios", "calculation: ratio", r"validation.yaml:2: ratio.calculation is 'ratio': there is no calculation"),
        ("column: ratio, ", "", "ratio.calculation needs the key column"),
        ("calculation: ratios,", "calculation: ratios, gear: 1,", "ratio.gear goes with value or metric"),
        ("calculation: ratios,", "calculation: ratios, value: n_in,", "needs one of value, .* metric, .* and calculation"),
        ("sequence: short, ", "", "work.calculation is motor_work, which needs a recording: the key sequence"),
        ("calculation: ratios,", "calculation: ratios, sequence: short,", "is ratios, which takes no recording"),
        ("where: {gear: 1, load: 2 kg}", "where: 3", "ratio.where is 3, expected a map of columns and values"),
        ("gear: 1, load: 2 kg", "gear: 2", "validation.yaml:2: ratio: ratios: 0 rows have {'gear': 2}"),
        ("low: 1 J, high: 1 kJ", "low: 1 s, high: 2 s", "work is an energy, the row's low is a time"),
    ],
)
def test_a_wrong_row_is_one_sentence_with_its_place(folder, old, new, sentence):
    assert old in ROWS
    (folder / "validation.yaml").write_text(ROWS.replace(old, new))
    config = load_rig(folder)
    with pytest.raises(RigError, match=sentence):
        for row in own_rows.load_rows(rows_file(folder), folder, config):
            own_rows.measure_rows(config, folder, [row])


def test_the_verb_refuses_in_one_sentence(folder, capsys):
    rig = ["--rig", str(folder)]
    for words, sentence in (
        (["calculate", "--rig", "clutch_bench"], "the rig 'clutch_bench' has no calculations; write a calculations.py beside"),
        (["calculate", "ratois", *rig], "there is no calculation of"),
        (["calculate", "motor_work", *rig], "the calculation motor_work needs a recording: --run RUN"),
    ):
        assert main(words) != 0
        assert sentence in capsys.readouterr().err


def test_names_are_read_without_running_the_file(folder):
    (folder / "calculations.py").write_text(CODE + '\nraise SystemExit("run")\n')
    assert list(calculations_of(folder)) == ["ratios", "motor_work"]
