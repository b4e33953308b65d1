"""Which failures `rig test` tries once more: few, and only of tests that run against the clock."""

import json

import pytest

from rig_nodes.cli.test import failed_tests, may_try_again

CLOCK = "tests/graph/test_live_graph.py::test_torque_is_read_without_gaps_and_in_time"
PLAIN = "tests/plant/test_models.py::test_something"


@pytest.mark.parametrize("failed, again", [
    ([], False), ([CLOCK], True), ([CLOCK, PLAIN], False), ([f"{CLOCK}[{n}]" for n in range(6)], False)])
def test_only_a_few_failures_against_the_clock(failed, again):
    assert may_try_again(failed) is again


def test_the_failures_are_those_that_pytest_noted(tmp_path):
    assert failed_tests(tmp_path) == []
    notes = tmp_path / ".pytest_cache/v/cache/lastfailed"
    notes.parent.mkdir(parents=True)
    notes.write_text(json.dumps({CLOCK: True, PLAIN: True}))
    (tmp_path / "tests/graph").mkdir(parents=True)
    (tmp_path / CLOCK.split("::")[0]).write_text("")
    assert failed_tests(tmp_path) == [CLOCK], "what is gone from the checkout is not tried again"
