# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The figures of a whole run: a bench's result, the rig's own pages, and its plots over time. ``Run.plot`` shows the first.

Where a signal moves faster than the figure can show, a second column shows three of its periods, or three turns of a shaft.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ..analysis import phases_of, running_mean
from ..rig import OwnPlot
from .figure import DASHED, SOLID, Column, Curve, Description, Moment, Panel, Stretch
from .figure_of_bench import figure_of_bench
from .pages import Pages
from .recorded import BINS, Envelope, envelopes_of, windows_of

if TYPE_CHECKING:
    from pathlib import Path

FAST, OFTEN = (
    0.08,
    0.2,
)  # a signal that swings by such a share of its range within 1 % of the run, for such a share of it, is a band
APART = 25.0  # ratio of two signals' sizes from which they have plots of their own
FLAT = 0.01  # of a signal's measuring range, below which it counts as constant
WITHIN = 0.25  # share of a swing that must lie within a stretch of a pixel; 1/9 of a ramp does
CLOSE, TURNS = 2.0, 3  # s that are searched for periods, and periods or turns that are shown
LEAST = 8  # samples in a period or turn, from which its shape is seen
PERIODIC = 0.5  # autocorrelation from which a signal has a period
SMOOTH = 9  # stretches over which the height of a swing is taken


def figures_of_run(report: Mapping, pages: Pages, path: str | Path, span: tuple[float, float]) -> list[Description]:
    """Return the figures of a run, the one that answers the rig's question first.

    Parameters
    ----------
    report : mapping
        Its report.
    pages : Pages
        The pages of its rig.
    path : str or Path
        Its folder or bag.
    span : (float, float)
        Its first and last time [s].

    Returns
    -------
    list of Description
        Plots, and figures, of which nothing was recorded are left out.
    """
    names = list(dict.fromkeys(name for plots in pages.questions.values() for plot in plots for name in plot.signals))
    span = span[0], max(span[1], span[0] + 1e-3)
    found = envelopes_of(path, pages, names, span)
    drawn = [_Page(report, pages, path, title, plots, found).figure() for title, plots in pages.questions.items()]
    return [one for one in (figure_of_bench(report, pages, path, span), *drawn) if one and one.panels]


class _Page:
    """The figure of a page while it is made."""

    def __init__(
        self, report: Mapping, pages: Pages, path: str | Path, title: str, plots: Sequence[OwnPlot], found: Mapping[str, Envelope]
    ) -> None:
        self.report, self.pages, self.path, self.title, self.found = report, pages, path, title, found
        self.plots = [
            kept for one in plots if (kept := replace(one, signals=tuple(name for name in one.signals if name in found))).signals
        ]
        self.close: dict[str, tuple[np.ndarray, np.ndarray]] = {}
        self.seldom: list[str] = []  # signals of which the second column would show what is between their samples

    def figure(self) -> Description:
        span = next((one.start, one.end) for one in self.found.values()) if self.plots else (0.0, 1.0)
        second = self._close()
        columns = (Column(*span, "time [s]"), second) if second else (Column(*span, "time [s]"),)
        panels, constant = [], []
        for plot in self.plots:
            for part in self._parts(plot):
                flat = [name for name in part.signals if self._flat(name)]
                if len(flat) == len(part.signals):
                    constant += flat
                else:
                    panels.append(self._panel(part))
        if not panels:
            panels, constant = [self._panel(part) for plot in self.plots for part in self._parts(plot)], []
        run, rows = self.report["run"], self.report["shifts"]
        way = self.pages.box.way if self.pages.box else None
        moments = [Moment(row["t_order_s"], way(row["from_gear"], row["to_gear"], " → "), "") for row in rows if way]
        for one in run.get("faults") or ():
            ends = ((one["from_s"], one["name"]), (one["to_s"], f"{one['name']} ends"))
            moments += [Moment(t, text, "") for t, text in ends if t is not None]
        return Description(
            f"{self.title}: {run.get('description') or run.get('sequence') or 'run'}",
            " · ".join(self._notes(constant)),
            "",
            "",
            columns,
            tuple(panels),
            tuple(Stretch(one.name, (), one.start, one.end) for row in rows for one in phases_of(row)),
            tuple(sorted(moments, key=lambda one: one.t)),
        )

    def _notes(self, constant: Sequence[str]) -> list[str]:
        """Return what is said in place of curves."""
        seldom = ", ".join(self.pages.words(name) for name in dict.fromkeys(self.seldom))
        notes = [f"constant: {', '.join(map(self._value, constant))}"] if constant else []
        return [*notes, f"recorded too seldom for the close-up: {seldom}"] if seldom else notes

    def _value(self, name: str) -> str:
        low, high = self.found[name].span
        return f"{self.pages.words(name)} {0.5 * (low + high):z.3g} {self.pages.signal(name).display_unit}".strip()

    # ---- which plots

    def _flat(self, name: str) -> bool:
        """Return True for a signal that only trembles, within a share of its measuring range."""
        signal, found = self.pages.signal(name), self.found[name]
        whole = 0.0 if name in self.pages.rates else abs(float(signal.shown(signal.high)) - float(signal.shown(signal.low)))
        low, high = found.span
        low_of_band, high_of_band = (one[found.filled] for one in found.band)
        return high - low <= FLAT * whole and np.ptp(low_of_band + high_of_band) <= high - low

    def _parts(self, plot: OwnPlot) -> list[OwnPlot]:
        """Return a plot, or several where the sizes of its signals differ so much that a small one would be a line on zero."""
        demanded = {name for name in plot.signals if self.pages.look(name).demanded}
        size = {name: max(map(abs, self.found[name].span)) for name in plot.signals}
        kept = sorted((name for name in plot.signals if name not in demanded), key=lambda name: -size[name])
        groups: list[list[str]] = [[*kept[:1]]]
        for name in kept[1:]:
            apart = size[name] > 0.0 and size[groups[-1][-1]] > APART * size[name]
            groups = [*groups, [name]] if apart else [*groups[:-1], [*groups[-1], name]]
        groups[0] += [name for name in plot.signals if name in demanded]
        if len(groups) == 1:
            return [plot]
        return [replace(plot, signals=tuple(one for one in plot.signals if one in group)) for group in groups]

    # ---- curves

    def _panel(self, plot: OwnPlot) -> Panel:
        curves: list[Curve] = []
        for name in plot.signals:
            look = self.pages.look(name)
            colour, style = look.colour, DASHED if look.demanded else SOLID
            scales = len(plot.signals) == 1 or not look.demanded
            text = self.pages.words(name)
            curves.append(_whole(self.found[name], Curve(name, text, text, colour, style, *_NONE, scales=scales, column=0)))
            if name in self.close:
                curves.append(Curve(name, text, text, colour, style, *self.close[name], scales=scales, column=1))
        if not any(one.scales for one in curves):
            curves = [replace(one, scales=True) for one in curves]
        return Panel(plot.title, self.pages.signal(plot.signals[0]).display_unit, tuple(curves))

    def _close(self) -> Column | None:
        """Find the stretch that the second column shows, and its curves; None where no signal is fast."""
        shown = [name for plot in self.plots for name in plot.signals]
        fast = [name for name in shown if name not in self.pages.rates and _is_fast(self.found[name])]
        speed = next((plot.over for plot in self.plots if plot.over), "")
        if not fast:
            return None
        chosen = [name for plot in self.plots if plot.over for name in plot.signals if name in fast] or fast[:1]
        swings = sum((self.found[name].swing / self.found[name].swing.max() for name in chosen), np.zeros(BINS))
        middle = float(self.found[chosen[0]].times[_middle_of_longest(running_mean(swings, SMOOTH))])
        names = sorted({*shown, *([speed] if speed else [])})
        (found,) = windows_of(self.path, self.pages, names, [(middle - 0.5 * CLOSE, middle + 0.5 * CLOSE)])
        read = {name: (one.time, self.pages.signal(name).shown(one.values)) for name, one in found.items()}
        if chosen[0] not in read or (speed and speed not in read):
            return None
        if speed:
            t, n = read[speed]
            turned = np.concatenate([[0.0], np.cumsum(0.5 * (n[1:] + n[:-1]) * np.diff(t) / 60.0)])  # rpm to turns
            turned -= np.interp(middle, t, turned)
            first, last = -0.5 * TURNS, 0.5 * TURNS
            if turned[0] > first or turned[-1] < last:
                return None
            scaled = {name: (360.0 * (np.interp(at, t, turned) - first), y) for name, (at, y) in read.items()}
            column = Column(0.0, 360.0 * TURNS, f"angle of {speed} around {middle:.1f} s [°]", 0.36)
        else:
            period = _period(*read[chosen[0]])
            if not period:
                return None
            length = TURNS * period
            scaled = {name: (1e3 * (at - middle + 0.5 * length), y) for name, (at, y) in read.items()}
            column = Column(0.0, 1e3 * length, f"time from {middle - 0.5 * length:.3f} s [ms]", 0.36)
        for name, (x, y) in scaled.items():
            part = slice(max(0, int(np.searchsorted(x, column.first)) - 1), int(np.searchsorted(x, column.last)) + 1)
            if len(x[part]) < 2 or name not in self.found:  # a speed that only gives the angle
                continue
            low, high = self.found[name].span
            if len(x[part]) < LEAST * TURNS and np.ptp(y[part]) > FAST * (high - low):
                self.seldom.append(name)
            else:
                self.close[name] = x[part], y[part]
        return column


_NONE = np.empty(0), np.empty(0)


def _is_fast(envelope: Envelope) -> bool:
    """Return True for a signal that swings often, and not only because it goes from one level to another."""
    low, high = envelope.span
    swings = envelope.filled & (envelope.swing > FAST * (high - low))
    if high <= low or swings.sum() <= OFTEN * envelope.filled.sum():
        return False
    return bool(np.median((envelope.high[swings] - envelope.low[swings]) / envelope.swing[swings]) > WITHIN)


def _middle_of_longest(swings: np.ndarray) -> int:
    """Return the middle of the longest stretch in which a swing (n,) is at least half of what it seldom exceeds."""
    high = swings >= 0.5 * np.percentile(swings, 95)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], high, [False]]).astype(int))).reshape(-1, 2)
    first, last = edges[int((edges[:, 1] - edges[:, 0]).argmax())]
    return int(first + last) // 2


def _whole(envelope: Envelope, curve: Curve) -> Curve:
    """Return the curve of a whole run: a band where it is fast, else a line through all extremes."""
    at = envelope.filled
    t, low, high = envelope.times, envelope.low, envelope.high
    if _is_fast(envelope):
        low, high = (one[at] for one in envelope.band)
        return replace(curve, t=t[at], y=0.5 * (low + high), band=(low, high))
    turns = np.arange(at.sum()) % 2 == 0
    y = np.column_stack([np.where(turns, low[at], high[at]), np.where(turns, high[at], low[at])])
    return replace(curve, t=np.repeat(t[at], 2), y=y.ravel())


def _period(t: np.ndarray, y: np.ndarray) -> float:
    """Return the period [s] of samples (n,), by the first peak of their autocorrelation; 0 without one."""
    known = np.isfinite(y)
    if known.sum() < 16:
        return 0.0
    even = np.linspace(t[known][0], t[known][-1], int(known.sum()))
    rest = np.interp(even, t[known], y[known])
    rest = rest - rest.mean()
    size = 2 * len(rest)
    power = np.abs(np.fft.rfft(rest, size)) ** 2
    shared = np.fft.irfft(power, size)[: len(rest) // TURNS] / np.arange(len(rest), len(rest) - len(rest) // TURNS, -1)
    if not len(shared) or shared[0] <= 0.0:
        return 0.0
    shared = shared / shared[0]
    below = np.flatnonzero(shared < 0.0)
    if not len(below) or shared[below[0] :].max() < PERIODIC:
        return 0.0
    peak = below[0] + int(np.flatnonzero(shared[below[0] :] > 0.9 * shared[below[0] :].max())[0])
    while peak + 1 < len(shared) and shared[peak + 1] > shared[peak]:
        peak += 1
    return float(peak * (even[1] - even[0]))
