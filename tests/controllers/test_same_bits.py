# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""One law, five plugs, two levels: the same numbers to the last bit, alone and on the rig."""

import random
from dataclasses import replace

import numpy as np
import pytest

from rig_nodes.bags.reader import Bag
from rig_nodes.base.errors import RigError
from rig_nodes.controllers import load_controller
from rig_nodes.rig.alfa46 import Alfa46Config, Alfa46Values
from rig_nodes.rig.configuration import load_rig
from rig_nodes.runs.sequence import load_sequence
from rig_nodes.runs.simulation import simulate

from .conftest import PYTHON, SIMULINK, C

ROS = "ros:same_bits"
UP_AND_DOWN = """
description: both gears, a shift up, a shift down and neutral
steps:
  - oil: {pressure: 4 MPa}
  - wait: {for: 300 ms}
  - motor: {speed: 300 rpm}
  - shift: {to: I}
  - load: {torque: 20 Nm}
  - shift: {to: II}
  - shift: {to: I}
  - shift: {to: neutral}
"""
SETTINGS = {"as it is": (1, {}), "late": (7, {"alfa46.t12": "200 ms", "alfa46.t21": "-2.5 ms"})}


@pytest.fixture(scope="module")
def sequence(tmp_path_factory):
    path = tmp_path_factory.mktemp("sequence") / "up_and_down.yaml"
    path.write_text(UP_AND_DOWN)
    return load_sequence(path, default="hydmag")


@pytest.fixture(scope="module")
def ros_node(ros_program):
    """Starts one node that serves every run of this file."""
    ros_program("same_bits")


@pytest.fixture(scope="module")
def hashes(sequence, tmp_path_factory, request):
    """Returns canonical_hash of the run with a controller (None: the one inside the kernel) under named settings."""
    known = {}

    def get(name, spec):
        if (name, spec) not in known:
            seed, settings = SETTINGS[name]
            config, folder = load_rig("hydmag", settings), tmp_path_factory.mktemp("run")
            if spec and spec.startswith("ros:"):
                request.getfixturevalue("ros_node")
            plug = load_controller(spec, config) if spec else None
            if plug:
                plug.wait(20.0)
            run = simulate(config, sequence, folder, seed, controller=plug)
            assert run["end"]["state"] == "ended", run["end"]["reason"]
            bag = Bag(folder)
            # every command names its level, and has a duty only at level duty; setpoints and gear must be the same at both
            asked = {name: bag.series(name)[1].tobytes() for name in ("I_set_zr_p1", "I_set_zr_p2", "gear_ordered")}
            known[name, spec] = bag.canonical_hash() | asked
        return known[name, spec]

    return get


@pytest.mark.parametrize(
    ("name", "spec"),
    [
        # two pairs show each plug both settings and both levels; the other two are a campaign
        pytest.param(
            name,
            f"{spec}{level}",
            id=f"{spec.partition(':')[0]}{level}-{name}",
            marks=[pytest.mark.campaign] if (name == "late") == bool(level) else [],
        )
        for name in SETTINGS
        for level in ("", "@current")
        for spec in ("alfa46", PYTHON, C, SIMULINK, ROS)
    ],
)
def test_every_topic_is_that_of_the_built_in_controller(hashes, name, spec):
    built_in = hashes(name, None)
    assert len(built_in) > 30 and "/controller/command" in built_in
    other = {"/controller/command", "all"} if spec.endswith("@current") else set()
    assert {topic for topic, value in hashes(name, spec).items() if built_in[topic] != value} == other
    assert hashes(name, spec).keys() == built_in.keys()


def test_the_settings_compared_differ(hashes):
    one, other = hashes("as it is", None), hashes("late", None)
    assert one["/controller/command"] != other["/controller/command"]


def random_settings(rng) -> Alfa46Config:
    """Returns any profile that the YAML would take, and delays that may fall between samples."""
    values = load_rig("hydmag").alfa46.values
    changed = {
        "t12": rng.choice((-0.22, 0.0, 0.0005, 0.0015, 0.0025, -0.0025, rng.uniform(-0.5, 0.5))),
        "t21": rng.uniform(-0.5, 0.5),
        "t23": rng.uniform(-0.5, 0.5),
        "t32": rng.uniform(-0.5, 0.5),
        "gain_d": rng.choice((0.0, 1.0)),
        "gain_i": rng.uniform(0.0, 3000.0),
    }
    values = Alfa46Values(**{**{name: getattr(values, name) for name in values.__dataclass_fields__}, **changed})
    profiles = np.zeros((3, 6, 2))
    for output in profiles:
        for half in (slice(0, 3), slice(3, 6)):
            output[half, 0] = np.cumsum([rng.uniform(1e-3, 0.2) for _ in range(3)])
            output[half, 1] = [rng.choice((0.0, rng.uniform(0.0, 0.8))) for _ in range(3)]
    return Alfa46Config(values, profiles)


@pytest.mark.parametrize("seed, rig, level", [(1, "hydmag", "duty"), (4, "three_speed", "current")])
def test_any_settings_orders_and_currents_give_the_same_bits(seed, rig, level):
    rng = random.Random(seed)
    settings = replace(load_rig(rig), alfa46=random_settings(rng))
    plugs = [load_controller(spec, settings, level) for spec in (None, PYTHON, C, SIMULINK)]
    transducers = [float(k) for k in range(len(plugs[0].rig_record.transducers))]
    taken = 0
    for sample in range(2500):
        if rng.random() < 0.01:
            gear, refusals = rng.choice(list(settings.transmission.names)), set()
            for plug in plugs:
                try:
                    plug.order(gear)
                    refusals.add("")
                except RigError as error:
                    refusals.add(str(error))
            assert len(refusals) == 1
            taken += refusals == {""}
        current = [rng.choice((0.0, rng.uniform(0.0, 0.9))) for _ in range(3)]
        seen = {(repr(plug.step(sample, current, transducers)), plug.gear, plug.shifting, plug.flags) for plug in plugs}
        assert len(seen) == 1, f"sample {sample}"
    assert taken > 3
    for plug in plugs:
        plug.close()
