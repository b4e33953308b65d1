# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A free-wheel in a rig's folder: it holds in one direction and overruns in the other, without an actuator."""

import pytest

from rig_nodes.bags.reader import Bag
from rig_nodes.base.errors import RigError
from rig_nodes.cli.main import main
from rig_nodes.rig.configuration import load_rig
from rig_nodes.runs.rig import Rig

# in addition to its brake, the ring of the three-speed gearbox has a free-wheel that prevents backward rotation
FREEWHEEL = """\
description: three speeds with a free-wheel at the ring
base: three_speed
gears:
  1: [brake_1, ring_stop]
parts:
  ring_stop:
    part: freewheel
    called: F1
    joins: [ground, ring]
"""


def written(folder, text: str = FREEWHEEL):
    folder.mkdir(exist_ok=True)
    (folder / "rig.yaml").write_text(text)
    return folder


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return written(tmp_path_factory.mktemp("rigs") / "one_way")


def driven(config, gear: int | None, speed: float = 100.0):
    """Returns the rig at a steady speed against the load, in a gear or with all clutches open."""
    rig = Rig(config)
    rig.set("oil", 4e6, True)
    rig.advance(0.3)
    if gear is not None:
        rig.order_gear(gear)
        rig.advance(1.5)
    rig.set("motor", speed, True)
    rig.set("load", 3e6, True)
    rig.advance(6.0)
    return rig


@pytest.fixture(scope="module")
def config(folder):
    return load_rig(folder, {"effects.transducers": "off"})


def test_it_holds_the_first_gear_with_every_clutch_open(config):
    rig = driven(config, None)
    w_in, w_out = rig.true("input.speed"), rig.true("output.speed")
    assert w_in == pytest.approx(100.0, rel=1e-4) and w_out == pytest.approx(w_in / 2.8, rel=1e-9)
    assert rig.holds("ring_stop") and rig.slip("ring_stop") == pytest.approx(0.0, abs=1e-9)
    assert [rig.clutch_mode(name) for name in rig.clutch_names] == [0, 0, 0]
    # by hand: the carrier's torque is the sum of load, bearings and the drag of C2 and C3; the ring carries 72/112 of it
    drags = {name: float(rig.device(name)["drag"]) for name in ("clutch_2", "clutch_3")}
    carrier = rig.load_torque() + 3.0 - drags["clutch_2"] * (0.625 * w_in - w_out) - drags["clutch_3"] * (w_in - w_out)
    assert rig.friction_torque("ring_stop") == pytest.approx(72 / 112 * carrier, rel=1e-3)


def test_it_overruns_without_torque_in_the_gear_above(config):
    rig = driven(config, 2)
    w_in = rig.true("input.speed")
    ring = (112 * w_in / 1.6 - 40 * w_in) / 72
    assert rig.true("output.speed") == pytest.approx(w_in / 1.6, rel=1e-9)
    assert not rig.holds("ring_stop") and rig.friction_torque("ring_stop") == 0.0
    assert rig.slip("ring_stop") == pytest.approx(-ring, rel=1e-9)


def test_it_lets_the_output_run_ahead_and_catches_the_drive_again(config):
    rig = driven(config, None)
    rig.set("motor", 0.0, True)  # the drive slows down faster than the load
    rig.set("load", 0.0, False)
    rig.advance(0.5)
    assert not rig.holds("ring_stop") and rig.slip("ring_stop") < -1.0
    rig.set("load", 6e6, True)
    rig.set("motor", 100.0, True)
    rig.advance(3.0)
    assert rig.holds("ring_stop") and rig.true("output.speed") == pytest.approx(100.0 / 2.8, rel=1e-3)
    energy = rig.energy()
    assert energy["motor"] > 1e3 and abs(energy["residual"]) < 1e-9 * energy["motor"]


def test_a_run_shows_when_it_holds(folder, tmp_path):
    assert main(["simulate", "demo", "--rig", str(folder), "--out", str(tmp_path / "run")]) == 0
    bag = Bag(tmp_path / "run")
    modes = [message.mode for _, message in bag.messages("/ring_stop/state")]
    assert {0, 2} == set(modes) and modes[-1] == 2, "the demo ends in the first gear"
    torque = bag.series("f1_torque")[1]
    assert torque.min() >= 0.0 and torque.max() > 10.0 and bag.series("f1_slip")[1].max() < 1e-6


def test_check_draws_it_and_names_it_with_its_gear(folder, tmp_path, capsys):
    assert main(["check", str(folder), "--picture", str(tmp_path / "p.svg")]) == 0
    assert "gear 1: B1, F1, ratio 2.8" in capsys.readouterr().out
    assert "F1 (not backwards)" in (tmp_path / "p.svg").read_text()


def test_between_two_bodies_it_joins_them_in_the_picture(tmp_path):
    folder = written(
        tmp_path / "two",
        FREEWHEEL.replace("[ground, ring]", "[wheel_2, output]").replace("  1: [brake_1, ring_stop]\n", "").replace("gears:\n", ""),
    )
    assert main(["check", str(folder), "--picture", str(tmp_path / "p.svg")]) == 0
    assert "F1: wheel_2 not faster" in (tmp_path / "p.svg").read_text()
    rig = driven(load_rig(folder, {"effects.transducers": "off"}), None)
    assert rig.holds("ring_stop"), "the second gear, held by it alone"
    assert rig.true("output.speed") == pytest.approx(rig.true("input.speed") / 1.6, rel=1e-9)


@pytest.mark.parametrize(
    "old, new, sentence",
    [
        ("[ground, ring]", "[ring, ground]", r"rig.yaml:\d+: parts.ring_stop.joins: it overruns as the input drives in gear 1"),
        ("[ground, ring]", "[ground, ground]", "joins 'ground' with itself; two bodies are needed"),
        ("[ground, ring]", "[ground, rung]", "parts.ring_stop.joins names the body 'rung'; did you mean 'ring'"),
        ("[ground, ring]", "[input, wheel_2]", "gears.1: brake_1, ring_stop held alone: they let nothing turn"),
        ("[ground, ring]", "ring", "must be a list of two bodies"),
        ("    joins: [ground, ring]\n", "", "parts.ring_stop lacks the key 'joins', two bodies, one of which may be 'ground'"),
        ("    joins: [ground, ring]\n", "    joins: [ground, ring]\n    drag: [1 Nm s/rad, x]\n", "unknown key 'drag'"),
        ("[brake_1, ring_stop]", "[ring_stop]", "gears.1 is held by free-wheels alone; a gear is ordered by a clutch"),
        ("[brake_1, ring_stop]", "[brake_1, ring_stap]", "names the clutch 'ring_stap'; did you mean 'ring_stop'"),
    ],
)
def test_what_cannot_be_is_refused_in_one_sentence(tmp_path, old, new, sentence):
    assert old in FREEWHEEL
    with pytest.raises(RigError, match=sentence) as refusal:
        load_rig(written(tmp_path / "wrong", FREEWHEEL.replace(old, new)))
    assert "\n" not in str(refusal.value)
