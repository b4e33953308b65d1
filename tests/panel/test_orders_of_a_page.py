# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Orders of an operator's page that need no running rig to be answered: too many at once, texts that are none, other failures."""

import asyncio
import json
from concurrent.futures import Future
from types import SimpleNamespace

import pytest

from rig_nodes.api import load
from rig_nodes.base import RigError
from rig_nodes.nodes.panel.measured import measured
from rig_nodes.nodes.panel.orders import AT_ONCE, obey
from rig_nodes.nodes.panel.page import Page


def answer_to(message, waiting=0, panel=None):
    """Returns what a page is told in answer to a message."""
    told = []
    page = SimpleNamespace(tell=told.append)
    asyncio.run(obey(panel, page, message if isinstance(message, str) else json.dumps(message), waiting))
    (answer,) = told
    return answer


def stopped():
    """Returns a panel whose rig stops at once."""
    done = Future()
    done.set_result("stopped")
    return SimpleNamespace(bench=SimpleNamespace(trigger=lambda name: done))


def test_an_emergency_stop_is_taken_beside_any_number_of_orders_that_wait():
    assert answer_to({"id": 7, "do": "e_stop"}, 2 * AT_ONCE - 1, stopped()) == {
        "kind": "answer",
        "id": 7,
        "ok": True,
        "text": "stopped",
    }
    refused = answer_to({"id": 8, "do": "gear", "gear": 1}, AT_ONCE)
    assert (refused["id"], refused["ok"], refused["text"]) == (8, False, "too many orders at once; wait for the answers")


@pytest.mark.parametrize("key", ["do", "name", "other"])
def test_half_a_letter_is_no_text(key):
    answer = answer_to(json.dumps({"id": 9, "do": "sequence", "name": "demo"} | {key: "\ud800"}))
    assert answer["ok"] is False and answer["text"].startswith("a message to the rig's page must be JSON, its texts Unicode")


def test_a_sequence_that_cannot_be_saved_is_refused_in_a_sentence(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "runs").write_text("")
    answer = answer_to({"id": 10, "do": "own sequence", "name": "mine", "content": "steps: []"})
    assert answer["ok"] is False and str(tmp_path / "runs") in answer["text"] and "\n" not in answer["text"]


def test_half_a_letter_of_others_reaches_a_page():
    sent = []
    socket = SimpleNamespace(write_message=lambda data, binary: sent.append(data.encode()) or Future())
    Page(socket).tell({"kind": "event", "text": "torn \ud800"})
    assert json.loads(sent[0])["text"] == "torn \ud800"


def test_a_measured_file_has_its_signals_in_the_rigs_units_around_its_orders(tmp_path):
    record = load("hydmag").config.as_dict()
    heads, t = ["t [ms]", "p1 [bar]", "p2 [bar]", "gear_ordered [-]"], range(0, 3000, 10)
    rows = [f"{k},{10 if k < 1500 else 0},0,{1 if k < 1500 else 2}" for k in t]
    file = tmp_path / "bench.csv"
    file.write_text("\n".join([",".join(heads), *rows, ""]))
    (part,) = (one for one in measured(file, record)["parts"] if one["way"] == "I -> II")
    before, after = (
        [v for at, v in zip(part["curves"]["p1"]["t"], part["curves"]["p1"]["v"]) if side * at > 0.0] for side in (-1, 1)
    )
    assert part["text"] == "I -> II at 1.500 s" and set(before) == {1.0} and set(after) == {0.0}, "MPa, ms after the order"
    file.write_text("t [s],p1 [rpm]\n0,1\n1,2\n")
    with pytest.raises(RigError) as refused:
        measured(file, record)
    assert str(refused.value).startswith("bench.csv: ") and "\n" not in str(refused.value)
