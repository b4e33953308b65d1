# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Every value of every part has a description in one sentence, which is shown wherever the value can be set."""

import re
from dataclasses import fields

from rig_nodes.cli.main import main
from rig_nodes.plant.parts.part import part, parts
from rig_nodes.rig.configuration import load_rig
from rig_nodes.rig.reference import page, sections
from rig_nodes.runs.fmu.rig_variables import rig_variables


def described():
    """Returns the name of each value of parts and sections -> its field."""
    found = {f"{name}.{one.name}": one for name in parts() for cls in part(name).configs for one in fields(cls)}
    return found | {f"{section}.{name}": one for section, (_, those) in sections().items() for name, one in those.items()}


def test_every_value_says_what_it_is_in_one_sentence():
    for name, one in described().items():
        text = one.metadata["text"]
        assert re.fullmatch(r"[A-Z][^\n\[\]]{10,150}[^.\s]", text), f"{name}: {text!r}"
        assert "; " not in text or text.count("; ") == 1, f"{name}: {text!r}"


def test_the_page_has_each_part_with_its_joints_setpoints_and_signals():
    text = page()
    assert all(f"### {name}\n" in text for name in parts())
    assert "`feeds` (a clutch)" in text and "Takes: `load: {torque: ...}`, `load: {pressure: ...}`." in text
    assert "| displacement | cm3/rev | 0.628319 to 6283.19 | Displacement of the motor |" in text
    assert "| pwm_frequency | Hz | 0 to 100000 | 0 Hz | Frequency of the resolved PWM of the coils; at 0 its average acts |" in text


def test_variables_of_an_fmu_are_described_by_the_same_sentences():
    texts = {one.name: one.text for one in rig_variables(load_rig("three_speed"))}
    assert texts["brake_1.piston_area"] == "Area of the piston"
    assert texts["motor.ramp"] == "Rate at which the speed setpoint moves to the ordered speed"
    assert texts["effects.wear"] == "Clearances grow with slip; off: they stay"
    assert texts["alfa46.t12"] == "Delay from gear 1 to 2; negative: the engaging valve is switched on that much earlier"


def test_parts_are_listed_with_their_values(capsys):
    assert main(["list", "parts"]) == 0
    heading, *rows = capsys.readouterr().out.splitlines()
    assert heading.split()[:4] == ["part", "value", "unit", "range"]
    assert any(row.startswith("torque_meter") and "beyond, within" in row for row in rows)
