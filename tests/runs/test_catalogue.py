# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The catalogue compared with messages, the kernel's channels and the page of signals."""

import pytest

from rig_nodes.bags.definitions import installed
from rig_nodes.base.errors import RigError
from rig_nodes.base.names import installed as installed_rigs
from rig_nodes.cli.list import WHAT, markdown
from rig_nodes.cli.main import main
from rig_nodes.rig.configuration import load_rig
from rig_nodes.rig.signal_catalogue import catalogue
from rig_nodes.runs.plan import plan_of

RIGS = {name: load_rig(name) for name in installed_rigs("rigs")}


@pytest.mark.parametrize("rig, name", [(rig, name) for rig, config in RIGS.items() for name in config.catalogue.signals])
def test_every_signal_is_a_field_of_its_topics_message(rig, name):
    known = RIGS[rig].catalogue
    signal = known.signal(name)
    definition = installed(known.all_topics[signal.topic].ros_type)
    assert signal.field.partition("[")[0] in dict(definition.tree.fields)
    assert signal.low < signal.high and signal.text.endswith(".") and signal.sign


@pytest.mark.parametrize("rig", RIGS)
def test_the_logger_and_the_transducers_carry_the_plans_channels(rig):
    config = RIGS[rig]
    channels, valves = list(plan_of(config).plan.channels), len(config.structure.valves)
    logged = [s.name for s in config.catalogue.logger_channels()]
    assert logged == channels[: len(logged)]
    assert set(config.catalogue.measured().values()) == set(channels[: len(channels) - valves])


def test_the_catalogue_of_the_laboratorys_rig_has_its_names():
    known = RIGS["hydmag"].catalogue
    assert [s.name for s in known.logger_channels()] == [
        "M_wej",
        "n_wej",
        "M_wyj",
        "n_wyj",
        "p1",
        "p2",
        "p_po",
        "I_zr_p1",
        "I_zr_p2",
    ]
    assert known.signals["s1_slip"].topic == "/clutch_s1/state" and known.signals["relief_setting"].topic == "/load_pump/state"
    assert catalogue(RIGS["hydmag"].as_dict()) == known, "as a bag says it"


@pytest.mark.parametrize("rig", RIGS)
def test_every_setpoint_keeps_to_the_range_that_the_page_gives_it(rig):
    config = RIGS[rig]
    checks = {one.setpoint.topic: one.check for one in config.settings.steps.values()}
    assert {topic.name for topic in config.catalogue.setpoints()} == set(checks)
    for topic, signal in config.catalogue.setpoints().items():
        for value in (signal.low, signal.high):
            checks[topic.name](value)
        for value in (signal.low - 0.001, 1.001 * signal.high):
            with pytest.raises(RigError):
                checks[topic.name](value)
    assert "| /oil_supply/command | supply pressure of the clutch oil | Pa | 0 to 10000000 | 0 to 10 MPa |" in markdown()


def test_a_list_says_what_its_columns_are(capsys):
    assert main(["list", "signals"]) == 0
    heading, *rows = capsys.readouterr().out.splitlines()
    assert heading.split() == ["signal", "unit", "shown", "range", "device", "topic", "field", "rate", "sign", "meaning"]
    assert len(rows) == len(load_rig("hydmag").catalogue.signals)
    assert all(row[heading.index("topic") :].startswith("/") for row in rows)


def test_list_alone_names_what_there_is_to_list_and_each_of_it_lists_something(capsys):
    assert main(["list"]) == 0
    shown = capsys.readouterr().out.splitlines()[1:]
    assert [line.split()[:3] for line in shown] == [["./rig", "list", what] for what in WHAT]
    for what in WHAT:
        assert main(["list", what]) == 0
        assert len(capsys.readouterr().out.splitlines()) > 1
