# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The choice among the installed rigs: each has a line and a picture, in the terminal and in the documentation."""

import json
import re
from pathlib import Path

import pytest

from rig_nodes.base.config import RIGS_DIR
from rig_nodes.base.names import installed
from rig_nodes.cli.main import main
from rig_nodes.rig.configuration import load_rig
from rig_nodes.rig.picture import driveline_svg

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.parametrize("name", installed("rigs"))
def test_the_picture_of_a_rig_is_of_its_description(name):
    assert (RIGS_DIR / name / "picture.svg").read_text() == driveline_svg(load_rig(name)), (
        f"run: ./rig check {name} --picture rig_nodes/rig_nodes/rigs/{name}/picture.svg"
    )


def test_the_picture_shows_a_mass_on_a_crank_and_boxes_as_wide_as_their_text():
    picture = driveline_svg(load_rig("frame_saw"))
    assert ">sash</text>" in picture and ">saw: saw cutting</text>" in picture
    boxes = re.findall(r'class="part" .*? width="(\d+)".*\n<text[^>]*>(.*?)</text>', picture)
    assert all(int(wide) >= 6 * len(text) for wide, text in boxes), boxes


def test_a_branch_between_two_bodies_is_a_line_between_them():
    picture = driveline_svg(load_rig("hydmag_hydrostatic"))
    assert re.search(r'<line class="torque".*>hydrostatic</text>', picture) and ">driven</text>" in picture


def test_every_rig_is_listed_with_a_line_and_a_picture_that_exists(capsys):
    assert main(["list", "rigs", "--json"]) == 0
    rows = {row["name"]: row for row in json.loads(capsys.readouterr().out)}
    assert set(rows) == set(installed("rigs")) and len(rows) >= 6
    assert all(row["description"] and Path(row["picture"]).is_file() for row in rows.values())


def test_the_documentation_opens_with_all_rigs_their_lines_and_pictures():
    page = (ROOT / "docs" / "rigs" / "index.md").read_text()
    for name in installed("rigs"):
        assert f"`{name}`" in page and load_rig(name).description in page, name
        assert f"../rig_nodes/rig_nodes/rigs/{name}/picture.svg" in page, name
