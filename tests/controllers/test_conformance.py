# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""`rig controller check`: the reference passes, and each fault for which it checks is found and named."""

import json

import pytest

from rig_nodes.cli.main import main
from rig_nodes.runs import conformance
from rig_nodes.runs.conformance import Check

from .conftest import ALFA46_C, PYTHON, C

HEAD = """
import random
import time
from rig_nodes.controllers import ControllerOutputs, Status
from rig_nodes.controllers.examples.alfa46 import Alfa46

class Mine(Alfa46):
    def step(self, inputs):
        out = super().step(inputs)
        WHAT
        return out
"""


def table(capsys, *arguments):
    """Returns the exit code of a check and its table {item: (ok, text)}."""
    code = main(["controller", "check", "--json", *arguments])
    found = json.loads(capsys.readouterr().out)
    assert found["ok"] is (code == 0)
    return code, {item["name"]: (item["ok"], item["text"]) for item in found["items"]}


# test_templates.py has the check of a class and of a library in every run of the tests
@pytest.mark.parametrize(
    "spec", ["alfa46", *(pytest.param(spec, marks=pytest.mark.campaign) for spec in (PYTHON, C, f"{PYTHON}@current"))]
)
def test_the_reference_passes(capsys, spec):
    code, items = table(capsys, spec)
    assert code == 0, items
    assert len(items) == 13


@pytest.mark.parametrize(
    ("what", "item", "sentence"),
    [
        ("out.command = [2.0, 0, 0]", "answers", "command[0] is 2, expected 0 to 1"),
        ("out = None", "answers", "returned NoneType without 'command'"),
        (
            "if 300 <= inputs.sample < 420: out.status = Status.DISCARD",
            "answers",
            "120 samples one after the other without an answer: the rig trips",
        ),
        ("out.command = [max(out.command[0], 0.1), 0, 0]", "at rest", "before the first order the largest command is 0.1"),
        ("if inputs.sample > 200: out.command = [random.random(), 0, 0]", "determinism", "another answer from sample 201 on"),
        ("if inputs.n_wej != inputs.n_wej: while_true = 1 / 0", "NaN", "trip the rig"),
        ("if inputs.p1 > 1e7: out.command = [1.5, 0, 0]", "saturation", "command[0] is 1.5"),
        ("out.command = [0.0, 0.0, 0.0]", "both gears", "reports gear I, and no clutch is locked; expected S1"),
        ("if inputs.sample > 3000: out.shifting = True", "request storm", ", shifting"),
        ("assert inputs.sample < 10_000", "late start", "AssertionError"),
        (
            "self.n = getattr(self, 'n', inputs.sample - 1) + 1\n        assert self.n == inputs.sample",
            "lost samples",
            "AssertionError",
        ),
    ],
)
def test_each_fault_is_found_by_its_item(tmp_path, config, monkeypatch, what, item, sentence):
    # long enough for each fault; the references above have the whole length
    monkeypatch.setattr(conformance, "DESK_SAMPLES", 1600)
    monkeypatch.setattr(conformance, "SHIFT", 2.0)
    for other in {"determinism", "restart", "late start", "lost samples", "NaN", "saturation", "both gears"} - {item}:
        monkeypatch.setattr(Check, f"_{other.replace(' ', '_').lower()}", lambda _: (True, "not of interest here"))
    path = tmp_path / "mine.py"
    path.write_text(HEAD.replace("WHAT", what))
    found = next(found for found in Check(f"python:{path}:Mine", config).items() if found.name == item)
    assert sentence in found.text and found.ok is (item == "NaN") and "\n" not in found.text


@pytest.mark.parametrize(
    ("old", "new", "item", "sentence"),
    [
        (
            "free(instance);",
            "free(instance); abort();",
            "ends",
            "in rig_controller_destroy the library's process was ended by SIGABRT (aborted); 12 of 12 ends",
        ),
        (
            "  return RIG_OK;\n}\n\nvoid rig",
            "  memset(&outputs[1], 7, 64);\n  return RIG_OK;\n}\n\nvoid rig",
            "answers",
            "the library wrote 64 bytes behind out of rig_controller_step; that memory is not its own",
        ),
    ],
)
def test_what_a_library_spoils_is_found_by_its_item(tmp_path, capsys, monkeypatch, old, new, item, sentence):
    monkeypatch.setattr(conformance, "DESK_SAMPLES", 1600)
    text = ALFA46_C.read_text()
    assert old in text
    (tmp_path / "mine.c").write_text("#include <stdlib.h>\n#include <string.h>\n" + text.replace(old, new))
    code, items = table(capsys, f"c:{tmp_path / 'mine.c'}")
    assert code == 1 and items[item][0] is False and items[item][1].endswith(sentence), items
    if item == "ends":
        assert [name for name, (ok, _) in items.items() if not ok] == ["ends"]


def test_a_slow_step_is_found(tmp_path, config):
    path = tmp_path / "mine.py"
    path.write_text(HEAD.replace("WHAT", "if inputs.sample % 8 == 0: time.sleep(0.0012)"))
    item = next(item for item in Check(f"python:{path}:Mine", config).items() if item.name == "timing")
    assert not item.ok and "real time takes one per 1000 us" in item.text


def test_what_does_not_load_is_one_line(capsys):
    code, items = table(capsys, "c:nowhere.so")
    assert code == 1 and items == {"loads": (False, "controller c:nowhere.so: there is no such file")}


def test_the_table_is_for_people(tmp_path, capsys):
    path = tmp_path / "mine.py"
    path.write_text(HEAD.replace("WHAT", "if inputs.sample > 5: raise RuntimeError('tired')"))
    assert main(["controller", "check", f"python:{path}:Mine"]) == 1
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("ok      loads          python:")
    assert lines[1].startswith("FAILED  answers        controller python:") and lines[1].endswith("RuntimeError: tired")
    assert [line for line in lines if line.startswith("not run ")] == [
        f"not run {name:<15}it needs what 'answers' did not get"
        for name in ("at rest", "timing", "determinism", "restart", "late start", "lost samples", "NaN")
    ]
    assert lines[-1] == "2 of 13 passed, 7 not run"


@pytest.mark.parametrize("what", ["raise GeneratorExit", "import os; os._exit(0)", "out.command = [float('nan'), 0, 0]"])
def test_a_controller_that_fails_every_item_gets_a_verdict_on_each(tmp_path, capsys, what):
    path = tmp_path / "mine.py"
    path.write_text(HEAD.replace("WHAT", what))
    code, items = table(capsys, f"python:{path}:Mine")
    assert code == 1 and len(items) == 13
    failed = [name for name, (ok, text) in items.items() if ok is False and f"controller python:{path}:Mine, sample " in text]
    assert failed == ["answers", "saturation", "both gears", "request storm"]
    if "_exit" in what:
        assert items["ends"] == (True, "ended 1 times, each in order; 4 times there was nothing to end after a fatal fault")


def test_a_fault_that_no_plug_foresaw_is_a_verdict_too(capsys, monkeypatch):
    monkeypatch.setattr("rig_nodes.runs.conformance.desk", lambda *_: {}["gear"])
    code, items = table(capsys, "alfa46")
    assert code == 1 and items["answers"] == (False, "the check could not go on: KeyError: 'gear'") and items["ends"][0]
