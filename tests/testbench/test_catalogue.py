# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The catalogue against what it describes: messages, the kernel's channels, the written page."""

from functools import partial
from pathlib import Path

import pytest

from rig_nodes.bags.definitions import installed
from rig_nodes.catalogue import catalogue
from rig_nodes.cli.list import WHAT, markdown
from rig_nodes.cli.main import main
from rig_nodes.errors import RigError
from rig_nodes.testbench import bench_plan, clutch_bench_topics
from rig_nodes.testbench.clutch_bench import check_bench_setpoint
from rig_nodes.testbench.gearbox_plan import CHANNELS
from rig_nodes.testbench.rig import check_setpoint

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.parametrize("name", list(catalogue().all_signals))
def test_every_signal_is_a_field_of_its_topics_message(name):
    signal = catalogue().signal(name)
    definition = installed(catalogue().all_topics[signal.topic].ros_type)
    assert signal.field.partition("[")[0] in dict(definition.tree.fields)
    assert signal.low < signal.high and signal.text.endswith(".") and signal.sign


def test_the_logger_and_the_transducers_carry_the_kernels_channels():
    assert [s.name for s in catalogue().logger_channels()] == list(CHANNELS)[:9]
    assert set(catalogue().measured().values()) == set(list(CHANNELS)[:11])


def test_the_clutch_benchs_logger_and_transducers_carry_its_kernels_channels():
    bench = catalogue("clutch_bench")
    assert [s.name for s in bench.logger_channels()] == list(bench_plan.CHANNELS)
    assert set(bench.measured().values()) == set(bench_plan.CHANNELS)
    with pytest.raises(RigError, match="no rig of kind 'brake_bench'; known are gearbox, clutch_bench"):
        catalogue("brake_bench")


def test_the_signals_page_is_what_the_catalogue_says():
    assert (ROOT / "docs" / "signals.md").read_text() == markdown(), \
        "run: ./rig list signals --markdown > docs/signals.md"


def test_every_setpoint_keeps_to_the_range_that_the_page_gives_it():
    checks = {"/motor/command": partial(check_setpoint, "motor_speed"),
              "/oil_supply/command": partial(check_setpoint, "oil_pressure"),
              "/load_pump/command": partial(check_setpoint, "load_pressure"),
              **{topic: partial(check_bench_setpoint, device)
                 for device, topic in clutch_bench_topics.COMMANDS.items()}}
    setpoints = catalogue().setpoints() | catalogue("clutch_bench").setpoints()
    assert {topic.name for topic in setpoints} == set(checks)
    for topic, signal in setpoints.items():
        for value in (signal.low, signal.high):
            checks[topic.name](value)
        for value in (signal.low - 0.001, 1.001 * signal.high):
            with pytest.raises(RigError):
                checks[topic.name](value)
    assert "| /oil_supply/command | supply pressure of the clutch oil | Pa | 0 to 1e+07 | 0 to 10 MPa |" in markdown()


def test_a_list_says_what_its_columns_are(capsys):
    assert main(["list", "signals"]) == 0
    heading, *rows = capsys.readouterr().out.splitlines()
    assert heading.split() == ["signal", "unit", "shown", "range", "device", "topic", "field", "rate", "sign", "meaning"]
    assert len(rows) == len(catalogue().all_signals)
    assert all(row[heading.index("topic"):].startswith("/") for row in rows)


def test_list_alone_names_what_there_is_to_list_and_each_of_it_lists_something(capsys):
    assert main(["list"]) == 0
    shown = capsys.readouterr().out.splitlines()[1:]
    assert [line.split()[:3] for line in shown] == [["./rig", "list", what] for what in WHAT]
    for what in WHAT:
        assert main(["list", what]) == 0
        assert len(capsys.readouterr().out.splitlines()) > 1
