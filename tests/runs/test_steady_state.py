# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Both gears in steady state compared with a calculation by hand, and the signs of the values."""

import dataclasses
import math

import pytest

from rig_nodes.runs.rig import Rig

# computed by hand from the tables of the thesis and, for calibrated values, from rigs/hydmag/rig.yaml
RATIO = {1: 47 / 34, 2: 41 / 40}
DISPLACEMENT = 100e-6 / (2 * math.pi)
RELIEF = 5e6


def open_drag(config, gear: int, n_wej: float, n_wyj: float) -> tuple[float, float]:
    """Returns (torque on w0, torque on wk) of the open clutch by (6.4), with the piston released and speeds in rad/s.

    A film is at least 0.1 mm high (fig. 6.5).
    """
    mean_radius = 2 / 3 * (0.038**3 - 0.025**3) / (0.038**2 - 0.025**2)
    per_gap = 12 * math.pi * mean_radius**2 * (0.038**2 - 0.025**2) * 0.08
    if gear == 1:  # S2 is open, its clearance over 12 gaps
        torque = per_gap / max(config.clutch_s2.clearance / 12, 1e-4) * (n_wej - 41 / 40 * n_wyj)
        return torque, 41 / 40 * torque
    torque = per_gap / max(config.clutch_s1.clearance / 12, 1e-4) * (34 / 47 * n_wej - n_wyj)
    return 34 / 47 * torque, torque


def hand(config, gear: int, rpm: float) -> dict:
    """Returns speeds and torques in steady state.

    The losses are those of Annex D, by the load's torque and by w0's torque, and that of (7.7), by the speed of w0. The loss by the
    load either brakes w0 with the power that it takes, or acts behind the clutches (torque_side).
    """
    into, out = config.loss_in, config.loss_out
    n_wyj = rpm / RATIO[gear]
    factor = 3.84e-7 * n_wyj**2 - 6.36e-4 * n_wyj + 1.32
    pressure = RELIEF * factor
    m_wyj = DISPLACEMENT * pressure + 0.5
    by_load = 41 / 40 * (out.share * m_wyj + out.square * m_wyj**2)
    before = out.torque_side == "driving"
    loss_out = 41 / 40 * out.drag + (0.0 if before else by_load)
    drag_in, drag_out = open_drag(config, gear, rpm * math.pi / 30, n_wyj * math.pi / 30)
    carried = m_wyj + loss_out - drag_out
    clutch = carried * (1.0 if gear == 1 else 40 / 41)
    u = carried / RATIO[gear]
    speed_loss = math.sqrt(into.at_rest**2 + (into.at_470**2 - into.at_rest**2) * rpm / 470.53)
    torque_loss = into.constant + into.share * u + into.square * u**2
    m_wej = u + drag_in + speed_loss + torque_loss + (by_load / RATIO[gear] if before else 0.0)
    return {"n_wyj": n_wyj, "p_po": pressure, "m_wyj": m_wyj, "m_wej": m_wej, "clutch": clutch}


def test_the_loss_by_load_costs_the_motor_the_same_on_either_side(config):
    """The power is equal: without a loss by w0's own torque, M_wej is the same in both cases."""
    found = []
    for side in ("driving", "driven"):
        rig = Rig(
            config.replaced(
                loss_in=dataclasses.replace(config.loss_in, constant=0.0, share=0.0, square=0.0),
                loss_out=dataclasses.replace(config.loss_out, share=0.12, torque_side=side),
            )
        )
        rig.set("oil", 4e6, True)
        rig.advance(0.3)
        rig.order_gear(2)
        rig.advance(1.0)
        rig.set("motor", 1000 * math.pi / 30, True)
        rig.set("load", RELIEF, True)
        rig.advance(6.0)
        found.append((rig.shown_truly("M_wej"), rig.clutch_torque(1)))
    assert found[0][0] == pytest.approx(found[1][0], rel=1e-4)
    assert found[0][1] < found[1][1] - 5.0, "what stands before the clutches they need not carry"


@pytest.mark.parametrize("gear", [1, 2])
@pytest.mark.parametrize("rpm", [1000, 1500, 2000])
def test_steady_state_equals_the_hand_calculation(steady_rig, config, gear, rpm):
    rig, expected = steady_rig(gear, rpm, RELIEF), hand(config, gear, rpm)
    rpm_of = 30 / math.pi
    assert rig.true("w0.speed") * rpm_of == pytest.approx(rpm, abs=0.02)
    assert rig.true("wk.speed") * rpm_of == pytest.approx(expected["n_wyj"], abs=0.02)
    assert rig.load["pressure"] == pytest.approx(expected["p_po"], rel=1e-4)
    assert rig.true("M_wyj") == pytest.approx(expected["m_wyj"], rel=1e-3)
    assert rig.shown_truly("M_wej") == pytest.approx(expected["m_wej"], rel=1e-3)
    assert rig.clutch_torque(gear - 1) == pytest.approx(expected["clutch"], rel=1e-3)
    assert rig.clutch_torque(2 - gear) == pytest.approx(0.0, abs=1e-9)
    assert rig.motor["torque"] == pytest.approx(rig.shown_truly("M_wej"), rel=1e-3)
    assert rig.slip(gear - 1) == pytest.approx(0.0, abs=1e-10)
    assert rig.locked_gear() == gear


def test_the_open_clutch_slips_with_the_sign_of_the_convention(steady_rig):
    rpm = math.pi / 30
    in_gear_i = steady_rig(1, 1000, RELIEF)
    # gear I: wheel z5 runs slower than w0, so S2 slips forward: w0 - 41/40 * 34/47 w0
    assert in_gear_i.slip(1) == pytest.approx(1000 * rpm * (1 - 41 / 40 * 34 / 47), rel=1e-4)
    in_gear_ii = steady_rig(2, 1000, RELIEF)
    # gear II: wheel z3 runs slower than the intermediate shaft, so S1 slips backward
    assert in_gear_ii.slip(0) == pytest.approx(1000 * rpm * (34 / 47 - 40 / 41), rel=1e-4)


def test_transducers_read_the_truth_within_their_largest_errors(steady_rig, config):
    """Tab. 7.1 and (7.1) give the errors; to these are added 3.5 deviations of noise, hum (up to 0.3 and 0.15 more) and pulses."""
    rig, parts = steady_rig(1, 1500, RELIEF), config.instruments
    truth = {
        "M_wej": (rig.shown_truly("M_wej"), 500 * 0.2e-2 + 3.5 * parts.torque_noise + 1.45 * parts.torque_hum),
        "n_wej": (rig.true("w0.speed"), 2 * math.pi / 60 + 3.5 * parts.speed_noise),
        "p1": (rig.line_pressure(0), 40e6 * 0.25e-2 + 3.5 * parts.p1_noise + 1.45 * parts.p1_hum + parts.p1_pickup),
        "I_zr_p1": (rig.valves[0]["current"], 3.5 * parts.current_noise + 0.5 / 4096),
    }
    for name, (value, most) in truth.items():
        reading = rig.measurement(name)
        assert reading != value
        assert reading == pytest.approx(value, abs=most)
