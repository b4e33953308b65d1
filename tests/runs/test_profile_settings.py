# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Points of the controller's profiles as settings of the rig, which the series of Annex B change."""

import numpy as np
import pytest

from rig_nodes.base.errors import RigError
from rig_nodes.rig.configuration import load_rig


def test_points_are_taken_together_whatever_their_order(config):
    """P1 at 340 ms alone would be later than the present P2 at 330 ms."""
    changed = load_rig(
        "hydmag", {"alfa46.output_1.P1": "340 ms 160 mA", "alfa46.t12": "-100 ms", "alfa46.output_1.P2": "420ms,170mA"}
    )
    assert changed.alfa46.profiles[0, :3] == pytest.approx(np.array([[0.34, 0.16], [0.42, 0.17], [0.65, 0.74]]))
    assert np.array_equal(changed.alfa46.profiles[1:], config.alfa46.profiles[1:])
    assert changed.alfa46.values.t12 == pytest.approx(-0.1)
    assert config.alfa46.profiles[0, 0] == pytest.approx([0.2, 0.16]), "the installed one stays"


@pytest.mark.parametrize(
    "key, text, sentence",
    [
        ("alfa46.output_1.P1", "340 ms 160 mA", "alfa46.output_1.P2 is at 330 ms; it must come after P1 at 340 ms"),
        ("alfa46.output_2.P3", "580 ms 810 mA", "alfa46.output_2.P3 asks for 810 mA; the valve takes 0 to 800 mA"),
        ("alfa46.output_2.P3", "580 ms", "expected time and current"),
        ("alfa46.output_2.P3", "740 mA 580 ms", "is a current, expected a time"),
        ("alfa46.output_4.P1", "100 ms 0 mA", "there is no value of alfa46 'output_4.P1'; did you mean 'output_3.P1'"),
    ],
)
def test_wrong_points_are_refused(key, text, sentence):
    with pytest.raises(RigError, match=sentence):
        load_rig("hydmag", {key: text})
