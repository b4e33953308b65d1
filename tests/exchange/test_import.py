# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Files of loggers become runs: those of twelve laboratories agree with the simulated shift, and faulty files are refused."""

from __future__ import annotations

import json

import numpy as np
import pytest
from laboratory import LABORATORIES, NAMES, RPM, SAMPLE

from rig_nodes.bags.exchange.orders import parse_orders
from rig_nodes.bags.logged import orders_in
from rig_nodes.bags.reader import Bag
from rig_nodes.base.config import RIGS_DIR
from rig_nodes.base.errors import RigError
from rig_nodes.base.names import find_of_rigs
from rig_nodes.cli.main import main
from rig_nodes.rig.configuration import load_rig

BOX = load_rig("hydmag").transmission


STANDARD = ("German, three lines above", "Polish, cp1250, ms", "lost rows", "no times", "times of day, UTF-16")


@pytest.mark.parametrize(
    "laboratory",
    [pytest.param(one, id=name, marks=[] if name in STANDARD else [pytest.mark.campaign]) for name, one in LABORATORIES.items()],
)
def test_a_laboratory_file_is_aligned_to_1_ms_and_all_its_metrics_agree(laboratory, tmp_path, capsys):
    path, profile = laboratory.write(tmp_path)
    out, compared = tmp_path / "run", tmp_path / "compared.json"
    assert main(["import", str(path), "--profile", str(profile), "--out", str(out)]) == 0
    captured = capsys.readouterr()
    assert ("values are missing" in captured.out) == bool(laboratory.dropped or laboratory.empty is not None)
    assert main(["compare", str(SAMPLE), str(out), "--json", str(compared)]) == 0, capsys.readouterr().err
    found = json.loads(compared.read_text())
    begins = laboratory.of_day or laboratory.offset < 0.0 or not laboratory.time
    zero = json.loads((out / "report.json").read_text())["run"]["imported"]["time_zero_s"] if begins else 0.0
    base = 9 * 3600 + 15 * 60 if laboratory.of_day else 0.0
    assert found["offset_s"][1] == pytest.approx(laboratory.offset - (zero - base), abs=1e-3)
    rows = [row for row in found["metrics"] if row["difference"] is not None]
    assert len(rows) >= 10 and all(row["in_errors"] is None or row["in_errors"] <= 1.0 for row in rows), rows


HEAD = "t [s];M_wej [Nm];n_wej [rpm];M_wyj [Nm];n_wyj [rpm];p1 [bar];p2 [bar]"
ROWS = [f"{n / 1000:.3f};{10 + n % 3};1500;80;1085;23;{n % 2}".replace(".", ",") for n in range(40)]
WRONG = "rig: hydmag\ncolumns:\n  "


def written(folder, text=None, profile=None, name="bad.csv", change=lambda rows: rows):
    """Writes a small file with the rig's own heads after ``change``, and a profile; returns the arguments of the verb."""
    path = folder / name
    if isinstance(text, bytes):
        path.write_bytes(text)
    else:
        path.write_text(text if text is not None else "\n".join([HEAD, *change(list(ROWS))]) + "\n", encoding="utf-8")
    words = ["import", str(path), "--out", str(folder / "run")]
    if profile is None:
        return [*words, "--rig", "hydmag"]
    (folder / "p.yaml").write_text(profile)
    return [*words, "--profile", str(folder / "p.yaml")]


def at(line, row):
    """Returns a change that puts another row in a line of the file."""
    return lambda rows: [*rows[: line - 2], row, *rows[line - 1 :]]


BROKEN = {
    "empty": ({"text": ""}, "bad.csv: is empty"),
    "only a head": ({"text": HEAD + "\n"}, "no row of numbers is among its first 1 lines"),
    "one row": ({"change": lambda rows: rows[:1]}, "has 1 rows below its header; a recording needs more"),
    "no text": ({"text": b"\0\1\2\3" * 40}, "is not text, although its ending is .csv"),
    "a word among numbers": ({"change": at(6, "0,004;x7;1;2;3;4;5")}, "line 6 has 'x7' in column 'M_wej [Nm]' where a number"),
    "a short row": ({"change": at(6, "0,004;1;2")}, "line 6 has 3 fields where the header names 7"),
    "an empty line": ({"change": at(6, "")}, "line 6 is empty; rows must follow each other"),
    "infinite": ({"change": at(6, "0,004;inf;1;2;3;4;5")}, "line 6 has 'inf' in column 'M_wej [Nm]' where a number"),
    "times back": ({"change": at(6, "0,001;1;1;2;3;4;5")}, "go from 0.003 to 0.001 s at line 6"),
    "too few digits": (
        {"change": lambda rows: [row[:4] + row[5:] for row in rows]},
        "its 40 rows have only 4 different times from 0 s on, too few for a clock; export more digits",
    ),
    "no unit": ({"text": "\n".join([HEAD.replace(" [bar];", ";"), *ROWS])}, "column 'p1' has no unit; write it in brackets"),
    "another unit": ({"text": "\n".join([HEAD.replace("p1 [bar]", "p1 [Nm]"), *ROWS])}, "is in Nm; a pressure such as p1 is in Pa"),
    "twice": ({"profile": WRONG + "p1: p1\n  p2: p1"}, "p.yaml:4: signal p1 is there twice, as 'p1 [bar]' and 'p2 [bar]'"),
    "no such signal": ({"profile": WRONG + "p1: p_1"}, "p.yaml:3: there is no signal 'p_1'; did you mean 'p1'"),
    "no such column": ({"profile": WRONG + "p11: p1"}, "p.yaml:3: ", "has no column 'p11'; did you mean 'p1'"),
    "no such key": ({"profile": "cols:\n  p1: p1"}, "p.yaml:1: there is no key of a profile 'cols'; did you mean 'columns'"),
    "encoding": ({"profile": "encoding: ascii\n" + WRONG + "p1: p1", "text": HEAD + "\n0;ż"}, "line 2 is not text in ascii"),
    "no times": ({"text": "\n".join([HEAD[6:], *(row.partition(";")[2] for row in ROWS)])}, "has no time column; add one"),
    "no rig": ({"profile": "time: t [s]\ncolumns:\n  p1: p1"}, "its rig is not given"),
    "Parquet": ({"text": b"PAR1 and not", "name": "bad.parquet"}, "bad.parquet: cannot be read as Parquet"),
    "MAT": ({"text": b"no MATLAB\0" * 30, "name": "bad.mat"}, "bad.mat: cannot be read as a MAT file"),
}


@pytest.mark.parametrize("case", BROKEN.values(), ids=BROKEN)
def test_a_broken_file_is_told_in_one_sentence_and_leaves_nothing(case, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    made, *sentence = case
    words = written(tmp_path, **made)
    before = sorted(path.name for path in tmp_path.iterdir())
    assert main(words) == 2
    error = capsys.readouterr().err.strip()
    assert error.count("\n") == 0 and all(part in error for part in sentence), error
    proposed = ["bad.profile.yaml"] if "is written for it" in error else []
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(before + proposed)


@pytest.mark.parametrize("period", ["0 ms", "-1 ms"])
def test_rows_do_not_come_at_a_period_that_is_no_time_above_0(period, tmp_path, capsys):
    assert main([*written(tmp_path), f"--period={period}"]) == 2
    assert capsys.readouterr().err.strip() == f"rig: --period: '{period}' is no time above 0"


def test_orders_come_from_a_column_and_the_times_of_the_file_are_kept(tmp_path):
    rows = [f"{0.1234 + n / 100:.4f};{1 + (n >= 20)};" + ROWS[n].partition(";")[2] for n in range(40)]
    text = "\n".join([HEAD.replace(";", ";gear_ordered;", 1), *rows]).replace(".", ",")
    assert main(written(tmp_path, text)) == 0
    bag = Bag(tmp_path / "run")
    assert [(t, name, value) for t, _, name, _, value in bag.events()] == [
        (pytest.approx(0.3234), "gear_was", 1.0),
        (pytest.approx(0.3234), "shift_ordered", 2.0),
    ]
    assert bag.logger().t0 == 0.1234 and bag.logger().period == 1e-2
    pieces = list(Bag.pieces(tmp_path / "run", 300))
    rows = [pieces[0].logger()]
    for piece in pieces[1:]:
        rows.append(piece.logger(after=rows[-1]))
    assert (
        len(rows) > 2 and sum(one.rows for one in rows) == 40 and rows[-1].t0 == pytest.approx(0.5134 - 0.01 * (rows[-1].rows - 1))
    )
    assert orders_in(bag.events()) == [(pytest.approx(0.3234), 1, 2)]


@pytest.mark.parametrize("rows", [2, 3, 5, 6])
def test_a_recording_of_a_few_ms_is_a_run_that_can_be_read(rows, tmp_path, capsys):
    arguments = written(tmp_path, change=lambda all_rows: all_rows[:rows], name="short.csv")
    out = tmp_path / "run"
    assert main(arguments) == 0
    assert "nothing was recorded" not in capsys.readouterr().out
    logger = Bag(out).logger()
    assert logger.rows == rows and logger.t0 == 0.0 and logger.period == pytest.approx(1e-3)
    assert logger.channels["M_wej"] == pytest.approx([10 + n % 3 for n in range(rows)])
    assert main(["export", "csv", str(out), "-o", str(tmp_path / "again.csv")]) == 0
    assert len((tmp_path / "again.csv").read_text().splitlines()) == rows + 1


def test_a_gap_stays_empty_when_it_is_too_long_to_be_bridged(tmp_path, capsys):
    assert main(written(tmp_path, change=lambda rows: rows[:5] + rows[6:20] + rows[30:])) == 0
    assert (
        "66 of 240 values are missing: 6 were bridged by straight lines, 60 in gaps over 2 ms stay empty" in capsys.readouterr().out
    )
    speed = Bag(tmp_path / "run").logger().channels["n_wej"]
    assert speed[5] == pytest.approx(1500.0 / RPM) and np.flatnonzero(np.isnan(speed)).tolist() == list(range(20, 30))


@pytest.mark.parametrize("profile", sorted(path.stem for path in RIGS_DIR.glob("*/profiles/*.yaml")))
def test_a_profile_of_the_project_reads_the_file_that_it_shows(profile, tmp_path, monkeypatch):
    text = find_of_rigs("profiles", profile).read_text(encoding="utf-8")
    shown = [line.removeprefix("#   ") for line in text.splitlines() if line.startswith("#   ")]
    first = shown[-1].partition(";")[0]
    rows = [shown[-1].replace(first, f"{n},0", 1) for n in range(30)]
    encoding = "cp1252" if profile == "german" else "cp1250"
    (tmp_path / "a.csv").write_bytes("\n".join([*shown[:-1], *rows]).encode(encoding))
    assert main(["import", str(tmp_path / "a.csv"), "--profile", profile, "--out", str(tmp_path / "run")]) == 0
    rows = Bag(tmp_path / "run").logger()
    values = {name: float(column[0]) for name, column in rows.channels.items()}
    assert values == pytest.approx(
        {"M_wej": 65.12, "n_wej": 1500.3 / RPM, "M_wyj": 79.87, "n_wyj": 1085.1 / RPM, "p1": 2.304e6, "p2": -0.002e6}
    )
    assert rows.period == (1.0 if profile == "german" else 1e-3)


def test_a_file_with_some_of_the_rigs_names_says_which_are_missing(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a.csv").write_text("t [s];M_wej [Nm];n_wej [rpm]\n0;1;2\n0.001;1;2\n0.002;1;3\n")
    assert main(["import", "a.csv", "--rig", "hydmag", "--out", "mine"]) == 0
    said = capsys.readouterr().out
    assert "it has no head M_wyj, n_wyj, p1, p2, which a file without a profile needs for rig 'hydmag'" in said
    assert "--profile a.profile.yaml --out mine" in said and not (tmp_path / "mine").exists()


@pytest.mark.parametrize("laboratory", ["German, three lines above", "Polish, cp1250, ms"])
def test_a_proposed_profile_reads_a_foreign_file_as_a_hand_written_one_does(laboratory, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    path, profile = LABORATORIES[laboratory].write(tmp_path)
    path.write_bytes(b"\n".join(path.read_bytes().split(b"\n")[:300]))
    assert main(["import", path.name]) == 0
    assert "nothing is imported yet" in capsys.readouterr().out and not (tmp_path / "runs").exists()
    text = (tmp_path / "lab.profile.yaml").read_text(encoding="utf-8")
    if "Polish" in laboratory:  # the proposal cannot detect that this torque meter has the opposite sign
        text = text.replace("{signal: M_wyj,", "{factor: -1, signal: M_wyj,")
    (tmp_path / "lab.profile.yaml").write_text(text, encoding="utf-8")
    for name, one in (("a", "lab.profile.yaml"), ("b", str(profile))):
        assert main(["import", path.name, "--profile", one, "--out", name]) == 0
    a, b = (Bag(tmp_path / name).logger().channels for name in "ab")
    assert {*a} == {*NAMES} and all(np.array_equal(a[name], b[name]) for name in NAMES)
    assert main(["import", path.name]) == 2
    assert "lab.profile.yaml: is there already" in capsys.readouterr().err


def test_a_matlab_file_of_another_hand_is_read_by_a_profile(tmp_path):
    from scipy.io import savemat

    t = np.arange(200) * 5e-4
    savemat(tmp_path / "x.mat", {"run": {"time": t, "torque_Nm": 3.0 * t, "slow": np.ones(7)}, "note": "no vector"})
    (tmp_path / "p.yaml").write_text("rig: hydmag\ncolumns: {torque: M_wej}\n")
    assert main(["import", str(tmp_path / "x.mat"), "--profile", str(tmp_path / "p.yaml"), "--out", str(tmp_path / "run")]) == 0
    rows = Bag(tmp_path / "run").logger()
    assert rows.period == 5e-4 and np.array_equal(rows.channels["M_wej"], 3.0 * t)


def test_mdf_channels_of_several_rates_come_onto_the_fastest_clock(tmp_path):
    import asammdf

    with asammdf.MDF() as file:
        fast, slow = np.arange(1000) * 1e-3, np.arange(100) * 1e-2
        file.append([asammdf.Signal(np.sin(fast), fast, "Nm", "Moment")])
        file.append([asammdf.Signal(2.0 * slow, slow, "bar", "Druck")])
        file.save(tmp_path / "x.mf4")
    (tmp_path / "p.yaml").write_text("rig: hydmag\ncolumns: {Moment: M_wej, Druck: p1}\n")
    assert main(["import", str(tmp_path / "x.mf4"), "--profile", str(tmp_path / "p.yaml"), "--out", str(tmp_path / "run")]) == 0
    rows = Bag(tmp_path / "run").logger()
    assert np.array_equal(rows.channels["M_wej"], np.sin(fast))
    assert rows.channels["p1"][:991] == pytest.approx(2e5 * fast[:991]) and np.isnan(rows.channels["p1"][-1])


def test_compare_takes_a_file_with_the_rig_of_the_run_and_says_so(tmp_path, capsys):
    path, profile = LABORATORIES["points and commas"].write(tmp_path)
    profile.write_text(profile.read_text().replace("rig: hydmag\n", ""))
    assert main(["compare", str(SAMPLE), str(path), "--profile", str(profile)]) == 0
    assert f"lab.csv: inertias and instrument errors of rig 'hydmag' of {SAMPLE}" in capsys.readouterr().out
    assert main(["compare", str(SAMPLE), str(path)]) == 2
    assert "a profile, which --profile takes, is proposed by ./rig import " in capsys.readouterr().err


def test_orders_of_the_command_line():
    assert parse_orders("8.32:II-I, 3.845:I->II", BOX) == [(3.845, 1, 2), (8.32, 2, 1)]
    assert parse_orders("0.5 s: 0-I", BOX) == [(0.5, 0, 1)]
    for bad in ("", "3:4", "I-II", "3:I-III", "3.85:I-I", "3.85:I-II, 3.85:I-II"):
        with pytest.raises(RigError, match="--orders"):
            parse_orders(bad, BOX)
