# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Response time of a valve: from the first PWM pulse on its coil to the first rise of the clutch pressure (thesis 7.2).

It serves the valve-response tests, 125 kHz for 5 s (7.1.3.1), and depends neither on bags nor on ROS.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..base import RigError
from .edges import first_true, odd_width, ramp_start, running_mean
from .hum import QUIET, without_hum

if TYPE_CHECKING:
    from ..base import Floats

PULSE = 8e-6  # s, shortest pulse: one sample at 125 kHz, because the first pulses are short
COARSE_MEAN = 1e-3  # s, filter when no PWM frequency is found
LONGEST_PERIOD = 20e-3  # s; slower pulses do not count as PWM
CLEAR_RISE = 0.05  # share of the whole rise at which the pressure has certainly risen
LEVEL = 0.01  # share of the whole rise, at least 5 standard deviations, at which the pressure has left its rest
SPAN, REACH = 0.05, 20e-3  # the ramp that is followed back to the rest: share of the whole rise, s


def valve_delay(t: np.ndarray, coil: np.ndarray, pressure: np.ndarray) -> dict[str, float | None]:
    """Return the delay of a valve by (7.5), (7.6).

    The thesis reads both moments by eye on the unfiltered trace. Here:

    * first pulse: the coil signal is above half of its height for at least 8 us and again within 20 ms; the moment is the sample
      before;
    * hum: 50 Hz and its harmonics are fitted to the pressure before the first pulse and subtracted everywhere;
    * pickup: a centred mean over whole periods of the coil signal's PWM removes it completely and moves no edge;
    * first rise: the last crossing of a level just above the rest (1 % of the whole rise or 5 standard deviations)
      before the pressure has clearly risen (5 %), followed back along its slope to the rest. An earlier sag or spike
      is not a rise. The rest is that of the 60 ms before the rise, after the pulse, because pickup may shift it.

    Parameters
    ----------
    t : (n,) array of float
        Equally spaced times [s].
    coil : (n,) array of float
        Voltage or duty of the coil.
    pressure : (n,) array of float
        Pressure of the clutch, in any unit.

    Returns
    -------
    dict
        valve_delay_s, t_pulse_s, t_rise_s, pwm_hz (None for a constant coil voltage), hum_hz and hum (amplitude
        of the fitted hum), noise (standard deviation that remains before the pulse), rest and end (levels of the pressure).

    Raises
    ------
    RigError
        When the signals do not fit, there is no pulse or no rise, or less than 0.1 s before the pulse.
    """
    t, coil, pressure = (np.asarray(x, dtype=float) for x in (t, coil, pressure))
    period = _period(t, coil, pressure)
    pulse, pwm = _first_pulse(coil, period)
    if pulse * period < QUIET:
        raise RigError(
            f"the first pulse comes {pulse * period:.3f} s after the start of the recording; {QUIET:g} s "
            "before it are needed to know rest and hum of the pressure"
        )
    clean, hum_hz, hum = without_hum(t, pressure, pulse)
    width = odd_width(COARSE_MEAN if pwm is None else max(1.0, round(COARSE_MEAN * pwm)) / pwm, period)
    smooth = running_mean(clean, width)
    noise = float(np.std(smooth[width : pulse - width]))
    at, rest, end = _rise(clean, smooth, pulse, noise, period)
    return {
        "valve_delay_s": (at - pulse) * period,
        "t_pulse_s": float(t[pulse]),
        "t_rise_s": float(t[0] + at * period),
        "pwm_hz": pwm,
        "hum_hz": hum_hz,
        "hum": hum,
        "noise": noise,
        "rest": rest,
        "end": end,
    }


def _period(t: Floats, coil: Floats, pressure: Floats) -> float:
    if not (t.ndim == 1 and t.shape == coil.shape == pressure.shape and t.size > 100):
        raise RigError(
            "a valve response needs time, coil and pressure of one length, more than 100 samples; these "
            f"have the shapes {t.shape}, {coil.shape}, {pressure.shape}"
        )
    for name, values in (("time", t), ("coil signal", coil), ("pressure", pressure)):
        if not np.all(np.isfinite(values)):
            at = f", the first at {t[~np.isfinite(values)][0]:.2f} s" if name != "time" else ""
            raise RigError(f"the {name} of the valve response has values that are no numbers{at}")
    period = (t[-1] - t[0]) / (t.size - 1)
    if period <= 0.0 or np.max(np.abs(np.diff(t) - period)) > 0.5 * period:
        raise RigError("the times of a valve response must grow in equal steps")
    return float(period)


def _first_pulse(coil: np.ndarray, period: float) -> tuple[int, float | None]:
    """Return the sample of the first pulse and the frequency of the pulses [Hz]."""
    low, high = np.percentile(coil, [0.1, 99.9])
    early = np.median(coil[: max(3, coil.size // 100)])
    on = coil > 0.5 * (low + high)
    if high - low <= 0.0 or early > 0.5 * (low + high):
        raise RigError("the coil signal has no first pulse: it is constant or switched on from the start")
    length = max(1, int(round(PULSE / period)))
    run = np.convolve(on, np.ones(length), "valid") > length - 0.5
    # a pulse without a following pulse is a spike
    starts, reach = np.flatnonzero(run), int(LONGEST_PERIOD / period)
    followed = np.searchsorted(starts, starts + reach, "right") - np.arange(starts.size) > length
    if not followed.any():
        raise RigError("the coil signal has no pulse that lasts 8 us and is followed by another")
    first = int(starts[np.argmax(followed)])
    edges = np.flatnonzero(run[1:] & ~run[:-1]) + 1
    gaps = np.diff(edges[edges >= first]) * period
    gaps = gaps[gaps < LONGEST_PERIOD]
    # the sample before it is the last one without a pulse
    return max(0, first - 1), float(1.0 / np.median(gaps)) if gaps.size >= 3 else None


def _rise(clean: Floats, smooth: Floats, pulse: int, noise: float, period: float) -> tuple[float, float, float]:
    """Return the fractional sample of the first rise, and the pressure at rest and at the end of the rise."""
    rest = float(np.median(smooth[:pulse]))
    # the level that the pressure keeps, without spikes
    end = float(np.percentile(smooth[pulse:], 90.0))
    size = end - rest
    if size < 20.0 * noise:
        raise RigError(f"the pressure does not rise after the first pulse: {size:.3g} over a noise of {noise:.3g}")
    clear = first_true(smooth > rest + CLEAR_RISE * size, pulse)
    for _ in range(2):
        level = min(max(5.0 * noise, LEVEL * size), CLEAR_RISE * size)
        below = np.flatnonzero(smooth[pulse:clear] - rest < level)
        at = pulse + (int(below[-1]) + 1 if below.size else 0)
        # repeated with the rest just before the rise, because pickup grows with the duty
        quiet = smooth[max(pulse, at - int(4.0 * REACH / period)) : at - int(REACH / period)]
        if quiet.size < int(REACH / period):
            break
        rest = float(np.median(quiet))
    reach = int(round(REACH / period))
    return ramp_start(clean - rest, smooth - rest, at, SPAN * size, reach), rest, end
