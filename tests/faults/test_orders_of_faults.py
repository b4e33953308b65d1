# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Orders of faults: by sequence, command line, session and set; when they act, what a run says of them, and what is refused."""

import json

import numpy as np
import pytest

import rig_nodes
from rig_nodes.bags.reader import Bag
from rig_nodes.base.errors import RigError
from rig_nodes.cli.main import main
from rig_nodes.controllers.load import load_controller
from rig_nodes.rig.configuration import load_rig
from rig_nodes.rig.faults import orders_by_name, read_fault
from rig_nodes.rig.recorded_rig import config_of_record
from rig_nodes.runs.rig import Rig
from rig_nodes.runs.sequence import load_sequence
from rig_nodes.runs.session import Session
from rig_nodes.runs.simulation import simulate

ON = {"faults": "on"}
STEPS = """
description: a short shift
rig: hydmag
steps:
  - oil: {pressure: 4 MPa}
  - wait: {for: 200 ms}
"""


def simulated(folder, steps="", faults="on", controller=None, overrides=None):
    """Returns end, bag and fault events (time, name, text, value) of a simulation."""
    folder.mkdir(exist_ok=True)
    (folder / "sequence.yaml").write_text(STEPS + steps)
    config = load_rig("hydmag", {"faults": faults} | (overrides or {}))
    plug = load_controller(controller, config) if controller else None
    end = simulate(config, load_sequence(folder / "sequence.yaml", config=config, rig="hydmag"), folder / "run", controller=plug)[
        "end"
    ]
    bag = Bag(folder / "run")
    return end, bag, [(t, name, text, value) for t, _, name, text, value in bag.events() if name.startswith("fault")]


def test_a_step_begins_and_ends_a_fault_and_the_bag_says_so(tmp_path):
    steps = """
  - fault: {name: p1.offset, size: 2 %}
  - wait: {for: 100 ms}
  - fault: {name: p1.offset, off: true}
  - wait: {for: 100 ms}
"""
    end, bag, events = simulated(tmp_path, steps)
    assert end["state"] == "ended", end
    assert [(name, text) for _, name, text, _ in events] == [
        ("fault_ordered", "p1.offset, size=2 %"),
        ("fault_on", "p1.offset: share of the full scale 2 %, abrupt"),
        ("fault_ordered", "p1.offset, off=true"),
        ("fault_off", "p1.offset ended"),
    ]
    t, p1 = bag.series("p1")
    on, off = events[1][0], events[3][0]
    inside = (t > on + 0.02) & (t <= off)
    assert np.allclose(p1[inside], 0.8e6, atol=0.15e6) and np.allclose(p1[(t < on) | (t > off + 0.02)], 0.0, atol=0.15e6)
    assert config_of_record(bag.record, "bag").faults == ()


@pytest.mark.parametrize(
    "step", ["  - fault: {name: p1.offset}\n", "  - repeat: {times: 2, steps: [{fault: {name: p1.offset}}]}\n"]
)
def test_a_sequence_with_a_fault_is_refused_while_faults_are_disabled(tmp_path, capsys, step):
    (tmp_path / "ill.yaml").write_text(STEPS + step)
    assert main(["simulate", str(tmp_path / "ill.yaml"), "--out", str(tmp_path / "run")]) == 2
    said = capsys.readouterr().err
    assert "ill.yaml:7" in said and "faults are disabled" in said and "--faults" in said and not (tmp_path / "run").exists()


def test_a_session_refuses_an_order_while_faults_are_disabled():
    with rig_nodes.load("hydmag").session() as session, pytest.raises(RigError, match="faults are disabled"):
        session.fault("p1.stuck")


@pytest.mark.parametrize(
    "order, sentence",
    [
        ("p1.stuk", "there is no fault 'p1.stuk'; did you mean 'p1.stuck'"),
        ("p1.stuck, size=1 %", "has no size; it is there or not"),
        ("p1.stuck, onset=growing", "has no size, so it cannot grow"),
        ("p1.offset, size=3", "size is 3, expected -1 to 1"),
        ("p1.offset, size=3 MPa", "expected a ratio"),
        ("valve_zr_p1.coil_open, size=2e9 ohm", "expected 0 to 1 000 000 000 ohm"),
        ("p1.offset, onset=sudden", "onset is 'sudden', expected abrupt, growing, intermittent"),
        ("p1.offset, over=1 s", "over go with onset=growing"),
        ("p1.offset, off=true, at=1 s", "off takes true, and no other key"),
        ("p1.offset, when=p2 over 1 MPa", "expected SIGNAL above VALUE"),
        ("p1.offset, when=p3 above 1 MPa", "there is no signal 'p3'"),
        ("p1.offset, at", "expected KEY=VALUE"),
        ("p1.losing_pulses", "refused: it counts no pulses"),
        ("n_wej.delayed", "refused: it counts pulses"),
        ("p1.stuck, onset=intermittent, period=2 ms, share=20 %", "share is 20 %, expected 50 to 100 %"),
        ("p1.stuck, for=0 ms", "for is 0 ms, expected 1 to"),
        ("T_oil.swapped", "refused: the rig has no other one of its type"),
        ("valve_zr_p1.air", "there is no fault"),
    ],
)
def test_what_does_not_fit_is_refused_in_a_sentence(order, sentence):
    with pytest.raises(RigError) as refused:
        read_fault(load_rig("hydmag", ON), order, "--fault")
    assert sentence in str(refused.value)


def test_a_large_size_is_told_without_an_exponent(capsys):
    config = load_rig("hydmag", ON)
    assert "contact 1 000 000 ohm" in read_fault(config, "valve_zr_p1.coil_open", "--fault").sentence()
    assert main(["list", "faults", "--json", "-"]) == 0
    row = next(row for row in json.loads(capsys.readouterr().out) if row["name"] == "valve_zr_p1.coil_open")
    assert (row["usual"], row["range"]) == ("1000000", "0 to 1000000000"), "for a program it is a number"


def test_what_the_rig_as_it_is_cannot_have_is_refused():
    for settings, order, why in (
        ({"effects.transducers": "off"}, "p1.stuck", "true values are shown"),
        ({"motor.source": "topic"}, "motor.weak", "it stands outside the plant"),
        ({"effects.motor_speed": "off"}, "motor.weak", "effects.motor_speed is off"),
        ({"effects.current_loop": "off"}, "valve_zr_p1.coil_hot", "effects.current_loop is off"),
        ({"effects.oil_temperature": "off"}, "oil_supply.cold", "effects.oil_temperature is off"),
        ({"instruments.speed_step": "0 rpm"}, "n_wej.losing_pulses", "it counts no pulses"),
    ):
        with pytest.raises(RigError, match=why):
            load_rig("hydmag", {**settings, "faults": order})
    with pytest.raises(RigError, match="the Alfa46 runs inside the rig, without messages"):
        Rig(load_rig("hydmag", {"faults": "messages.lost"}))
    with pytest.raises(RigError, match="the shift controller is outside, and its fill times are its own"):
        Rig(load_rig("hydmag", {"faults": "output_1.fill_time"}), controller="external")
    with pytest.raises(RigError, match="n_wej.swapped exchanges the same two wires"):
        Rig(load_rig("hydmag", {"faults": "n_wej.swapped; n_wyj.swapped"}))


def test_one_fault_at_a_time_under_a_name_and_only_what_is_there_ends():
    with rig_nodes.load("hydmag", **ON).session() as session:
        session.fault("p1.stuck")
        with pytest.raises(RigError, match="is there already"):
            session.fault("p1.stuck")
        with pytest.raises(RigError, match=r"it is not there; there is p1\.stuck"):
            session.fault("p1.noise", off=True)


def test_time_signal_and_duration_trigger_it_at_their_sample(tmp_path):
    faults = (
        "oil_supply.air, at=123 ms, for=77 ms; p2.noise, when=p_p above 2 MPa, for=30 ms;"
        "p1.dropped, onset=intermittent, period=40 ms, share=25 %, at=0.3 s, for=100 ms;"
        "I_zr_p1.noise, when=I_set_zr_p1 above 0.1 A"
    )
    _, bag, events = simulated(tmp_path, "  - shift: {to: I}\n", faults)
    times = {(name, text.split(":")[0].split()[0]): t for t, name, text, _ in events}
    assert times["fault_on", "oil_supply.air"] == pytest.approx(0.123) and times["fault_off", "oil_supply.air"] == pytest.approx(
        0.2
    )
    t, supply = bag.series("p_p")
    reached = times["fault_on", "p2.noise"]
    assert reached % 0.005 < 1e-9 or reached % 0.005 > 0.0049
    assert supply[t < reached - 0.02].max() < 2.1e6 and supply[(t >= reached) & (t < reached + 0.02)].max() > 1.9e6
    assert times["fault_off", "p2.noise"] - reached == pytest.approx(0.03)
    assert times["fault_off", "p1.dropped"] - times["fault_on", "p1.dropped"] == pytest.approx(0.1)
    t, asked = bag.series("I_set_zr_p1")
    assert 0.0 <= times["fault_on", "I_zr_p1.noise"] - t[np.argmax(asked > 0.1)] < 0.007


def test_a_growing_fault_grows_evenly():
    with rig_nodes.load("hydmag", **ON).session() as session:
        session.advance(0.1)
        session.fault("p1.offset", size="10 %", onset="growing", over="1 s")
        shown = []
        for _ in range(4):
            session.advance(0.25)
            shown.append(session.read("p1"))
    assert np.allclose(shown, [1e6, 2e6, 3e6, 4e6], atol=0.15e6)


def test_how_time_is_divided_and_snapshots_change_no_bit():
    faults = (
        "valve_zr_p1.sticking, at=0.3 s; p2.offset, onset=growing, over=1 s; n_wej.swapped, at=0.4 s;"
        "oil_supply.cold, at=0.2 s, for=0.3 s; valve_zr_p1.leaking, at=0.101 s, onset=growing, over=0.6 s;"
        "p1.delayed, at=0.15 s, size=30 ms, onset=growing, over=0.2 s; output_1.fill_time, at=0.1 s"
    )
    config = load_rig("hydmag", {"faults": faults})

    def moved(pieces):
        rig = Rig(config, 1)
        rig.set("oil", 4e6, True)
        rig.order_gear(1)
        for samples in pieces:
            rig.advance_samples(samples)
            if pieces[0] == 7:
                rig.restore(rig.snapshot())
        return rig.state_hash(), rig.row().tobytes()

    assert moved([600]) == moved([1] * 600) == moved([7] * 85 + [5])


def test_a_healthy_run_has_the_same_bits_whether_faults_are_enabled_or_over():
    faults = "p1.dropped, at=0.2 s, for=20 ms; valve_zr_p2.coil_hot, at=0.2 s, for=50 ms"  # of what leaves nothing behind
    healthy, enabled, over = (Rig(load_rig("hydmag", one), 1) for one in ({}, ON, {"faults": faults}))
    for rig in (healthy, enabled, over):
        rig.set("oil", 4e6, True)
        rig.order_gear(1)
        rig.advance_samples(800)
    assert [one.name for one in over.faults.take_news()] == ["fault_on", "fault_on", "fault_off", "fault_off"]
    assert healthy.state_hash() == enabled.state_hash() == over.state_hash()


@pytest.mark.parametrize("step", ["100 us", "50 us"])
def test_a_delayed_reading_is_the_true_one_of_before(step):
    exact = {"p1_class": "0 %", "p1_hum": "0 Pa", "p1_pickup": "0 Pa"}
    with rig_nodes.load("hydmag", faults="on", kernel={"step": step}, instruments=exact).session(seed=1) as session:
        session.set("oil", "4 MPa")
        session.set("shift", "I")
        session.advance(0.1)
        session.fault("p1.delayed", size="40 ms")
        true, shown = [], []
        for _ in range(600):
            session.advance(0.001)
            true.append(session.true("p1"))
            shown.append(session.read("p1"))
    apart = {late: np.abs(np.array(shown[60:]) - true[60 - late : 600 - late]).max() for late in (30, 40, 50)}
    assert max(true) > 2e6 and apart[40] < 0.04e6 < min(apart[30], apart[50]), apart


def test_cold_oil_stays_as_cold_as_it_is_said_to_be_and_is_as_before_at_the_end():
    quick = {"tank_heat_capacity": "8000 J/K", "tank_cooling": "8000 W/K", "pump_flow": "0 l/min"}  # a tank that cools in seconds
    ill, healthy = (rig_nodes.load("hydmag", faults="on", oil_supply=quick).session(seed=1) for _ in range(2))
    with ill, healthy:
        ill.fault("oil_supply.cold", size="25 K")
        for end, colder in ((False, 25.0), (True, 0.0)):
            if end:
                ill.fault("oil_supply.cold", off=True)
            ill.advance(2.0)
            healthy.advance(2.0)
            assert healthy.true("T_oil") - ill.true("T_oil") == pytest.approx(colder, abs=0.5)


@pytest.mark.parametrize("size", [-60, 40])
def test_a_wrong_fill_time_moves_the_rise_of_the_current(size):
    risen = []
    for faults in ("on", f"output_1.fill_time, size={size} ms"):
        rig = Rig(load_rig("hydmag", {"faults": faults}))
        rig.order_gear(1)
        asked = []
        for _ in range(700):
            rig.advance_samples(1)
            asked.append(rig.setpoint[0])
        risen.append(np.argmax(np.array(asked) > 0.4))
    assert risen[1] - risen[0] == size


def test_messages_between_controller_and_rig_fail(tmp_path):
    steps = "  - shift: {to: I}\n"
    runs = {
        fault: simulated(tmp_path / str(number), steps, fault, "alfa46")
        for number, fault in enumerate(
            ["on", "messages.late, size=60 ms", "messages.lost, size=100 %, at=0.25 s", "messages.corrupted, size=20 %"]
        )
    }
    ends = [end for end, *_ in runs.values()]
    assert [end["state"] for end in ends] == ["ended", "ended", "tripped", "ended"]
    assert "valve commands older than 100 ms" in ends[2]["reason"]
    (t, healthy), (_, late), _, (_, corrupted) = (bag.series("I_zr_p1") for _, bag, _ in runs.values())
    size = min(len(healthy), len(late), len(corrupted))
    rises = [t[np.argmax(current[:size] > 0.02)] for current in (healthy, late)]
    assert 0.03 <= rises[1] - rises[0] < 0.2  # less than the delay, because the current loop has wound up meanwhile
    assert np.abs(np.diff(corrupted[:size])).max() > 1.3 * np.abs(np.diff(healthy[:size])).max()


def test_a_set_of_faults_is_a_file_and_random_is_drawn_by_the_seed(tmp_path, capsys):
    (tmp_path / "sequence.yaml").write_text(STEPS)
    (tmp_path / "ill.yaml").write_text("description: two\nfaults:\n  - name: p1.gain\n    at: 50 ms\n  - name: oil_supply.air\n")
    for number, names in enumerate((["--fault", str(tmp_path / "ill.yaml")], ["--fault", "random"], ["--fault", "random"])):
        assert main(["simulate", str(tmp_path / "sequence.yaml"), *names, "--seed", "5", "--out", str(tmp_path / str(number))]) == 0
    capsys.readouterr()
    sets, first, second = (
        json.loads((tmp_path / str(k) / "report.json").read_text())["run"]["configuration"]["faults"] for k in range(3)
    )
    assert sets == ["p1.gain, at=50 ms", "oil_supply.air"]
    assert first == second and len(first) == 1 and "at=" in first[0]
    drawn = orders_by_name(["random"] * 40 + [first[0]], "hydmag", 5, {}).split(";")
    assert len({order.partition(",")[0].strip() for order in drawn}) == 41


def test_the_list_has_all_of_a_rig_as_json(capsys):
    assert main(["list", "faults", "--json", "-"]) == 0
    rows = {row["name"]: row for row in json.loads(capsys.readouterr().out)}
    assert {"unit", "range", "usual", "onset", "one sees", "spn", "fmi", "refused"} <= rows["valve_zr_p1.coil_hot"].keys()
    assert rows["valve_zr_p1.coil_hot"]["unit"] == "K" and rows["p1.losing_pulses"]["refused"] == "it counts no pulses"
    assert len({(row["spn"], row["part"]) for row in rows.values() if row["part"] == "proportional_valve"}) == 4


def test_a_rerun_repeats_faults_and_report_and_figures_name_them(tmp_path, capsys):
    steps = "  - fault: {name: p1.offset}\n  - shift: {to: I}\n  - fault: {name: p1.offset, off: true}\n  - wait: {for: 100 ms}\n"
    simulated(tmp_path, steps, "oil_supply.air, at=0.4567 s; p2.offset, at=100 s")
    assert main(["report", str(tmp_path / "run")]) == 0
    said = capsys.readouterr().out
    assert said.count("fault ordered, but never begun: ") == 1 and "never begun: p2.offset, at=100 s" in said
    assert "fault injected: oil_supply.air: share of the volume at the atmosphere 5 %, abrupt, from 0.457 s on" in said
    assert "fault injected: p1.offset: share of the full scale 5 %, abrupt, from 0.205 s to" in said
    assert main(["rerun", str(tmp_path / "run"), "--through", "plant", "--out", str(tmp_path / "again")]) == 0
    assert "bit for bit as recorded" in capsys.readouterr().out
    figure = rig_nodes.open(tmp_path / "run").plot()
    written = {text.get_text() for text in figure.texts}
    assert {"oil_supply.air", "p1.offset"} <= written


@pytest.mark.parametrize("ends", [("p1", "p2"), ("p2", "p1")])
def test_two_swapped_wires_that_share_a_transducer_are_as_before_when_both_have_ended(ends):
    pressures = ("p1", "p2", "p_po", "p_p")
    ill, healthy = (rig_nodes.load("hydmag", faults="on", trips={"watched": "off"}).session() for _ in range(2))
    with ill, healthy:
        for session in (ill, healthy):
            session.set("oil", "4 MPa")
            session.set("shift", "I")
            session.advance(0.8)
        for name in ("p1", "p2"):
            ill.fault(f"{name}.swapped")
        ill.advance(0.1)
        healthy.advance(0.1)
        assert abs(ill.read("p1") - healthy.read("p1")) > 1e6, "p1 shows another wire"
        for name in ends:
            ill.fault(f"{name}.swapped", off=True)
        ill.advance(0.1)
        healthy.advance(0.1)
        for name in pressures:
            assert ill.read(name) == pytest.approx(healthy.read(name), abs=0.05e6), name


@pytest.mark.parametrize("fault", ["messages.lost, size=100 %", "messages.late, size=150 ms"])
def test_commands_that_are_lost_or_late_from_the_first_one_on_trip_for_their_age(tmp_path, fault):
    end, *_ = simulated(tmp_path, "  - wait: {for: 200 ms}\n", fault, "alfa46")
    assert end["state"] == "tripped" and end["trip"] == "controller_silent", end
    assert "valve commands older than 100 ms" in end["reason"]


def test_commands_that_come_too_late_trip_in_the_middle_of_a_run_and_again_after_a_reset():
    config = load_rig("hydmag", ON)
    with Session(config, controller=load_controller("alfa46", config)) as session:
        session.advance(0.3)
        for fault, size in (("messages.late", "150 ms"), ("messages.lost", "100 %")):
            session.fault(fault, size=size)
            session.advance(0.09)
            assert session.status != "tripped", session.reason
            session.advance(0.02)
            assert session.status == "tripped" and "valve commands older than 100 ms" in session.reason
            session.fault(fault, off=True)
            session.reset()
        session.advance(0.3)
        assert session.status == "ready"


def test_the_copy_of_a_command_acts_behind_the_next_command():
    rigs = [Rig(load_rig("hydmag", {"faults": fault}), controller="external") for fault in ("on", "messages.doubled, size=100 %")]
    on_the_coil = []
    for rig in rigs:
        on_the_coil.append([])
        for k in range(6):
            rig.set_duty(k, [0.01 * k, 0.0, 0.0], [0.0, 0.0, 0.0], 0, False)
            rig.advance_samples(1)
            on_the_coil[-1].append(round(rig.coil_duty("valve_zr_p1"), 6))
    healthy, doubled = on_the_coil
    assert healthy == [0.0, 0.01, 0.02, 0.03, 0.04, 0.05]
    assert doubled == [0.0, 0.0, 0.01, 0.02, 0.03, 0.04]
