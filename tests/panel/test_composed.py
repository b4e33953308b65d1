# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The steps of which the operator's page composes a sequence: every rig has those of its own setpoints, and takes each as it is."""

import functools

import pytest

from rig_nodes.api import load
from rig_nodes.base import RIGS_DIR
from rig_nodes.nodes.panel.composed import VALUE
from rig_nodes.nodes.panel.description import Description
from rig_nodes.runs import load_sequence

RIGS = sorted(path.name for path in RIGS_DIR.iterdir() if (path / "rig.yaml").is_file())


@functools.cache
def about(rig):
    return Description(load(rig).config.as_dict(), rig)


def steps(rig):
    return about(rig).whole["steps"]


@pytest.mark.parametrize("rig", RIGS)
def test_a_rig_takes_each_step_with_the_value_that_the_page_begins_with(rig, tmp_path):
    lines = [f"  - {step['line'].replace(VALUE, step['value'])}\n" for step in steps(rig)]
    path = tmp_path / "own.yaml"
    path.write_text(f"description: composed on the page\nsteps:\n{''.join(lines)}")
    sequence = load_sequence(path, None, rig)
    sequence.check_rig(load(rig).config)
    assert len(sequence.steps) == len(lines)


@pytest.mark.parametrize("rig", RIGS)
def test_each_sign_of_a_clutch_in_the_picture_has_its_joint_or_its_brake(rig):
    one = about(rig)
    picture, devices = one.whole["picture"], [*one.config.structure.clutches, *one.config.structure.freewheels]
    joints = [link for link in picture["links"] if link["kind"] == "clutch"]
    braked = [body for body in picture["bodies"] if body["braked"]]
    assert picture["svg"].count('<path class="clutch"') == len(joints) + len(braked)
    shown = [link["clutch"]["called"] for link in picture["links"] if link["clutch"]]
    assert sorted(shown) == sorted(one.called for one in devices if "joins" in one.wires and "ground" not in one.wires["joins"])


def test_the_kinds_are_those_of_the_rig_and_a_first_sequence_has_what_makes_it_turn():
    def kinds(rig):
        return [one["kind"] for one in steps(rig)]

    def first(rig):
        return kinds(rig)[: kinds(rig).index("wait")]

    assert first("hydmag") == ["oil pressure", "gear", "motor speed"]
    assert {"load torque", "load pressure", "load off"} < set(kinds("hydmag"))
    assert first("frame_saw") == ["motor speed"] and "feed per turn" in kinds("frame_saw")
    assert {"wood force", "engine throttle"} < set(kinds("chain_saw")) and "gear" not in kinds("chain_saw")
