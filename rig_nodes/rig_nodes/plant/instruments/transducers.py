# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""What lies between a true value and a logger row: analog transducer, encoder, mains hum, and the logger's converter.

The engine calls the compiled functions for each channel and row; runs.gauges fills the table that they read.
"""

from __future__ import annotations

from fractions import Fraction
from math import floor, sqrt
from typing import TYPE_CHECKING

import numpy as np

from ...base import INLINED, INNER, njit, one_record
from .noise import noise_at

if TYPE_CHECKING:
    import numpy.typing as npt

    from ...base import Floats, Record

# Rows of the table, which has a column for each channel of the logger, in SI units:
# NOISE: standard deviation; LOW, HIGH: range; QUANTUM: step of the converter; GAIN, OFFSET: class error; KEEP: share of the
# low pass's last output that is left after a row; HUM: amplitude of the mains; PICKUP: height of the induced coil pulses;
# STEP: step of an encoder's reading, 0 for analog channels; TURN: counts of an encoder per rad/s and row; GATE: rows in its gate
NOISE, LOW, HIGH, QUANTUM, GAIN, OFFSET, KEEP, HUM, PICKUP, STEP, TURN, GATE = range(12)
ROWS = 12
HARMONICS = {1: 1.0, 3: 0.3, 5: 0.15}  # harmonics of the mains with their shares of the first, assumed: a supply with a rectifier
SQRT2 = sqrt(2.0)
WIDTH = 8  # numbers in a vector of the processor: the number of lanes of a logger is a multiple of it


def shown_dtype(channels: int, untouched: int, encoders: int) -> np.dtype:
    """Return the type of the record with all channels of a logger side by side, for :func:`show`.

    Its fields are: table, as described above; white: noise of the analog channels; keys: keys of the noise; state: state of the low
    passes; angle: angle of the encoders in counts; counted: their counters one gate ago, then now; fineness: steps of the converter
    per unit; induced: voltage of the coils less its mean; mains: hum; row: true values, then the values shown; encoder: channels
    that are encoders; source: place of each channel's true value in the world; untouched, untouched_source: values of the last
    channels, which no transducer shows, and their places; pickup > 0, noisy > 0: some channel has pickup or noise; present > 0:
    there are transducers.

    Parameters
    ----------
    channels : int
        Number of channels that transducers show.
    untouched : int
        Number of the last channels, which no transducer shows.
    encoders : int
        Number of encoders.

    Returns
    -------
    numpy.dtype
        Type of the record.
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
    """Return the hum of unit fundamental at successive rows until it repeats, or for one second at most.

    Parameters
    ----------
    step : float
        Time from row to row [s].
    frequency : float
        Frequency of the mains [Hz].
    phase : float
        Share of a period that has passed at row 0.

    Returns
    -------
    (rows,) array of float
        Hum at each row.
    """
    rows = Fraction(step * frequency).limit_denominator(round(1.0 / step)).denominator
    angle = 2.0 * np.pi * (phase + frequency * step * np.arange(rows))
    return sum((share * np.sin(order * angle) for order, share in HARMONICS.items()), np.zeros(rows))


@njit(cache=True, error_model="numpy", forceinline=True)
def analog(true: float, disturbance: float, c: int, table: Floats, state: Floats) -> float:
    """Return the output of an analog transducer behind its first-order low pass.

    It is the exact solution for an input that is held over a row.

    Parameters
    ----------
    true : float
        True value.
    disturbance : float
        What mains and coils induce, in addition to the class error.
    c : int
        Column of the channel.
    table : (ROWS, channels) array of float
        The table.
    state : (channels,) array of float
        Last output of the low pass, which is changed.

    Returns
    -------
    float
        Output of the transducer.
    """
    value = table[GAIN, c] * true + table[OFFSET, c] + disturbance
    state[c] = value + table[KEEP, c] * (state[c] - value)
    return state[c]


@njit(cache=True, error_model="numpy", forceinline=True)
def encoder(speed: float, index: int, c: int, key: np.uint64, table: Floats, state: Floats, counts: Floats) -> float:
    """Return the speed from the pulses of an incremental encoder, counted over the gate that ends with this row.

    The reading is a whole number of steps, and the fraction that is cut off one reading is part of a later one. The noise is that
    of the places of the pulses on the disc, so a disc at rest has none.

    Parameters
    ----------
    speed : float
        True speed [rad/s].
    index : int
        Number of the row.
    c : int
        Column of the channel.
    key : uint64
        Key of the noise.
    table : (ROWS, channels) array of float
        The table.
    state : (channels,) array of float
        Angle in counts, which is changed.
    counts : (rows of the longest gate, channels) array of float
        Counter at the last rows, which is changed.

    Returns
    -------
    float
        Reading [rad/s].
    """
    state[c] += table[TURN, c] * speed
    place = state[c]
    if table[NOISE, c] > 0.0 and speed != 0.0:
        # a reading is the difference of two places
        place += table[NOISE, c] / (SQRT2 * table[STEP, c]) * noise_at(key, index)
    count = floor(place)
    slot = index % counts.shape[0]
    reading = (count - counts[(index - int(table[GATE, c])) % counts.shape[0], c]) * table[STEP, c]
    counts[slot, c] = count
    return reading


@njit(cache=True, error_model="numpy", forceinline=True)
def logged(value: float, c: int, table: Floats) -> float:
    """Return the value limited to the range of channel c, in steps of the logger's converter."""
    value = min(max(value, table[LOW, c]), table[HIGH, c])
    quantum = table[QUANTUM, c]
    return round(value / quantum) * quantum if quantum > 0.0 else value


@njit(**INNER)
def take(shown: Record, table: Floats, keys: npt.NDArray[np.uint64], state: Floats) -> None:
    """Copy the arrays of runs.gauges into a record of :func:`shown_dtype`."""
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


@njit(**INNER)
def give(shown: Record, state: Floats) -> None:
    """Copy the states of the transducers back into the array of runs.gauges."""
    for c in range(shown.source.shape[0]):
        state[c] = shown.angle[c] if shown.table[STEP, c] > 0.0 else shown.state[c]


@njit(**INLINED)
def encode(shown: Record, c: int, index: int) -> None:
    """Apply :func:`encoder` to a channel of a record of :func:`shown_dtype`, if the channel has an encoder."""
    table = shown.table
    if table[STEP, c] > 0.0:
        speed = shown.row[c]
        place = shown.angle[c] = shown.angle[c] + table[TURN, c] * speed
        if table[NOISE, c] > 0.0 and speed != 0.0:
            place += table[NOISE, c] / (SQRT2 * table[STEP, c]) * noise_at(shown.keys[c], index)
        count = np.floor(place)  # a float, so that it is not converted to a whole number and back
        shown.row[c] = (count - shown.counted[c]) * table[STEP, c]
        shown.counted[c] = count


@njit(**INLINED)
def behind_low_pass(shown: Record, c: int, mains: float) -> float:
    """Return what the transducer of channel c of a record of :func:`shown_dtype` gives, without its noise; see :func:`analog`."""
    table = shown.table
    disturbance = table[HUM, c] * mains + table[PICKUP, c] * shown.induced[c]
    value = table[GAIN, c] * shown.row[c] + table[OFFSET, c] + disturbance
    return value + table[KEEP, c] * (shown.state[c] - value)


@njit(**INLINED)
def converted(shown: Record, c: int, value: float) -> float:
    """Return a value of channel c of a record of :func:`shown_dtype` as the converter gives it; see :func:`logged`."""
    table = shown.table
    value = min(max(value, table[LOW, c]), table[HIGH, c])
    quantum = table[QUANTUM, c]
    steps = np.rint(value * shown.fineness[c]) * quantum + 0.0  # + 0.0 removes the sign of a negative zero
    return steps if quantum > 0.0 else value


@njit(**INLINED)
def show(shown: Record, index: int) -> None:
    """Replace the true values in a record of :func:`shown_dtype` by what analog transducers and converter show.

    It does the same as :func:`analog`, noise and :func:`logged` one by one, without a branch, for all channels at once. A channel
    takes one turn of one loop, because the compiler writes out a loop of few operations and then computes its channels one by one.
    """
    row, state, mains = shown.row, shown.state, shown.mains
    if shown.noisy > 0.0:
        for c in range(row.shape[0]):
            value = behind_low_pass(shown, c, mains)
            shows = converted(shown, c, value + shown.white[c] * noise_at(shown.keys[c], index))
            state[c] = value
            row[c] = shows
    else:
        for c in range(row.shape[0]):
            value = behind_low_pass(shown, c, mains)
            shows = converted(shown, c, value)
            state[c] = value
            row[c] = shows
