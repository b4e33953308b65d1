# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Several clocks in one file, counters that begin anew, and what of a recording no clock has: counted and told, never closed up."""

from __future__ import annotations

from datetime import timedelta

import numpy as np
import pytest
from small import HEADS, ROWS, measured, rpm, table, values

from rig_nodes.base.errors import RigError

ONLY_PERIOD = "time: {period: 1 ms}\ncolumns: {n_wej: n_wej}\n"


def two_clocks(first, second):
    """Text of a file with all but p2 over the first times and p2 over the second ones, as an oscilloscope writes it."""
    lines = [";".join(["t [s]", *HEADS[:5], "t2 [s]", HEADS[5]])]
    for k in range(max(len(first), len(second))):
        cells = [f"{x:.3f}" for x in values(k)]
        left = [f"{first[k]:.4f}", *cells[:5]] if k < len(first) else [""] * 6
        lines.append(";".join([*left, *([f"{second[k]:.4f}", cells[5]] if k < len(second) else ["", ""])]))
    return "\n".join(lines).replace(".", ",") + "\n"


def missing(found):
    return found.about["missing"]


def test_rows_before_and_behind_the_times_of_a_signal_are_counted_as_missing(tmp_path):
    all_of_it, half = 3.0 + np.arange(400) * 1e-3, 3.1 + np.arange(200) * 1e-3
    found = measured(tmp_path, two_clocks(all_of_it, half))
    empty = np.isnan(found.channels["p2"])
    assert empty[:99].all() and empty[301:].all() and not empty[101:299].any()
    assert missing(found) == pytest.approx(empty.sum(), abs=3) and any("stay empty" in note for note in found.notes)


def test_values_beside_the_clock_are_told_and_clocks_without_a_common_time_refused(tmp_path):
    short, long = 3.0 + np.arange(400) * 1e-3, np.arange(700) * 5e-3
    found = measured(tmp_path, two_clocks(short, long))
    assert found.period == pytest.approx(1e-3), "the fastest clock, not the one with the most values"
    assert "617 values of 'p2 [bar]' are before or behind the times of the others, and were left out" in found.notes
    with pytest.raises(RigError, match=r"'p2 \[bar\]' has times from 0 to 0.399 s, and the other signals from 3 to 3.399 s"):
        measured(tmp_path, two_clocks(short, short - 3.0))


@pytest.mark.parametrize("head, period", [("Zeit ms", 1e-4), ("t ms", 1e-4), ("Time us", 1e-7), ("TimeMs", 1e-4), ("Zeit", 0.1)])
def test_a_unit_in_the_head_of_the_times_needs_no_brackets(head, period, tmp_path):
    found = measured(tmp_path, table([f"{k / 10:.1f}".replace(".", ",") for k in range(ROWS)], head=head))
    assert found.period == pytest.approx(period)


@pytest.mark.parametrize(("begin", "turn", "rows", "turns"), [(65400, 2**16, 70_000, 2), (4294967000, 2**32, 600, 1)])
def test_a_counter_of_times_that_begins_anew_goes_on(begin, turn, rows, turns, tmp_path):
    found = measured(tmp_path, table([str((begin + k) % turn) for k in range(rows)], head="t [ms]"))
    assert found.period == pytest.approx(1e-3) and len(found.channels["p1"]) == rows and missing(found) == 0
    assert f"'t [ms]' begins anew {turns} times, as a counter does at its end; its times go on there" in found.notes


def test_a_second_recording_in_a_file_is_no_counter(tmp_path):
    with pytest.raises(RigError, match="rows are out of order: the times go from 0.299 to 0 s at line 302; put the rows"):
        measured(tmp_path, table([str(k % 300) for k in range(600)], head="t [ms]"))


def test_a_counter_of_rows_that_begins_anew_shows_missing_ones(tmp_path):
    numbers = [str(k % 256) for k in range(800) if not 300 <= k < 360]
    with pytest.raises(RigError, match="'Nr' goes from 299 to 360 at line 302, and a period would close 60 rows up"):
        measured(tmp_path, table(numbers, head="Nr"), profile=ONLY_PERIOD)


def test_a_period_does_not_make_new_rows_of_doubled_ones(tmp_path):
    lines = table(head="t [s]").splitlines()
    doubled = "\n".join([lines[0], *(line for line in lines[1:] for _ in range(2))])
    with pytest.raises(RigError, match="400 of its rows repeat time and values of the row before, and a period would take them"):
        measured(tmp_path, doubled, profile=ONLY_PERIOD.replace("1 ms", "0.5 ms"))
    assert len(measured(tmp_path, doubled).channels["p1"]) == ROWS


def test_durations_of_python_go_on_behind_the_first_day(tmp_path):
    times = [str(timedelta(days=1, microseconds=1000 * (k - 200))) for k in range(ROWS)]
    assert times[0].startswith("23:59:59.8") and times[200] == "1 day, 0:00:00"
    found = measured(tmp_path, table(times, head="Zeit"))
    assert (
        found.period == pytest.approx(1e-3) and len(found.channels["p1"]) == ROWS and rpm(found) == pytest.approx([1500.0, 1501.0])
    )


@pytest.mark.parametrize(
    "line, period",
    [
        ("Abtastrate: 2 500 Hz", 4e-4),
        ("Abtastrate: 2\u00a0500 Hz", 4e-4),
        ("Sample rate: 12'500 Hz", 8e-5),
        ("Abtastzeit: 1/2500 s", None),
        ("Samples;400;Duration [s];0,4", None),
        ("Number of samples: 400, trigger 5 ms before", None),
        ("Abtastfilter: 400 Hz", None),
    ],
)
def test_a_stated_period_is_read_whole_or_not_at_all(line, period, tmp_path):
    text = table(head="", above=f"{line}\n")
    if period is not None:
        assert measured(tmp_path, text).period == pytest.approx(period)
    else:
        with pytest.raises(RigError, match="has no time column"):
            measured(tmp_path, text)


def test_a_given_period_is_taken_over_that_of_a_line_and_the_difference_is_told(tmp_path):
    found = measured(tmp_path, table(head="", above="# Sample rate: 2 kHz\n"), profile=ONLY_PERIOD)
    told = "the time between rows was given as 1 ms, but line 1, '# Sample rate: 2 kHz' says 0.5 ms; which is right?"
    assert found.period == 1e-3 and told in found.notes
