# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parameters of a sequence: defaults, values from outside, refusals, and their place in a run's record."""

import math

import pytest

from rig_nodes.bags.reader import Bag
from rig_nodes.base.errors import RigError
from rig_nodes.cli.main import main
from rig_nodes.nodes.processes.supervisor import Order
from rig_nodes.runs.sequence import load_sequence

RPM = math.pi / 30.0
SEQUENCE = """description: a parameter of each kind
parameters:
  speed: 500 rpm
  gear: I
  times: 2
steps:
  - oil: {pressure: 4 MPa}
  - shift: {to: "${gear}"}
  - motor: {speed: "${speed}"}
  - wait: {until: {signal: n_wej, near: "${speed}", within: 10 rpm}}
  - repeat: {times: "${times}", steps: [{wait: {for: 20 ms}}]}
"""


@pytest.fixture
def path(tmp_path):
    file = tmp_path / "asked.yaml"
    file.write_text(SEQUENCE)
    return file


def test_defaults_and_given_values_reach_the_steps(path):
    sequence = load_sequence(path, default="hydmag")
    assert sequence.parameters == {"speed": "500 rpm", "gear": "I", "times": 2}
    assert [step.kind for step in sequence.steps] == ["oil", "shift", "motor", "wait", "wait", "wait"]
    given = load_sequence(path, {"speed": "1.2e3 rpm", "gear": "II", "times": "1"}, default="hydmag")
    assert given.parameters == {"speed": "1.2e3 rpm", "gear": "II", "times": 1}
    _, shift, motor, wait, *pauses = given.steps
    assert shift.value == 2 and len(pauses) == 1
    assert motor.value == pytest.approx(1200 * RPM) and motor.text == "motor speed 1.2e3 rpm"
    assert (wait.condition.low, wait.condition.high) == pytest.approx((1190 * RPM, 1210 * RPM))


@pytest.mark.parametrize(
    "values, sentence",
    [
        ({"sped": "500 rpm"}, "sequence 'asked': there is no parameter 'sped'; did you mean 'speed'"),
        ({"speed": "500 Nm"}, "parameter speed=500 Nm: '500 Nm' is a torque, expected an angular velocity"),
        ({"speed": "500"}, "'500' has no unit, expected an angular velocity"),
        ({"times": "2.5"}, "parameter times=2.5: expected a whole number, e.g. 2"),
        ({"gear": "III"}, r"asked\.yaml:8: shift.to is 'III', expected neutral, I, II"),
        ({"speed": "5000 rpm"}, r"asked\.yaml:9: motor.speed is 5000 rpm; the rig takes 0 to"),
    ],
)
def test_values_are_refused(path, values, sentence):
    with pytest.raises(RigError, match=sentence):
        load_sequence(path, values, default="hydmag")


@pytest.mark.parametrize(
    "old, new, sentence",
    [
        ("gear: I\n", "gear: I\n  load: 3 Nm\n", r"asked\.yaml:5: parameter load is used by no step"),
        ('"${speed}"}\n', '"${spede}"}\n', r"asked\.yaml:9: there is no parameter '\$\{spede\}'; did you mean '\$\{speed\}'"),
        ("times: 2", "times: [2]", r"asked\.yaml:5: parameter times is \[2\]; expected"),
        ('near: "${speed}", ', "near: 500 rpm, above: 3 rpm, ", r"asked\.yaml:10: unknown key 'above'"),
        (", within: 10 rpm", "", r"lacks the key 'within'"),
    ],
)
def test_a_wrong_sequence_is_refused(path, old, new, sentence):
    assert old in SEQUENCE
    path.write_text(SEQUENCE.replace(old, new, 1))
    with pytest.raises(RigError, match=sentence):
        load_sequence(path, default="hydmag")


def test_a_sequence_without_parameters_takes_none():
    with pytest.raises(RigError, match="sequence 'demo': there is no parameter 'speed'; there is none at all"):
        load_sequence("demo", {"speed": "500 rpm"}, rig="hydmag")


def test_the_command_line_gives_them_and_the_bag_says_them(path, tmp_path, capsys):
    assert main(["simulate", str(path), "--with", "speed=40 rpm", "--with", "times=1", "--out", str(tmp_path / "run")]) == 0
    assert Bag(tmp_path / "run").run_info()["parameters"] == {"speed": "40 rpm", "gear": "I", "times": 1}


@pytest.mark.parametrize(
    "arguments, sentence",
    [
        (["--with", "speed"], "--with speed: expected NAME=VALUE"),
        (["--with", "speed=1 rpm", "--with", "speed=2 rpm"], "--with speed is given twice"),
        (["--with", "load=1 Nm"], "there is no parameter 'load'"),
    ],
)
@pytest.mark.parametrize("verb", ["simulate", "run"])
def test_the_command_line_refuses(path, capsys, verb, arguments, sentence):
    assert main([verb, str(path), *arguments]) == 2
    assert sentence in capsys.readouterr().err


def test_parameters_without_a_sequence_are_refused(capsys):
    assert main(["run", "--with", "speed=1 rpm"]) == 2
    assert "name the sequence too" in capsys.readouterr().err


def test_container_and_sequencer_of_a_run_get_them():
    order = Order("asked", "hydmag", parameters=["speed=40 rpm", "times=1"])
    for process in ("container", "sequencer"):
        text = " ".join(order.arguments(process))
        assert "--with speed=40 rpm --with times=1" in text
    assert "--with" not in order.arguments("alfa46") + order.arguments("recorder")
