# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The controller box: its currents compared with a trace by hand from the thesis's rules, its orders and its current loop."""

import numpy as np
import pytest

from rig_nodes.base.errors import RigError
from rig_nodes.controllers.alfa46.box import Alfa46
from rig_nodes.rig.alfa46 import Alfa46Config
from rig_nodes.rig.configuration import load_rig


def box_with(rig="hydmag", **settings):
    config = load_rig(rig, {f"alfa46.{key}": value for key, value in settings.items()})
    return Alfa46(config.alfa46, config.transmission)


def setpoints(box, first, samples):
    """Returns the setpoints [mA] over samples, with coils that follow at once."""
    out, current = [], np.zeros(3)
    for sample in range(first, first + samples):
        _, setpoint = box.step(sample, current)
        current = setpoint.copy()
        out.append(current * 1e3)
    return np.array(out)


# tab. 7.5, straight lines between the points, ms -> mA
ON_1 = ([0, 200, 330, 650, 5000], [0, 160, 300, 740, 740])
ON_2 = ([0, 125, 330, 580, 5000], [0, 215, 215, 740, 740])
OFF = ([0, 250, 750, 1250, 5000], [740, 130, 130, 0, 0])


@pytest.mark.parametrize("t12, engaging_from, releasing_from", [("-220 ms", 0, 220), ("0 ms", 0, 0), ("200 ms", 200, 0)])
def test_upshift_follows_the_rules_of_the_thesis(t12, engaging_from, releasing_from):
    box = box_with(t12=t12)
    box.order(1)
    setpoints(box, 0, 1000)
    box.order(2)
    seen = setpoints(box, 1000, 2000)
    ms = np.arange(2000.0)
    rising = np.where(ms >= engaging_from, np.interp(ms - engaging_from, *ON_2), 0.0)
    falling = np.where(ms >= releasing_from, np.interp(ms - releasing_from, *OFF), 740.0)
    assert seen[:, 1] == pytest.approx(rising, abs=1e-9)
    assert seen[:, 0] == pytest.approx(falling, abs=1e-9)
    assert not seen[:, 2].any()


def test_downshift_uses_its_own_delay_and_profiles():
    box = box_with(t21="100 ms")
    box.order(2)
    setpoints(box, 0, 1000)
    box.order(1)
    seen = setpoints(box, 1000, 2000)
    ms = np.arange(2000.0)
    assert seen[:, 0] == pytest.approx(np.where(ms >= 100, np.interp(ms - 100, *ON_1), 0.0), abs=1e-9)
    assert seen[:, 1] == pytest.approx(np.interp(ms, *OFF), abs=1e-9)


@pytest.mark.parametrize("old, new, delay, wait", [(2, 3, "t23", 60), (3, 2, "t32", -40), (1, 3, "t23", None), (3, 1, "t32", None)])
def test_the_third_gear_drives_the_third_output_with_delays_of_its_own(old, new, delay, wait):
    """A change that skips a gear has no delay."""
    box = box_with("three_speed", **{delay: "60 ms" if wait is None else f"{wait} ms"})
    wait = wait or 0
    box.order(old)
    setpoints(box, 0, 1000)
    box.order(new)
    seen = setpoints(box, 1000, 1000)
    engages, lets_go = np.flatnonzero(seen[:, new - 1])[0], np.flatnonzero(seen[:, old - 1] < 740.0 - 1e-9)[0]
    assert (engages - 1, lets_go - 1) == (max(0, wait), max(0, -wait))
    assert not seen[:, ({1, 2, 3} - {old, new}).pop() - 1].any()


def test_files_may_leave_out_the_delays_of_a_third_gear():
    values = load_rig("hydmag").alfa46.values
    assert (values.t12, values.t23, values.t32) == (-0.22, 0.0, 0.0)


def test_falling_starts_from_the_current_of_that_moment():
    """Neutral is ordered in gear with P3 lowered, and P4 is reached from the lowered current."""
    config = load_rig("hydmag")
    profiles = config.alfa46.profiles.copy()
    profiles[0, 2, 1] = 0.5
    box = Alfa46(Alfa46Config(config.alfa46.values, profiles), config.transmission)
    box.order(1)
    setpoints(box, 0, 700)
    box.order(0)
    seen = setpoints(box, 700, 300)
    assert seen[:251, 0] == pytest.approx(np.linspace(500, 130, 251), abs=1e-9)


@pytest.mark.parametrize("gear, sentence", [(2, "still running"), (5, "there is no gear 5")])
def test_orders_are_refused_with_their_reason(gear, sentence):
    box = box_with()
    box.order(1)
    setpoints(box, 0, 100)
    with pytest.raises(RigError, match=sentence):
        box.order(gear)


def test_the_gear_already_in_is_refused_and_the_next_order_is_taken():
    box = box_with()
    box.order(1)
    setpoints(box, 0, 700)
    with pytest.raises(RigError, match="gear I is already ordered"):
        box.order(1)
    box.order(2)
    setpoints(box, 700, 1)
    assert box.gear == 2 and box.shifting


def coil_run(box, samples, disturbance=0.0):
    """Returns the current [A] of output 1 with the coil of ZR-P1 (22 ohm, 350 mH) and one sample of delay."""
    current, duty, seen = 0.0, 0.0, []
    for sample in range(samples):
        new, setpoint = box.step(sample, [current, 0.0, 0.0])
        current += 1e-3 / 0.35 * (24 * duty - (22 + disturbance) * current)
        duty = float(new[0])
        seen.append((setpoint[0], current, duty))
    return np.array(seen)


def test_current_loop_reaches_its_setpoint_whatever_the_coil():
    for disturbance in (0.0, 5.0):
        box = box_with()
        box.order(1)
        seen = coil_run(box, 3000, disturbance)
        assert seen[-1, 1] == pytest.approx(0.740, abs=1e-4)
        assert seen[-200:, 1].std() < 1e-4, "the loop does not hunt"
        assert seen[:, 2].min() >= 0.0 and seen[:, 2].max() <= 1.0


def test_ramp_lag_is_that_of_the_integral_part():
    """On a ramp of s A/s a PI loop on an R-L coil lags by s R / I: 1.375 A/s 22 ohm / 2000 V/(A s) = 15 mA."""
    box = box_with()
    box.order(1)
    seen = coil_run(box, 640)
    assert seen[630, 0] - seen[630, 1] == pytest.approx(1.375 * 22 / 2000, rel=0.1)
