# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The signals that a controller names as its own are in the bag, by name and sample for sample."""

import numpy as np
import pytest

from rig_nodes.bags.reader import Bag
from rig_nodes.base.errors import RigError
from rig_nodes.controllers import ControllerFailed, load_controller
from rig_nodes.controllers.own_signals import Blocks
from rig_nodes.runs.sequence import load_sequence
from rig_nodes.runs.simulation import simulate

from .conftest import C_FRAME, PYTHON, ask
from .test_own_process import framed

SEQUENCE = """
description: the input shaft turns, and gear I comes
steps:
  - motor: {speed: 300 rpm}
  - oil: {pressure: 4 MPa}
  - shift: {to: I, timeout: 2 s}
"""
COUNTING = """
from rig_nodes.controllers import Status
from rig_nodes.controllers.examples.alfa46 import Alfa46

class Mine(Alfa46):
    signals = {"count": "-", "slip": "rad/s"}

    def step(self, inputs):
        out = super().step(inputs)
        out.signals = {"slip": inputs.n_wej - inputs.n_wyj, "count": float(inputs.sample)}
        if inputs.sample == 103:
            out.status = Status.DISCARD
        return out
"""


@pytest.fixture
def sequence(tmp_path):
    (tmp_path / "sequence.yaml").write_text(SEQUENCE)
    return load_sequence(tmp_path / "sequence.yaml", default="hydmag")


def test_they_are_in_the_bag_by_name(config, sequence, tmp_path):
    (tmp_path / "mine.py").write_text(COUNTING)
    hashes = []
    for name in ("one", "other"):
        plug = load_controller(f"python:{tmp_path / 'mine.py'}:Mine", config)
        run = simulate(config, sequence, tmp_path / name, controller=plug)
        assert run["end"]["state"] == "ended"
        hashes.append(Bag(tmp_path / name).canonical_hash())
    assert hashes[0] == hashes[1]
    bag = Bag(tmp_path / "one")
    rows = bag.logger("/controller/signals")
    assert list(rows.channels) == ["count", "slip"] and rows.period == 1e-3
    count, slip = rows.channels.values()
    whole = np.arange(len(count), dtype=float)
    whole[103] = np.nan  # the controller discards this sample
    assert np.array_equal(count, whole, equal_nan=True)
    samples = [(m.sample, m.measured[0] - m.measured[1]) for _, m in bag.messages("/instruments/controller")][: len(slip)]
    assert all(slip[k] == value for k, value in samples if k != 103)
    assert not any(bag.gaps().values()) and bag.check() == []


def test_without_them_the_bag_has_no_such_topic(config, sequence, tmp_path):
    simulate(config, sequence, tmp_path / "run", controller=load_controller(PYTHON, config))
    assert not {"/controller/signals", "/controller/channels"} & set(Bag(tmp_path / "run").canonical_hash())


def test_blocks_are_five_samples_and_holes_are_none():
    blocks = Blocks(1)
    done = [block for sample in (0, 1, 2, 3, 4, 7, 12, 14) for block in blocks.add(sample, (float(sample),))]
    nan = float("nan")
    assert [first for first, _ in done] == [0, 5, 10]
    expected = [[0, 1, 2, 3, 4], [nan, nan, 7, nan, nan], [nan, nan, 12, nan, 14]]
    assert np.array_equal([rows[:, 0] for _, rows in done], expected, equal_nan=True)


@pytest.mark.parametrize(
    ("signals", "sentence"),
    [
        ("('a b',)", "expected up to 64 names"),
        ("'slip'", "expected up to 64 names"),
        ("{'a': 1}", "expected up to 64 names"),
        ("5", "expected up to 64 names"),
        ("[['a']]", "expected up to 64 names"),
        ("tuple(f's{k}' for k in range(65))", "expected up to 64 names"),
    ],
)
def test_names_that_cannot_be_recorded_are_refused(python_controller, signals, sentence):
    with pytest.raises(RigError, match=sentence):
        python_controller("return Out()", f"signals = {signals}", where="@in-process")


@pytest.mark.parametrize("given", ["None", "{}", "{'slip': 'fast'}"])
def test_a_signal_without_its_value_is_an_error(python_controller, given):
    with pytest.raises(ControllerFailed, match="expected a number for each of slip"):
        ask(python_controller(f"return Out(signals={given})", "signals = ('slip',)", where="@in-process"))


C_SIGNALS = (
    C_FRAME.replace("STEP", "now = (double)in->sample; if (in->sample == 2) return RIG_DISCARD;").replace(
        '#include "rig_record.h"', '#include "rig_record.h"\nstatic double now;'
    )
    + """
const char *const *rig_controller_signals(void) {
  static const char *const names[] = {"number", "half_of_it", 0};
  return names;
}
"""
)
VALUES = """
void rig_controller_signal_values(void *instance, double *values, uint32_t count) {
  (void)instance;
  if (count == 2) { values[0] = now; values[1] = now / 2.0; }
}
"""


def test_a_library_names_its_own_too(build, config):
    plug = load_controller(f"c:{build(C_SIGNALS + VALUES, '-Wall', '-Wextra', '-Werror')}", config)
    assert plug.signals == {"number": "-", "half_of_it": "-"}
    seen = []
    for sample in range(4):
        ask(plug, sample)
        seen.append(plug.signal_values)
    assert seen == [(0.0, 0.0), (1.0, 0.5), (1.0, 0.5), (3.0, 1.5)], "as at the newest answer"
    plug.close()


def test_names_without_values_are_refused(build, config):
    with pytest.raises(RigError, match="does not export rig_controller_signal_values"):
        load_controller(f"c:{build(C_SIGNALS)}", config)


@pytest.mark.parametrize(
    ("once", "twice", "sentence"),
    [
        ('{"M_wej", 0}', '{"M_wej", "M_wej", 0}', "wants has the name 'M_wej' twice, expected each name once"),
        ('{"slip", 0}', '{"slip", "slip", 0}', "signals has the name 'slip' twice, expected each name once"),
        ('{"gain", 1}', '{"gain", 1}, {"gain", 2}', "settings has the name 'gain' twice, expected each name once"),
    ],
)
def test_a_name_that_a_library_gives_twice_is_refused(build, config, once, twice, sentence):
    """It would get, or give, another number of values than the rig has names."""
    text = framed("")
    for name in ("WANTED", "SIGNALS", "SET"):
        text = text.replace(f"{name} }}", "}")
    load_controller(f"c:{build(text, '-w')}", config).close()
    with pytest.raises(RigError, match=sentence):
        load_controller(f"c:{build(text.replace(once, twice), '-w')}", config)


def test_a_signal_that_a_class_names_twice_is_refused(python_controller):
    with pytest.raises(RigError, match="signals has the name 'slip' twice, expected each name once"):
        python_controller("return Out()", "signals = ('slip', 'slip')")
