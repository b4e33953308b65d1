# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Every plug of the reference controller against a current trace that was written by hand from the thesis's rules.

The rules (thesis 3.4, Tab. 7.5): P1-P3 count from switch-on, P4-P6 from switch-off, with straight lines between them. In a
change with a negative delay the engaging valve is switched on at the order and the releasing one is switched off that much
later; with a positive delay the releasing valve is switched off at the order and the engaging one on that much later.
"""

import numpy as np
import pytest

from rig_nodes.controllers import load_controller
from rig_nodes.rig.configuration import load_rig

from .conftest import PYTHON, SIMULINK, C

# orders: I at 0 ms, II at 2000 ms (t12 = -220 ms), I at 5000 ms (t21 = +100 ms), neutral at 8000 ms; knots in ms, mA
ORDERS = {0: 1, 2000: 2, 5000: 1, 8000: 0}
SETTINGS = {"alfa46.t12": "-220 ms", "alfa46.t21": "100 ms"}
OUTPUT_1 = [
    (0, 0),
    (200, 160),
    (330, 300),
    (650, 740),  # switched on at 0
    (2220, 740),
    (2470, 130),
    (2970, 130),
    (3470, 0),  # off at 2000 + 220
    (5100, 0),
    (5300, 160),
    (5430, 300),
    (5750, 740),  # on at 5000 + 100
    (8000, 740),
    (8250, 130),
    (8750, 130),
    (9250, 0),  # off at 8000
]
OUTPUT_2 = [
    (2000, 0),
    (2125, 215),
    (2330, 215),
    (2580, 740),  # on at 2000
    (5000, 740),
    (5250, 130),
    (5750, 130),
    (6250, 0),  # off at 5000
]
MILLISECONDS = np.arange(10_000)


@pytest.mark.parametrize(
    "spec",
    [
        pytest.param(f"{spec}@{level}", id=f"{spec.partition(':')[0]}-{level}")
        # each plug at one level, and at the other in the runs of test_same_bits.py
        for spec, level in (("alfa46", "duty"), (PYTHON, "current"), (C, "duty"), (SIMULINK, "current"))
    ],
)
def test_the_currents_are_those_of_the_thesis(spec):
    currents_are_those_of_the_thesis(load_controller(spec, load_rig("hydmag", SETTINGS)))


def currents_are_those_of_the_thesis(plug):
    """Asserts it for a plug with SETTINGS, which is closed then."""
    seen = []
    for ms in MILLISECONDS:
        if ms in ORDERS:
            plug.order(ORDERS[ms])
        seen.append(plug.step(int(ms), (0.3, 0.3, 0.0), [0.0, 0.0, 0.0, 0.0]).setpoint)
    plug.close()
    seen = np.array(seen) * 1e3
    for column, knots in ((0, OUTPUT_1), (1, OUTPUT_2)):
        assert seen[:, column] == pytest.approx(np.interp(MILLISECONDS, *zip(*knots)), abs=1e-9)
    assert not seen[:, 2].any()
