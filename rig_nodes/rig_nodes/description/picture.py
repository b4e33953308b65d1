# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The driveline of a rig as a picture: bodies, wheels, planetary sets, clutches, and what sits on them. Used by `rig check`.

Bodies stand in columns by how far they are from the input; what joins two of them is a line with a sign on it.
"""

from __future__ import annotations

from html import escape

from ..parts import part as parts
from .structure import Structure

WIDE, HIGH, ACROSS, DOWN, EDGE = 150, 46, 270, 110, 60  # of a body, between columns and rows, at the edge [px]
STYLE = """text{font:13px sans-serif;fill:#1b1f24}.small{font-size:11px;fill:#57606a}.body{fill:#eaf2fb;stroke:#1f6feb;stroke-width:1.5}
.massless{fill:#fff;stroke:#8c959f;stroke-dasharray:5 3}.mesh{stroke:#57606a;stroke-width:2}.set{stroke:#8250df;stroke-width:2}
.clutch{stroke:#cf222e;stroke-width:2}.freewheel{stroke:#bc4c00;stroke-width:2}.shaft{stroke:#1a7f37;stroke-width:2}.torque{stroke:#bf8700;stroke-width:2;stroke-dasharray:2 4}.part{fill:#fff8e5;stroke:#bf8700}
.sign{fill:#fff;stroke-width:1.5}"""


def _links(structure: Structure, config) -> list[tuple[str, str, str, str]]:
    """(body, body, kind, words) of everything that joins two bodies."""
    out = [(*mesh.bodies, "mesh", f"{mesh.name} {mesh.teeth[0]} : {mesh.teeth[1]}".lstrip() + (
        f", {getattr(config, mesh.name).efficiency:.3g}" if mesh.lossy else "")) for mesh in structure.meshes]
    out += [(*shaft.bodies, "shaft", shaft.name) for shaft in structure.shafts]
    for device in structure.clutches:
        if "joins" in device.wires:
            out.append((*device.wires["joins"], "clutch", _clutch(structure, device)))
    out += [(*device.wires["joins"], "freewheel", f"{device.called}: {device.wires['joins'][0]} not faster")
            for device in structure.freewheels]
    out += [(*one.bodies, one.kind, one.name) for one in structure.of_kind("clutch", "torque") if len(one.bodies) == 2]
    for one in structure.of_kind("relation"):
        words = [f"{c:g} {body}" for body, c in zip(one.bodies, one.coefficients)]
        out += [(one.bodies[0], other, "set", f"{one.name}: {words[0]}, {told}") for other, told in zip(one.bodies[1:], words[1:])]
    for one in structure.planetary_sets:
        out += [(one.ring, wheel, "set", f"{one.name}: {role} {teeth}") for wheel, role, teeth in (
            (one.sun, "sun", one.teeth[0]), (one.carrier, "carrier,", f"ring {one.teeth[1]}"))]
    return [link for link in out if link[0] in structure.bodies and link[1] in structure.bodies]


def _attached(structure: Structure) -> dict[str, list[str]]:
    """What sits on each body or acts on it, in words."""
    out: dict[str, list[str]] = {body: [] for body in structure.bodies}
    for device in structure.devices:
        if device.role in (parts.SOURCE, parts.LOAD, parts.LOSS, parts.METER):
            kind = device.part.replace("_", " ")
            out[device.wires["body"]].append(f"{device.called}: {kind}" if device.called != device.part else kind)
    for one in structure.of_kind("torque", "varying_inertia", "slider_crank", "motion"):
        if len(one.bodies) == 1:
            out[one.bodies[0]].append(f"{one.name}: {one.kind.replace('_', ' ')}")
    for name in structure.inputs:
        if name in out:
            out[name].append("torque over time")
    return out


def _clutch(structure: Structure, device) -> str:
    """A clutch for people, with the valve that fills it and the controller's output that drives that."""
    valve = structure.valve_of(device.name)
    return f"{device.called} ({valve.called}, output {valve.wires['output']})" if valve else device.called


def _places(structure: Structure, links) -> dict[str, tuple[int, int]]:
    """Column and row of each body: columns by the number of joints from the input, the output alone in the last one.

    What is joined across a column stands above what is joined to the next one, so that no line runs through a body.
    """
    start = structure.input.body if structure.input else structure.bodies[0]
    end = structure.output.body if structure.output else None
    column, todo = {start: 0}, [start]
    while todo:
        here = todo.pop(0)
        for a, b, *_ in links:
            for one, other in ((a, b), (b, a)):
                if one == here and other not in column and end not in (one, other):
                    column[other] = column[here] + 1
                    todo.append(other)
    for body in structure.bodies:
        column.setdefault(body, 1 if body != end else 0)
    if end:
        column[end] = 1 + max(column[body] for body in structure.bodies if body != end)
    span = {body: max((abs(column[a] - column[b]) for a, b, *_ in links if body in (a, b)), default=0) for body in structure.bodies}
    across, places = any(value > 1 for value in span.values()), {}
    for k in sorted(set(column.values())):
        free = 0 if k in (0, column.get(end)) else int(across)
        for body in sorted((body for body in structure.bodies if column[body] == k), key=lambda body: -span[body]):
            beside = [places[other][1] for a, b, *_ in links for one, other in ((a, b), (b, a)) if one == body and other in places]
            row = max(free, min(beside)) if beside and free else free
            places[body], free = (k, row), row + 1
    return places


def driveline_svg(config) -> str:
    """The picture of a rig's driveline as SVG; config: of testbench.configuration."""
    structure = config.structure
    links = _links(structure, config)
    places = _places(structure, links)
    attached = _attached(structure)
    brakes = {device.wires["brakes"]: _clutch(structure, device) for device in structure.clutches if "brakes" in device.wires}
    for one in structure.of_kind("brake"):
        brakes[one.bodies[0]] = f"{brakes[one.bodies[0]]}, {one.name}" if one.bodies[0] in brakes else one.name
    down = DOWN + 20 * max(map(len, attached.values()), default=0)
    where = {body: (EDGE + column * ACROSS, EDGE + 40 + row * down) for body, (column, row) in places.items()}
    title = f"{config.name}: {config.description}"
    width = EDGE * 2 + max(9 * len(title), WIDE + ACROSS * max(column for column, _ in places.values()))
    height = EDGE * 2 + 60 + HIGH + down * max(row for _, row in places.values()) + 20 * max(map(len, attached.values()), default=0)
    out = [f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" viewBox="0 0 {width} {height}">',
           f"<style>{STYLE}</style>", f'<rect width="{width}" height="{height}" fill="#fff"/>',
           f'<text x="{EDGE}" y="30" style="font-size:16px">{escape(title)}</text>']
    drawn: dict[frozenset, int] = {}
    for a, b, kind, words in links:
        k = drawn[frozenset((a, b))] = drawn.get(frozenset((a, b)), -1) + 1
        out.append(_link(where[a], where[b], kind, words, k))
    for body, (x, y) in where.items():
        massless = body in structure.massless
        out.append(f'<rect class="{"massless body" if massless else "body"}" x="{x}" y="{y}" width="{WIDE}" height="{HIGH}" rx="6"/>')
        ends = [f" ({key})" for key in ("input", "output") if (end := getattr(structure, key)) and end.body == body
                and body != key]
        out.append(f'<text x="{x + 10}" y="{y + 19}">{escape(body)}{"".join(ends)}</text>')
        inertia = "no inertia of its own" if massless else f"{getattr(config, body).inertia:.4g} kg m2"
        out.append(f'<text class="small" x="{x + 10}" y="{y + 36}">{inertia}</text>')
        if body in brakes:
            out.append(f'<path class="clutch" d="M{x + WIDE / 2} {y} v-14 m-14 0 h28 m-28 0 l-6 -7 m20 7 l-6 -7 m20 7 l-6 -7" fill="none"/>')
            out.append(f'<text x="{x + WIDE / 2 + 20}" y="{y - 10}">{escape(brakes[body])}</text>')
        for k, device in enumerate(one for one in structure.freewheels if {*one.wires["joins"]} == {body, "ground"}):
            way = "not backwards" if device.wires["joins"][0] == "ground" else "not forwards"
            top = y - 14 - 16 * (body in brakes)
            out.append(f'<path class="freewheel" d="M{x + 24 + 60 * k} {y} v-14 m-12 0 h24 m-24 0 l8 -7 m16 7 l-8 -7" fill="none"/>')
            out.append(f'<text x="{x + 42 + 60 * k}" y="{top}">{escape(device.called)} ({way})</text>')
        for k, told in enumerate(map(escape, attached[body])):
            out.append(f'<rect class="part" x="{x + 8}" y="{y + HIGH + 4 + 20 * k}" width="{WIDE - 8}" height="17" rx="3"/>')
            out.append(f'<text class="small" x="{x + 14}" y="{y + HIGH + 16 + 20 * k}">{told}</text>')
    table = [f"{gear.name}: {', '.join(structure.device(one).called for one in gear.held)}, ratio "
             f"{config.transmission.ratios[number]:.4g}" for number, gear in enumerate(structure.gears, 1)]
    if table:
        out.append(f'<text class="small" x="{EDGE}" y="{height - 14}">gears: {escape("; ".join(table))}</text>')
    return "\n".join([*out, "</svg>", ""])


def _link(a: tuple[int, int], b: tuple[int, int], kind: str, words: str, k: int) -> str:
    """A line between two bodies with its words in the middle; k: how many there are between them already."""
    if a[0] > b[0]:
        a, b = b, a
    same = a[0] == b[0]
    x1, y1 = a[0] + (WIDE / 2 if same else WIDE), a[1] + (HIGH if same and a[1] < b[1] else 0 if same else HIGH / 2 + 12 * k)
    x2, y2 = b[0] + (WIDE / 2 if same else 0), b[1] + (0 if same and a[1] < b[1] else HIGH if same else HIGH / 2 + 12 * k)
    share = 0.5 + 0.16 * (k % 3 - 1) * (k > 0)
    x, y = x1 + (x2 - x1) * share, y1 + (y2 - y1) * share
    sign = {"freewheel": f'<path class="freewheel" d="M{x - 6} {y - 9} l12 9 l-12 9 z M{x + 6} {y - 10} v20" fill="#fff"/>',
            "clutch": f'<path class="clutch" d="M{x - 4} {y - 11} v22 M{x + 4} {y - 11} v22" fill="none"/>',
            "mesh": f'<circle class="mesh sign" cx="{x}" cy="{y}" r="6"/>',
            "set": f'<circle class="set sign" cx="{x}" cy="{y}" r="6"/>',
            "torque": f'<circle class="torque sign" cx="{x}" cy="{y}" r="6"/>',
            "shaft": f'<path class="shaft" d="M{x - 12} {y} l4 -7 l8 14 l8 -14 l4 7" fill="#fff"/>'}[kind]
    return (f'<line class="{kind}" x1="{x1}" y1="{y1}" x2="{x2}" y2="{y2}"/>{sign}'
            f'<text x="{x - 4 * len(words) / 1.3:.0f}" y="{y - 15:.0f}">{escape(words)}</text>')
