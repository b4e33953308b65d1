# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A re-run that fails removes what it has made itself, and nothing of another one in the same folder."""

from pathlib import Path

import pytest

from rig_nodes.analysis.of_runs import gather
from rig_nodes.bags.reader import Bag
from rig_nodes.bags.writer import BagWriter
from rig_nodes.base.errors import RigError
from rig_nodes.controllers import load_controller
from rig_nodes.rig.recorded_rig import config_of_record
from rig_nodes.runs.rerun import rerun_controller

SAMPLE = Path(__file__).parents[2] / "bags" / "sample"


@pytest.fixture
def again():
    """Runs the sample through its controller into a folder."""
    bag = gather(SAMPLE)
    config = config_of_record(bag.record, str(SAMPLE))
    return lambda folder: rerun_controller(bag, config, load_controller("alfa46", config), "alfa46", folder)


def test_the_second_re_run_into_a_folder_leaves_the_first_its_bag(again, tmp_path):
    (tmp_path / "logs").mkdir()
    first = BagWriter(tmp_path, "sample")  # of the re-run that came first and goes on
    with pytest.raises(RigError, match="sample_0.mcap is there already"):
        again(tmp_path)
    first.close()
    assert Bag(tmp_path).counts == {} and (tmp_path / "logs").is_dir()


def test_of_a_re_run_that_fails_no_half_bag_is_left(again, tmp_path, monkeypatch):
    (tmp_path / "logs").mkdir()

    def failing(*_):
        raise RigError("it is no use")

    monkeypatch.setattr("rig_nodes.runs.rerun._answered", failing)
    with pytest.raises(RigError, match="it is no use"):
        again(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["logs"]
