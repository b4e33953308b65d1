# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The page of `rig controller check --faults --html`: each outcome with sign and word, the worst first, and its refusals."""

import html
import json
import re
import sys
from contextlib import closing
from pathlib import Path

import pytest

from rig_nodes import runs
from rig_nodes.base import KINDS
from rig_nodes.cli.main import main
from rig_nodes.rig.configuration import load_rig
from rig_nodes.runs import fault_check
from rig_nodes.runs.fault_check import BADLY, FAILED, HARM, IN_TIME, WELL, Outcome
from rig_nodes.view.page_of_faults import OUTCOMES, faults_page
from rig_nodes.view.palette import DARK, LIGHT

sys.path.insert(0, str(Path(__file__).parents[1] / "panel"))

from browser import NEEDED, Browser

CONFIG = load_rig("hydmag")
HEALTHY = Outcome("", WELL, "in gear after 612 ms, input torque up to 98 Nm")
SEEN = [
    HEALTHY,
    Outcome("motor.weak", WELL, "in gear after 620 ms, input torque up to 90 Nm"),
    Outcome("valve_zr_p1.stuck", HARM, "0.210 s after the order: trip tie_up"),
    Outcome("valve_zr_p2.coil_open", IN_TIME, "0.301 s after the order: trip coil_open"),
    Outcome("p1.gain", FAILED, "0.300 s before the order: controller <mine>, sample 2700: ValueError"),
    Outcome("clutch_s2.worn", BADLY, "in gear after 1204 ms, input torque up to 98 Nm"),
    Outcome("valve_zr_p2.stuck", HARM, "0.250 s after the order: trip tie_up"),
]
CHECK = ["controller", "check", "alfa46", "--faults", "--only", "motor.weak"]


def cells(text):
    """Returns the cells of the page's tables: each shift's, and each outcome's with what it means."""
    shifts, meanings = (re.findall(r"<tr>(<td.*?)</tr>", one, re.DOTALL) for one in text.split("<table")[1:])
    cell = re.compile(r"<td[^>]*>(.*?)</td>", re.DOTALL)
    return [[list(map(html.unescape, cell.findall(row))) for row in rows] for rows in (shifts, meanings)]


@pytest.fixture(scope="module")
def text():
    return faults_page("c:mine.c", CONFIG, SEEN)


def test_the_healthy_shift_is_the_first_row_and_the_worst_outcomes_follow(text):
    shifts, _ = cells(text)
    assert [row[0] for row in shifts] == [
        "no fault, for reference",
        *("valve_zr_p1.stuck", "valve_zr_p2.stuck", "p1.gain", "clutch_s2.worn", "valve_zr_p2.coil_open", "motor.weak"),
    ]
    assert shifts[0][1:] == ["-", "✓ shifted well", HEALTHY.text]
    sizes = {row[0]: row[1] for row in shifts}
    assert sizes["motor.weak"] == "60 %" and sizes["clutch_s2.worn"] == "0.8 mm" and sizes["valve_zr_p1.stuck"] == "-"
    assert ">6 faults: 2 did harm, 1 failed itself, 1 shifted badly, 1 tripped in time, 1 shifted well.<" in text
    assert text.count("<title>hydmag: controller c:mine.c under faults</title>") == 1


def test_each_outcome_is_told_by_a_sign_and_a_word_and_says_what_it_means(text):
    assert set(OUTCOMES) == {HARM, FAILED, BADLY, IN_TIME, WELL}
    assert len({shown.sign for shown in OUTCOMES.values()}) == len(OUTCOMES)
    shifts, meanings = cells(text)
    ranked = (HARM, FAILED, BADLY, IN_TIME, WELL)
    assert [row[0] for row in meanings] == [f"{OUTCOMES[outcome].sign} {outcome}" for outcome in ranked]
    assert {row[2] for row in shifts} == {row[0] for row in meanings}
    assert all(row[1].endswith(".") for row in meanings) and f"{fault_check.WORSE:g} times" in meanings[2][1]


def test_it_is_the_same_each_time_has_both_palettes_and_takes_no_markup_from_a_controller(text):
    assert faults_page("c:mine.c", CONFIG, SEEN) == text
    assert all(f"{colour};" in text for palette in (LIGHT, DARK) for colour in palette.values())
    assert "<mine>" not in text and "controller &lt;mine&gt;, sample 2700" in text and "http" not in text


@NEEDED
def test_no_table_is_wider_than_the_window_and_on_a_phone_each_row_is_a_card(text, tmp_path):
    (tmp_path / "page.html").write_text(text.replace("trip tie_up", f"trip {'tie_up_of_' * 3}: {'above its limit ' * 9}"), "utf-8")
    with closing(Browser((tmp_path / "page.html").as_uri(), 390)) as browser:
        browser.until("document.querySelectorAll('.table').length == 2")
        for width, shown in ((390, "none"), (1200, "table-cell")):
            browser.call("Emulation.setDeviceMetricsOverride", width=width, height=1000, deviceScaleFactor=1, mobile=width < 600)
            browser.until(f"innerWidth == {width}")
            assert browser.js("[...document.querySelectorAll('.table')].every((one) => one.scrollWidth <= one.clientWidth)")
            assert browser.js("getComputedStyle(document.querySelector('.cards th')).display") == shown


def test_the_verb_writes_what_it_prints(tmp_path, capsys):
    path = tmp_path / "page.html"
    for _ in range(2):  # the second one replaces an older page
        assert main([*CHECK, "--json", "--html", str(path)]) == 0
        said = json.loads(capsys.readouterr().out)["faults"]
        made = path.read_text(encoding="utf-8")
        shifts, _ = cells(made)
        assert [[row[2].partition(" ")[2], row[3]] for row in shifts] == [[one["outcome"], one["text"]] for one in said]
        assert shifts[1][:2] == ["motor.weak", "60 %"] and [one.name for one in tmp_path.iterdir()] == ["page.html"]
    assert KINDS["page"].own(made.encode(), path)


def test_a_check_that_is_interrupted_leaves_the_older_page_and_no_part_of_a_new_one(text, tmp_path, monkeypatch, capsys):
    def interrupted(*_):
        yield from SEEN[:2]
        raise KeyboardInterrupt

    path = tmp_path / "page.html"
    path.write_text(text, encoding="utf-8")
    monkeypatch.setattr(runs, "check_under_faults", interrupted)
    assert main([*CHECK, "--html", str(path)]) == 130
    assert "what was begun is not finished" in capsys.readouterr().err
    assert path.read_text(encoding="utf-8") == text and list(tmp_path.iterdir()) == [path]


def test_a_page_that_cannot_be_is_refused_in_a_sentence_before_any_shift(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(runs, "check_under_faults", lambda *_: pytest.fail("a shift began"))
    path = tmp_path / "page.html"
    monkeypatch.setitem(sys.modules, "jinja2", None)
    for words, sentence in (
        (["controller", "check", "alfa46", "--html", str(path)], "--html is the page of the shifts with faults; give --faults too"),
        ([*CHECK, "--html", str(tmp_path / "none" / "page.html")], "there is no folder"),
        ([*CHECK, "--html", str(path)], "the Python package jinja2"),
    ):
        assert main(words) == 2
        error = capsys.readouterr().err
        assert sentence in error and error.count("\n") == 1 and list(tmp_path.iterdir()) == []
