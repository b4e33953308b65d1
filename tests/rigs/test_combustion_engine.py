# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The combustion engine alone on its shaft, compared with closed forms."""

import math

import numpy as np
import pytest

from rig_nodes.base.errors import RigError
from rig_nodes.plant.parts.combustion_engine import STALLED
from rig_nodes.rig.configuration import load_rig
from rig_nodes.runs.rig import Rig

ENGINE = """\
description: an engine alone on its shaft
step: [100 us, "one row of the logger"]
bodies:
  crank:
    inertia: [0.05 kg m2, "assumed"]
parts:
  engine:
    part: combustion_engine
    body: crank
    torque_low: [20 Nm, "assumed"]
    speed_low: [100 rad/s, "assumed"]
    torque_peak: [27 Nm, "assumed"]
    speed_peak: [200 rad/s, "assumed"]
    torque_high: [22 Nm, "assumed"]
    speed_high: [400 rad/s, "assumed"]
    drag: [1.5 Nm, "assumed"]
    drag_by_speed: [0.01 Nm s/rad, "assumed"]
    throttle_time: [200 ms, "assumed"]
    manifold_time: [50 ms, "assumed"]
    ramp: [500 rad/s2, "assumed"]
    governor_band: [60 rad/s, "assumed"]
    governor_time: [300 ms, "assumed"]
    idle_speed: [90 rad/s, "assumed"]
    starter_torque: [6 Nm, "assumed"]
    firing_speed: [20 rad/s, "assumed"]
    stall_speed: [15 rad/s, "assumed"]
    cut_speed: [700 rad/s, "assumed"]
    firings: [2 -, "assumed"]
    irregularity: [0.5 %, "assumed"]
    irregularity_scatter: [0 %, "assumed"]
    irregularity_inertia: [0.05 kg m2, "assumed"]
    irregularity_speed: [200 rad/s, "assumed"]
    irregularity_growth: [0 -, "assumed"]
    seed: [1 -, "assumed"]
transducers:
  n: {type: speed, shows: crank.speed, at: engine, range: [0 rad/s, 1000 rad/s], text: Speed of the engine.}
  throttle: {type: ratio, shows: engine.throttle, at: engine, range: [0 %, 100 %], text: Opening of the throttle.}
  torque: {type: torque, shows: engine.torque, at: engine, range: [-500 Nm, 500 Nm], text: Torque of the engine.}
instruments:
  speed_range: [1000 rad/s, "assumed"]
  speed_gate: [2 ms, "assumed"]
  ratio_range: [100 %, "assumed"]
  torque_range: [500 Nm, "assumed"]
  hum_frequency: [50 Hz, "assumed"]
effects:
  transducers: [off, "true values are compared"]
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("rigs") / "engine"
    folder.mkdir()
    (folder / "rig.yaml").write_text(ENGINE)
    return folder


@pytest.fixture
def rig(folder):
    """Returns a rig of this folder with some of its values changed."""
    return lambda **values: Rig(load_rig(folder, {f"engine.{name}": text for name, text in values.items()}))


def speeds(rig, seconds):
    """The speed at each row of the next seconds."""
    out = []
    for _ in range(round(seconds / 0.01)):
        rig.advance(0.01)
        out.append(rig.rows_at(1e-4, round(rig.time * 1e4) - 99, 100)[:, 0])
    return np.concatenate(out)


def drag(w):
    return 1.5 + 0.01 * w


def test_open_throttle_ends_where_the_curve_meets_nothing(rig):
    one = rig(irregularity="0 %")
    one.set("engine", 1.0, True)
    one.advance(20.0)
    assert one.true("crank.speed") == pytest.approx(200.0 + 200.0 * math.sqrt(27.0 / 5.0), rel=1e-6)
    assert one.true("engine.torque") == pytest.approx(0.0, abs=1e-4)


def test_a_part_of_the_throttle_ends_where_its_torque_is_the_drag(rig):
    one = rig(irregularity="0 %")
    one.set("engine", 0.25, True)
    one.advance(50.0)
    # 0.25 (27 - 5 ((w - 200) / 200)^2 + d) = d beyond the peak
    x = np.roots([0.25 * 5.0 / 200.0**2, 0.75 * 0.01, 0.75 * drag(200.0) - 0.25 * 27.0]).max()
    assert one.true("crank.speed") == pytest.approx(200.0 + x, rel=1e-6)


@pytest.mark.parametrize("firings", [2, 1])
def test_the_speed_is_as_uneven_as_is_stated(rig, firings):
    one = rig(firings=f"{firings} -")
    one.set("motor", 200.0, True)
    one.advance(4.0)
    w = speeds(one, 2.0)
    mean = 0.5 * (w.max() + w.min())
    assert mean == pytest.approx(200.0, rel=2e-3)
    assert (w.max() - mean) / mean == pytest.approx(0.005, rel=0.02)
    crossings = np.count_nonzero((w[:-1] < mean) & (w[1:] >= mean))
    assert crossings == pytest.approx(firings * 200.0 * 2.0 / (2.0 * math.pi), abs=1.5)


def test_cycles_scatter_as_stated_and_follow_the_seed_alone(rig):
    def cycles(**values):
        one = rig(irregularity="3 %", irregularity_scatter="1 %", **values)
        one.set("motor", 200.0, True)
        one.advance(2.0)
        seen = {}
        for _ in range(8000):
            one.advance_samples(1)
            me = one.device("engine")
            seen[int(me["cycle"])] = float(me["uneven"])
        return seen

    first, again, other = cycles(), cycles(), cycles(seed="2 -")
    assert first == again and first != other
    drawn = np.array(list(first.values()))
    assert len(drawn) > 480
    assert drawn.mean() == pytest.approx(0.03, abs=3 * 0.01 / math.sqrt(len(drawn)))
    assert drawn.std() == pytest.approx(0.01, rel=0.1)


def test_the_governor_holds_a_speed_and_the_idle_speed(rig):
    one = rig(irregularity="0 %")
    one.set("motor", 250.0, True)
    one.advance(15.0)
    assert one.true("crank.speed") == pytest.approx(250.0, rel=1e-4)
    # the throttle that carries the drag at this speed
    held = drag(250.0) / (27.0 - 5.0 * 0.25**2 + drag(250.0))
    assert one.true("engine.throttle") == pytest.approx(held, rel=1e-3)
    one.set("motor", 0.0, True)
    one.advance(15.0)
    assert one.true("crank.speed") == pytest.approx(90.0, rel=1e-3)


def test_the_throttle_moves_within_its_time_and_the_charge_behind_it(rig):
    one = rig(irregularity="0 %")
    one.set("motor", 200.0, True)
    one.advance(8.0)
    one.set("motor", 0.0, True)
    one.set("engine", 1.0, True)
    before = one.true("engine.throttle")
    one.advance(0.1)
    assert one.true("engine.throttle") == pytest.approx(before + 0.5, abs=1e-3)
    t, tau = 0.1, 0.05  # a ramp of 5 1/s behind a lag
    assert one.true("engine.charge") == pytest.approx(before + 5.0 * (t - tau * (1.0 - math.exp(-t / tau))), abs=5e-3)


def test_the_starter_turns_it_until_it_fires(rig):
    one = rig(irregularity="0 %")
    one.set("engine", 0.0, True)
    one.advance(0.1)
    # 6 Nm less 1.5 Nm of drag and less the growth of the drag
    assert one.true("crank.speed") == pytest.approx(4.5 / 0.05 * 0.1, rel=0.06)
    one.advance(12.0)
    assert one.true("crank.speed") == pytest.approx(90.0, rel=1e-2)


def test_an_engine_that_is_held_down_stalls_until_it_is_switched_off_and_on(rig):
    one = rig()
    one.set("engine", 0.0, True)
    one.advance(5.0)
    one.v[0] = 10.0  # below the stall speed, to which a closing clutch would pull it
    one.advance(2.0)
    assert one.true("engine.runs") == STALLED
    one.advance(5.0)
    assert one.true("crank.speed") == pytest.approx(0.0, abs=1e-3)
    one.set("engine", 0.0, False)
    one.advance(0.01)
    one.set("engine", 0.0, True)
    one.advance(5.0)
    assert one.true("crank.speed") > 80.0


def test_the_ignition_leaves_out_firings_above_its_speed(rig):
    one = rig(cut_speed="300 rad/s")
    one.set("engine", 1.0, True)
    one.advance(6.0)
    w = speeds(one, 2.0)
    assert 295.0 < w.mean() < 305.0 and w.max() < 308.0


def test_its_work_is_in_what_turns_and_a_stop_takes_its_torque(rig):
    one = rig()
    one.set("engine", 0.6, True)
    one.advance(4.0)
    energy = one.energy()
    assert energy["motor"] == pytest.approx(0.5 * 0.05 * one.true("crank.speed") ** 2, rel=1e-9)
    assert abs(energy["residual"]) < 1e-9 * energy["motor"]
    w = one.true("crank.speed")
    one.e_stop()
    one.advance(0.1)
    assert one.true("crank.speed") == pytest.approx(w - drag(w) / 0.05 * 0.1, rel=2e-3)


@pytest.mark.parametrize(
    "old, new, sentence",
    [
        ("[2 -,", "[0 -,", r"rig.yaml:\d+: engine.firings is 0 -, outside 0.125 to 24"),
        ("throttle_time: [200 ms,", "throttle_time: [200 Nm,", r"rig.yaml:\d+: engine.throttle_time: .200 Nm. is a torque"),
        ("type: ratio, ", "type: travel, ", r"rig.yaml:\d+: transducers.throttle.range: '0 %' is a ratio, expected a length"),
    ],
)
def test_what_cannot_be_is_refused_in_one_sentence(tmp_path, old, new, sentence):
    assert old in ENGINE
    (tmp_path / "rig.yaml").write_text(ENGINE.replace(old, new))
    with pytest.raises(RigError, match=sentence) as refusal:
        load_rig(tmp_path)
    assert "\n" not in str(refusal.value)
