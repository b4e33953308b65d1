# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The page of a report: its contents, its independence of other files and servers, and its layout in a browser."""

import json
import os
import re
import shutil
import subprocess
import xml.etree.ElementTree as ElementTree
from html.parser import HTMLParser
from pathlib import Path

import pytest

from rig_nodes.analysis import phases_of
from rig_nodes.bags import rig_record
from rig_nodes.base import KINDS
from rig_nodes.base.errors import RigError
from rig_nodes.cli.main import main
from rig_nodes.view import pdf
from rig_nodes.view.document import report_document, run_document
from rig_nodes.view.page import page, words
from rig_nodes.view.page_of_report import Facts, report_page
from rig_nodes.view.palette import DARK, LIGHT, ON_GRADE

SAMPLE = Path(__file__).resolve().parents[2] / "bags" / "sample"
LIMITS = ["--limit", "t_c=.. 700 ms", "--limit", "I-II:k=0.95 .."]
browser = pytest.mark.skipif(
    not any(map(shutil.which, pdf.BROWSERS)), reason="no Chromium or Chrome on the PATH, which lays the page out"
)


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """The folder of a copied run with its page."""
    folder = tmp_path_factory.mktemp("run") / "sample"
    shutil.copytree(SAMPLE, folder)
    assert main(["report", str(folder), "--html", str(folder / "page.html"), *LIMITS]) == 0
    return folder


@pytest.fixture(scope="module")
def text(written):
    return (written / "page.html").read_text(encoding="utf-8")


class Tree(HTMLParser):
    """Checks that each element is closed in its order, and keeps attributes and the texts of headings."""

    def __init__(self):
        super().__init__()
        self.open, self.attributes, self.headings = [], [], []

    def handle_starttag(self, tag, attrs):
        self.attributes += [(tag, *one) for one in attrs]
        if tag not in ("meta", "br"):
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open and self.open[-1] in ("h1", "h2"):
            self.headings.append(data)


def tree_of(text):
    tree = Tree()
    tree.feed(text)
    assert tree.open == []
    return tree


def test_it_is_well_formed_and_needs_nothing_from_outside(text):
    tree = tree_of(text)
    assert tree.headings[0] == "hydmag: sample" and "Shifts" in tree.headings and "Provenance" in tree.headings
    assert not {"script", "link", "img", "iframe"} & {tag for tag, *_ in tree.attributes}
    assert not [one for one in tree.attributes if one[1] in ("src", "href", "srcset") and not one[2].startswith("#")]
    assert "http" not in text and "@import" not in text and not re.search(r"url\((?!#)", text)
    drawings = re.findall(r"<svg.*?</svg>", text, re.DOTALL)
    names = [one for drawing in drawings for one in {*re.findall(r' id="([mp][0-9a-f]+)"', drawing)}]
    assert len(drawings) == 4 and len(names) == len(set(names)), "a name of two drawings"
    for drawing in drawings:
        ElementTree.fromstring(drawing)


def test_both_palettes_are_in_the_page_and_no_other_colour(text):
    assert all(f"{colour};" in text for palette in (LIGHT, DARK) for colour in palette.values())
    for drawing in re.findall(r"<svg.*?</svg>", text, re.DOTALL):
        assert set(re.findall(r"#[0-9a-f]{6}", drawing)) <= {ON_GRADE}


def test_each_shift_has_its_metrics_with_errors_verdicts_phases_and_times(text, written):
    report = json.loads((written / "report.json").read_text())
    for row, error in zip(report["shifts"], report["uncertainty"]):
        assert f"{1e3 * row['t_c_s']:.0f}<br><small>± {1e3 * error['t_c_s']:.0f}, " in text
        lengths = {one.name: 1e3 * (one.end - one.start) for one in phases_of(row)}
        assert re.search(rf">fill of S\d {lengths['fill']:.0f} ms</text>", text)
        assert f">settling {1e3 * row['t_o_s']:.0f} ms</text>" in text and f">{1e3 * row['t_c_s']:.0f} ms</text>" in text
    assert [one["verdict"] for one in report["limits"]] and "<h2>Limits</h2>" in text
    assert all(f'class="{one["grade"]}"' in text for one in report["quality"] if one)
    assert all(one in text for one in ("messages lost", "version of rig_nodes", "rig bag hash", "SHA-256", "All settings are"))


def test_the_phases_of_the_page_lie_where_the_report_has_them(text, written):
    rows = json.loads((written / "report.json").read_text())["shifts"]
    drawings = [one for one in re.findall(r'<figure class="wide".*?</figure>', text, re.DOTALL) if "order to lock-up" in one]
    assert len(drawings) == len(rows)
    for row, drawing in zip(rows, drawings):
        ends = {}
        for kind in ("fill", "torque-phase", "inertia-phase", "settling"):
            path = re.search(rf'<path d="([^"]*)"[^>]*style="fill: var\(--{kind}\)', drawing)[1]
            x = [float(one) for one in re.findall(r"[ML] (-?[\d.]+)", path)]
            ends[kind] = min(x), max(x)
        zero, settled = ends["fill"][0], ends["settling"][1]
        scale = 1e3 * (row["t_c_s"] + row["t_o_s"]) / (settled - zero)
        expected = {"fill": row["kiss_s"], "torque-phase": row["departure_s"], "inertia-phase": row["t_c_s"]}
        for kind, end in expected.items():
            assert scale * (ends[kind][1] - zero) == pytest.approx(1e3 * end, abs=1.0), kind


@pytest.mark.parametrize(
    "beside", [{"lateness_ms": 5}, {"lateness_ms": {"p50": "slow"}}, {"recorded_from_s": "late"}, {"parent": 7}]
)
def test_pages_tell_of_a_report_that_others_have_written_what_they_can(beside, written):
    report = json.loads((written / "report.json").read_text())
    report["run"] |= beside
    for made in (
        report_page(report, Facts(), [], []),
        report_document(report, []),
        run_document(report, rig_record(report["run"]["configuration"]), [], []),
    ):
        assert "sample" in made and "lateness" not in made and "recorded from" not in made


def test_a_folder_of_runs_has_a_table_and_its_spread(written, tmp_path, capsys):
    for n in (1, 2):
        (tmp_path / f"series-{n}").mkdir()
        shutil.copy(written / "report.json", tmp_path / f"series-{n}")
    assert main(["report", str(tmp_path), "--html", str(tmp_path / "page.html"), "--limit", "t_c=.. 100 ms"]) == 0
    out = capsys.readouterr().out
    assert re.search(r"^series +2 ", out, re.MULTILINE) and "spread over all runs" in out and "limit missed: series-1, " in out
    made = (tmp_path / "page.html").read_text(encoding="utf-8")
    assert tree_of(made).headings[1:] == ["Limits", "Metrics over what was varied", "Runs", "Spread over all runs"]
    assert main(["report", str(tmp_path), "--truth"]) == 2
    assert "--truth is for a single recording" in capsys.readouterr().err


def test_a_page_that_cannot_be_written_or_printed_is_refused_before_anything_is_computed(written, tmp_path, monkeypatch, capsys):
    assert main(["report", str(written), "--html", str(tmp_path / "none" / "page.html")]) == 2
    assert "there is no folder" in capsys.readouterr().err
    monkeypatch.setenv("PATH", str(tmp_path))
    assert main(["report", str(written), "--pdf", str(tmp_path / "page.pdf")]) == 2
    error = capsys.readouterr().err
    assert "there is no Chromium or Chrome on the PATH" in error and "--html" in error and list(tmp_path.iterdir()) == []


def test_names_in_a_bag_cannot_become_parts_of_the_page():
    made = page("<script>x</script>", [("", words(["<script>"]))])
    assert "<script>" not in made and "&lt;script&gt;" in made


@browser
def test_a_browser_prints_it_on_a4(written, tmp_path):
    assert main(["report", str(written), "--pdf", str(tmp_path / "page.pdf")]) == 0
    made = (tmp_path / "page.pdf").read_bytes()
    assert made.startswith(b"%PDF")
    assert KINDS["pdf"].own(made, tmp_path / "page.pdf"), "a later page would be refused this name"
    sizes = {tuple(round(float(one)) for one in box.split()) for box in re.findall(rb"/MediaBox\s*\[([^\]]*)\]", made)}
    assert sizes and all(size[:2] == (0, 0) and abs(size[2] - 595) <= 1 and abs(size[3] - 842) <= 1 for size in sizes)


@browser
def test_nothing_is_wider_than_a_phone_or_a4(text, tmp_path):
    # a frame has the width of the phone whatever the narrowest window of the browser is
    inner = tmp_path / "page.html"
    inner.write_text(text, encoding="utf-8")
    look = """<script>onload=()=>{document.body.dataset.found=JSON.stringify([...document.querySelectorAll("iframe")].map(f=>{
const d=f.contentDocument;
const w=d.documentElement, texts=[...d.querySelectorAll("svg text")].map(t=>t.getBoundingClientRect()).filter(t=>t.height);
return {width:w.clientWidth,needed:w.scrollWidth,letters:Math.min(...texts.map(t=>t.height)),
cut:texts.filter(t=>t.left<-1||t.right>w.clientWidth+1).length}}))}</script>"""
    widths = (390, 794)
    frames = [f'<iframe src="page.html" style="border:0;width:{width}px;height:3000px"></iframe>' for width in widths]
    outer = tmp_path / "outer.html"
    outer.write_text(f"<body>{look}{''.join(frames)}</body>")
    alone = ["--no-sandbox"] if os.geteuid() == 0 else []
    profile = f"--user-data-dir={tmp_path / 'profile'}"
    command = [
        pdf.browser(),
        *pdf.QUIET,
        *alone,
        profile,
        "--allow-file-access-from-files",
        "--window-size=1000,3000",
        "--dump-dom",
    ]
    done = subprocess.run([*command, outer.as_uri()], text=True, capture_output=True, timeout=120)
    seen = json.loads(re.search(r'data-found="([^"]*)"', done.stdout)[1].replace("&quot;", '"'))
    assert [found["width"] for found in seen] == [*widths]
    for found in seen:
        assert found["needed"] <= found["width"] and found["letters"] >= 10.0 and found["cut"] == 0


def test_a_browser_that_prints_nothing_is_told(tmp_path, monkeypatch):
    program = tmp_path / "chromium"
    program.write_text("#!/bin/sh\nexit 1\n")
    program.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(RigError, match="printed nothing"):
        pdf.pdf_of("<p>")
