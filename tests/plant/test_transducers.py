# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Each part between a true value and a logger row, compared with values computed by hand."""

import math

import numpy as np
import pytest

from rig_nodes.plant.instruments import transducers as parts
from rig_nodes.plant.instruments.noise import channel_key, noise_at, uniform

KEY = channel_key(1, 0)
RPM = math.pi / 30


def table(**rows) -> np.ndarray:
    """Returns one channel without errors or range, except for the named rows."""
    out = np.zeros((parts.ROWS, 1))
    out[parts.GAIN], out[parts.LOW], out[parts.HIGH] = 1.0, -np.inf, np.inf
    for name, value in rows.items():
        out[getattr(parts, name)] = value
    return out


def readings(speeds, gate=20, state=0.0, noise=0.0, step=RPM) -> np.ndarray:
    """Returns what an encoder reads [rpm] of true speeds [rpm], one for each row."""
    t = table(STEP=step, TURN=1.0 / (step * gate), NOISE=noise)
    place, counts = np.array([state]), np.zeros((gate, 1))
    return np.array([parts.encoder(n * RPM, k + 1, 0, KEY, t, place, counts) for k, n in enumerate(speeds)]) / RPM


def test_noise_is_counter_based_with_unit_variance():
    values = np.array([noise_at(channel_key(7, 3), k) for k in range(20_000)])
    assert values.mean() == pytest.approx(0.0, abs=0.03) and values.std() == pytest.approx(1.0, abs=0.02)
    assert np.abs(values).max() < 3.5
    assert noise_at(channel_key(7, 3), 1234) == values[1234] != noise_at(channel_key(7, 4), 1234)
    assert abs(np.corrcoef(values[:-1], values[1:])[0, 1]) < 0.03


def test_uniform_numbers_fill_their_range_evenly():
    values = np.array([uniform(5, 2, k) for k in range(20_000)])
    assert 0.0 <= values.min() < 1e-3 and 1.0 - 1e-3 < values.max() < 1.0
    assert np.histogram(values, 10, (0.0, 1.0))[0] == pytest.approx(2000, abs=200)  # five deviations of about 42


def test_an_encoder_reads_whole_steps_and_loses_no_pulse():
    """1500.3 rpm in steps of 1 rpm give 1500 in seven of ten gates, 1501 in three, and nothing else."""
    shown = readings(np.full(4020, 1500.3))[20:]
    assert set(np.round(shown, 6)) == {1500.0, 1501.0}
    assert shown.mean() == pytest.approx(1500.3, abs=0.02)
    whole = readings(np.full(4020, 1500.0), state=0.5)[20:]
    assert np.ptp(whole) < 1e-9, "a whole number of counts in each gate"


def test_an_encoder_is_never_wrong_by_more_than_a_step_and_late_by_half_its_gate():
    """From rest at 750 rpm/s the mean of the gate of 20 rows is 9.5 rows or 0.71 rpm behind the speed of the last one."""
    true = 750.0 * 1e-4 * np.arange(1, 10_001)
    shown = readings(true, state=0.3)
    mean = np.convolve(true, np.full(20, 0.05))[: len(true)]
    assert np.abs(shown - mean).max() < 1.0 + 1e-6
    assert (true - shown)[1000:].mean() == pytest.approx(750.0 * 19 / 2 * 1e-4, abs=0.02)


def test_a_standing_encoder_gives_no_pulses_and_one_that_turns_back_counts_down():
    assert readings(np.zeros(100), state=0.999, noise=1.0).tolist() == [0.0] * 100
    assert readings(np.full(100, -300.0), state=0.5)[50] == pytest.approx(-300.0)


def test_uneven_pulses_scatter_the_reading_by_the_noise_that_is_set():
    """The standard deviation of the step of 1 rpm is added, but the noise of 5 rpm is far above it."""
    shown = readings(np.full(20_000, 1500.0), noise=5.0 * RPM)[20:]
    assert shown.std() == pytest.approx(math.hypot(5.0, math.sqrt(1 / 6)), rel=0.03)
    assert shown.mean() == pytest.approx(1500.0, abs=0.1)


def test_the_low_pass_follows_a_step_with_its_time_constant():
    """1 kHz: 1/(2 pi 1000) = 0.159 ms, so one row of 0.1 ms leaves exp(-0.628) = 0.5335 of a step."""
    t, state = table(KEEP=math.exp(-2 * math.pi * 1e3 * 1e-4)), np.zeros(1)
    seen = [parts.analog(1.0, 0.0, 0, t, state) for _ in range(3)]
    assert seen == pytest.approx([1 - 0.5335, 1 - 0.5335**2, 1 - 0.5335**3], abs=2e-4)
    assert parts.analog(7.0, 0.0, 0, table(), state) == 7.0, "without it the value itself, bit for bit"


def test_class_error_and_disturbance_are_added_before_the_low_pass():
    t, state = table(GAIN=1.002, OFFSET=-0.5, KEEP=0.5), np.array([0.0])
    assert parts.analog(100.0, 0.3, 0, t, state) == pytest.approx(0.5 * (100.2 - 0.5 + 0.3))


def test_the_converter_stays_in_its_range_and_rounds_to_its_step():
    t = table(LOW=-500.0, HIGH=500.0, QUANTUM=1000.0 / 4096)
    assert parts.logged(612.0, 0, t) == 500.0 and parts.logged(-1e9, 0, t) == -500.0
    assert parts.logged(100.0, 0, t) == pytest.approx(410 * 1000.0 / 4096)  # 409.6 steps
    assert parts.logged(1e9 / 3, 0, table()) == 1e9 / 3


@pytest.mark.parametrize("frequency, step, rows", [(50.0, 1e-4, 200), (500.0, 1e-4, 20), (60.0, 1e-4, 500), (50.0, 4e-6, 5000)])
def test_hum_repeats_after_its_table(frequency, step, rows):
    hum = parts.mains(step, frequency, 0.25)
    assert len(hum) == rows
    # a quarter of a period in: sines of 90, 270 and 450 degrees
    assert hum[0] == pytest.approx(1.0 - 0.3 + 0.15)
    t = 0.25 / frequency + step * np.arange(rows)
    spectrum = [2 * np.mean(hum * np.sin(2 * np.pi * k * frequency * t)) for k in (1, 2, 3, 5)]
    assert spectrum == pytest.approx([1.0, 0.0, 0.3, 0.15], abs=1e-9)
