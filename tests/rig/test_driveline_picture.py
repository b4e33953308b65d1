# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The picture of a driveline: each text stands free, whatever the rig."""

import re
from itertools import combinations

import pytest

from rig_nodes.base.config import RIGS_DIR
from rig_nodes.driveline import Body, Link, svg
from rig_nodes.rig import driveline_svg, load_rig

RIGS = sorted(one.parent.name for one in RIGS_DIR.glob("*/rig.yaml"))
TEXT = re.compile(r'<text( class="small")? x="(\S+)" y="(\S+)"( text-anchor="(\w+)")?[^>]*>([^<]*)<')
LINE = re.compile(r'<line class="\w+" x1="(\S+)" y1="(\S+)" x2="(\S+)" y2="(\S+)"')
RECT = re.compile(r'<rect class="[\w ]+" x="(\S+)" y="(\S+)" width="(\S+)" height="(\S+)"')


def boxes(picture):
    found = []
    for small, x, y, _, anchor, text in TEXT.findall(picture):
        width, height = (6.0, 11.0) if small else (7.0, 13.0)
        width *= len(text)
        left = float(x) - {"middle": 0.5, "end": 1.0}.get(anchor, 0.0) * width
        found.append((text, left, float(y) - 0.75 * height, left + width, float(y) + 0.2 * height))
    return found


def meet(one, other):
    return one[0] < other[2] and other[0] < one[2] and one[1] < other[3] and other[1] < one[3]


def free(picture):
    texts = boxes(picture)
    lines = [tuple(map(float, one)) for one in LINE.findall(picture)]
    bars = [(float(x), float(y), float(x) + float(w), float(y) + float(h)) for x, y, w, h in RECT.findall(picture)]
    wrong = [(a[0], b[0]) for a, b in combinations(texts, 2) if meet(a[1:], b[1:])]
    wrong += [(text, "a line") for text, *box in texts for line in lines if meet(box, line)]
    for text, *box in texts:  # wholly inside a bar, or wholly outside
        wrong += [(text, "an edge") for bar in bars if meet(box, bar) and not (bar[0] <= box[0] and box[2] <= bar[2])]
    wrong += [("a line", "a bar") for line in lines for bar in bars if meet(line, (bar[0] + 1, bar[1] + 1, bar[2] - 1, bar[3] - 1))]
    return wrong


@pytest.mark.parametrize("rig", RIGS)
def test_no_label_of_a_rig_touches_anything(rig):
    picture = driveline_svg(load_rig(rig))
    assert free(picture) == []
    if load_rig(rig).structure.gears:
        assert "input side" in picture and "output side" in picture


def test_what_only_the_input_joins_stands_on_its_left_and_both_sides_of_a_mesh_are_named():
    bodies = [Body("shaft", 1.0, end="input"), Body("rotor", 1.0), Body("wheel", 1.0), Body("road", 1.0, end="output")]
    links = [Link("rotor", "shaft", "shaft", "coupling"), Link("shaft", "wheel", "mesh", "", ("20 teeth", "40 teeth"))]
    picture = svg("x", bodies, [*links, Link("wheel", "road", "clutch", "C1"), Link("road", "shaft", "clutch", "C2")])
    places = {text: left for text, left, *_ in boxes(picture)}
    assert places["rotor"] < places["shaft (input)"] < places["20 teeth"] < places["40 teeth"] < places["road (output)"]
    assert free(picture) == []


def test_a_driveline_in_which_every_body_is_joined_to_every_other_is_drawn():
    bodies = [Body(f"b{n}", 1.0) for n in range(6)]
    links = [Link(a.name, b.name, "shaft", f"{a.name}-{b.name}") for a, b in combinations(bodies, 2)]
    assert all(f">b{n}<" in svg("x", bodies, links) for n in range(6))
