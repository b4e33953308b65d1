# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The transducers that a user adds to a rig: what their signs mean, their ranges, their order and their errors."""

from dataclasses import MISSING

import pytest

from rig_nodes.config.units import UNITS
from rig_nodes.description.quantities import QUANTITIES
from rig_nodes.description.transducer_types import TRANSDUCER_TYPES
from rig_nodes.testbench.configuration import load_rig


@pytest.fixture
def variant(tmp_path):
    """A function that writes a rig on hydmag with some lines of its own, and returns its folder."""

    def write(text: str):
        into = tmp_path / "variant"
        into.mkdir(exist_ok=True)
        (into / "rig.yaml").write_text(f"description: a variant\nbase: hydmag\n{text}")
        return into

    return write


def test_the_sign_of_a_current_speaks_of_a_clutch_only_where_the_rig_says_so(variant):
    added = "{type: current, logged: no, shows: valve_zr_p1.current, at: motor, range: [0 A, 1 A], text: Current of something.}"
    signals = load_rig(variant(f"transducers:\n  I_own: {added}\n")).catalogue.signals
    assert signals["I_own"].sign == "positive when it flows from its supply"
    assert signals["I_zr_p1"].sign == "positive opens supply to the clutch"


def test_each_type_of_transducer_has_a_quantity_a_dimension_and_a_range():
    dimensions = {dimension for dimension, _ in UNITS.values()}
    for name, one in TRANSDUCER_TYPES.items():
        assert one.quantity in QUANTITIES and one.dimension in dimensions, name
        errors = one.errors()
        assert errors["range"].metadata["dimension"] == one.dimension, name
        assert errors["range"].default is MISSING, f"the full scale of {name} must be written"
        assert ("offset" in errors) == ("gain" in errors) and ("step" in errors) == ("gate" in errors), name
