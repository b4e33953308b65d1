# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The site: it builds without a warning, and its search answers a user's questions."""

import functools
import re
import shlex
import subprocess
import sys

import matplotlib as mpl
import pytest

from rig_nodes.base.optional import Lacking
from rig_nodes.cli import docs
from rig_nodes.cli.main import main

# what users ask, and the page that answers it
QUESTIONS = {
    "how do I connect a Simulink model": "how_to/controllers.md",
    "own controller in C": "how_to/controllers.md",
    "ROS 2 node as controller": "how_to/ros_controller.md",
    "FMU in another tool": "how_to/fmu.md",
    "J1939 PGN": "how_to/can.md",
    "dbc file": "how_to/can.md",
    "PLC Modbus register": "how_to/modbus.md",
    "dual clutch": "how_to/rigs.md",
    "reverse gear": "how_to/rigs.md",
    "natural frequency": "how_to/modes.md",
    "Excel": "how_to/import_export.md",
    "thousands separator": "how_to/import_export.md",
    "times over midnight": "how_to/import_export.md",
    "put a measured CSV over a simulated shift": "how_to/import_export.md",
    "why does the torque peak": "learn/powershift.md",
    "torque phase inertia phase": "learn/powershift.md",
    "cold oil": "learn/lessons.md",
    "what is k": "reference/glossary.md",
    "kiss point": "reference/glossary.md",
    "tie-up": "reference/glossary.md",
    "largest error": "reference/glossary.md",
    "exit code 3": "reference/exit_codes.md",
    "how fast is it": "reference/performance.md",
    "friction model of plates": "background/friction_models.md",
    "change the oil temperature while it runs": "how_to/settings.md",
    "emergency stop": "how_to/settings.md",
    "steps of a sequence": "how_to/procedures.md",
    "sweep over load": "how_to/sweep.md",
    "picture of a shift": "how_to/report.md",
    "replay a bag": "how_to/replay.md",
    "damaged bag recover": "how_to/bags.md",
    "which shifts are valid": "how_to/report.md",
}


COMMAND = re.compile(r"^    \./rig (.+)$", re.M)
# a number and its unit, or k and its number; settings of the commands are no results
RESULT = re.compile(r"(?<![\w.-])(\d+(?:\.\d+)?) (?:Nm|ms|J)\b|\bk (?:falls to )?(\d\.\d+)")


def stated(text):
    """Returns the numbers that a text states as results, as it writes them."""
    return {found[1] or found[2] for found in RESULT.finditer(COMMAND.sub("", text))}


def lost(numbers, out):
    """Returns those of the numbers to which no printed number rounds."""
    shown = {abs(float(number)) for number in re.findall(r"-?\d+(?:\.\d+)?", out)}
    return {number for number in numbers if not any(f"{value:.{len(number.partition('.')[2])}f}" == number for value in shown)}


@pytest.fixture(scope="module")
def read_once():
    """Has each page read only once for all questions."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(docs, "_sections", functools.cache(docs._sections))
        yield


@pytest.mark.usefixtures("read_once")
@pytest.mark.parametrize("question", QUESTIONS)
def test_the_page_that_answers_a_question_is_among_the_first_three_hits(question):
    pages = [hit.page for hit in docs.search(question.split()) if not hit.page.startswith("made/")]
    assert QUESTIONS[question] in pages[:3]


def test_hits_are_printed_with_page_line_and_heading(capsys):
    assert main(["docs", "kiss", "point"]) == 0
    places = re.findall(r"^docs/(\S+\.md):(\d+)  (.+)$", capsys.readouterr().out, re.M)
    assert 3 <= len(places) <= 10
    for page, line, _ in places:
        text = (docs.DOCS / page).read_text(encoding="utf-8").splitlines()[int(line) - 1].lower()
        assert "kiss" in text or "point" in text
    assert main(["docs", "xyzzy"]) == 1
    assert capsys.readouterr().out == "no page has 'xyzzy'\n"


def test_what_is_missing_is_one_sentence(monkeypatch, tmp_path, capsys):
    monkeypatch.setitem(sys.modules, "myst_parser", None)
    with pytest.raises(Lacking, match=r"the Python package myst_parser .*pip install 'rig_nodes\[docs\]'"):
        docs.build()
    monkeypatch.setattr(docs, "DOCS", tmp_path)
    assert main(["docs"]) == 2
    assert "the pages are part of a checkout, not of an installed package" in capsys.readouterr().err


@pytest.fixture
def sphinx():
    for package in ("sphinx", "myst_parser", "sphinx_copybutton", "furo"):
        pytest.importorskip(package)


READ = """
import sys
sys.path.insert(0, "docs")
import fault_pictures, lesson_pictures
from sphinx.cmd.build import main
fault_pictures.draw = lesson_pictures.draw = lambda *_: None
sys.exit(main(["-q", "-E", "-W", "--keep-going", "-b", "dummy", "-D", "suppress_warnings=image.not_readable", *sys.argv[1:]]))
"""


@pytest.mark.usefixtures("sphinx")
def test_its_pages_are_read_without_a_warning(tmp_path):
    """All pages and their links, also those that are made from the program; the campaign draws pictures and writes HTML too."""
    words = ["-d", str(tmp_path / "trees"), str(docs.DOCS), str(tmp_path / "out")]
    done = subprocess.run([sys.executable, "-c", READ, *words], cwd=docs.DOCS.parent, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


@pytest.mark.campaign
@pytest.mark.usefixtures("sphinx")
def test_it_builds_without_a_warning():
    built = subprocess.run([sys.executable, "-m", "rig_nodes", "docs"], capture_output=True, text=True, check=False)
    assert (built.returncode, built.stderr) == (0, "")
    html = docs.DOCS / "_build" / "html"
    assert built.stdout == f"the site is {html / 'index.html'}\n"
    assert "rig simulate" in (html / "made" / "command_line.html").read_text(encoding="utf-8")
    assert (html / "searchindex.js").stat().st_size > 100_000
    page = (html / "how_to" / "report.html").read_text(encoding="utf-8")
    assert "<pre>" not in page and 'role="heading"><' not in page  # blocks take keys, captions that are headings have a level
    lessons = (html / "learn" / "lessons.html").read_text(encoding="utf-8")
    drawn = re.findall(r"--picture (\S+\.png)", (docs.DOCS / "learn" / "lessons.md").read_text(encoding="utf-8"))
    assert [name for name in drawn if f'src="../_images/{name}"' not in lessons] == [] and len(drawn) >= 10
    assert all((html / "_images" / name).stat().st_size > 20_000 for name in drawn)
    shown = re.findall(r"\]\(faults/(\S+\.svg)\)", (docs.DOCS / "made" / "faults.md").read_text(encoding="utf-8"))
    ill = (html / "made" / "faults.html").read_text(encoding="utf-8")
    assert [name for name in shown if f'src="../_images/{name}"' not in ill] == [] and len(shown) >= 30
    assert "it builds without a warning" in (html / "made" / "requirements.html").read_text(encoding="utf-8")
    fetched = [
        address
        for page in html.rglob("*.html")
        for address in re.findall(r'<(?:script|link|img)[^>]+(?:src|href)="(https?://[^"]+)"', page.read_text(encoding="utf-8"))
    ]
    assert fetched == []  # it is read without a network


def test_the_lessons_have_the_numbers_that_their_commands_print(capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "docs").symlink_to(docs.DOCS)
    page = (docs.DOCS / "learn" / "lessons.md").read_text(encoding="utf-8")
    printed = ""  # a lesson compares itself with those before
    for number, lesson in enumerate(re.split(r"^## ", page, flags=re.M)[1:], 1):
        for command in COMMAND.findall(lesson) if stated(lesson) else ():  # the campaign runs the others
            assert main(shlex.split(re.sub(" --(picture|html) .+", "", command))) == 0, command
        printed += capsys.readouterr().out
        assert lesson.startswith(f"{number}. ") and lost(stated(lesson), printed) == set(), f"lesson {number}"


def test_the_explained_shift_has_the_numbers_of_its_picture(capsys, monkeypatch, tmp_path):
    page = (docs.DOCS / "learn" / "powershift.md").read_text(encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    mpl.use("Agg")
    assert [main(shlex.split(command)) for command in COMMAND.findall(page)] == [0, 0]
    assert len((tmp_path / "shift.png").read_bytes()) > 20_000
    explained = "**Downshift.**" + page.split("**Downshift.**")[1]
    assert lost(stated(explained), capsys.readouterr().out) == set() and len(stated(explained)) >= 8
