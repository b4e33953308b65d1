# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Inertia of the driving side from a coast-down (thesis 7.1.3.2, 7.3.1): parabola, tangent at its start, M = J dw/dt.

It serves recordings with both clutches open in which the drive is cut off, and depends neither on bags nor on ROS.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..base import RigError
from .edges import first_true, odd_width, running_mean

if TYPE_CHECKING:
    from ..base import Floats

MEAN = 20e-3  # s over which the speed is averaged in the search for the cut and the standstill
BEFORE = 0.5  # s before the cut from which speed and torque are taken
STANDSTILL = 0.02  # share of the speed before the cut below which the shaft counts as standing
FALL = 0.01  # share of the speed; a loss of this size shows that the drive is cut off, and five of them are the first fall


def coast_down(
    t: np.ndarray, w: np.ndarray, torque: float | Floats, t_cut: float | None = None, down_to: float = STANDSTILL, degree: int = 2
) -> dict[str, float | list[float] | None]:
    """Evaluate a coast-down by (7.7), (7.8) and (6.110).

    The fit spans from the cut until the speed has fallen to ``down_to`` of the speed before the cut (to standstill by default,
    as in the thesis); its time counts from the cut. The tangent time is the speed at time 0 of the fit divided by its slope
    there; inertia = torque * tangent time / speed = torque / slope.

    A parabola over the whole run is stiff: where the losses bend the speed in another shape, its slope at the start is wrong.
    ``inertia_half`` is the same evaluation from the upper half of the speed and measures this error.

    Parameters
    ----------
    t : (n,) array of float
        Equally spaced times [s].
    w : (n,) array of float
        Speed of the input shaft [rad/s].
    torque : float or (n,) array of float
        Input torque that was noted before the drive is cut off [Nm], or its channel, whose mean over 0.5 s before the cut
        is taken.
    t_cut : float, optional
        Time at which the drive is cut off [s]; by default the start of the speed's fall, followed back along its slope.
    down_to : float
        Share of the speed before the cut at which the fit ends.
    degree : int
        Degree of the polynomial, 2 as in the thesis.

    Returns
    -------
    dict
        coast_down_tangent_s, coast_down_torque_nm, inertia [kg m2], inertia_half, coefficients [highest power first],
        residual (root mean square, rad/s), t_cut_s, t_end_s (end of the fitted part, from the cut), w_start (mean before
        the cut, None when nothing was recorded there).

    Raises
    ------
    RigError
        When no coast-down is found.
    """
    t, w = np.asarray(t, dtype=float), np.asarray(w, dtype=float)
    _check(t, w, down_to)
    period = float(t[-1] - t[0]) / (t.size - 1)
    smooth = running_mean(w, odd_width(MEAN, period))
    start = _cut(t, smooth, period) if t_cut is None else float(t_cut)
    first = int(np.searchsorted(t, start - 1e-9))
    if first >= t.size - 10:
        raise RigError(f"the recording ends before the drive is cut off at {start:.3f} s")
    before = (t >= start - BEFORE) & (t < start)
    full = float(np.mean(w[before])) if before.any() else float(smooth[first])
    last = first_true(smooth <= max(down_to, 1e-6) * full, first)
    last = t.size if last is None else last
    low = float(smooth[first:last].min())
    if last - first < 10 or low > 0.75 * full:
        raise RigError(
            f"the speed falls only from {full:.2f} to {low:.2f} rad/s after {start:.3f} s; a coast-down must lose a quarter of it"
        )
    half = first_true(smooth <= 0.5 * full, first)
    fits = [
        np.polyfit(t[first:stop] - start, w[first:stop], degree) for stop in (last, min(last, t.size if half is None else half))
    ]
    m = _torque(t, torque, before)
    (tangent, inertia), (_, upper) = (_tangent(fit, m) for fit in fits)
    residual = w[first:last] - np.polyval(fits[0], t[first:last] - start)
    return {
        "coast_down_tangent_s": tangent,
        "coast_down_torque_nm": m,
        "inertia": inertia,
        "inertia_half": upper,
        "coefficients": [float(c) for c in fits[0]],
        "residual": float(np.sqrt(np.mean(residual**2))),
        "t_cut_s": start,
        "t_end_s": float(t[last - 1] - start),
        "w_start": full if before.any() else None,
    }


def _check(t: np.ndarray, w: np.ndarray, down_to: float) -> None:
    """Raise RigError for what is no coast-down that can be fitted."""
    if not (t.ndim == 1 and t.shape == w.shape and t.size > 20 and np.all(np.isfinite(w)) and np.all(np.diff(t) > 0.0)):
        raise RigError(
            f"a coast-down needs growing times and speeds of one length, more than 20 finite samples; these "
            f"have the shapes {t.shape} and {w.shape}"
        )
    if not 0.0 <= down_to < 0.9:
        raise RigError(f"a coast-down is fitted down to a share of its speed from 0 to 0.9, not {down_to:g}")


def _tangent(fit: np.ndarray, torque: float) -> tuple[float, float]:
    """Return the time at which the tangent at time 0 meets zero speed [s], and the inertia [kg m2]."""
    slope, speed = float(fit[-2]), float(fit[-1])
    if slope >= 0.0:
        raise RigError(f"the fitted speed grows at the cut by {slope:.3f} rad/s2; this is no coast-down")
    time = -speed / slope
    return time, torque * time / speed


def _torque(t: np.ndarray, torque: float | Floats, before: np.ndarray) -> float:
    """Return the torque before the cut: the noted number, or the mean of the channel."""
    if np.ndim(torque) == 0:
        return float(torque)
    torque = np.asarray(torque, dtype=float)
    if torque.shape != t.shape:
        raise RigError(f"the torque of a coast-down has the shape {torque.shape}, its times {t.shape}")
    if not before.any():
        raise RigError("the recording starts with the coast-down; the torque before it must be given as a number")
    mean = float(np.mean(torque[before]))
    if not np.isfinite(mean):
        at = t[before][~np.isfinite(torque[before])][0]
        raise RigError(f"the torque before the drive is cut off has values that are no numbers, the first at {at:.2f} s")
    return mean


def _cut(t: np.ndarray, smooth: np.ndarray, period: float) -> float:
    """Return the start of the last long fall of the speed: a line through its first 5 %, followed back to the speed before."""
    top = float(smooth.max())
    far = int(np.flatnonzero(smooth >= 0.9 * top)[-1])
    deep = first_true(smooth <= 0.8 * top, far)
    if top <= 0.0 or deep is None or deep - far < 3:
        raise RigError("the speed never falls by a fifth; there is no coast-down in this recording")
    slope = np.polyfit(t[far : deep + 1], smooth[far : deep + 1], 1)[0]
    # the fall is steepest at its start, so this guess is early
    guess = t[far] + 0.1 * top / slope
    steady = smooth[(t > guess - BEFORE) & (t < guess)]
    if steady.size * period < 0.5 * BEFORE:
        return float(t[0])
    full = float(np.median(steady))
    begun = int(np.flatnonzero(smooth[: far + 1] >= (1.0 - FALL) * full)[-1])
    part = slice(begun, max(begun + 3, first_true(smooth <= (1.0 - 5.0 * FALL) * full, begun) + 1))
    slope, offset = np.polyfit(t[part], smooth[part], 1)
    return float(np.clip((full - offset) / slope, t[0], t[begun]))
