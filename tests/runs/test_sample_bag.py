# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The sample bag that ships with the project is complete, small, and equal to the output of its command."""

from pathlib import Path

import pytest

from rig_nodes.analysis.run_report import build_report
from rig_nodes.bags.reader import Bag
from rig_nodes.rig.configuration import load_rig
from rig_nodes.runs.sequence import load_sequence
from rig_nodes.runs.simulation import simulate

SAMPLE = Path(__file__).resolve().parents[2] / "bags" / "sample"


def test_sample_bag_is_what_its_command_makes(tmp_path):
    assert sum(path.stat().st_size for path in SAMPLE.iterdir()) < 2**20
    bag = Bag(SAMPLE)
    assert bag.check() == []
    (shift,) = build_report(bag, bag.run_info())["shifts"]
    assert shift["valid"] and (shift["from_gear"], shift["to_gear"]) == (1, 2)
    simulate(load_rig("hydmag"), load_sequence("sample"), tmp_path / "again")
    again = Bag(tmp_path / "again")
    assert again.counts == bag.counts
    for name in ("M_wej", "n_wyj", "p1", "p2"):
        # not bit by bit, because another processor may round differently
        assert again.series(name)[1] == pytest.approx(bag.series(name)[1], rel=1e-3, abs=1e-3 * bag.series(name)[1].max())
