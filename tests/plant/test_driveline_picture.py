# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A description is drawn without being run: every body and every joint has its name in the picture."""

import xml.etree.ElementTree as ElementTree

import pytest

from rig_nodes.base.errors import RigError
from rig_nodes.driveline.builder import Driveline


def described():
    d = Driveline()
    for name, inertia in (("input", 0.3), ("ring", 0.0), ("output <1>", 4.0), ("wheel", 2.0)):
        d.inertia(name, inertia)
    d.planetary("set", "input", "ring", "output <1>", 2.5)
    d.brake("low", "ring")
    d.brake("park", "ring")
    d.clutch("high", "input", "output <1>")
    d.shaft("half-shaft", "output <1>", "wheel", stiffness=1e4)
    d.mesh("bevel", "output <1>", "wheel", 2.0, 0.9, 0.5)
    d.freewheel("hill hold", "ground", "wheel")
    d.torque("fan", "input", table=([0.0, 100.0], [0.0, -5.0]))
    d.torque("brushes", "input", "wheel", table=([0.0, 100.0], [0.0, -5.0]))
    d.slider_crank("piston", "input", mass=1.0, radius=0.1, rod=0.3)
    d.motion("drive", "wheel")
    return d


def test_all_that_is_described_stands_in_the_picture(tmp_path):
    described().draw(tmp_path / "set.svg", "a set & more")
    words = " | ".join(ElementTree.parse(tmp_path / "set.svg").getroot().itertext())
    for name in (
        "a set & more",
        "input",
        "0.3 kg m2",
        "no inertia of its own",
        "output <1>",
        "wheel",
        "set (2.5)",
        "low, park",
        "high",
        "half-shaft",
        "bevel: 2, efficiency 0.9 and 0.5",
        "hill hold (not backwards)",
        "fan: torque",
        "brushes",
        "piston: varying inertia",
        "drive: motion",
    ):
        assert name in words, name


def test_what_cannot_be_drawn_is_one_sentence(tmp_path):
    with pytest.raises(RigError, match="there is no body to draw"):
        Driveline().draw(tmp_path / "none.svg")
    with pytest.raises(RigError, match="cannot be written"):
        described().draw(tmp_path / "no" / "folder.svg")
