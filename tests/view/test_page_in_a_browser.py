# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The page of a run as a reader sees it: nothing is wider than a phone, and each row of the table says what it is."""

import html
import sys
from contextlib import closing
from pathlib import Path

import pytest

import rig_nodes
from rig_nodes.analysis import named_metrics, shown_transmission

sys.path.insert(0, str(Path(__file__).parents[1] / "panel"))

from browser import NEEDED, Browser


@NEEDED
@pytest.mark.parametrize("width", [390, 1200], ids=["phone", "desk"])
def test_the_results_of_a_bench_are_read_without_moving_them_sideways(tmp_path, width):
    rig_nodes.load("clutch_bench").simulate("clutch_bench", seed=1).page(tmp_path / "page.html")
    with closing(Browser((tmp_path / "page.html").as_uri(), width)) as browser:
        browser.until("document.querySelectorAll('pre').length == 1")
        assert browser.js("document.documentElement.scrollWidth") <= width
        assert browser.js("[...document.querySelectorAll('.table')].every((one) => one.scrollWidth <= one.clientWidth)")
        heads = browser.js("document.querySelector('pre').innerText").splitlines()[0]
        assert heads.split()[0] == "t" and heads.endswith("M_eks Nm")


def test_each_row_of_the_table_of_shifts_says_what_it_is(tmp_path):
    run = rig_nodes.load("hydmag").simulate("demo", seed=1)
    run.page(tmp_path / "page.html")
    text, box = html.unescape((tmp_path / "page.html").read_text(encoding="utf-8")), shown_transmission(run.report)
    known = [one for one in named_metrics() if run.report["shifts"][0][one.key] is not None]
    assert len(known) > 15
    for one in known:
        assert f"<td>{one.named(box)}</td><td>{one.text}</td>" in text, one.key
