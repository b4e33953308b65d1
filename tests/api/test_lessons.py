# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The pages of docs/learn: every command of lessons and explanation is run, and prints the numbers that the text states."""

import re
import shlex
from pathlib import Path

import matplotlib as mpl
import pytest

from rig_nodes.cli.main import main

LEARN = Path(__file__).parents[2] / "docs" / "learn"
SECTIONS = re.split(r"^## ", (LEARN / "lessons.md").read_text(encoding="utf-8"), flags=re.M)[1:]
COMMAND = re.compile(r"^    \./rig (.+)$", re.M)
# a number and its unit, or k and its number; settings of the commands are no results
RESULT = re.compile(r"(?<![\w.-])(\d+(?:\.\d+)?) (?:Nm|ms|J)\b|\bk (?:falls to )?(\d\.\d+)")


def printed(text, capsys, monkeypatch, folder):
    """Runs the commands of a text in a folder and returns what they print."""
    monkeypatch.chdir(folder)
    mpl.use("Agg")
    out = ""
    for command in COMMAND.findall(text):
        words = shlex.split(command)
        code, shown = main(words), capsys.readouterr()
        assert code == 0, (command, shown.err)
        out += shown.out
        made = next((words[words.index(option) + 1] for option in ("--picture", "--html") if option in words), None)
        if made:
            content = (folder / made).read_bytes()
            assert len(content) > 20_000 and (content[:4] == b"\x89PNG" or b"<svg" in content), made
    return out


def stated(text):
    """Returns the numbers that a text states as results, as it writes them."""
    return {found[1] or found[2] for found in RESULT.finditer(COMMAND.sub("", text))}


def lost(numbers, out):
    """Returns those of the numbers to which no printed number rounds."""
    shown = {abs(float(number)) for number in re.findall(r"-?\d+(?:\.\d+)?", out)}
    return {number for number in numbers if not any(f"{value:.{len(number.partition('.')[2])}f}" == number for value in shown)}


@pytest.fixture(scope="module")
def first(tmp_path_factory):
    """Folder of the commands, and what has been printed so far: a lesson compares itself with those before."""
    folder = tmp_path_factory.mktemp("lessons")
    (folder / "docs").symlink_to(LEARN.parent)
    return {"folder": folder, "out": ""}


# the others, each a run or more, in a campaign
QUICK = (1, 2, 4)


@pytest.mark.parametrize(
    "number", [pytest.param(n, marks=() if n in QUICK else pytest.mark.campaign) for n in range(1, len(SECTIONS) + 1)]
)
def test_a_lesson_shows_what_it_says(number, first, capsys, monkeypatch):
    section = SECTIONS[number - 1]
    assert section.startswith(f"{number}. ")
    out = printed(section, capsys, monkeypatch, first["folder"])
    first["out"] += out
    assert lost(stated(section), first["out"]) == set()


def test_the_explained_shift_has_the_numbers_of_its_picture(capsys, monkeypatch, tmp_path):
    page = (LEARN / "powershift.md").read_text(encoding="utf-8")
    out = printed(page, capsys, monkeypatch, tmp_path)
    table = page.split("## Where the numbers are measured")[1]
    assert lost(stated(table), out) == set() and len(stated(table)) >= 6
