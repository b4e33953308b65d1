# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The plug on a CAN bus: one controller is told from two by their answers, and a driver that fails at the end harms no run."""

import can
import pytest

from rig_nodes.controllers import ControllerFailed

from .test_j1939 import Bus

EVERY = 20


@pytest.fixture
def bus(config):
    """A bus on which the rig sends measurements with every 20th sample, and a controller has come."""
    made = Bus(config, f"&every={EVERY}")
    made.answer(0)
    made.plug.wait(5.0)
    made.plug.pace(0.1, real_time=True)
    yield made
    made.plug.close()
    made.bus.shutdown()


def newest(sample):
    """Returns the sample whose measurements were on the bus before this one."""
    return max(0, (sample - 1) // EVERY * EVERY)


def test_one_controller_that_goes_on_between_two_measurements_is_not_taken_for_two(bus):
    for sample in range(20 * EVERY):
        bus.answer(newest(sample), command=1000 * (sample % EVERY))
        assert bus.plug.step(sample, [0.0] * 3, [0.0] * 4) is not None


def test_one_controller_that_a_rig_hears_late_is_not_taken_for_two(bus):
    """The rig was held up, and all answers of that time come at once."""
    for sample in range(5 * EVERY):
        for late in range(EVERY) if sample % EVERY == 10 else (0,):
            bus.answer(newest(sample), command=1000 * late)
        assert bus.plug.step(sample, [0.0] * 3, [0.0] * 4) is not None


def test_two_controllers_are_two_with_every_nth_sample_too(bus):
    with pytest.raises(ControllerFailed, match="another controller is at work on CAN virtual .* two different answers"):
        for sample in range(20 * EVERY):
            for command in (0, 20_000):
                bus.answer(newest(sample), command=command)
            bus.plug.step(sample, [0.0] * 3, [0.0] * 4)


def test_a_driver_that_fails_at_the_end_is_said_and_harms_no_run(bus, monkeypatch):
    def fail():
        raise can.CanOperationError("the adapter has gone")

    with monkeypatch.context() as patch:
        patch.setattr(bus.plug._bus, "shutdown", fail)
        bus.plug.close()
    assert bus.plug.end_fault == "it cannot be ended in order: CanOperationError: the adapter has gone"
    bus.plug._bus.shutdown()
