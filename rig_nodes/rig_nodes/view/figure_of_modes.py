# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The figure of a driveline's modes: shapes on the driveline, critical speeds with their rpm, response and a recorded spectrum.

`rig modes --picture` draws it.
"""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

import numpy as np

from ..analysis import RPM
from ..driveline import columns
from ..rig import driveline_drawn
from .figure import DASHED, DOTTED, POINTS, SOLID, Column, Curve, Description, Level, Panel, Ring
from .palette import CURVES, LIMIT

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ..analysis import Critical, Found, Response, Spectrum
    from ..rig import RigConfig

HIGH = 230  # px of a plot
SHAPES, RINGS = 4, 12  # modes whose shapes are drawn, and critical speeds that are named
MOST = 2000  # points of a curve


def figure_of_modes(
    config: RigConfig,
    found: Found,
    speeds: tuple[str, Sequence[float], tuple[float, float], Sequence[Critical]],
    response: Response | None,
    spectrum: tuple[str, str, Spectrum] | None,
) -> Description:
    """Return the figure of the modes of a rig in a state of its clutches.

    Parameters
    ----------
    config : RigConfig
        The rig.
    found : Found
        Its modes.
    speeds : (str, sequence of float, (float, float), sequence of Critical)
        The exciting body, the orders of its speed, its lowest and highest speed [rad/s], and its critical speeds.
    response : Response, optional
        The response to a torque on that body.
    spectrum : (str, str, Spectrum), optional
        Name and unit of a recorded signal, and its spectrum.

    Returns
    -------
    Description
        The figure; without panels where no shaft can twist.
    """
    natural = [float(f) for f, damping in zip(found.modes.frequencies, found.modes.damping) if f > 0.0 and abs(damping) < 1.0]
    panels = []
    if (found.modes.frequencies > 0.0).any():
        panels.append(_shapes(config, found))
    if natural:
        panels.append(_speeds(natural, *speeds))
    if response and (np.abs(response.torques) > 0.0).any():
        panels.append(_response(response, speeds[0]))
    if spectrum:
        panels.append(_spectrum(*spectrum, natural))
    title = f"{config.name}, {found.state.name}: mode shapes and critical speeds"
    return Description(title, config.description, "", "", (Column(0.0, 1.0, ""),), tuple(panels), high=HIGH)


def _shapes(config: RigConfig, found: Found) -> Panel:
    """Return the shapes of the lowest modes along what joins the bodies in this state."""
    bodies, links = driveline_drawn(config)
    column = columns(bodies, links)
    names = sorted(found.modes.bodies, key=lambda name: (column.get(name, 0), found.modes.bodies.index(name)))
    place = {name: n for n, name in enumerate(names)}
    called = {one.called for one in config.structure.devices if one.name in found.state.locked}
    joined = [
        (one.a, one.b)
        for one in links
        if one.a in place
        and one.b in place
        and (one.kind != "clutch" or one.text.partition(" (")[0] in {*called, *found.state.locked})
    ]
    still = np.array([[place[a], place[b], np.nan] for a, b in joined]).ravel() if joined else np.array([0.0, len(names) - 1.0])
    curves = [Curve("driveline", "", "", CURVES[-1], DOTTED, still, np.zeros(len(still)))]
    chosen = [k for k, f in enumerate(found.modes.frequencies) if f > 0.0][:SHAPES]
    for k, colour in zip(chosen, CURVES):
        shape = np.abs(found.modes.shapes[k]) * np.where(np.real(found.modes.shapes[k]) < 0.0, -1.0, 1.0)
        y = dict(zip(found.modes.bodies, shape))
        damping = f", D {found.modes.damping[k]:.2g}" if found.modes.damping[k] else ""
        text = f"{found.modes.frequencies[k]:.4g} Hz"
        line = np.array([[y[a], y[b], np.nan] for a, b in joined]).ravel() if joined else np.array([y[names[0]], y[names[-1]]])
        curves.append(Curve(text, text + damping, text, colour, SOLID, still, line))
        curves.append(
            Curve(text, "", "", colour, POINTS, np.arange(len(names), dtype=float), np.array([y[name] for name in names]))
        )
    across = Column(-0.4, len(names) - 0.6, "bodies along the driveline", names=tuple(names))
    return Panel("Mode shapes: amplitude, the largest 1", "", tuple(curves), across=across)


def _speeds(
    natural: Sequence[float], body: str, orders: Sequence[float], speeds: tuple[float, float], critical: Sequence[Critical]
) -> Panel:
    """Return natural frequencies and orders over the speed of the exciting body; where they meet, the speed is named."""
    low, high = speeds[0] * RPM, speeds[1] * RPM
    top = 1.15 * max(natural)
    if orders and 60.0 * top / min(orders) > low:
        high = min(high, 60.0 * top / min(orders))  # beyond it no order meets a frequency
    levels = tuple(Level(f, f"{f:.4g} Hz", False) for f in natural)
    curves, rings = [], []
    for n, order in enumerate(orders):
        last = min(high, 60.0 * top / order)
        if order * low / 60.0 < top and last > low:
            text, style = f"order {order:g}", (SOLID, DASHED)[n // len(CURVES) % 2]
            x = np.linspace(low, last, 50)
            curves.append(Curve(text, text, text, CURVES[n % len(CURVES)], style, x, order * x / 60.0))
    if not curves:
        curves.append(Curve("0", "", "", CURVES[-1], SOLID, np.array([low, high]), np.zeros(2)))
    for one in sorted(critical, key=lambda one: -abs(one.share))[:RINGS]:
        rpm = one.speed * RPM
        rings.append(Ring(rpm, one.order * rpm / 60.0, f"{rpm:.0f} rpm", LIMIT))
    return Panel("Critical speeds", "Hz", tuple(curves), tuple(rings), levels, across=Column(low, high, f"speed of {body} [rpm]"))


def _response(found: Response, body: str) -> Panel:
    curves, rings = [], []
    shown = [k for k in range(len(found.shafts)) if np.abs(found.torques[:, k]).any()]
    for n, k in enumerate(shown[: len(CURVES)]):
        size = np.abs(found.torques[:, k])
        at = int(size.argmax())
        curves.append(Curve(found.shafts[k], found.shafts[k], found.shafts[k], CURVES[n], SOLID, found.frequencies, size))
        rings.append(
            Ring(float(found.frequencies[at]), float(size[at]), f"{found.frequencies[at]:.4g} Hz: {size[at]:.3g}", CURVES[n])
        )
    across = Column(float(found.frequencies[0]), float(found.frequencies[-1]), "frequency [Hz]", log=True)
    return Panel(f"Torque in the shafts under 1 Nm on {body}", "Nm/Nm", tuple(curves), tuple(rings), log=True, across=across)


def _spectrum(name: str, unit: str, found: Spectrum, natural: Sequence[float]) -> Panel:
    top = 1.5 * max(natural) if natural else float(found.frequencies[-1])
    keep = found.frequencies <= top
    x, y = found.frequencies[keep], found.amplitudes[keep]
    step = max(1, len(x) // MOST)
    ends = [*range(0, len(x), step), len(x)]
    tops = np.array([low + int(y[low:high].argmax()) for low, high in itertools.pairwise(ends)])
    rings = tuple(Ring(f, float(np.interp(f, x, y)), f"computed {f:.4g} Hz", LIMIT) for f in natural if f <= top)
    curve = Curve(name, name, name, CURVES[0], SOLID, x[tops], y[tops])
    return Panel(f"Averaged spectrum of {name}", unit.replace(".", ""), (curve,), rings, across=Column(0.0, top, "frequency [Hz]"))
