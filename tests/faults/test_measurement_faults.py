# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Faults of what a plugged controller is told: late, lost and corrupted measurements; what the rig records of them stays true.

tests/graph/test_faults_in_a_run.py has them on the graph.
"""

import pickle

import pytest

from rig_nodes.bags.reader import Bag
from rig_nodes.base.errors import RigError
from rig_nodes.cli.main import main
from rig_nodes.controllers.load import load_controller
from rig_nodes.controllers.plug import BuiltIn
from rig_nodes.rig.configuration import load_rig
from rig_nodes.rig.faults import faults_of
from rig_nodes.runs.rig import Rig
from rig_nodes.runs.sequence import load_sequence
from rig_nodes.runs.session import Session
from rig_nodes.runs.simulation import simulate

ON = {"faults": "on"}
ALL = "measurements.late, size=4 ms; measurements.lost, size=20 %; measurements.corrupted, size=1 %"
SEQUENCE = """
description: a short shift
rig: hydmag
steps:
  - oil: {pressure: 4 MPa}
  - wait: {for: 200 ms}
  - shift: {to: I}
  - wait: {for: 200 ms}
"""


class Listening(BuiltIn):
    """The Alfa46 behind the seam, which notes what it is given of each sample."""

    wants = ("p_p",)

    def __init__(self, config):
        super().__init__(config)
        self.numbers, self.given = [], []

    def _answer(self, inputs):
        self.numbers.append(inputs.sample)
        self.given.append((inputs.current, inputs.measured, inputs.others["p_p"]))
        return super()._answer(inputs)


def course(faults, samples=240):
    """Returns for each sample of a session what the wires carried, and what the controller was given."""
    config = load_rig("hydmag", {"faults": faults})
    plug, true = Listening(config), []
    with Session(config, 1, plug) as session:
        session.set("oil", "4 MPa")
        session.set("shift", "I")
        for _ in range(samples):
            current, measured = session.rig.seen()
            true.append((tuple(current), tuple(measured), session.read("p_p")))
            session.advance(0.001)
    assert plug.numbers == list(range(samples)), "it is asked at each tick of its clock"
    return true, plug.given


def test_late_measurements_are_those_of_before_and_none_overtakes_another():
    true, given = course("measurements.late, size=30 ms, at=50 ms, for=100 ms")
    assert given[:50] == true[:50]
    assert given[50:80] == [true[49]] * 30, "the newest that was there"
    assert given[80:179] == true[50:149]
    assert given[179:] == true[179:], "those that were sent behind the fault came with its last one"


def test_lost_measurements_leave_the_controller_the_last_ones():
    true, given = course("measurements.lost, size=100 %, at=50 ms, for=50 ms")
    assert given[:50] == true[:50] and given[50:100] == [true[49]] * 50 and given[100:] == true[100:]
    true, given = course("measurements.lost, size=30 %", 400)
    stale = [k for k in range(1, 400) if given[k] != true[k]]
    assert given[0] == true[0] and all(given[k] == given[k - 1] for k in stale)
    assert 0.2 < len(stale) / 400 < 0.4
    assert course("measurements.lost, size=100 %", 20)[1] == [true[0]] * 20, "from the very first on, which is there"


def test_corrupted_measurements_are_in_their_ranges_and_gone_with_the_next():
    true, given = course("measurements.corrupted, size=10 %", 400)
    wrong = [k for k in range(400) if given[k] != true[k]]
    assert 0.05 < len(wrong) / 400 < 0.15
    config = load_rig("hydmag")
    names, signals = Listening(config).rig_record.names, config.catalogue.signals
    for k in wrong:
        current, measured, supply = given[k]
        assert all(signals[name].low <= value <= signals[name].high for name, value in zip(names, measured))
        assert signals["p_p"].low <= supply <= signals["p_p"].high and current[2] == 0.0, "no valve, no wire"
        assert measured[0] != true[k][1][0]


def test_late_and_lost_together_give_the_newest_of_those_that_came():
    true, given = course("measurements.late, size=10 ms; measurements.lost, size=30 %")
    which = [true.index(one) for one in given]
    assert which == sorted(which) and which[:10] == [0] * 10
    assert all(0 <= k - 10 - number < 10 for k, number in enumerate(which) if k >= 20)


def simulated(folder, spec, faults=ALL):
    folder.mkdir(exist_ok=True)
    (folder / "sequence.yaml").write_text(SEQUENCE)
    config = load_rig("hydmag", {"faults": faults})
    plug = spec(config) if callable(spec) else load_controller(spec, config)
    sequence = load_sequence(folder / "sequence.yaml", config=config, rig="hydmag")
    simulate(config, sequence, folder / "run", controller=plug)
    return Bag(folder / "run"), plug


def test_what_is_recorded_stays_true(tmp_path):
    bag, plug = simulated(tmp_path, Listening, "measurements.late, size=30 ms")
    rows = [tuple(message.measured) for _, message in bag.messages("/instruments/controller")]
    told = [measured for _, measured, _ in plug.given]
    assert told[:30] == rows[:1] * 30 and told[30:] == rows[: len(told) - 30]


@pytest.mark.parametrize("kind", ["python:rig_nodes.controllers.examples.alfa46:Alfa46", "c:{examples}/alfa46.c"])
def test_controllers_of_the_same_law_are_told_the_same_behind_each_plug(tmp_path, kind):
    from rig_nodes.controllers import examples

    ours, theirs = (
        simulated(tmp_path / name, spec)[0].canonical_hash()
        for name, spec in (("ours", "alfa46"), ("theirs", kind.format(examples=examples.__path__[0])))
    )
    healthy = simulated(tmp_path / "healthy", "alfa46", "on")[0].canonical_hash()
    assert ours["/controller/command"] == theirs["/controller/command"] != healthy["/controller/command"]


def told(rig, samples):
    out = []
    for _ in range(samples):
        out.append(rig.handed(["p_p"]))
        rig.advance_samples(1)
        rig.set_duty(rig.sample - 1, [0.0] * 3, [0.0] * 3, 0, False)
    return out


def test_a_snapshot_has_what_is_on_its_way():
    config = load_rig("hydmag", {"faults": "measurements.late, size=20 ms; measurements.lost, size=30 %"})
    rig, other = (Rig(config, controller="plugged") for _ in range(2))
    told(rig, 40)
    kept = rig.snapshot()
    on = told(rig, 40)
    for one, moment in ((rig, kept), (other, pickle.loads(pickle.dumps(kept)))):
        one.restore(moment)
        assert told(one, 40) == on


def test_after_a_reset_nothing_of_before_is_on_its_way():
    rig = Rig(load_rig("hydmag", {"faults": "measurements.late, size=20 ms"}), controller="plugged")
    told(rig, 40)
    rig.trip("a reason of the test", "test")
    rig.advance_samples(5)
    rig.reset()
    assert rig.handed([])[1] == rig.seen()[1]


def test_it_is_refused_where_nobody_is_told_anything():
    with pytest.raises(RigError, match="the Alfa46 runs inside the rig, without messages"):
        Rig(load_rig("hydmag", {"faults": "measurements.lost"}))
    sentence = r"^fault measurements\.late refused: here all read the rig's measurements from the same topics or outputs; "
    with pytest.raises(RigError, match=sentence):
        Rig(load_rig("hydmag", {"faults": "measurements.late"}), controller="external")
    config = load_rig("hydmag", ON)
    with Session(config, controller="external") as by_hand, pytest.raises(RigError, match=sentence):
        by_hand.fault("measurements.late")
    with Session(config, controller=load_controller("alfa46", config)) as session:
        session.advance(0.01)
        session.set("duty", [0.0, 0.0, 0.0])  # a person takes over
        with pytest.raises(RigError, match=sentence):
            session.fault("measurements.late")


def test_each_way_has_a_number_of_its_own():
    known = faults_of(load_rig("hydmag"))
    owners = {}
    for one in known.values():
        owners.setdefault(one.spn, set()).add(one.fault.part)
    assert known["measurements.late"].spn == 522_560 and known["messages.late"].spn == 522_464
    assert owners[522_560] == {"measurements"} and owners[522_464] == {"messages"}


def test_a_rerun_repeats_them_through_the_plant_and_not_through_a_controller(tmp_path, capsys):
    simulated(tmp_path, "alfa46")
    run, again = str(tmp_path / "run"), str(tmp_path / "again")
    assert main(["rerun", run, "--through", "plant", "--out", again]) == 0
    assert "bit for bit as recorded" in capsys.readouterr().out
    assert main(["rerun", run, "--through", "controller", "alfa46", "--out", str(tmp_path / "other")]) == 2
    said = capsys.readouterr().err
    assert "holds what was measured, and not what its controller was told with the fault measurements.late: delay 4 ms" in said
    assert not (tmp_path / "other").exists()
