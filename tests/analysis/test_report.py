# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The report of a run: its inputs, and what a reader of the JSON and of the terminal sees."""

from __future__ import annotations

import dataclasses
import json
import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from synthetic_shift import FakeBag, Shift

from rig_nodes.analysis.metrics import metric_keys, named_metrics
from rig_nodes.analysis.report_text import format_report
from rig_nodes.analysis.results import results_of
from rig_nodes.analysis.run_report import build_report, read_report, write_report
from rig_nodes.base.errors import BagError, RigError
from rig_nodes.rig.configuration import load_rig
from rig_nodes.view.document import report_document
from rig_nodes.view.page_of_report import Facts, report_page

BOX = load_rig("hydmag").transmission

REPOSITORY = Path(__file__).parents[2]
RUN = {
    "configuration": {"rig": "hydmag"},
    "seed": 1,
    "versions": {"numpy": np.__version__},
    "lost": 0,
    "ticks": 3000,
    "overruns": 2,
    "lateness_ms": {"p50": 0.11, "p99": 1.5, "max": float("nan")},
    "end": {"reason": "sequence done"},
}


def state_messages(length=3.0):
    times = np.arange(0.0, length, 0.005)

    def topic(**rates):
        return [(int(round(t * 1e9)), SimpleNamespace(**{name: rate * t for name, rate in rates.items()})) for t in times]

    return {
        "/motor/state": topic(work=500.0),
        "/load_pump/state": topic(work=300.0),
        "/clutch_s1/state": topic(heat=150.0),
        "/clutch_s2/state": topic(heat=49.0),
        "/gearbox/state": topic(heat=0.0, speed_in=0.0, speed_out=0.0),
        "/rig/state": topic(energy_residual=1.0),
    }


def bag(events=None, **kwargs):
    events = (
        events
        if events is not None
        else [
            (0.2, "/controller/events", "shift_ordered", "gear I ordered", 1.0),
            (0.5, "/sequencer/events", "step", "step 2", 2.0),
            (1.0, "/controller/events", "shift_ordered", "gear II ordered", 2.0),
        ]
    )
    return FakeBag(Shift().recording(1), state_messages(), events=events, **kwargs)


def test_orders_come_from_the_controllers_events():
    rows = build_report(bag(), RUN)["shifts"]
    orders = [(row["from_gear"], row["to_gear"], row["t_order_s"]) for row in rows]
    assert orders == [(0, 1, 0.2), (1, 2, 1.0)]
    assert set(metric_keys()) <= set(rows[1])
    assert rows[1]["valid"] and rows[1]["t_c_s"] == pytest.approx(0.70, abs=2e-3)


def test_energy_of_run_and_of_each_shift():
    energy = build_report(bag(), RUN)["energy"]
    assert energy["run"]["residual_j"] == pytest.approx(2.995)
    assert len(energy["shifts"]) == 2
    assert energy["shifts"][1]["t_start_s"] == pytest.approx(1.0)
    assert energy["shifts"][1]["t_end_s"] == pytest.approx(1.795, abs=0.01)  # order + t_c + t_o
    assert energy["shifts"][1]["residual_of_heat"] == pytest.approx(1.0 / 199.0)


def test_inertias_are_those_of_the_rig_that_ran():
    plain = build_report(bag(), RUN)
    light = build_report(bag(), {**RUN, "configuration": {"gearbox": {"inertia_in": 1e-9, "inertia_out_z5": 1e-9}}})
    # the output gains kinetic energy, which would count as a loss if it were not included
    assert light["shifts"][1]["e_loss_j"] > plain["shifts"][1]["e_loss_j"] + 500.0


def test_json_is_finite_ordered_and_repeatable(tmp_path):
    first = write_report(tmp_path, build_report(bag(), RUN)).read_bytes()
    assert write_report(tmp_path, build_report(bag(), dict(reversed(RUN.items())))).read_bytes() == first
    report = json.loads(first, parse_constant=lambda name: pytest.fail(f"{name} in the report"))
    assert list(report) == ["run", "shifts", "energy", "quality", "uncertainty", "basis"]
    assert list(report["run"]) == list(RUN)
    assert report["run"]["lateness_ms"]["max"] is None
    assert read_report(tmp_path) == report


def test_failed_write_keeps_the_old_report(tmp_path):
    write_report(tmp_path, build_report(bag(), RUN))
    before = (tmp_path / "report.json").read_bytes()
    with pytest.raises(ValueError):
        write_report(tmp_path, {"run": float("inf")})
    assert (tmp_path / "report.json").read_bytes() == before
    assert [path.name for path in tmp_path.iterdir()] == ["report.json"]
    with pytest.raises(RigError, match="cannot be written"):
        write_report(tmp_path / "nowhere", build_report(bag(), RUN))


def test_file_that_is_no_report_is_refused_in_one_sentence(tmp_path):
    assert read_report(tmp_path) is None
    for text in ("{", "[]", '{"shifts": []}'):
        (tmp_path / "report.json").write_text(text)
        with pytest.raises(RigError, match="is no report"):
            read_report(tmp_path)


def test_table_speaks_peoples_units():
    lines = format_report(build_report(bag(), RUN)).splitlines()
    at = next(i for i, line in enumerate(lines) if line.startswith("2: I -> II"))
    cells = dict(zip(_split(lines[0]), _split(lines[at])))
    assert cells["shift"] == "2: I -> II" and cells["valid"] == "yes"
    assert cells["n_wej rpm"] == "1500"
    assert float(cells["t_d ms"]) == pytest.approx(250, abs=3)
    assert float(cells["t_c ms"]) == pytest.approx(700, abs=2)
    assert float(cells["M_wej max Nm"]) == pytest.approx(250, abs=1)
    errors = lines[at + 1].split()
    assert errors[:3] == ["+-", "1", "1.0"]  # rpm and Nm of tab. 7.1
    assert len({len(line) for line in lines[: at + 1] if "+-" not in line}) == 1
    text = "\n".join(lines)
    assert "messages lost: 0" in text
    assert "lateness of ticks: median 0.11, p99 1.50 ms; 2 of 3000 ticks more than one tick late" in text
    assert "end: sequence done" in text
    assert "energy of shift 2, I -> II: clutch heat" in text and "+0.50 % of it" in text


def _split(line):
    return [cell.strip() for cell in line.split("  ") if cell.strip()]


def test_the_page_and_the_section_that_the_report_names_explain_its_symbols_and_verdicts():
    report = build_report(bag(), RUN)
    (line,) = (one for one in format_report(report).splitlines() if one.startswith("what the symbols mean: "))
    glossary, page = (REPOSITORY / name for name in re.findall(r"docs/\S+\.md", line))
    assert line.endswith("section Quality of a shift") and "## Quality of a shift" in page.read_text()
    symbols = glossary.read_text() + page.read_text()
    for metric in named_metrics():
        assert metric.named(BOX).split()[0] in symbols, metric.key


def test_a_number_that_rounds_to_zero_has_no_sign():
    report = build_report(bag(), RUN)
    row, account = report["shifts"][1], report["energy"]["shifts"][1]
    row |= {"t_p_s": -1e-9, "k": -1e-5, "e_loss_j": -0.3, "output_torque_nm": -0.01}
    account |= {"residual_j": -1e-4, "residual_of_heat": -1e-7}
    text = format_report(report) + report_document(report, []) + report_page(report, Facts(), [], [])
    assert not re.search(r"[-\u2212]0(\.0*)?(?![0-9.])", text)
    assert results_of(report)[len(named_metrics()) + 1].text.startswith("<1.0")


def test_errors_stand_under_a_key_of_their_own():
    report = build_report(bag(), RUN)
    assert len(report["uncertainty"]) == len(report["shifts"])
    assert report["uncertainty"][1]["output_torque_nm"] == pytest.approx(1.01)
    assert "annex_a" not in report and "truth" not in report


def test_annex_a_beside_the_plain_definitions():
    report = build_report(bag(), RUN, annex_a=1.1)
    assert report["annex_a"]["factor"] == 1.1
    plain, annex = report["shifts"][1], report["annex_a"]["shifts"][1]
    assert annex["t_order_s"] == plain["t_order_s"]
    lines = format_report(report).splitlines()
    at = next(i for i, line in enumerate(lines) if line.startswith("shift 2, I -> II at 1.00 s"))
    difference = dict(zip(_split(lines[at]), _split(lines[at + 3])))
    assert float(difference["M_wej max Nm"]) == pytest.approx(annex["input_torque_max_nm"] - plain["input_torque_max_nm"], abs=0.05)
    assert "shift 1, 0 -> I at 0.20 s" in "\n".join(lines) and "not by Annex A: Annex A covers only" in "\n".join(lines)


def test_annex_a_of_another_sample_rate_is_a_problem_not_a_crash():
    slow = bag()
    r = slow.recording
    slow.logger = lambda fill: SimpleNamespace(
        t0=0.0, period=1e-3, channels={name: values[::10] for name, values in r.channels.items()}
    )
    report = build_report(slow, RUN, annex_a=1.05)
    assert "annex_a" not in report and len(report["shifts"]) == 2
    assert "no results by Annex A: Annex A counts samples of 10 kHz" in report["run"]["problems"][0]


def test_bad_shift_is_named_under_the_table():
    case = dataclasses.replace(Shift(), depart=5.0, end=6.0)  # the output stays in gear I
    orders = [(t, "/controller/events", "shift_ordered", "", gear) for t, gear in ((0.3, 1.0), (1.0, 2.0))]
    report = build_report(FakeBag(case.recording(), state_messages(), events=orders), RUN)
    assert not report["shifts"][1]["valid"]
    text = format_report(report)
    assert "shift 2, I -> II at 1.00 s, is not valid: the output never settled on the ratio of gear II" in text
    # the report gives no heat, because heat up to another moment would be mistaken for that of a shift
    assert report["energy"]["shifts"][1] is None and report["energy"]["run"]["motor_work_j"] > 0.0
    assert "energy of shift 2, I -> II: -, as no end of the shift was found" in text


def test_lost_messages_are_counted_from_the_bag_when_nobody_else_did():
    report = build_report(bag(gaps={"/rig/state": 3, "/motor/n_wej": 2}), {})
    assert report["run"]["lost"] == 5
    assert report["run"]["end"] is None
    assert "messages lost: 5" in format_report(report) and "end: unknown" in format_report(report)


def test_damaged_bag_still_gives_a_report():
    broken = bag()
    broken.logger = lambda fill: (_ for _ in ()).throw(BagError("blocks are missing from 2.005 s on"))
    broken._messages = {}
    report = build_report(broken, RUN)
    assert report["shifts"] == [] and report["energy"] == {"run": None, "shifts": []}
    text = format_report(report)
    assert "no shift metrics: blocks are missing from 2.005 s on" in text
    assert "no energy balance" in text and "end: sequence done" in text


def test_order_after_the_last_state_has_no_balance_but_the_others_have():
    late = bag(events=[(t, "/controller/events", "shift_ordered", "", gear) for t, gear in ((0.5, 1.0), (1.0, 2.0), (7.0, 1.0))])
    report = build_report(late, RUN)
    assert report["energy"]["shifts"][1]["motor_work_j"] > 0.0
    assert report["energy"]["shifts"][2] is None
    assert "does not cover the order at 7.000 s" in format_report(report)
