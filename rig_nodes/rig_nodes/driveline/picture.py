# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Draws a driveline as an SVG picture: its bodies, what joins two of them, and what sits on them.

Used by driveline.builder for a description in Python, and by rig.picture for a rig. The bodies stand in columns by their
distance from the first one; what joins two of them is a line with a symbol on it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from html import escape

WIDE, HIGH, ACROSS, DOWN, EDGE = 150, 46, 290, 110, 60  # size of a body, distances of columns and of rows, margin [px]
STYLE = (
    "text{font:13px sans-serif;fill:#1b1f24}.small{font-size:11px;fill:#57606a}"
    ".body{fill:#eaf2fb;stroke:#1f6feb;stroke-width:1.5}.massless{fill:#fff;stroke:#8c959f;stroke-dasharray:5 3}"
    ".mesh{stroke:#57606a;stroke-width:2}.set{stroke:#8250df;stroke-width:2}.clutch{stroke:#cf222e;stroke-width:2}"
    ".freewheel{stroke:#bc4c00;stroke-width:2}.shaft{stroke:#1a7f37;stroke-width:2}"
    ".torque{stroke:#bf8700;stroke-width:2;stroke-dasharray:2 4}.part{fill:#fff8e5;stroke:#bf8700}"
    ".sign{fill:#fff;stroke-width:1.5}"
)


@dataclass(frozen=True)
class Link:
    """A line between two bodies.

    Parameters
    ----------
    a, b : str
        Names of the bodies.
    kind : str
        "mesh", "set", "clutch", "freewheel", "shaft" or "torque".
    text : str
        Text on the line.
    """

    a: str
    b: str
    kind: str
    text: str


@dataclass
class Body:
    """A body in the picture.

    Parameters
    ----------
    name : str
        Name of the body.
    inertia : float
        Inertia [kg m2], 0 for a body without one of its own.
    brake : str
        Names of its brakes.
    one_way : list of (str, str)
        Name and direction of each of its free-wheels to the ground.
    notes : list of str
        What else sits on it.
    end : str
        "input", "output" or empty.
    """

    name: str
    inertia: float
    brake: str = ""
    one_way: list[tuple[str, str]] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    end: str = ""


def _places(bodies: Sequence[Body], links: Sequence[Link]) -> dict[str, tuple[int, int]]:
    """Return column and row of each body: columns by the number of joints from the input, the output alone in the last one.

    A body that is joined across a column stands above one that is joined to the next column, so that no line runs through a body.
    """
    start = next((body.name for body in bodies if body.end == "input"), bodies[0].name)
    end = next((body.name for body in bodies if body.end == "output"), None)
    column, todo = {start: 0}, [start]
    while todo:
        here = todo.pop(0)
        for link in links:
            for one, other in ((link.a, link.b), (link.b, link.a)):
                if one == here and other not in column and end not in (one, other):
                    column[other] = column[here] + 1
                    todo.append(other)
    for body in bodies:
        column.setdefault(body.name, 1 if body.name != end else 0)
    if end:
        column[end] = 1 + max((column[body.name] for body in bodies if body.name != end), default=0)
    span = {
        body.name: max((abs(column[one.a] - column[one.b]) for one in links if body.name in (one.a, one.b)), default=0)
        for body in bodies
    }
    across, places = any(value > 1 for value in span.values()), {}
    for k in sorted(set(column.values())):
        free = 0 if k in (0, column.get(end)) else int(across)
        for body in sorted((body.name for body in bodies if column[body.name] == k), key=lambda body: -span[body]):
            beside = [
                places[other][1]
                for link in links
                for one, other in ((link.a, link.b), (link.b, link.a))
                if one == body and other in places
            ]
            row = max(free, min(beside)) if beside and free else free
            places[body], free = (k, row), row + 1
    return places


def svg(title: str, bodies: Sequence[Body], links: Sequence[Link], below: str = "") -> str:
    """Return the picture as SVG text.

    Parameters
    ----------
    title : str
        Text above the picture.
    bodies : sequence of Body
        The bodies.
    links : sequence of Link
        What joins two of these bodies.
    below : str
        A line of text under the picture.

    Returns
    -------
    str
        The SVG document.
    """
    places = _places(bodies, links)
    notes = max(len(body.notes) for body in bodies)
    down = DOWN + 20 * notes
    where = {body: (EDGE + column * ACROSS, EDGE + 40 + row * down) for body, (column, row) in places.items()}
    width = EDGE * 2 + max(9 * len(title), WIDE + ACROSS * max(column for column, _ in places.values()))
    height = EDGE * 2 + 60 + HIGH + down * max(row for _, row in places.values()) + 20 * notes
    out = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" viewBox="0 0 {width} {height}">',
        f"<style>{STYLE}</style>",
        f'<rect width="{width}" height="{height}" fill="#fff"/>',
        f'<text x="{EDGE}" y="30" style="font-size:16px">{escape(title)}</text>',
    ]
    drawn: dict[frozenset, int] = {}
    for link in links:
        k = drawn[frozenset((link.a, link.b))] = drawn.get(frozenset((link.a, link.b)), -1) + 1
        out.append(_line(where[link.a], where[link.b], link, k))
    named = {body.name: body for body in bodies}
    for name, corner in where.items():
        out += _body(named[name], *corner)
    if below:
        out.append(f'<text class="small" x="{EDGE}" y="{height - 14}">{escape(below)}</text>')
    return "\n".join([*out, "</svg>", ""])


def _body(body: Body, x: int, y: int) -> list[str]:
    """Return the SVG elements of a body and of what sits on it, with its corner at x, y."""
    end = f" ({body.end})" if body.end and body.end != body.name else ""
    out = [
        f'<rect class="{"body" if body.inertia else "massless body"}" x="{x}" y="{y}" width="{WIDE}" height="{HIGH}" rx="6"/>',
        f'<text x="{x + 10}" y="{y + 19}">{escape(body.name)}{end}</text>',
    ]
    inertia = f"{body.inertia:.4g} kg m2" if body.inertia else "no inertia of its own"
    out.append(f'<text class="small" x="{x + 10}" y="{y + 36}">{inertia}</text>')
    if body.brake:
        out.append(
            f'<path class="clutch" d="M{x + WIDE / 2} {y} v-14 m-14 0 h28 m-28 0 l-6 -7 m20 7 l-6 -7 m20 7 l-6 -7" fill="none"/>'
        )
        out.append(f'<text x="{x + WIDE / 2 + 20}" y="{y - 10}">{escape(body.brake)}</text>')
    for k, (name, way) in enumerate(body.one_way):
        top = y - 14 - 16 * bool(body.brake)
        out.append(f'<path class="freewheel" d="M{x + 24 + 60 * k} {y} v-14 m-12 0 h24 m-24 0 l8 -7 m16 7 l-8 -7" fill="none"/>')
        out.append(f'<text x="{x + 42 + 60 * k}" y="{top}">{escape(name)} ({way})</text>')
    for k, note in enumerate(body.notes):
        wide = max(WIDE - 8, 6 * len(note) + 12)
        out.append(f'<rect class="part" x="{x + 8}" y="{y + HIGH + 4 + 20 * k}" width="{wide}" height="17" rx="3"/>')
        out.append(f'<text class="small" x="{x + 14}" y="{y + HIGH + 16 + 20 * k}">{escape(note)}</text>')
    return out


def _line(a: tuple[int, int], b: tuple[int, int], link: Link, k: int) -> str:
    """Return a line between two bodies with its text in the middle; k lines between the same bodies come before it."""
    if a[0] > b[0]:
        a, b = b, a
    same = a[0] == b[0]
    x1, y1 = a[0] + (WIDE / 2 if same else WIDE), a[1] + (HIGH if same and a[1] < b[1] else 0 if same else HIGH / 2 + 12 * k)
    x2, y2 = b[0] + (WIDE / 2 if same else 0), b[1] + (0 if same and a[1] < b[1] else HIGH if same else HIGH / 2 + 12 * k)
    share = (0.5, 0.72, 0.28)[k % 3]
    x, y = x1 + (x2 - x1) * share, y1 + (y2 - y1) * share
    sign = {
        "freewheel": f'<path class="freewheel" d="M{x - 6} {y - 9} l12 9 l-12 9 z M{x + 6} {y - 10} v20" fill="#fff"/>',
        "clutch": f'<path class="clutch" d="M{x - 4} {y - 11} v22 M{x + 4} {y - 11} v22" fill="none"/>',
        "shaft": f'<path class="shaft" d="M{x - 12} {y} l4 -7 l8 14 l8 -14 l4 7" fill="#fff"/>',
    }.get(link.kind, f'<circle class="{link.kind} sign" cx="{x}" cy="{y}" r="6"/>')
    return (
        f'<line class="{link.kind}" x1="{x1}" y1="{y1}" x2="{x2}" y2="{y2}"/>{sign}'
        f'<text x="{x - 4 * len(link.text) / 1.3:.0f}" y="{y - 15:.0f}">{escape(link.text)}</text>'
    )
