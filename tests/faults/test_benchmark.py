# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""`rig faults bench`: a public set of runs by seed, the baseline detector, and the scores of any detector."""

import json
from pathlib import Path

import numpy as np
import pytest

from rig_nodes.base.errors import RigError
from rig_nodes.cli.faults import detector_of
from rig_nodes.cli.main import main
from rig_nodes.plant.faults.fault import LINES, faults
from rig_nodes.rig.configuration import load_rig
from rig_nodes.rig.faults import faults_of
from rig_nodes.runs.workers import Workers
from rig_nodes.studies.faults.baseline import Alarm, Baseline, residuals
from rig_nodes.studies.faults.cases import Case, cases_of, course_of
from rig_nodes.studies.faults.score import Judged, judged, lines_of_faults, scores

CONFIG = load_rig("hydmag")
SCORES = Path(__file__).parents[2] / "docs" / "reference" / "fault_benchmark.json"  # which the site shows
ILL = ("valve_zr_p2.coil_open", "p2.stuck", "load_pump.chattering", "oil_supply.worn", "n_wyj.losing_pulses")


def test_the_runs_of_a_seed_are_the_same_for_everybody_and_have_every_fault_in_every_size():
    cases = cases_of(CONFIG, 1, 10, 1)
    assert {one.size for one in cases if one.fault and not faults_of(CONFIG)[one.fault].fault.size} == {1.0}
    assert cases == cases_of(CONFIG, 1, 10, 1) and not {one.seed for one in cases} & {
        one.seed for one in cases_of(CONFIG, 2, 10, 1)
    }
    assert [one.fault for one in cases[:10]] == [""] * 10 and all(one.fault for one in cases[10:])
    assert {one.size for one in cases if one.fault == "oil_supply.air"} == {0.25, 0.5, 1.0, 2.0}
    assert {one.size for one in cases if one.fault == "clutch_s2.glazed"} == {0.25, 0.5, 1.0, 1.25}, "its range ends there"
    one, other = (course_of(CONFIG, cases[10]) for _ in range(2))
    assert all(np.array_equal(one.signals[name], other.signals[name]) for name in one.signals)


def test_the_baseline_finds_gross_faults_and_is_silent_on_healthy_runs():
    cases = cases_of(CONFIG, 3, 33, 1)
    learn = [*cases[:30], *(Case(k + 1, 90.0, 30.0, 40.0, fault, 1.0, 2.8) for k, fault in enumerate(ILL))]
    found = [residuals(course_of(CONFIG, case)) for case in learn]
    detector = Baseline()
    detector.learn_healthy(found[:30])
    detector.learn_ill(zip(ILL, found[30:]))
    assert [detector(course_of(CONFIG, case)) for case in cases[30:33]] == [None] * 3
    for k, fault in enumerate(ILL):
        case = Case(50 + k, 110.0, 40.0, 45.0, fault, 1.0, 3.0)
        alarm = detector(course_of(CONFIG, case))
        assert alarm is not None and alarm.t >= 3.0 and alarm.faults[0] == fault, (fault, alarm)


def test_scores_are_counted_from_alarms_with_their_runs():
    ill = [Case(1, 0, 0, 0, "p1.stuck", size, 2.0) for size in (0.5, 1.0)] + [Case(1, 0, 0, 0, "p1.offset", 1.0, 2.0)]
    results = [
        *(Judged(Case(1, 0, 0, 0), alarm) for alarm in (None, None, Alarm(1.0))),
        *(
            Judged(case, alarm)
            for case, alarm in zip(
                ill, (Alarm(1.0, ("p1.stuck",)), Alarm(2.5, ("p1.stuck",)), Alarm(2.1, ("p1.stuck", "p1.offset")))
            )
        ),
    ]
    found = scores(CONFIG, results)
    assert found["false_alarms_healthy"] == [1, 3] and found["false_alarms"] == [2, 6]
    assert found["detected"] == {"0.5": [0, 1], "1.0": [2, 2]} and found["time_s"]["median"] == pytest.approx(0.3)
    assert found["isolated"] == {"first": [1, 2], "first_three": [2, 2], "type": [1, 2]}
    assert found["confusion"]["transducer.offset"] == {"transducer.stuck": 1}
    assert found["ambiguous"] == [["transducer.offset", "transducer.stuck"]]
    assert "detected at 1.0 of the usual size: 2 of 2 (100 %)" in lines_of_faults(found)
    assert found["smallest"] == {"transducer.stuck": None, "transducer.offset": None}
    assert "no smallest size is stated, as a healthy run has an alarm" in lines_of_faults(found)
    assert scores(CONFIG, results[:2] + results[3:])["smallest"] == {"transducer.stuck": 1.0, "transducer.offset": 1.0}


def test_the_published_scores_are_of_the_runs_that_their_command_makes():
    published = json.loads(SCORES.read_text(encoding="utf-8"))
    seed, healthy = published["seed"], published["healthy"]
    cases = cases_of(load_rig(published["rig"]), seed, healthy, 1)
    made = {"runs": len(cases), **scores(CONFIG, [Judged(case, None) for case in cases])}

    def runs(found):
        """Returns how many runs each rate is of."""
        kinds = {kind: sum(said.values()) for kind, said in found["confusion"].items()}
        return found["runs"], {size: of for size, (_, of) in found["detected"].items()}, kinds

    assert runs(published) == runs(made), f"run: ./rig faults bench --seed {seed} --healthy {healthy} --json {SCORES}"


def test_anybodys_detector_is_a_function_and_its_slips_are_sentences(tmp_path, capsys):
    path = tmp_path / "mine.py"
    path.write_text(
        "def never(course):\n    return None\n\ndef slip(course):\n    return 'ill'\n\ndef broken(course):\n    return 1 / 0\n"
    )
    for arguments, sentence in (
        (("--detector", f"{path}:none"), "has no function 'none'"),
        (("--detector", "nowhere.py:none"), "there is no file"),
        (("--sizes", "0"), "expected numbers above 0"),
        (("--healthy", "0"), "healthy is 0, expected a whole number of at least 1"),
    ):
        assert main(["faults", "bench", *arguments]) == 2
        assert sentence in capsys.readouterr().err
    case = cases_of(CONFIG, 1, 1, 1)[:1]
    with Workers(1) as here:
        assert judged(CONFIG, detector_of(f"{path}:never"), case, here) == [Judged(case[0], None)]
        for name, sentence in (("slip", "expected None, or the time of its alarm"), ("broken", "it raised ZeroDivisionError")):
            with pytest.raises(RigError, match=sentence):
                judged(CONFIG, detector_of(f"{path}:{name}"), case, here)


@pytest.mark.campaign
def test_no_false_alarm_of_the_baseline_in_200_healthy_runs(capsys):
    assert main(["faults", "bench", "--json", "-"]) == 0
    found = json.loads(capsys.readouterr().out)
    print(json.dumps(found, indent=1))
    assert found["false_alarms_healthy"] == [0, 200] and set(found["confusion"]) == {
        name for name, one in faults().items() if one.part not in LINES
    }
