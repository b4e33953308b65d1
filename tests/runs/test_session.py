# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A rig stepped by hand: what is set acts, a branch from a snapshot is the run that was not interrupted, bit for bit."""

import doctest
import pickle
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from rig_nodes.base import RigError
from rig_nodes.controllers import load_controller
from rig_nodes.rig import load_rig, with_overrides
from rig_nodes.runs import Session, load_sequence, record
from rig_nodes.runs import session as module

OTHERS = ("three_speed", "hydmag_engine", "ural2", "chain_saw")


def given(setting, value: float) -> float | str:
    """A value as Session.set takes it: with its unit where a torque is possible too."""
    return f"{value!r} Pa" if "torque" in setting.setpoint.command.takes.values() else value


def begun(config, **options) -> Session:
    """A rig whose devices are all on, each at a third of its range, in its first gear when it has gears."""
    session = Session(config, **options)
    for step, setting in session.rig.settings.steps.items():
        session.set(step, given(setting, setting.low + (setting.high - setting.low) / 3.0))
    if session.rig.embedded:
        session.set("shift", config.transmission.names[1])
    session.advance(0.4)
    return session


def end_of(session: Session, seconds: float = 0.4) -> tuple:
    session.advance(seconds)
    rig = session.rig
    rows = rig.rows_at(rig.row_period, rig.sample * rig.rows_per_sample - 1000, 1000)
    return rig.state_hash(), rig.row().tobytes(), rows.tobytes(), session.events, session.status, session.reason


def check_branches(session: Session, other: Session) -> None:
    """The run goes on as one that was not interrupted: from the snapshot here, again, and pickled in another session."""
    kept = session.snapshot()
    hash_, row, rows, events, *state = end_of(session)
    straight = (hash_, row, rows, list(events), *state)
    for step, setting in session.rig.settings.steps.items():
        session.set(step, given(setting, setting.low))
    session.advance(0.1)
    for one, moment in ((session, kept), (session, kept), (other, pickle.loads(pickle.dumps(kept)))):
        one.restore(moment)
        assert one.time == kept.time
        assert end_of(one) == straight


def test_the_example_of_the_class_is_true():
    assert doctest.testmod(module).failed == 0


@pytest.mark.parametrize("name", OTHERS)
def test_a_branch_is_the_run_that_was_not_interrupted(name):
    config = load_rig(name)
    check_branches(begun(config), Session(load_rig(name)))


def test_a_branch_in_the_middle_of_a_shift(config):
    session = begun(config)
    session.advance(0.6)
    session.set("shift", "II")
    session.advance(0.15)
    assert session.shifting
    check_branches(session, Session(config))


def test_a_branch_at_an_order_that_the_controller_has_not_taken(config):
    session = begun(config)
    session.advance(0.6)
    session.set("shift", "II")
    assert not session.shifting
    check_branches(session, Session(config))
    assert session.gear == "II"


def test_a_branch_of_changed_settings_takes_them_along(config):
    session = begun(config)
    session.set("alfa46.t12", "-100 ms")
    session.set("instruments.noise.p1", "50 kPa")
    session.set("oil_supply.temperature", "60 degC")
    session.advance(0.6)
    session.set("shift", "II")
    other = Session(config)
    check_branches(session, other)
    assert other.rig.config.alfa46.values.t12 == -0.1 and other.rig.value("instruments.noise.p1") == 50e3


@pytest.mark.parametrize("level,delay", [("current", 1), ("current", 7), ("duty", 3), ("duty", 0)])
def test_a_branch_of_commands_from_outside_that_are_on_their_way(config, level, delay):
    options = {"controller": "external", "level": level, "delay": delay}
    session = Session(config, **options)
    session.set("oil", 4e6)
    session.set("motor", "300 rpm")
    for k in range(30):
        session.set(level, [0.01 * k, 0.0, 0.0])
        session.advance(0.001)
    check_branches(session, Session(config, **options))


def test_a_branch_after_a_trip_keeps_its_reason(config):
    session = begun(config)
    session.rig.trip("a reason of the test", "test")
    check_branches(session, Session(config))
    assert session.status == "tripped" and session.reason == "a reason of the test"
    session.reset()
    assert session.status in ("ready", "starting") and not session.reason


def test_a_branch_of_a_rig_with_devices_cut_out():
    config = with_overrides(load_rig("hydmag"), {"motor.source": "topic", "valve_zr_p1.source": "topic"})
    check_branches(begun(config), Session(config))


def test_a_snapshot_of_something_else_is_refused_with_what_differs(config):
    kept = begun(config).snapshot()
    with pytest.raises(RigError, match="the snapshot is of a run with seed 1, and this one has seed 2"):
        Session(config, seed=2).restore(kept)
    with pytest.raises(RigError, match=r"another configuration \(load_pump differ\)"):
        Session(with_overrides(config, {"load_pump.displacement": "30 cm3/rev"})).restore(kept)
    with pytest.raises(RigError, match="the snapshot is of the rig 'hydmag', and this one is 'three_speed'"):
        Session(load_rig("three_speed")).restore(kept)
    for version, said in (("2.0.0 (01ab)", r"2.0.0 \(01ab\)"), ("", "of an earlier version")):
        with pytest.raises(RigError, match=f"^the snapshot is of rig_nodes {said}, and this is .*; make a new one$"):
            Session(config).restore(replace(kept, rig=replace(kept.rig, version=version)))


IN_ANOTHER_PROCESS = """\
import pickle, sys
import rig_nodes

session = rig_nodes.load("hydmag").session()
with open(sys.argv[1], "rb") as file:
    session.restore(pickle.load(file))
session.advance(0.4)
print(session.time, session.rig.state_hash())
"""


def test_a_branch_in_another_process_is_the_run_that_was_not_interrupted(config, tmp_path):
    session = begun(config)
    (tmp_path / "kept").write_bytes(pickle.dumps(session.snapshot()))
    command = [sys.executable, "-c", IN_ANOTHER_PROCESS, str(tmp_path / "kept")]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    session.advance(0.4)
    assert done.stdout.split() == [str(session.time), session.rig.state_hash()]


def test_a_warning_is_an_event_of_the_branch_in_which_it_came():
    session = Session(load_rig("hydmag", {"trips.overspeed_w0.limit": "1000 rpm"}))
    start = session.snapshot()
    session.set("motor", "1500 rpm")
    session.advance(3.0)
    (warned, name, text, _), (tripped, *_) = session.events
    assert name == "rig_warning" and text.startswith("warning overspeed_w0: the speed of w0 is 9")
    assert session.status == "tripped" and 0.0 < warned < tripped < session.time
    session.restore(start)
    session.set("motor", "1500 rpm")
    session.rig.advance(warned)
    assert len(session.rig.warnings) == 1  # which nobody has taken
    session.restore(start)
    session.advance(0.1)
    assert session.events == []


def test_a_session_that_plays_a_sequence_is_its_run(config):
    sequence = load_sequence("demo", config=config, rig="hydmag")
    run, session = record(config, sequence, 3), Session(config, 3)
    session.play(sequence, 2)
    assert [event[1] for event in session.events if event[1] == "shift_ordered"] == ["shift_ordered"] * 2
    ordered = session.time
    session.advance(0.6)
    rows = session.rig.rows_at(1e-4, round(ordered * 1e4), 6000)
    first = round(ordered * 1e4)
    for name, column in run.recording.channels.items():
        assert np.array_equal(column[first : first + 6000], rows[:, session.rig.channels.index(name)]), name
    assert session.events == [event for event in run.events if event[0] <= ordered]


def test_a_command_by_hand_takes_over_from_a_plugged_controller(config):
    with Session(config, controller=load_controller("alfa46", config, "current")) as session:
        session.set("oil", "4 MPa")
        session.set("shift", "I")
        session.advance(0.5)
        with pytest.raises(RigError, match="has no snapshots"):
            session.snapshot()
        held = session.rig.setpoint.tolist()
        session.set("current", held)
        session.advance(1.0)
        assert session.status == "ready" and session.true("s1_mode") == 2.0
        session.snapshot()


def test_readings_are_of_transducers_and_true_values_apart(config):
    session = begun(config)
    assert session.read("p_p") == pytest.approx(session.true("p_p"), rel=0.05)
    assert session.read("p_p") != session.true("p_p")
    with pytest.raises(RigError, match="'s1_slip' is not a transducer"):
        session.read("s1_slip")
    with pytest.raises(RigError, match="there is no signal 's1_slop'; did you mean 's1_slip'"):
        session.true("s1_slop")


@pytest.mark.parametrize("name", ["hydmag", *OTHERS])
def test_every_signal_has_a_true_value(name):
    session = Session(load_rig(name))
    session.advance(0.01)
    values = [session.true(signal) for signal in session.rig.config.catalogue.signals]
    assert np.isfinite(values).all()


def test_a_torque_is_taken_for_a_load(config):
    session = begun(config)
    session.set("motor", "1500 rpm")
    session.advance(3.0)
    session.set("load", "80 Nm")
    session.advance(1.0)
    assert session.read("M_wyj") == pytest.approx(80.0, abs=2.0)
    session.set("load", None)
    session.advance(1.0)
    assert session.read("M_wyj") < 20.0


@pytest.mark.parametrize(
    "name,value,sentence",
    [
        ("motr", 1.0, "there is no setpoint or setting 'motr'; did you mean 'motor'"),
        ("motor", "3 MPa", "motor: '3 MPa' is a pressure, expected an angular velocity"),
        ("motor", 1e4, "motor.speed of 10000 rad/s refused; expected 0 to"),
        ("shift", "V", "there is no gear 'V'; known are neutral, I, II"),
        ("current", [0.1, 0.0, 0.0], "this rig runs its controller inside"),
        ("wet_clutch.mass", 1.0, "there is no setpoint or setting"),
        ("motor", object(), "motor is <object object.*; expected a number in SI, or a text with its unit"),
        ("alfa46.t12", [1.0], r"alfa46.t12 is \[1.0\]; expected a number in SI"),
        ("load", 40.0, "load is 40 without a unit, and it takes a torque or a pressure; write '40 Nm' or '40 Pa'"),
        ("load", "-5 Nm", "load is -5 Nm; expected a torque of 0 Nm or more"),
        ("current", 0.7, r"current is 0.7; expected a number for each of output_1 \(valve_zr_p1\), output_2"),
        ("current", None, "current is None; expected a number for each of output_1"),
    ],
)
def test_what_cannot_be_set_is_refused_in_a_sentence(config, name, value, sentence):
    with pytest.raises(RigError, match=sentence):
        Session(config).set(name, value)


def test_wrong_commands_from_outside_are_refused(config):
    session = Session(config, controller="external")
    with pytest.raises(RigError, match=r"must be 3 finite numbers, one for each of output_1 \(valve_zr_p1\), .*, output_3$"):
        session.set("current", [0.1])
    session.set("current", [0.1, 0.0, 0.0])
    with pytest.raises(RigError, match="a command for this millisecond already"):
        session.set("current", [0.2, 0.0, 0.0])
    session.advance(1.0)
    assert session.status == "ready"
    with pytest.raises(RigError, match="takes commands at level 'current', found one at level 'duty'"):
        session.set("duty", [0.1, 0.0, 0.0])
    with pytest.raises(RigError, match="cannot advance by 0.0001 s"):
        session.advance(1e-4)


def test_times_have_units_and_other_objects_are_refused_in_a_sentence(config):
    session = Session(config)
    session.advance("20 ms")
    assert session.time == 0.02
    for call, sentence in (
        (lambda: session.advance(None), "dt is None; expected a number in SI, or a text with its unit"),
        (lambda: session.advance("1 rpm"), "dt: '1 rpm' is an angular velocity, expected a time"),
        (lambda: session.restore(None), r"restore takes a result of snapshot\(\), found None"),
        (lambda: session.restore({}), "restore takes a result of snapshot"),
        (lambda: session.play("demo"), "play takes a sequence as rig_nodes.runs.load_sequence returns it, found 'demo'"),
        (lambda: session.read("n_wejj"), "'n_wejj' is not a transducer; did you mean 'n_wej'"),
    ):
        with pytest.raises(RigError, match=sentence):
            call()


def test_a_session_shows_its_state_to_people(config):
    session = begun(config)
    assert repr(session) == "<Session hydmag: seed 1, 0.400 s, running, gear I, shifting>"
    shown = session._repr_html_()
    assert "<td>p_p</td>" in shown and "MPa" in shown and "0.400 s" in shown


DISCARDS = """\
from rig_nodes.controllers import ControllerOutputs, Status


class Discards:
    levels = ("duty",)

    def initialize(self, info): self.asked = 0

    def step(self, inputs):
        self.asked += 1
        discards = FIRST < self.asked <= LAST
        return ControllerOutputs(status=Status.DISCARD) if discards else ControllerOutputs([0.0, 0.0, 0.0])

    def terminate(self): pass
"""


@pytest.mark.parametrize("discarded, reason", [(30, ""), (1000, "none of the first 101 samples after the reset was answered")])
def test_after_a_reset_a_controller_has_its_time_for_the_first_answer_again(config, tmp_path, discarded, reason):
    (tmp_path / "mine.py").write_text(DISCARDS.replace("FIRST", "200").replace("LAST", str(200 + discarded)))
    with Session(config, controller=load_controller(f"python:{tmp_path / 'mine.py'}:Discards", config)) as session:
        session.advance(0.2)
        session.rig.e_stop()
        session.advance(0.01)
        session.reset()
        session.advance(0.09)
        assert session.status != "tripped", session.reason
        session.advance(0.1)
        assert (reason in session.reason and session.status == "tripped") if reason else session.status == "ready"
