# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A user's Python class: its inputs, its allowed results, and one sentence for everything that is wrong."""

import ast

import pytest

from rig_nodes.base.errors import RigError
from rig_nodes.controllers import ControllerFailed, Status, load_controller

from .conftest import ask

BOTH = "levels = ('current', 'duty')"


def test_it_gets_what_the_wires_carry(python_controller, tmp_path):
    plug = python_controller("""
        names = "sample time gear_request current measured n_wej n_wyj p1 p2".split()
        open(__file__ + ".seen", "w").write(repr([getattr(inputs, name) for name in names]))
        return Out([0.25, 0.5, 1.0], [0.1, 0.2, 0.0], inputs.gear_request, True)
    """)
    plug.order(2)
    answer = plug.step(12, [0.1, 0.2, 0.0], [157.0, 100.0, 1e5, 2e5])
    assert answer.command == (0.25, 0.5, 1.0) and answer.setpoint == (0.1, 0.2, 0.0)
    assert (plug.gear, plug.shifting, plug.level) == (2, True, "duty")
    seen = ast.literal_eval((tmp_path / "mine.py.seen").read_text())
    measured = (157.0, 100.0, 1e5, 2e5)
    assert seen == [12, 0.012, 2, (0.1, 0.2, 0.0), measured, *measured]


def test_it_gets_the_settings_of_the_rig_as_flat_names(python_controller, config):
    given = python_controller("return Out()").info.parameters
    assert given["t12"] == -0.22 and given["gain_i"] == 2000.0
    assert (given["output_1.P1.time"], given["output_1.P1.current"]) == (0.2, 0.16)
    assert len(given) == 12 + 3 * 6 * 2


def test_numpy_answers_and_answers_of_their_own_type_are_taken(python_controller):
    plug = python_controller("""
        import numpy, types
        return types.SimpleNamespace(command=numpy.array([0, 1, 0]), setpoint=None, gear=numpy.int64(1),
                                     shifting=numpy.bool_(True), flags=0)
    """)
    assert ask(plug).command == (0.0, 1.0, 0.0) and plug.gear == 1 and plug.shifting is True


def test_at_level_current_the_setpoint_shown_is_the_command(python_controller):
    plug = python_controller("return Out([0.7, 0, 0], [0.1, 0.1, 0.1], flags=2)", BOTH)
    assert plug.level == "current" and ask(plug).setpoint == (0.7, 0.0, 0.0) and plug.flags == 2


@pytest.mark.parametrize(
    ("suffix", "level", "found"),
    [("", None, "current"), ("", "duty", "duty"), ("@duty", None, "duty"), ("@current", "current", "current")],
)
def test_the_level_is_chosen_by_the_user_else_by_the_class(python_controller, config, suffix, level, found):
    name = python_controller("return Out()", BOTH).name
    assert load_controller(name + suffix, config, level).level == found


@pytest.mark.parametrize(
    ("step", "sentence"),
    [
        ("return Out([0.1, math.nan, 0])", r"command\[1\] is nan, expected 0 to 1"),
        ("return Out([0.1, 0, math.inf])", r"command\[2\] is inf"),
        ("return Out([0.1, 0, 1.5])", r"command\[2\] is 1.5, expected 0 to 1"),
        ("return Out([0.1, 0])", "command has 2 numbers, expected 3"),
        ("return Out(0.5)", "command is 0.5, expected 3 numbers"),
        ("return Out([0, 0, 0], [0, math.nan, 0])", r"setpoint\[1\] is nan"),
        ("return Out([0, 0, 0], [0])", "setpoint has 1 numbers"),
        ("return Out(gear=3)", "gear is 3, expected 0"),
        ("return Out(flags=8)", "flags is 8, expected 0 to 7"),
        ("return Out(flags='a')", "flags is 'a'"),
        ("return None", "returned NoneType without 'command'"),
        ("return [0.1, 0.1, 0.1]", "returned list without 'command'"),
        ("return Out(status=7)", "status is 7, expected 0"),
        ("import numpy\nreturn Out(gear=numpy.zeros(2))", "outputs cannot be read: ValueError"),
        ("return Out(status=Status.ERROR, message='no speed\\nsignal')", "status error: no speed signal$"),
        ("return Out(status=Status.ERROR)", "status error: it gave no reason"),
        ("x = 0\nreturn 1 / x", r"step failed: mine.py line 11: ZeroDivisionError: division by zero"),
        ("return math.sqrt('a')", r"mine.py line 10: TypeError"),
        ("sys.exit(3)", r"mine.py line 10: SystemExit: 3"),
        ("import json\nreturn json.loads('{')", r"mine.py line 11: JSONDecodeError"),
    ],
)
def test_what_no_valve_can_be_given_is_an_error_in_one_sentence(python_controller, tmp_path, step, sentence):
    plug = python_controller(step, where="@in-process")  # test_python_process.py has what a process of its own adds
    with pytest.raises(ControllerFailed, match=sentence) as failure:
        ask(plug, 5)
    assert f"{plug.name}, sample 5: " in str(failure.value) and "\n" not in str(failure.value)
    assert failure.value.status == Status.ERROR and failure.value.exit_code == 1
    plug.close()
    assert (tmp_path / "mine.py.ended").read_text() == "x", "terminate is called once after an error"


def test_level_current_is_held_to_the_current_of_the_valves(python_controller):
    with pytest.raises(ControllerFailed, match=r"command\[0\] is 0.9, expected 0 to 0.8 A"):
        ask(python_controller("return Out([0.9, 0, 0])", BOTH))


def test_after_fatal_nothing_is_called_again(python_controller, tmp_path):
    plug = python_controller("return Out(status=Status.FATAL, message='memory is gone')")
    with pytest.raises(ControllerFailed, match="status fatal: memory is gone"):
        ask(plug)
    with pytest.raises(ControllerFailed, match="has ended"):
        ask(plug, 1)
    plug.close()
    assert not (tmp_path / "mine.py.ended").exists()


def test_a_discarded_sample_has_no_answer(python_controller):
    plug = python_controller("return Out(status=Status.DISCARD) if inputs.sample % 2 else Out([1, 0, 0], gear=1)")
    assert [ask(plug, sample) is None for sample in range(4)] == [False, True, False, True]
    assert plug.gear == 1


def test_a_failing_terminate_is_told_and_harms_nobody(python_controller):
    plug = python_controller("self.terminate = lambda: 1 / 0\nreturn Out()")
    ask(plug)
    plug.close()
    plug.close()
    assert plug.end_fault == "terminate failed: mine.py line 10: ZeroDivisionError: division by zero"


def test_orders_are_refused_by_what_the_controller_says(python_controller):
    plug = python_controller("return Out(gear=inputs.gear_request, shifting=inputs.sample < 3)")
    plug.order(1)
    with pytest.raises(RigError, match="a shift to I is still running"):
        plug.order(2)
    for sample in range(3):
        ask(plug, sample)
        with pytest.raises(RigError, match="still running"):
            plug.order(2)
    ask(plug, 3)
    with pytest.raises(RigError, match="gear I is already ordered"):
        plug.order(1)
    with pytest.raises(RigError, match="there is no gear 4"):
        plug.order(4)
    plug.order(2)
    ask(plug, 4)
    assert plug.gear == 2


@pytest.mark.parametrize(
    ("text", "name", "sentence"),
    [
        ("class Mine:\n    def step(self, i): pass\n", "Mine", "no method initialize, terminate"),
        ("class Mine:\n    def step(self, i): pass\n", "Yours", "class with a step 'Yours'; known are Mine"),
        ("x = (\n", "Mine", "cannot be loaded: line 1: SyntaxError"),
        ("import math\n\n1 / 0\n", "Mine", "cannot be loaded: mine.py line 3: ZeroDivisionError"),
        ("import not_there_at_all\n", "Mine", "mine.py line 1: ModuleNotFoundError: No module named 'not_there_at_all'"),
        ("class Mine:\n    levels = ('volts',)\n    initialize = step = terminate = print\n", "Mine", "levels is"),
        (
            "class Mine:\n    step = terminate = print\n    def initialize(self, info):\n        raise KeyError('t13')\n",
            "Mine",
            "initialize failed: mine.py line 4: KeyError: 't13'",
        ),
    ],
)
def test_code_that_does_not_fit_is_refused_before_the_run(tmp_path, config, text, name, sentence):
    path = tmp_path / "mine.py"
    path.write_text(text)
    with pytest.raises(RigError, match=sentence) as refusal:
        load_controller(f"python:{path}:{name}", config)
    assert refusal.value.exit_code == 2 and "\n" not in str(refusal.value)


@pytest.mark.parametrize(
    ("spec", "level", "sentence"),
    [
        ("python:nowhere.py:Mine", None, "no such file"),
        ("python:rig_nodes.nowhere:Mine", None, "no module 'rig_nodes.nowhere'"),
        ("python:mine.py", None, "expected python:FILE.py:CLASS"),
        ("c:", None, "expected alfa46, python:"),
        ("labview:model", None, "kind 'labview'; .*expected alfa46, python:"),
        ("new/my_controller.c", None, r"cannot be loaded; did you mean c:new/my_controller\.c\?"),
        ("c:x.c@currant", None, "there is no level 'currant'; expected duty or current behind the @"),
        ("c:/", None, "controller c:/: it is a folder, expected a file"),
        ("fmu:/", None, "controller fmu:/: it is a folder, expected a file"),
        ("alfa46@current", "duty", "name one level"),
        ("alfa46", "volts", "expected duty or current"),
    ],
)
def test_specifications_that_mean_nothing_are_refused(config, spec, level, sentence):
    with pytest.raises(RigError, match=sentence):
        load_controller(spec, config, level)


def test_a_level_that_the_class_does_not_know_is_refused(python_controller):
    with pytest.raises(RigError, match="works at level duty, not at level 'current'"):
        python_controller("return Out()", level="current")


def test_the_file_finds_its_neighbours(tmp_path, config):
    (tmp_path / "ramps_of_mine.py").write_text("LEVEL = 0.5\n")
    (tmp_path / "mine.py").write_text(
        "import ramps_of_mine\nfrom rig_nodes.controllers import ControllerOutputs\n"
        "class Mine:\n    def initialize(self, info): pass\n    def terminate(self): pass\n"
        "    def step(self, inputs): return ControllerOutputs([ramps_of_mine.LEVEL] * 3)\n"
    )
    assert ask(load_controller(f"python:{tmp_path / 'mine.py'}:Mine", config)).command == (0.5, 0.5, 0.5)
