# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Settings from another process in `rig run --speed`: the bag shows when each acts. test_settings tests real time."""

import re
from types import SimpleNamespace

import numpy as np
import pytest
from running_graph import RigRun
from test_settings import PROFILE_1, User

from rig_nodes.bags.reader import Bag

TWO_TICKS = 0.0101
HELD = """
description: gear I is in and the motor turns until somebody ends it
steps:
  - oil: {pressure: 4 MPa}
  - shift: {to: I}
  - motor: {speed: 300 rpm}
  - wait: {for: 1 s}
  - wait: {for: 3600 s}
"""
LOWER = PROFILE_1.copy()
LOWER[2, 1] = 0.6  # A, the current that holds gear I
# event of the setting -> signal that shows it, and the condition that its new values meet
SHOWN = {
    "motor.speed = 40 rad/s": ("motor_speed_setpoint", lambda v: v > 31.5),
    "load_pump.relief_pressure = 2e+06 Pa": ("relief_setting", lambda v: v == 2e6),
    "oil_supply.temperature = 70 degC": ("T_oil", lambda v: v > 65.0),
    "alfa46.output_1.currents = 0.16 0.3 0.6 0.13 0.13 0 A": ("I_set_zr_p1", lambda v: v == 0.6),
}
REFUSED = [
    ("motor", {"speed": 400.0}, "Max: 314.2"),
    ("load_pump", {"relief_pressure": -1.0}, "Min: 0.0"),
    ("oil_supply", {"temperature": 200.0}, "Max: 150.0"),
    ("instruments", {"noise__p1": -1.0}, "Min: 0.0"),
    ("alfa46", {"output_1__currents": [0.2, 0.2, 0.9, 0.1, 0.1, 0.0]}, "output_1.P3 asks for 900 mA"),
]


@pytest.mark.parametrize("speed", [pytest.param("1", marks=pytest.mark.campaign), "max"])  # max is the stricter one
def test_a_setting_of_each_node_acts_within_two_ticks(tmp_path, speed, record_property):
    path = tmp_path / "held.yaml"
    path.write_text(HELD)
    run = RigRun(tmp_path / "run", "--speed", speed, sequence=path)
    number = int(re.search(r"domain (\d+)", run.until("ROS domain"))[1])
    run.until("wait 3600 s")
    user = User(SimpleNamespace(number=number))
    try:
        assert user.ask("motor", speed=40.0).successful
        assert user.ask("load_pump", relief_pressure=2e6).successful
        assert user.ask("oil_supply", temperature=70.0).successful
        assert user.ask("instruments", noise=False).successful
        assert user.set_profile(1, LOWER).success
        events = [event for topic in user.events.values() for event in topic]
        for node, values, reason in REFUSED:
            result = user.ask(node, **values)
            assert not result.successful and reason in result.reason
        user.until(
            lambda: sum(e.name == "setting_changed" for t in user.events.values() for e in t) >= 6, f"the events, after {events}"
        )
    finally:
        user.close()
        run.ctrl_c()
    code, output = run.end()
    assert code == 130, output
    bag = Bag(run.folder)
    taken = {text: t for t, _, name, text, _ in bag.events() if name == "setting_changed"}
    assert taken.keys() == SHOWN.keys() | {"instruments.noise = false", "alfa46.output_1.times = 0.2 0.33 0.65 0.25 0.75 1.25 s"}
    delays = {}
    for text, (signal, is_new) in SHOWN.items():
        t, values = bag.series(signal)
        new = is_new(values)
        assert not new[(t < taken[text]) & (t > taken[text] - 0.5)].any(), text
        delays[text] = t[new & (t >= taken[text])][0] - taken[text]
    # The pressure of a load that is off is 0, so its signal is only noise and the transducer's error, which stays constant.
    t, pressure = bag.series("p_po")
    off, scatters = taken["instruments.noise = false"], pressure != pressure[t < t[-1]][-1]
    assert np.mean(scatters[t < off]) > 0.2
    delays["instruments.noise = false"] = t[scatters & (t < t[-1])][-1] - off
    record_property("delays_s", {text: float(delay) for text, delay in delays.items()})
    assert max(delays.values()) <= TWO_TICKS, delays
