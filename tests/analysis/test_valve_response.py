# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Valve delay from coil and pressure at 125 kHz, for traces made by hand."""

from __future__ import annotations

import numpy as np
import pytest

from rig_nodes.analysis.valve_response import valve_delay
from rig_nodes.base.errors import RigError

RATE = 125e3
STEADY = {"slope": 1.33, "noise": 0.0, "hum": 0.0, "hum_hz": 50.0, "pickup": 0.0}


def trace(delay=0.3306, pulse=0.8753, pwm=1000.0, duty=0.3, seed=None, length=1.9, **disturbed):
    """Returns times, 24 V PWM, and a pressure [MPa] that rises to 2.3 by a straight fill and a steep end."""
    slope, noise, hum, hum_hz, pickup = ({**STEADY, **disturbed}[name] for name in STEADY)
    t = np.arange(int(length * RATE)) / RATE
    coil = np.where((t >= pulse) & (((t - pulse) * pwm) % 1.0 < duty), 24.0, 0.0)
    start = pulse + delay
    p = np.interp(t, [start, start + 0.23, start + 0.28], [0.0, 0.23 * slope, 2.3])
    p = p + hum * np.sin(2 * np.pi * hum_hz * t + 0.7) + 0.3 * hum * np.sin(20 * np.pi * hum_hz * t)
    p = p + pickup * (coil > 0) + pickup * np.sin(2 * np.pi * pwm * t) * (t >= pulse)
    if seed is not None:
        p = p + np.random.default_rng(seed).normal(0.0, noise, t.size)
    return t, coil, p


def test_both_printed_delays_come_back_from_clean_traces():
    for delay, pulse in ((0.3306, 2.2734 - 1.4), (0.19516, 0.87524)):
        found = valve_delay(*trace(delay, pulse))
        assert found["valve_delay_s"] == pytest.approx(delay, abs=5e-4)
        assert found["t_pulse_s"] == pytest.approx(pulse, abs=1.5 / RATE)
        assert found["t_rise_s"] == pytest.approx(pulse + delay, abs=5e-4)
        assert found["pwm_hz"] == pytest.approx(1000.0, rel=1e-3)
        assert found["end"] == pytest.approx(2.3, abs=1e-3)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("hum_hz", [50.0, 49.93])
def test_hum_pickup_and_noise_move_it_less_than_3_ms(seed, hum_hz):
    """Hum of 0.05 MPa and pickup of the same size hide the first 40 ms of the rise."""
    found = valve_delay(*trace(seed=seed, noise=0.02, hum=0.05, hum_hz=hum_hz, pickup=0.05))
    assert found["valve_delay_s"] == pytest.approx(0.3306, abs=3e-3)
    assert found["hum_hz"] == pytest.approx(hum_hz, abs=0.02)
    assert found["hum"] == pytest.approx(0.05, abs=0.02)


def test_hum_of_2_ms_is_taken_off_too():
    found = valve_delay(*trace(seed=1, noise=0.02, hum=0.05, hum_hz=499.4))
    assert found["valve_delay_s"] == pytest.approx(0.3306, abs=3e-3)
    assert found["noise"] < 0.01


def test_a_sag_before_the_rise_is_none():
    t, coil, p = trace(delay=0.2)
    p = p + 0.06 * np.exp(-(((t - 0.8753 - 0.08) / 0.01) ** 2))
    assert valve_delay(t, coil, p)["valve_delay_s"] == pytest.approx(0.2, abs=1e-3)


def test_a_spike_on_the_coil_is_no_pulse_and_a_constant_voltage_has_no_frequency():
    t, coil, p = trace(duty=1.0)
    coil[40000] = 24.0
    found = valve_delay(t, coil, p)
    assert found["t_pulse_s"] == pytest.approx(0.8753, abs=1.5 / RATE)
    assert found["pwm_hz"] is None
    assert found["valve_delay_s"] == pytest.approx(0.3306, abs=1e-3)


@pytest.mark.parametrize(
    "change, sentence",
    [({"pulse": 0.05}, "before it are needed"), ({"pulse": 5.0}, "no first pulse"), ({"delay": 3.0}, "does not rise")],
)
def test_what_cannot_be_answered_is_refused(change, sentence):
    with pytest.raises(RigError, match=sentence):
        valve_delay(*trace(seed=1, noise=0.01, **change))


def test_bad_arrays_are_refused():
    t, coil, p = trace()
    with pytest.raises(RigError, match="one length"):
        valve_delay(t, coil[1:], p)
    with pytest.raises(RigError, match="pressure .* no numbers"):
        valve_delay(t, coil, np.where(t > 1.0, np.nan, p))
    with pytest.raises(RigError, match="equal steps"):
        valve_delay(np.delete(t, 500), np.delete(coil, 500), np.delete(p, 500))
