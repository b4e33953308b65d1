"""What lies between a true value and a logger row: analog transducer, encoder, mains, the logger's converter.

Compiled parts are called by plant.kernel for each channel and row; testbench.gauges fills the table that they read.
"""

from __future__ import annotations

from fractions import Fraction
from math import floor, sqrt

import numpy as np
from numba import njit

from .noise import noise_at

# rows of the table, a column for each channel of the logger, SI:
# NOISE standard deviation; LOW, HIGH range; QUANTUM step of the converter; GAIN, OFFSET class error; KEEP share of the
# low pass's last output that is left after a row; HUM amplitude of the mains; PICKUP height of the induced coil pulses;
# STEP of an encoder's reading, 0 for analog channels; TURN counts of an encoder per rad/s and row
NOISE, LOW, HIGH, QUANTUM, GAIN, OFFSET, KEEP, HUM, PICKUP, STEP, TURN = range(11)
ROWS = 11
HARMONICS = {1: 1.0, 3: 0.3, 5: 0.15}  # of the mains and their shares of the first, assumed: a supply with rectifier
SQRT2 = sqrt(2.0)


def mains(step: float, frequency: float, phase: float) -> np.ndarray:
    """Hum of unit fundamental at rows every ``step`` [s], as many as it takes until it repeats; at most one second.

    frequency [Hz]; phase: share of a period that has passed at row 0.
    """
    rows = Fraction(step * frequency).limit_denominator(round(1.0 / step)).denominator
    angle = 2.0 * np.pi * (phase + frequency * step * np.arange(rows))
    return sum(share * np.sin(order * angle) for order, share in HARMONICS.items())


@njit(cache=True)
def analog(true, disturbance, c, table, state):
    """Output of an analog transducer behind its first-order low pass, whose last output stands in ``state``.

    disturbance: what mains and coils induce, beside the class error; the exact solution for an input held over a row.
    """
    value = table[GAIN, c] * true + table[OFFSET, c] + disturbance
    state[c] = value + table[KEEP, c] * (state[c] - value)
    return state[c]


@njit(cache=True)
def encoder(speed, index, c, key, table, state, counts):
    """Speed [rad/s] from the pulses of an incremental encoder, counted over the gate that ends with this row.

    ``state`` has the angle in counts; counts (gate in rows, channels): the counter at the rows of one gate. So the
    reading is a whole number of steps, and what is cut off one reading comes with a later one. The noise is that of the
    pulses' places on the disc: a standing disc has none.
    """
    state[c] += table[TURN, c] * speed
    place = state[c]
    if table[NOISE, c] > 0.0 and speed != 0.0:
        # a reading is the difference of two places
        place += table[NOISE, c] / (SQRT2 * table[STEP, c]) * noise_at(key, index)
    count = floor(place)
    slot = index % counts.shape[0]
    reading = (count - counts[slot, c]) * table[STEP, c]
    counts[slot, c] = count
    return reading


@njit(cache=True)
def logged(value, c, table):
    """The value held inside the channel's range, in steps of the logger's converter."""
    value = min(max(value, table[LOW, c]), table[HIGH, c])
    quantum = table[QUANTUM, c]
    return round(value / quantum) * quantum if quantum > 0.0 else value
