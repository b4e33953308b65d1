# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The logger's rate is a setting of the rig: fewer rows are some of the same rows, and the report is that of all rows."""

import json

import numpy as np
import pytest

from rig_nodes.bags.reader import Bag
from rig_nodes.base.errors import RigError
from rig_nodes.cli.main import main
from rig_nodes.rig.configuration import load_rig
from rig_nodes.rig.recorded_rig import config_of_record

HALF = "instruments.logger_rate=5 kHz"


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """A run with all rows, and one with half of them."""
    folder = tmp_path_factory.mktemp("rates")
    for name, settings in (("all", []), ("half", ["--set", HALF])):
        assert main(["simulate", "demo", "--out", str(folder / name), *settings]) == 0
    return folder / "all", folder / "half"


def test_half_the_rate_records_half_the_rows(runs):
    whole, half = (Bag(run).logger() for run in runs)
    assert (whole.period, half.period) == (1e-4, 2e-4) and whole.rows == 2 * half.rows
    assert all(np.array_equal(values[::2], half.channels[name]) for name, values in whole.channels.items())


def test_the_report_holds(runs):
    whole, half = (json.loads((run / "report.json").read_text())["shifts"] for run in runs)
    assert len(whole) == len(half) == 2
    for one, other in zip(whole, half, strict=True):
        assert other["valid"] and other["from_gear"] == one["from_gear"]
        assert other["t_dt_s"] == pytest.approx(one["t_dt_s"], abs=2e-3)
        assert other["input_torque_max_nm"] == pytest.approx(one["input_torque_max_nm"], rel=0.02)
        assert other["e_loss_j"] == pytest.approx(one["e_loss_j"], rel=0.02)


def test_the_record_has_it_where_it_is_another(runs):
    whole, half = (Bag(run).record for run in runs)
    assert "logger_rate" not in whole["instruments"] and half["instruments"]["logger_rate"] == 5e3
    assert config_of_record(half, "half").instruments.logger_rate == 5e3


@pytest.mark.parametrize(
    ("overrides", "sentence"),
    [
        (
            {"instruments.logger_rate": "3 kHz"},
            "logger_rate of 3 kHz does not fit the plant's step of 100 us; expected 1, 2, 5, 10 kHz",
        ),
        ({"instruments.logger_rate": "20 kHz"}, "does not fit the plant's step of 100 us"),
        ({"instruments.logger_rate": "500 Hz"}, "outside 1000 to 1 000 000 Hz"),
        ({"instruments.logger_rate": "5 rpm"}, "frequency"),
    ],
)
def test_what_cannot_be_done_is_refused(overrides, sentence):
    with pytest.raises(RigError, match=sentence):
        load_rig("hydmag", overrides)


def test_a_shorter_step_takes_a_higher_rate_and_it_is_shown(capsys):
    assert load_rig("hydmag", {"instruments.logger_rate": "20 kHz", "kernel.step": "50 us"}).instruments.logger_rate == 2e4
    assert main(["list", "settings"]) == 0
    assert "instruments.logger_rate" in capsys.readouterr().out
    assert main(["check", "hydmag"]) == 0
    assert "logged at 10 kHz" in capsys.readouterr().out
