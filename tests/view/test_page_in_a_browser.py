# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The page of a run as a reader sees it: nothing is wider than a phone, and each row of the table says what it is."""

import html
import sys
from contextlib import closing
from pathlib import Path

import rig_nodes
from rig_nodes.analysis import named_metrics, read_report, shown_transmission
from rig_nodes.view.page_of_report import Facts, report_page

sys.path.insert(0, str(Path(__file__).parents[1] / "panel"))

from browser import NEEDED, Browser


@NEEDED
def test_the_results_of_a_bench_are_read_without_moving_them_sideways(tmp_path):
    rig_nodes.load("clutch_bench").simulate("clutch_bench", seed=1).page(tmp_path / "page.html")
    with closing(Browser((tmp_path / "page.html").as_uri(), 390)) as browser:
        browser.until("document.querySelectorAll('pre').length == 1")
        for width in (390, 1200):
            browser.call("Emulation.setDeviceMetricsOverride", width=width, height=1000, deviceScaleFactor=1, mobile=width < 600)
            browser.until(f"innerWidth == {width}")
            assert browser.js("document.documentElement.scrollWidth") <= width
            assert browser.js("[...document.querySelectorAll('.table')].every((one) => one.scrollWidth <= one.clientWidth)")
        heads = browser.js("document.querySelector('pre').innerText").splitlines()[0]
        assert heads.split()[0] == "t" and heads.endswith("M_eks Nm")


def test_each_row_of_the_table_of_shifts_says_what_it_is():
    report = read_report(Path(__file__).parents[2] / "bags" / "sample")
    text, box = html.unescape(report_page(report, Facts(), [], [])), shown_transmission(report)
    known = [one for one in named_metrics() if report["shifts"][0][one.key] is not None]
    assert len(known) > 15
    for one in known:
        assert f"<td>{one.named(box)}</td><td>{one.text}</td>" in text, one.key
