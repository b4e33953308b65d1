# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""What lies between a true value and a logger row: analog transducer, encoder, mains, the logger's converter.

Compiled parts are called by the engine for each channel and row; testbench.gauges fills the table that they read.
"""

from __future__ import annotations

from fractions import Fraction
from math import floor, sqrt
from typing import TYPE_CHECKING

import numpy as np
from numba import njit

from ..compiled import one_record
from .noise import noise_at

if TYPE_CHECKING:
    import numpy.typing as npt

    from ..arrays import Floats, Record

# rows of the table, a column for each channel of the logger, SI:
# NOISE standard deviation; LOW, HIGH range; QUANTUM step of the converter; GAIN, OFFSET class error; KEEP share of the
# low pass's last output that is left after a row; HUM amplitude of the mains; PICKUP height of the induced coil pulses;
# STEP of an encoder's reading, 0 for analog channels; TURN counts of an encoder per rad/s and row
NOISE, LOW, HIGH, QUANTUM, GAIN, OFFSET, KEEP, HUM, PICKUP, STEP, TURN = range(11)
ROWS = 11
HARMONICS = {1: 1.0, 3: 0.3, 5: 0.15}  # of the mains and their shares of the first, assumed: a supply with rectifier
SQRT2 = sqrt(2.0)
WIDTH = 8  # of a vector of the processor: the lanes of a logger are a multiple of it


def shown_dtype(channels: int, untouched: int, encoders: int) -> np.dtype:
    """All channels of a logger side by side, for :func:`show`.

    table: as above; white: noise of the analog channels; keys: of the noise; state: of the low passes; angle: of the
    encoders, in counts; counted: their counters a gate ago, then now; fineness: steps of the converter per unit; induced:
    voltage of the coils less its mean; mains: hum; row: true values, then what is shown; encoder: channels that are
    encoders; source: place of each channel's true value in the world; untouched: values of the last channels, which no
    transducer shows, and where they are; pickup, noisy > 0: somebody has some; present > 0: there are transducers.
    """
    lanes = -(-max(channels, 1) // WIDTH) * WIDTH
    return one_record(
        np.dtype(
            [
                ("table", "f8", (ROWS, lanes)),
                ("white", "f8", (lanes,)),
                ("keys", "u8", (lanes,)),
                ("state", "f8", (lanes,)),
                ("angle", "f8", (lanes,)),
                ("counted", "f8", (lanes,)),
                ("fineness", "f8", (lanes,)),
                ("induced", "f8", (lanes,)),
                ("row", "f8", (lanes,)),
                ("mains", "f8"),
                ("pickup", "f8"),
                ("noisy", "f8"),
                ("present", "f8"),
                ("encoder", "u8", (encoders,)),
                ("source", "u8", (channels,)),
                ("untouched", "f8", (untouched,)),
                ("untouched_source", "u8", (untouched,)),
            ]
        )
    )


def mains(step: float, frequency: float, phase: float) -> np.ndarray:
    """Hum of unit fundamental at rows every ``step`` [s], as many as it takes until it repeats; at most one second.

    frequency [Hz]; phase: share of a period that has passed at row 0.
    """
    rows = Fraction(step * frequency).limit_denominator(round(1.0 / step)).denominator
    angle = 2.0 * np.pi * (phase + frequency * step * np.arange(rows))
    return sum(share * np.sin(order * angle) for order, share in HARMONICS.items())


@njit(cache=True, error_model="numpy", forceinline=True)
def analog(true: float, disturbance: float, c: int, table: Floats, state: Floats) -> float:
    """Output of an analog transducer behind its first-order low pass, whose last output stands in ``state``.

    disturbance: what mains and coils induce, beside the class error; the exact solution for an input held over a row.
    """
    value = table[GAIN, c] * true + table[OFFSET, c] + disturbance
    state[c] = value + table[KEEP, c] * (state[c] - value)
    return state[c]


@njit(cache=True, error_model="numpy", forceinline=True)
def encoder(speed: float, index: int, c: int, key: np.uint64, table: Floats, state: Floats, counts: Floats) -> float:
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


@njit(cache=True, error_model="numpy", forceinline=True)
def logged(value: float, c: int, table: Floats) -> float:
    """The value held inside the channel's range, in steps of the logger's converter."""
    value = min(max(value, table[LOW, c]), table[HIGH, c])
    quantum = table[QUANTUM, c]
    return round(value / quantum) * quantum if quantum > 0.0 else value


@njit(cache=True, error_model="numpy")
def take(shown: Record, table: Floats, keys: npt.NDArray[np.uint64], state: Floats) -> None:
    """Copy the arrays of testbench.gauges, into a record of :func:`shown_dtype`."""
    shown.pickup = shown.noisy = 0.0
    for c in range(shown.source.shape[0]):
        for i in range(ROWS):
            shown.table[i, c] = table[i, c]
        shown.keys[c] = keys[c]
        shown.state[c] = shown.angle[c] = state[c]
        shown.fineness[c] = 1.0 / table[QUANTUM, c] if table[QUANTUM, c] > 0.0 else 0.0
        shown.white[c] = table[NOISE, c] if table[STEP, c] == 0.0 else 0.0
        if table[PICKUP, c] > 0.0:
            shown.pickup = 1.0
        if shown.white[c] > 0.0:
            shown.noisy = 1.0


@njit(cache=True, error_model="numpy")
def give(shown: Record, state: Floats) -> None:
    """Copy what transducers remember back into the array of testbench.gauges."""
    for c in range(shown.source.shape[0]):
        state[c] = shown.angle[c] if shown.table[STEP, c] > 0.0 else shown.state[c]


@njit(cache=True, error_model="numpy", forceinline=True)
def encode(shown: Record, c: int, index: int) -> None:
    """:func:`encoder` on a channel of a record of :func:`shown_dtype`, if it has one."""
    table = shown.table
    if table[STEP, c] > 0.0:
        speed = shown.row[c]
        place = shown.angle[c] = shown.angle[c] + table[TURN, c] * speed
        if table[NOISE, c] > 0.0 and speed != 0.0:
            place += table[NOISE, c] / (SQRT2 * table[STEP, c]) * noise_at(shown.keys[c], index)
        count = np.floor(place)  # a float, which takes no way through whole numbers
        shown.row[c] = (count - shown.counted[c]) * table[STEP, c]
        shown.counted[c] = count


@njit(cache=True, error_model="numpy", forceinline=True)
def show(shown: Record, index: int) -> None:
    """True values in a record of :func:`shown_dtype` as analog transducers and the converter show them, all channels at once.

    The same as :func:`analog`, noise and :func:`logged` one by one, without a branch.
    """
    table, row, state = shown.table, shown.row, shown.state
    for c in range(row.shape[0]):
        disturbance = table[HUM, c] * shown.mains + table[PICKUP, c] * shown.induced[c]
        value = table[GAIN, c] * row[c] + table[OFFSET, c] + disturbance
        value = value + table[KEEP, c] * (state[c] - value)
        state[c] = value
        row[c] = value
    if shown.noisy > 0.0:
        for c in range(row.shape[0]):
            row[c] += shown.white[c] * noise_at(shown.keys[c], index)
    for c in range(row.shape[0]):
        value = min(max(row[c], table[LOW, c]), table[HIGH, c])
        quantum = table[QUANTUM, c]
        steps = np.rint(value * shown.fineness[c]) * quantum + 0.0  # no zero with a sign
        row[c] = steps if quantum > 0.0 else value
