# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The division of a time into calls does not matter: any division and any repetition gives the same bits."""

import numpy as np
import pytest

from rig_nodes.base.errors import RigError
from rig_nodes.rig.configuration import load_rig
from rig_nodes.runs.rig import Rig
from rig_nodes.runs.rig_base import RigStatus


def shift_up(config, chunks, seed=1):
    """Returns a rig through a whole upshift, advanced in the given pieces (controller samples)."""
    rig = Rig(config, seed)
    rig.set("oil", 4e6, True)
    rig.advance(0.3)
    rig.order_gear(1)
    rig.advance(1.0)
    rig.set("motor", 150.0, True)
    rig.set("load", 5e6, True)
    rig.advance(3.0)
    rig.order_gear(2)
    for samples in chunks:
        rig.advance_samples(samples)
    return rig


def test_advance_is_chunk_invariant(config):
    whole = shift_up(config, [1000])
    pieces = [shift_up(config, chunks) for chunks in ([1] * 1000, [7] * 142 + [6], [499, 501])]
    assert {rig.state_hash() for rig in pieces} == {whole.state_hash()}
    for rig in pieces:
        assert np.array_equal(rig.row(), whole.row())


def test_seed_changes_the_noise_and_nothing_changes_without_it(config):
    assert shift_up(config, [500], seed=1).state_hash() == shift_up(config, [500], seed=1).state_hash()
    assert shift_up(config, [500], seed=2).state_hash() != shift_up(config, [500], seed=1).state_hash()


def test_a_step_that_does_not_divide_the_sample_is_refused():
    with pytest.raises(RigError, match="does not divide"):
        Rig(load_rig("hydmag", {"kernel.step": "30 us"}))


def test_halving_the_step_changes_little(config):
    """The step is 100 us because half of it moves speeds during a shift by less than one in a thousand."""
    coarse = shift_up(config, [700])
    fine = shift_up(load_rig("hydmag", {"kernel.step": "50 us"}), [700])
    assert fine.v == pytest.approx(coarse.v, rel=2e-3)


def external(config):
    rig = Rig(config, controller="external")
    rig.set("oil", 4e6, True)
    rig.set("motor", 100.0, True)
    for sample in range(200):
        rig.set_duty(sample, [0.5, 0.0, 0.0], [0.5, 0.0, 0.0], 1, True)
        rig.advance_samples(1)
    return rig


def test_a_silent_controller_ends_in_the_safe_state(config):
    rig = external(config)
    assert rig.status == RigStatus.RUNNING
    assert rig.measurement("I_zr_p1") > 0.4
    rig.advance_samples(99)
    assert rig.status == RigStatus.RUNNING
    rig.advance_samples(5)
    assert rig.status == RigStatus.TRIPPED
    assert "older than 100 ms" in rig.reason
    rig.advance(0.2)
    assert [float(valve["duty"]) for valve in rig.valves] == [0.0, 0.0]
    assert rig.measurement("I_zr_p1") < 0.005
    assert rig.motor["torque"] == 0.0


def test_e_stop_beats_commands_until_reset(config):
    rig = external(config)
    rig.e_stop()
    rig.set("motor", 150.0, True)
    rig.set_duty(rig.sample, [1.0, 1.0, 0.0], [0.8, 0.8, 0.0], 1, True)
    rig.advance(0.05)
    assert rig.status == RigStatus.TRIPPED and rig.reason == "emergency stop" and rig.stopped_by_person
    assert rig.motor["torque"] == 0.0 and [float(valve["duty"]) for valve in rig.valves] == [0.0, 0.0]
    rig.reset()
    assert rig.status == RigStatus.STARTING
    rig.advance(0.05)
    assert rig.motor["torque"] == 0.0, "a setting made while stopped must not start the motor"
    # as by a controller that did not receive the stop; the reset does not restore the current that it held
    for _ in range(200):
        rig.set_duty(rig.sample, [0.5, 0.0, 0.0], [0.5, 0.0, 0.0], 1, False)
        rig.advance_samples(1)
    assert rig.status == RigStatus.STARTING and rig.measurement("I_zr_p1") < 0.005
    rig.set_duty(rig.sample, [0.5, 0.0, 0.0], [0.5, 0.0, 0.0], 0, False)
    assert rig.status == RigStatus.STARTING, "0.55 A in neutral would clamp S1"
    rig.advance_samples(1)
    rig.set_duty(rig.sample, [0.04, 0.04, 0.0], [0.04, 0.04, 0.0], 0, False)
    assert rig.status == RigStatus.READY, "it has been in neutral, with a standby current that opens no valve"
    for _ in range(200):
        rig.advance_samples(1)
        rig.set_duty(rig.sample, [0.5, 0.0, 0.0], [0.5, 0.0, 0.0], 1, False)
    assert rig.measurement("I_zr_p1") > 0.4, "ordered anew"


def test_a_reset_of_a_rig_that_is_not_stopped_changes_nothing(config):
    rig = external(config)
    before = rig.state_hash()
    with pytest.raises(RigError, match="not in its safe state; nothing done"):
        rig.reset()
    assert rig.state_hash() == before and rig.status == RigStatus.RUNNING


def test_the_embedded_controller_begins_in_neutral_after_a_reset(config):
    rig = Rig(config)
    rig.set("oil", 4e6, True)
    rig.order_gear(1)
    rig.advance(1.0)
    assert rig.clutch_mode(0) == 2 and rig.measurement("p1") > 1.5e6
    rig.e_stop()
    rig.advance(1.0)
    rig.reset()
    rig.advance(1.0)
    assert rig.gear == 0 and rig.measurement("I_zr_p1") < 0.005 and rig.clutch_mode(0) == 0
    rig.order_gear(1)
    rig.advance(1.0)
    assert rig.clutch_mode(0) == 2 and rig.measurement("p1") > 1.5e6


@pytest.mark.parametrize(
    "duty, sentence", [([float("nan"), 0, 0], "finite"), ([1.5, 0, 0], "0 to 1"), ([0.5, 0], "3 finite numbers")]
)
def test_wrong_duty_is_refused_and_the_old_one_stays(config, duty, sentence):
    rig = external(config)
    before = [float(valve["pending"]) for valve in rig.valves]
    with pytest.raises(RigError, match=sentence):
        rig.set_duty(rig.sample, duty, [0.0, 0.0, 0.0], 1, True)
    assert [float(valve["pending"]) for valve in rig.valves] == before


def test_a_repeated_command_is_not_a_fresh_one(config):
    rig = external(config)
    with pytest.raises(RigError, match="expected one after"):
        rig.set_duty(199, [0.5, 0.0, 0.0], [0.5, 0.0, 0.0], 1, True)


@pytest.mark.parametrize(
    "call, sentence",
    [
        (lambda rig: rig.set("motor", float("nan"), True), "motor.speed of nan rad/s refused"),
        (lambda rig: rig.set("motor", -5.0, True), "0 to 314.2"),
        (lambda rig: rig.set("load", 1e9, True), "load_pump.relief_pressure of"),
        (lambda rig: rig.set("oil", float("inf"), True), "oil_supply.pressure of inf Pa"),
    ],
)
def test_impossible_settings_are_refused(config, call, sentence):
    with pytest.raises(RigError, match=sentence):
        call(Rig(config))
