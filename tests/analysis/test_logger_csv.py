# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A logger's CSV gives the same numbers as the arrays from which it was written; a bad one is refused in one sentence."""

from __future__ import annotations

import numpy as np
import pytest
from synthetic_shift import PERIOD, RPM, Shift

from rig_nodes.analysis.logger_csv import parse_orders, read_logger_csv
from rig_nodes.analysis.metrics import KEYS, shifts
from rig_nodes.errors import RigError

HEADINGS = {
    "M_wej": ("M_wej [Nm]", 1.0),
    "n_wej": ("n_wej [rpm]", RPM),
    "M_wyj": ("M_wyj (N·m)", 1.0),
    "n_wyj": ("n_wyj [obr/min]", RPM),
    "p1": ("p1 [bar]", 1e-5),
    "p2": ("p2 [MPa]", 1e-6),
}
ORDERS = [(1.0, 1, 2)]


def write(path, separator=";", comma=True, time="t [s]", extra=(), rows=None, encoding="utf-8"):
    recording = Shift().recording(3)
    columns = [recording.channels[name] * factor for name, (_, factor) in HEADINGS.items()]
    names = [heading for heading, _ in HEADINGS.values()]
    if time:
        names.insert(0, time)
        columns.insert(0, np.arange(recording.rows) * PERIOD)
    for name, values in extra:
        names.append(name)
        columns.append(values)
    lines = [separator.join(f"{x:.10g}" for x in row) for row in np.array(columns).T[:rows]]
    text = "\n".join(lines)
    if comma:
        text = text.replace(".", ",")
    path.write_text(separator.join(names) + "\n" + text + "\n", encoding=encoding)
    return path


@pytest.mark.parametrize("separator, comma", [(";", True), (";", False), ("\t", True), (",", False)])
def test_the_same_metrics_as_from_the_arrays(tmp_path, separator, comma):
    recording = read_logger_csv(write(tmp_path / "run.csv", separator, comma), orders=ORDERS)
    assert recording.period == pytest.approx(PERIOD, rel=1e-9)
    (mine,), (made) = shifts(recording), shifts(Shift().recording(3))[0]
    for key in KEYS:
        assert mine[key] == (pytest.approx(made[key], rel=1e-5) if isinstance(made[key], float) else made[key])


def test_period_in_place_of_times_and_orders_from_a_column(tmp_path):
    gear = np.where(np.arange(30000) < 10000, 1, 2)
    path = write(tmp_path / "run.csv", time=None, extra=[("gear_ordered", gear), ("Uwagi", np.zeros(30000))])
    recording = read_logger_csv(path, period=1e-4)
    assert recording.orders == [(pytest.approx(1.0), 1, 2)]
    assert "Uwagi" not in recording.channels
    with pytest.raises(RigError, match="has no time column; add one, .* --period"):
        read_logger_csv(path)


def test_comments_marks_and_polish_letters_before_the_header(tmp_path):
    path = write(tmp_path / "run.csv", rows=200)
    body = path.read_text(encoding="utf-8").replace("N·m", "N.m")
    path.write_bytes(("# próba wybiegu\n\n" + body).encode("cp1250"))
    assert read_logger_csv(path).rows == 200
    path.write_bytes(b"\xef\xbb\xbf" + body.encode())
    assert read_logger_csv(path).rows == 200


def test_time_in_ms_that_starts_late(tmp_path):
    path = write(tmp_path / "run.csv", time="czas [ms]", rows=100)
    assert read_logger_csv(path).period == pytest.approx(1e-7)


@pytest.mark.parametrize(
    "old, new, sentence",
    [
        ("M_wej [Nm]", "M_wej", "column 'M_wej' has no unit; write it in brackets, e.g. 'M_wej \\[Nm\\]'"),
        ("p1 [bar]", "p1 [Nm]", "column 'p1 \\[Nm\\]' is in Nm; a pressure is in Pa, kPa, MPa, bar"),
        ("p1 [bar]", "p3 [bar]", "has no column p1; the analysis needs"),
        ("p1 [bar]", "p2 [bar]", "column p2 is there twice"),
        ("\n0,0003;", "\n0,0003;x", "line 5 has 'x[-0-9].*' where a number is expected"),
        ("\n0,0003;", "\n0,03;", "line 6|line 5"),
        ("\n0,0003;", "\n0,0003\n", "line 5 has 1 fields where the header names 7"),
        ("\n0,0003;", "\n\n0,0003;", "line 5 is empty"),
    ],
)
def test_bad_files_are_refused(tmp_path, old, new, sentence):
    path = write(tmp_path / "run.csv", rows=50)
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(RigError, match=sentence) as caught:
        read_logger_csv(path)
    assert str(path) in str(caught.value)


def test_times_with_too_few_digits(tmp_path):
    path = write(tmp_path / "run.csv", rows=40)
    header, *lines = path.read_text(encoding="utf-8").splitlines()
    short = [line[:4] + line[line.index(";") :] for line in lines]  # 0,00
    later = [line.replace("0,00", "0,01", 1) for line in short[1:]]
    path.write_text("\n".join([header, short[0], *later]), encoding="utf-8")
    with pytest.raises(RigError, match="too few digits"):
        read_logger_csv(path)


def test_files_that_are_none(tmp_path):
    empty = tmp_path / "empty.csv"
    empty.write_text("# nothing\n")
    with pytest.raises(RigError, match="holds no header"):
        read_logger_csv(empty)
    empty.write_text("M_wej\n1\n2\n")
    with pytest.raises(RigError, match="line 1 has no ';', tab or ','"):
        read_logger_csv(empty)
    empty.write_text("M_wej [Nm];n_wej [rpm]\n1;2\n")
    with pytest.raises(RigError, match="has 1 rows below its header"):
        read_logger_csv(empty)
    with pytest.raises(RigError, match="cannot be read"):
        read_logger_csv(tmp_path / "nowhere.csv")
    wrong = write(tmp_path / "gear.csv", extra=[("gear_ordered", np.full(30000, 3))])
    with pytest.raises(RigError, match="line 2 orders the gear 3"):
        read_logger_csv(wrong)


def test_orders_of_the_command_line():
    assert parse_orders("8.32:II-I, 3.845:I->II") == [(3.845, 1, 2), (8.32, 2, 1)]
    assert parse_orders("0.5 s: 0-I") == [(0.5, 0, 1)]
    for bad in ("", "3:4", "I-II", "3:I-III", "3.85:I-I", "3.85:I-II, 3.85:I-II"):
        with pytest.raises(RigError, match="--orders"):
            parse_orders(bad)
