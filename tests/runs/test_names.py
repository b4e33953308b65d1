# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The sentences about a name that does not exist."""

import pytest

from rig_nodes.base.errors import RigError
from rig_nodes.base.names import unknown
from rig_nodes.cli.main import main
from rig_nodes.runs.sequence import load_sequence

TOPICS = ("/motor/m_wej", "/motor/state", "/gearbox/state")


@pytest.mark.parametrize(
    "name, known, sentence",
    [
        ("n_wei", ("n_wyj", "m_wej", "n_wej", "p1"), "there is no signal 'n_wei'; did you mean 'n_wej' or 'n_wyj'?"),
        ("N_WEJ", ("n_wej", "p1"), "there is no signal 'N_WEJ'; did you mean 'n_wej'?"),
        ("m_wej", TOPICS, "there is no signal 'm_wej'; did you mean '/motor/m_wej'?"),
        ("zzz", ("n_wej", "p1"), "there is no signal 'zzz'; known are n_wej, p1"),
        ("x", (), "there is no signal 'x'; there is none at all"),
        (3, (1, 2), "there is no signal '3'; known are 1, 2"),
    ],
)
def test_the_name_most_like_it_is_proposed_else_all_are_named(name, known, sentence):
    assert unknown("signal", name, known) == sentence


@pytest.mark.parametrize(
    "command, meant",
    [
        ("simulate demo --contoller x", "--controller"),
        ("list signls", "signals"),
        ("controller chek x", "check"),
        ("controller new pyton d", "python"),
        ("device motr", "motor"),
        ("bench kernl", "kernel"),
        ("calibrate --stages loses", "losses"),
        ("tune --objectives peak,dipp", "dip"),
        ("tune --ways II-J", "II-I"),
        ("validate --procedures gridup", "grid_up"),
        ("validate --rows kiss_presure_s2", "kiss_pressure_s2"),
        ("sweep demo --vary alfa46t12=1", "alfa46.t12"),
        ("sweep grid_point --vary spede=1", "speed"),
        ("simulate demo --controller pyton:x:y", "python"),
        ("simulate demo --level curent", "current"),
        ("simulate demo --controller python:rig_nodes.controllers.examples.alfa46:Alfa", "Alfa46"),
        ("simulate demmo", "demo"),
        ("simulate demo --rig hydmg", "hydmag"),
        ("procedure delay_serie", "delay_series"),
    ],
)
def test_every_name_on_the_command_line_is_answered_with_the_one_meant(command, meant, capsys):
    assert main(command.split()) == 2
    error = capsys.readouterr().err
    assert f"did you mean '{meant}'" in error and error.count("\n") == 1


@pytest.mark.parametrize("name", ["x" * 300, "demo\nsteps: []"])
def test_a_name_that_no_file_can_have_is_unknown(name):
    with pytest.raises(RigError, match="there is no sequence"):
        load_sequence(name, default="hydmag")
