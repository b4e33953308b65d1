# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Limits of a user: each result is judged with its error, and a wrong limit is refused in one sentence."""

import pytest
from synthetic_shift import FakeBag, Shift

from rig_nodes.analysis.limits import judged, limit_lines, parse_limits, read_limits
from rig_nodes.analysis.results import Result, results_of, spread, spread_lines
from rig_nodes.analysis.run_report import build_report
from rig_nodes.base.errors import RigError


@pytest.fixture(scope="module")
def results():
    events = [(0.2, "/controller/events", "shift_ordered", "", 1.0), (1.0, "/controller/events", "shift_ordered", "", 2.0)]
    return results_of(build_report(FakeBag(Shift().recording(1), events=events), {}))


def verdicts(results, *texts):
    return [(one.result.kind, one.verdict) for one in judged(results, parse_limits(texts))]


def test_a_value_meets_or_misses_its_limit_and_is_undecided_within_its_error(results):
    up = "I-II:"  # t_c is 700 ms, give or take 1.3 ms
    assert verdicts(results, f"{up}t_c=.. 0.71 s") == [("I-II", "met")]
    assert verdicts(results, f"{up}t_c_s=720 ms .. 1 s") == [("I-II", "missed")]
    assert verdicts(results, f"{up}t_c=.. 699.8 ms", f"{up}t_c=.. 701 ms") == [("I-II", "undecided")] * 2
    assert dict(verdicts(results, "n_wej=1000 rpm .. 1600 rpm"))["I-II"] == "met"
    assert ("0-I", "not found") in verdicts(results, "t_c=.. 1 s"), (
        "a limit holds for each shift, and a value that is missing is told"
    )
    (line,) = limit_lines(one.as_dict() for one in judged(results, parse_limits([f"{up}k=0.95 .. 2 -"])))
    assert line.startswith("limit met: shift 2, I -> II at 1.00 s: k 1.0") and line.endswith("limit 0.95 .. 2")


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("t_x=.. 1 s", "there is no result in this report 't_x'; did you mean 't_"),
        ("t_c=.. 300 rpm", "'300 rpm' is an angular velocity, expected a time"),
        ("t_c=.. 300", "'300' has no unit, expected a time (s, ms, us, min)"),
        ("t_c=300 ms", "'300 ms' is no range, expected 'LOW .. HIGH'"),
        ("t_c=..", "is no range"),
        ("t_c=1 s .. 0.5 s", "the range goes from 1000 down to 500 ms"),
        ("II-III:t_c=.. 1 s", "t_c is there of 0-I, I-II, not of 'II-III'"),
        ("t_c", "expected NAME='LOW .. HIGH'"),
    ],
)
def test_a_wrong_limit_is_refused_with_what_would_be_right(results, text, sentence):
    with pytest.raises(RigError) as refusal:
        judged(results, parse_limits([text]))
    assert f"--limit {text}" in str(refusal.value) and sentence in str(refusal.value)
    assert "\n" not in str(refusal.value)


def test_a_file_holds_limits_for_all_and_for_one_way(results, tmp_path):
    file = tmp_path / "limits.yaml"
    file.write_text("k: 0.95 ..\nI-II:\n  t_c: .. 800 ms\n")
    assert [(one.kind, one.name, one.text) for one in read_limits(file)] == [("", "k", "0.95 .."), ("I-II", "t_c", ".. 800 ms")]
    file.write_text("k: 0.95 ..\nI-II:\n  t_c: 800\n")
    with pytest.raises(RigError, match=r"limits.yaml:3: t_c is 800, expected 'LOW .. HIGH'"):
        read_limits(file)
    file.write_text("I-II:\n  t_k: .. 800 ms\n")
    with pytest.raises(RigError, match=r"limits.yaml:2: t_k: there is no result in this report 't_k'"):
        judged(results, read_limits(file))
    file.write_text("- k\n")
    with pytest.raises(RigError, match="expected a map of names"):
        read_limits(file)


def test_the_spread_of_several_runs_is_that_of_like_results():
    runs = [[Result("inertia", "inertia", "driving side", "driving side", "kg m2", 3, value, 0.1)] for value in (0.7, 0.72, 0.76)]
    (row,) = spread(runs)
    assert (row["runs"], row["lowest"], row["mean"], row["highest"], row["error"]) == pytest.approx(
        (3, 0.7, 0.72667, 0.76, 0.1), abs=1e-4
    )
    assert spread_lines([row])[1].split() == ["driving", "side", "inertia", "kg", "m2", "3", "0.700", "0.727", "0.760", "0.100"]
