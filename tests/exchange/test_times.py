# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The times of a logger's file are read by what they are, and a fault in them is told and never closed up."""

from __future__ import annotations

from datetime import datetime, timedelta

import numpy as np
import pytest
from small import ROWS, SECONDS, measured, rpm, table

from rig_nodes.base.errors import RigError

MIDNIGHT = datetime(2024, 3, 14, 23, 59, 59, 900000)
EPOCH = 1710460799900


def stamps(form, begin=MIDNIGHT, rows=ROWS):
    """Texts of times 1 ms apart, from 100 ms before midnight on by default."""
    return [form(begin + timedelta(milliseconds=k)) for k in range(rows)]


def since(x):
    return round((x - MIDNIGHT).total_seconds() * 1e3)


FORMS = {
    "ISO": lambda x: x.isoformat(timespec="milliseconds"),
    "ISO, UTC": lambda x: x.isoformat(timespec="milliseconds") + "Z",
    "ISO, offset": lambda x: x.isoformat(timespec="milliseconds") + "+01:00",
    "compact": lambda x: x.strftime("%Y%m%dT%H%M%S.%f"),
    "points": lambda x: x.strftime("%d.%m.%Y %H:%M:%S,%f"),
    "day first": lambda x: x.strftime("%d/%m/%Y %H:%M:%S.%f"),
    "month first, AM/PM": lambda x: x.strftime("%m/%d/%Y %I:%M:%S.%f %p"),
    "short year": lambda x: x.strftime("%y/%m/%d %H:%M:%S.%f"),
    "month by name": lambda x: x.strftime("%d-%b-%Y %H:%M:%S.%f"),
    "time of day": lambda x: x.strftime("%H:%M:%S,%f"),
    "time of day, AM/PM": lambda x: x.strftime("%I:%M:%S.%f %p"),
    "time of day with ms behind a colon": lambda x: x.strftime("%H:%M:%S:") + f"{x.microsecond // 1000:03d}",
    "time of day with single ms behind a colon": lambda x: x.strftime("%H:%M:%S:") + str(x.microsecond // 1000),
    "time of day in words": lambda x: x.strftime("%H:%M:%S,%f") + " Uhr",
    "zone by name": lambda x: x.strftime("%Y-%m-%d %H:%M:%S.%f") + " EST",
    "ms since 1970": lambda x: str(EPOCH + since(x)),
    "us since 1970": lambda x: str(1000 * (EPOCH + since(x))),
    "ns since 1970": lambda x: str(1000000 * (EPOCH + since(x))),
    "s since 1970, with a point among commas": lambda x: (
        f"{EPOCH // 1000}.{900 + since(x):03d}" if since(x) < 100 else f"{EPOCH // 1000 + 1}.{since(x) - 100:03d}"
    ),
    "days of Excel": lambda x: f"{45365.9999988426 + since(x) / 864e5:.10f}".replace(".", ","),
}


@pytest.mark.parametrize("form", FORMS.values(), ids=FORMS)
def test_dates_and_times_are_read_by_their_content_over_midnight_whatever_their_head(form, tmp_path):
    found = measured(tmp_path, table(stamps(form), head="Stempel"), orders="0.2:I-II")
    assert found.t0 == pytest.approx(0.0, abs=2e-6) and found.period == pytest.approx(1e-3, rel=1e-5)
    assert len(found.channels["n_wej"]) == ROWS and rpm(found) == pytest.approx([1500.0, 1501.0])
    assert [(t, what) for t, _, what, _, _ in found.events][-1] == (pytest.approx(0.2, abs=2e-6), "shift_ordered")
    assert sum("time 0 of the run is" in note for note in found.notes) == 1


@pytest.mark.parametrize(
    "begin, order", [(datetime(2024, 4, 3, 23, 59, 59, 900000), form) for form in ("%d/%m/%Y", "%m/%d/%Y", "%d-%m-%Y")]
)
def test_day_and_month_are_told_apart_by_the_days_that_follow_each_other(begin, order, tmp_path):
    found = measured(tmp_path, table(stamps(lambda x: x.strftime(f"{order} %H:%M:%S.%f"), begin), head="Zeit"))
    assert found.period == 1e-3 and len(found.channels["n_wej"]) == ROWS


@pytest.mark.parametrize(
    "head, form, period",
    [
        ("Zeit [h]", lambda k: f"{k / 3600e3:.12f}", 1e-3),
        ("Zeit [min]", lambda k: f"{k / 60e3:.12f}", 1e-3),
        ("t [ns]", lambda k: str(k * 1000), 1e-6),
        ("elapsed", lambda k: f"0 days 00:00:{k / 1000:06.3f}", 1e-3),
    ],
)
def test_units_and_durations_become_seconds(head, form, period, tmp_path):
    found = measured(tmp_path, table([form(k).replace(".", ",") for k in range(ROWS)], head=head))
    assert (found.t0, found.period) == (0.0, pytest.approx(period, rel=1e-9))


def test_whole_nanoseconds_since_1970_lose_no_digit(tmp_path):
    found = measured(tmp_path, table([str(1710460799900000123 + 1001 * k) for k in range(ROWS)], head="stamp"))
    assert found.period == pytest.approx(1.001e-6, abs=1e-15)


def test_the_date_may_stand_in_a_column_of_its_own(tmp_path):
    two = stamps(lambda x: x.strftime("%d.%m.%Y;%H:%M:%S.%f"))
    assert measured(tmp_path, table(two, head="Datum;Uhrzeit")).period == 1e-3
    later = [one.replace("15.03.", "17.03.") for one in two]
    with pytest.raises(RigError, match="not a recording of equal steps"):
        measured(tmp_path, table(later, head="Datum;Uhrzeit"))


def test_times_of_few_digits_give_a_clock_with_its_error(tmp_path):
    full = [k for k in range(4000) if not 2005 <= k < 2045]
    found = measured(tmp_path, table([f"10:15:{k // 10 / 1000:06.3f}" for k in full], head="Zeit"))
    assert found.period == pytest.approx(1e-4, rel=0.0025) and len(found.channels["n_wej"]) == pytest.approx(4000, abs=5)
    assert any("steps of 1 ms, the same for up to 10 rows" in note and "is sure to 2506 ppm" in note for note in found.notes)
    (gap,) = [note for note in found.notes if "rows are missing:" in note]
    assert "40 (4 ms) after 0.20" in gap and "before line 2007" in gap


@pytest.mark.parametrize("hours, sentence", [(-1, "go back by an hour at line 102"), (1, "jump by an hour at line 102")])
def test_a_change_to_summer_time_is_named_and_offsets_take_it_away(hours, sentence, tmp_path):
    def form(x, k, offset=""):
        return (x + timedelta(hours=hours * (k >= 100))).strftime("%Y-%m-%d %H:%M:%S.%f") + offset

    begin = datetime(2026, 10, 25, 2, 59, 59)
    times = [begin + timedelta(milliseconds=k) for k in range(ROWS)]
    with pytest.raises(RigError, match=sentence):
        measured(tmp_path, table([form(x, k) for k, x in enumerate(times)], head="Zeit"))
    zoned = [form(x, k, f"+0{2 + hours * (k >= 100)}:00") for k, x in enumerate(times)]
    assert measured(tmp_path, table(zoned, head="Zeit")).period == 1e-3


def test_each_column_goes_with_the_times_left_of_it(tmp_path):
    lines = table([f"{k / 1000:.3f}".replace(".", ",") for k in range(ROWS)]).splitlines()
    fast, slow = [line.split(";")[:5] for line in lines], [line.split(";")[5:] for line in lines]
    for heads in ("t2 [s]", "t [s]"):  # with a name of its own, or the same once more
        second = [[heads, *slow[0]]]
        second += [[f"{k / 50:.2f}".replace(".", ","), *slow[k + 1]] if k < 20 else ["", "", ""] for k in range(ROWS)]
        text = "\n".join(";".join(a + b) for a, b in zip(fast, second))
        profile = "columns: {M_wej: M_wej, n_wej: n_wej, p1: p1, p2: p2}\n"
        assert measured(tmp_path, text, profile=profile).channels["p2"][10] == pytest.approx(0.625e5)
        slower = measured(tmp_path, text, profile=f"time: '{heads if heads == 't2 [s]' else 't [s] (2)'}'\n{profile}")
        assert slower.period == 0.02 and slower.channels["M_wej"][1] == pytest.approx(10.25 + 20 % 3)
        found = measured(tmp_path, text)
        assert found.period == 1e-3 and any("p1, p2 have the times of" in note for note in found.notes)
        assert found.channels["p2"][[0, 20, 10]] == pytest.approx([0.125e5, 1.125e5, 0.625e5])
        assert np.isnan(found.channels["p2"][-1]) and not np.isnan(found.channels["n_wej"]).any()


def test_identical_rows_are_left_out_and_counted(tmp_path):
    lines = table().splitlines()
    found = measured(tmp_path, "\n".join([*lines[:50], lines[49], *lines[50:]]))
    assert len(found.channels["n_wej"]) == ROWS
    assert any("1 row was left out that repeats time and values of the row before, the first in line 51" in n for n in found.notes)


@pytest.mark.parametrize(
    "change, sentence",
    [
        (lambda rows: [*rows[:50], rows[51], rows[50], *rows[52:]], "rows are out of order: .* from 3.05 to 3.049 s at line 52"),
        (lambda rows: [*rows[:100], *rows[50:]], "out of order: .* from 3.098 to 3.049 s at line 101; put the rows in order"),
        (
            lambda rows: [*rows[:51], rows[50][:-5] + "7,125", *rows[51:]],
            "line 51 and line 52 have the same time, 3.049 s, and diff",
        ),
    ],
)
def test_rows_out_of_order_are_named_with_their_lines(change, sentence, tmp_path):
    with pytest.raises(RigError, match=sentence):
        measured(tmp_path, "\n".join(change(table().splitlines())))


def test_missing_rows_are_named_with_place_and_length(tmp_path):
    lines = table().splitlines()
    found = measured(tmp_path, "\n".join([*lines[:100], *lines[104:200], *lines[230:]]))
    assert any("34 rows are missing: 4 (4 ms) after 3.09800 s, before line 101, 30 (30 ms) after" in note for note in found.notes)


@pytest.mark.parametrize(
    "text, sentence",
    [
        (table(SECONDS[:100] + SECONDS[104:]), "but column 't .s.' has 400 steps of 1 ms in 0.399 s; 4 rows are missing"),
        (table(SECONDS[:100] + SECONDS[99:]), "have the same time, 3.099 s; remove the wrong row; a period in place of 't .s.'"),
        (table([f"{k / 5000:.4f}" for k in range(ROWS)]), "has 400 steps of 0.2 ms in 0.0798 s"),
        (table([f"10:00:0{k // 100}" for k in range(ROWS)], head="Zeit"), "its 400 rows take 0.4 s, but the times in 'Zeit'"),
        (
            table([str(k + 5 * (k > 99)) for k in range(ROWS)], head="Nr"),
            "'Nr' goes from 99 to 105 at line 102, and a period would",
        ),
        (table(SECONDS[:100] + SECONDS[104:], head="Temps"), "'Temps' goes from 3.099 to 3.104 at line 102, and a period would"),
    ],
    ids=["gap", "row twice", "other step", "few digits", "jumping count", "times without a unit"],
)
def test_a_period_is_refused_when_the_file_contradicts_it(text, sentence, tmp_path):
    with pytest.raises(RigError, match=sentence):
        measured(tmp_path, text.replace(".", ","), profile="time: {period: 1 ms}\ncolumns: {n_wej: n_wej}\n")


def test_a_period_stands_where_the_times_have_the_digits_to_agree(tmp_path):
    profile = "time: {period: 1 ms}\ncolumns: {n_wej: n_wej}\n"
    for text in (table(), table([f"10:00:0{k // 1000}" for k in range(ROWS)], head="Zeit"), table(head="")):
        assert measured(tmp_path, text, profile=profile).period == 1e-3


@pytest.mark.parametrize(
    "line, period",
    [
        ("# Okres próbkowania: 0,1 ms", 1e-4),
        ("Sample rate: 10000 Hz", 1e-4),
        ("Abtastintervall;0,002;s", 2e-3),
        ("Sampling interval (ms): 0.5", 5e-4),
        ("Filter frequency: 1 kHz", None),
        ("Sample rate: 10,000 Hz", None),
    ],
)
def test_a_period_is_taken_from_a_line_that_states_it_and_never_invented(line, period, tmp_path):
    text = table(head="", above=f"{line}\n")
    if period is None:
        with pytest.raises(RigError, match="has no time column; add one, e.g. 't .s.', or give --period"):
            measured(tmp_path, text)
    else:
        found = measured(tmp_path, text)
        assert found.period == pytest.approx(period) and f"is from line 1, '{line}'" in found.notes[0]


@pytest.mark.parametrize(
    "head, times, orders, sentence",
    [
        ("t [s]", SECONDS, "1:I-II", "the order at 1 s, I to II, is outside .*a.csv, whose times go from 3 to 3.399 s"),
        ("t [s]", SECONDS, "300:I-II", "the order at 300 s"),
        ("Zeit", [f"10:00:{s}" for s in SECONDS], "3.1:I-II", "the order at 3.1 s, I to II, is outside .* go from 0 to 0.399 s"),
    ],
)
def test_an_order_outside_the_file_is_refused(head, times, orders, sentence, tmp_path):
    with pytest.raises(RigError, match=sentence):
        measured(tmp_path, table([one.replace(".", ",") for one in times], head=head), orders=orders)


def test_a_clock_that_no_recording_has_is_said(tmp_path):
    found = measured(tmp_path, table([str(k * 90) for k in range(ROWS)]))
    assert any("its rows are 90 s apart, which is unusual; is the unit of its times right?" in note for note in found.notes)


@pytest.mark.parametrize(
    "text", ["2024-03-32 10:00:00", "2300-01-01 00:00:00", "2024-03-14 10:61:00", "soon", "2024-03-14 10:00:00Z"]
)
def test_a_cell_that_is_no_time_is_refused_with_its_line(text, tmp_path):
    times = stamps(lambda x: x.strftime("%Y-%m-%d %H:%M:%S.%f"))
    with pytest.raises(RigError, match=f"line 102 has .*'{text}'"):
        measured(tmp_path, table([*times[:100], text, *times[101:]], head="Zeit"))


def test_two_steps_of_different_lengths_are_no_clock(tmp_path):
    with pytest.raises(RigError, match="the times must grow in equal steps, but go from 1 to 100 s at line 4"):
        measured(tmp_path, table(["0", "1", "100"]))
