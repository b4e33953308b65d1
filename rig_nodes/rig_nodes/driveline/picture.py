# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Draws a driveline as an SVG picture: its bodies, what joins two of them, and what sits on them.

Used by driveline.builder for a description in Python, and by rig.picture for a rig. A body is a bar, and what joins two of them
is a horizontal line with a symbol on it, in a row in which it meets nothing else; texts stand between the rows.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from html import escape

EDGE, TOP = 24, 64  # margin, and the room for title and sides [px]
HALF, ROW, NOTE, BRAKE = 23, 58, 20, 34  # half the height of a body with one row, and heights of a row, a note and a brake [px]
BODY, GAP = 96, 64  # smallest width of a body, and of the room between two [px]
LETTER, SMALL = 8.0, 6.9  # width of a letter of a text and of a small one [px]
TRIES = 20_000  # arrangements that are tried, before a line may pass behind a body
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
    sides : (str, str)
        What the line is at a and at b, e.g. the teeth of both wheels.
    """

    a: str
    b: str
    kind: str
    text: str
    sides: tuple[str, str] = ("", "")


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

    @property
    def words(self) -> tuple[str, str]:
        """The two lines of text in its bar."""
        end = f" ({self.end})" if self.end and self.end != self.name else ""
        return self.name + end, f"{self.inertia:.4g} kg m2" if self.inertia else "no inertia of its own"

    @property
    def held(self) -> list[tuple[str, str]]:
        """Kind and text of what holds it to the ground."""
        free = [("freewheel", f"{name} ({way})") for name, way in self.one_way]
        return [("clutch", self.brake), *free] if self.brake else free

    @property
    def width(self) -> float:
        """Width of its bar, which holds all its texts [px]."""
        name, inertia = self.words
        under = [*(SMALL * len(note) + 4 for note in self.notes), *(LETTER * len(text) + 38 for _, text in self.held)]
        return max(BODY, LETTER * len(name) + 20, SMALL * len(inertia) + 20, *under)

    @property
    def foot(self) -> float:
        """Height of what is drawn under its bar [px]."""
        return NOTE * len(self.notes) + BRAKE * len(self.held)


def columns(bodies: Sequence[Body], links: Sequence[Link]) -> dict[str, int]:
    """Return the column of each body: by the number of joints from the input; two that are joined are never in the same one.

    The output is behind all that lies between it and the input, and what only the input joins to it is on the input's left.
    """
    start = next((body.name for body in bodies if body.end == "input"), bodies[0].name)
    end = next((body.name for body in bodies if body.end == "output" and body.name != start), None)
    column = {start: 0}

    def spread(todo: list[str]) -> None:
        while todo:
            here = todo.pop(0)
            for link in links:
                for one, other in ((link.a, link.b), (link.b, link.a)):
                    if one == here and other not in column and other != end:
                        column[other] = column[here] + 1
                        todo.append(other)

    spread([start])
    if end:
        column[end] = 1 + max(column.values())
        spread([end])
    for body in bodies:
        if body.name not in column:
            column[body.name] = 0
            spread([body.name])
    if end:
        inner, todo = {end}, [end]
        while todo:
            here = todo.pop()
            beside = {link.b if link.a == here else link.a for link in links if here in (link.a, link.b)}
            todo += beside - inner - {start}
            inner |= beside - {start}
        column = {name: at if name == start or name in inner else -at for name, at in column.items()}
        column = {name: at - min(column.values()) for name, at in column.items()}
    while same := next((link for link in links if column[link.a] == column[link.b]), None):
        here = column[same.b]
        column = {name: at + (at > here or name == same.b) for name, at in column.items()}
    return column


def _crosses(rows: Mapping[int, int], links: Sequence[Link], column: Mapping[str, int]) -> bool:
    """Return True when two bars or two lines meet, or a line a bar to which it does not belong."""
    spans: dict[str, tuple[int, int]] = {}
    for number, row in rows.items():
        for body in (links[number].a, links[number].b):
            low, high = spans.get(body, (row, row))
            spans[body] = min(low, row), max(high, row)
    lines = [(row, *sorted((column[links[number].a], column[links[number].b]))) for number, row in rows.items()]
    for place, (body, (low, high)) in enumerate(spans.items()):
        at = column[body]
        for other, (first, last) in list(spans.items())[place + 1 :]:
            if column[other] == at and low <= last and first <= high:
                return True
        if any(low <= row <= high and left < at < right for row, left, right in lines):
            return True
    return any(
        row == other and left < last and first < right
        for place, (row, left, right) in enumerate(lines)
        for other, first, last in lines[place + 1 :]
    )


def _rows(links: Sequence[Link], column: Mapping[str, int]) -> dict[int, int] | None:
    """Return the row of each line by its number, as few rows as can be; None where none was found."""
    order = sorted(range(len(links)), key=lambda n: sorted((column[links[n].a], column[links[n].b])))
    left = [TRIES]

    def place(rows: dict[int, int], most: int) -> dict[int, int] | None:
        if len(rows) == len(order):
            return rows
        number = order[len(rows)]
        for row in range(most):
            left[0] -= 1
            if left[0] < 0:
                return None
            more = {**rows, number: row}
            if not _crosses(more, links, column) and (found := place(more, most)):
                return found
        return None

    for most in range(1, len(links) + 1):
        if len(links) < 200 and (found := place({}, most)):
            return found
    return None


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
    column = columns(bodies, links)
    rows = _rows(links, column)
    if rows is None:  # a body a column, a line a row
        column = {name: place for place, name in enumerate(sorted(column, key=lambda name: column[name]))}
        rows = dict(enumerate(range(len(links))))
    of = {body.name: [row for number, row in rows.items() if body.name in (links[number].a, links[number].b)] for body in bodies}
    free = 1 + max(rows.values(), default=-1)
    for place, name in enumerate(name for name, mine in of.items() if not mine):
        of[name] = [free + place]
    y, lefts, right = _grid(bodies, links, column, of)
    named = {body.name: body for body in bodies}
    widths = {at: max(named[name].width for name, here in column.items() if here == at) for at in lefts}
    width, height = max(right, LETTER * 1.25 * len(title) + EDGE) + EDGE, y[-1] + (24 if below else 0)
    size = f'width="{width:.0f}" height="{height:.0f}"'
    out = [
        f'<svg xmlns="http://www.w3.org/2000/svg" {size} viewBox="0 0 {width:.0f} {height:.0f}">',
        f"<style>{STYLE}</style>",
        f'<rect {size} fill="#fff"/>',
        f'<text x="{EDGE}" y="28" style="font-size:16px">{escape(title)}</text>',
    ]
    for body in bodies:
        if body.end:
            out.append(f'<text class="small" x="{lefts[column[body.name]]:.0f}" y="52">{body.end} side</text>')
    for number, link in enumerate(links):
        if column[link.a] > column[link.b]:
            link = Link(link.b, link.a, link.kind, link.text, link.sides[::-1])
        near = lefts[column[link.a]] + widths[column[link.a]]
        out.append(_line((near, lefts[column[link.b]]), lefts[column[link.a] + 1], y[rows[number]], link))
    for body in bodies:
        at = column[body.name]
        out += _body(body, lefts[at], y[min(of[body.name])] - HALF, y[max(of[body.name])] + HALF, widths[at])
    if below:
        out.append(f'<text class="small" x="{EDGE}" y="{height - 14:.0f}">{escape(below)}</text>')
    return "\n".join([*out, "</svg>", ""])


def _grid(
    bodies: Sequence[Body], links: Sequence[Link], column: Mapping[str, int], of: Mapping[str, Sequence[int]]
) -> tuple[list[float], dict[int, float], float]:
    """Return the heights of the rows and the end of the last one, the left ends of the columns, and the end of the last one."""
    y = [TOP + float(HALF)]
    for row in range(1 + max(max(mine) for mine in of.values())):
        y.append(y[-1] + ROW + max((body.foot for body in bodies if max(of[body.name]) == row), default=0.0))
    lefts, right = {}, float(EDGE)
    for at in range(1 + max(column.values())):
        lefts[at] = right
        ends = [(link, *sorted((column[link.a], column[link.b]))) for link in links]
        texts = [LETTER * len(link.text) + 24 for link, first, _ in ends if first == at]
        sides = [SMALL * len("".join(link.sides)) + 56 for link, first, last in ends if at in (first, last - 1)]
        right += max(body.width for body in bodies if column[body.name] == at) + max(GAP, *texts, *sides, 0)
    last = max(column.values())
    return y, lefts, lefts[last] + max(body.width for body in bodies if column[body.name] == last)


def _body(body: Body, x: float, top: float, bottom: float, width: float) -> list[str]:
    """Return the SVG elements of a bar and of what sits on it."""
    name, inertia = body.words
    middle = 0.5 * (top + bottom)
    kind = "body" if body.inertia else "massless body"
    out = [
        f'<rect class="{kind}" x="{x:.0f}" y="{top:.0f}" width="{width:.0f}" height="{bottom - top:.0f}" rx="6"/>',
        f'<text x="{x + 10:.0f}" y="{middle - 4:.0f}">{escape(name)}</text>',
        f'<text class="small" x="{x + 10:.0f}" y="{middle + 13:.0f}">{inertia}</text>',
    ]
    y = bottom
    for kind, text in body.held:
        out.append(
            f'<path class="{kind}" d="M{x + 20:.0f} {y:.0f} v14 m-12 0 h24 m-24 0 l-5 7 m17 -7 l-5 7 m17 -7 l-5 7" fill="none"/>'
        )
        out.append(f'<text x="{x + 38:.0f}" y="{y + 18:.0f}">{escape(text)}</text>')
        y += BRAKE
    for note in body.notes:
        out.append(f'<rect class="part" x="{x:.0f}" y="{y + 4:.0f}" width="{width:.0f}" height="17" rx="3"/>')
        out.append(f'<text class="small" x="{x + 6:.0f}" y="{y + 16:.0f}">{escape(note)}</text>')
        y += NOTE
    return out


def _line(ends: tuple[float, float], gap: float, y: float, link: Link) -> str:
    """Return the line of a link at a height with its texts; its symbol is in the gap beside its left end, which ends at ``gap``."""
    x = 0.5 * (ends[0] + gap)
    sign = {
        "freewheel": f'<path class="freewheel" d="M{x - 6:.0f} {y - 9:.0f} l12 9 l-12 9 z m12 -1 v20" fill="#fff"/>',
        "clutch": f'<path class="clutch" d="M{x - 4:.0f} {y - 11:.0f} v22 m8 -22 v22" fill="none"/>',
        "shaft": f'<path class="shaft" d="M{x - 12:.0f} {y:.0f} l4 -7 l8 14 l8 -14 l4 7" fill="#fff"/>',
    }.get(link.kind, f'<circle class="{link.kind} sign" cx="{x:.0f}" cy="{y:.0f}" r="6"/>')
    a, b = map(escape, link.sides)
    return (
        f'<line class="{link.kind}" x1="{ends[0]:.0f}" y1="{y:.0f}" x2="{ends[1]:.0f}" y2="{y:.0f}"/>{sign}'
        + (f'<text x="{x:.0f}" y="{y - 14:.0f}" text-anchor="middle">{escape(link.text)}</text>' if link.text else "")
        + (f'<text class="small" x="{ends[0] + 6:.0f}" y="{y + 15:.0f}">{a}</text>' if a else "")
        + (f'<text class="small" x="{ends[1] - 6:.0f}" y="{y + 15:.0f}" text-anchor="end">{b}</text>' if b else "")
    )
