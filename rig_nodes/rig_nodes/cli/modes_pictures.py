# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The picture of the verb ``modes``: mode shapes, frequencies over speed with orders, responses and a recorded spectrum."""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING

import numpy as np

from ..studies import HEIGHT, WIDTH, Figure, Series

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ..analysis import Found, Response, Spectrum

RPM = math.pi / 30.0
MOST = 8  # lines of a chart, as many as there are colours
_FIRST = re.compile(r"<svg [^>]*>")


def stacked(figures: Sequence[Figure]) -> str:
    """Return charts below each other as one SVG text."""
    out = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT * len(figures)}" width="{WIDTH}" '
        f'height="{HEIGHT * len(figures)}" font-family="sans-serif" font-size="12">'
    ]
    for k, figure in enumerate(figures):
        inner = _FIRST.sub(f'<g transform="translate(0 {k * HEIGHT})">', figure.svg(), count=1)
        out.append(inner.replace("</svg>", "</g>").strip())
    return "\n".join([*out, "</svg>", ""])


def shapes_figure(rig: str, found: Found) -> Figure | None:
    """Return the chart of the mode shapes; None where no mode is above 0 Hz."""
    modes = found.modes
    names = ", ".join(f"{k} {name}" for k, name in enumerate(modes.bodies, 1))
    title = f"{rig}, {found.state.name}: mode shapes"
    series = []
    for f, damping, shape in zip(modes.frequencies, modes.damping, modes.shapes):
        if f > 0.0 and len(series) < MOST:
            amplitudes = np.abs(shape) * np.where(np.real(shape) < 0.0, -1.0, 1.0)
            label = f"{f:.4g} Hz, D {damping:.2g}" if damping else f"{f:.4g} Hz"
            series.append(Series(label, list(range(1, len(shape) + 1)), amplitudes.tolist()))
    return Figure(title, f"body: {names}", "amplitude, largest 1", series) if series else None


def speeds_figure(rig: str, found: Found, body: str, orders: Sequence[float], speeds: tuple[float, float]) -> Figure | None:
    """Return the chart of natural frequencies and orders over the speed of a body; None where no mode is above 0 Hz."""
    rpm = [speeds[0] / RPM, speeds[1] / RPM]
    natural = [f for f, damping in zip(found.modes.frequencies, found.modes.damping) if f > 0.0 and abs(damping) < 1.0]
    if not natural:
        return None
    top = 1.15 * max(natural)
    series = [Series(f"{f:.4g} Hz", rpm, [f, f], marks=False) for f in natural]
    for order in orders:
        ends = [order * one / 60.0 for one in rpm]
        last = min(rpm[1], 60.0 * top / order)
        if ends[0] < top:
            series.append(Series(f"order {order:g}", [rpm[0], last], [ends[0], order * last / 60.0], marks=False, dashed=True))
    at = [(60.0 * f / order, f) for f in natural for order in orders if rpm[0] <= 60.0 * f / order <= rpm[1]]
    if at:
        series.append(Series("critical", [x for x, _ in at], [y for _, y in at], line=False))
    return Figure(f"{rig}, {found.state.name}: critical speeds", f"speed of {body} [rpm]", "frequency [Hz]", series)


def response_figure(rig: str, state: str, body: str, found: Response) -> Figure | None:
    """Return the chart of the shafts' torques under a harmonic torque on a body; None for a rig without shafts."""
    series = []
    for k, shaft in enumerate(found.shafts[:MOST]):
        size = np.abs(found.torques[:, k])
        if size.any():
            logs = np.log10(np.maximum(size, 1e-12 * size.max()))
            series.append(Series(shaft, np.log10(found.frequencies).tolist(), logs.tolist(), marks=False))
    title = f"{rig}, {state}: torque in the shafts under 1 Nm on {body}"
    return Figure(title, "log10 of the frequency in Hz", "log10 of Nm per Nm", series) if series else None


def spectrum_figure(rig: str, name: str, unit: str, found: Spectrum, frequencies: Sequence[float]) -> Figure:
    """Return the chart of a recorded spectrum with the natural frequencies."""
    natural = [f for f in frequencies if f > 0.0]
    top = 1.5 * max(natural) if natural else float(found.frequencies[-1])
    keep = found.frequencies <= top
    places, sizes = found.frequencies[keep], found.amplitudes[keep]
    step = max(1, len(places) // 2000)
    high = float(sizes.max())
    series = [Series(name, places[::step].tolist(), sizes[::step].tolist(), marks=False)]
    series += [Series(f"computed {f:.4g} Hz", [f, f], [0.0, high], marks=False, dashed=True) for f in natural[: MOST - 1]]
    return Figure(f"{rig}: averaged spectrum of {name}", "frequency [Hz]", f"amplitude [{unit}]", series)
