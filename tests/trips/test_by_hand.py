# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A run in which a person presses the red button over a trip and resets the rig: its report, its CAN log, and the run again."""

import pytest

from rig_nodes.analysis import build_report, format_report, gather, info_of
from rig_nodes.bags import Bag, BagWriter
from rig_nodes.cli.main import main
from rig_nodes.controllers import load_controller
from rig_nodes.controllers.can.dm1 import DM1, Code, dm1_data, dm1_frames
from rig_nodes.controllers.can.j1939 import parts
from rig_nodes.rig import load_rig
from rig_nodes.rig.bench_trips import RULES
from rig_nodes.runs import BY_HAND, Rig, run_record
from rig_nodes.runs.bag_outputs import BagOutputs
from rig_nodes.runs.simulation import advance_with

ORDERED, STOPPED, RESET, END = 300, 1100, 1300, 1700  # samples


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """The run: a gear ordered without an oil supply trips, the red button is pressed over it, the rig is reset."""
    config, made = load_rig("hydmag"), tmp_path_factory.mktemp("by_hand")
    plug = load_controller("alfa46", config, "duty")
    rig = Rig(config, controller="external", level="duty")
    with BagWriter(made, "by_hand", topics=config.catalogue.all_topics) as bag:
        outputs = BagOutputs(bag, rig, run_record(config, BY_HAND, 1), True)

        def person(name, text, act):
            act()
            outputs.event("/rig/events", name, text)

        for sample in range(END):
            if sample == 0:
                rig.set("motor", 100.0, True)
                outputs.setpoint(rig.settings.steps["motor"].setpoint.topic, 100.0, True)
            elif sample == ORDERED:
                plug.order(1)
            elif sample == STOPPED:
                person("e_stop", "emergency stop", rig.e_stop)
            elif sample == RESET:
                plug.force_neutral()
                person("reset", "safe state left", rig.reset)
            outputs.boundary()
            advance_with(rig, plug)
        plug.close()
        outputs.finish()
        bag.end("ended", "the rig was ended by hand")
    assert not rig.safe
    return made


def tripped_at(folder):
    return next(round(t * 1e3) for t, _, name, _, _ in Bag(folder).events() if name == "rig_tripped")


def test_run_again_it_trips_stops_and_is_reset_as_recorded(folder, tmp_path, capsys):
    assert main(["rerun", str(folder), "--through", "plant", "--out", str(tmp_path / "again")]) == 0
    assert "topics are bit for bit as recorded" in capsys.readouterr().out
    assert Bag(tmp_path / "again").end["state"] == "ended"


def test_its_report_has_trip_and_red_button_with_their_times_and_the_reset(folder):
    bag = gather(folder)
    report = build_report(bag, info_of(bag))
    assert [(one["name"], one["to_s"]) for one in report["run"]["trips"]] == [("lost_oil_supply", 1.3), ("e_stop", 1.3)]
    lines = format_report(report).splitlines()
    begun = tripped_at(folder) * 1e-3
    [trip] = [line for line in lines if line.startswith(f"tripped at {begun:.3f} s: trip lost_oil_supply: the pressure of ")]
    assert trip.endswith(", reset at 1.300 s") and "tripped at 1.100 s: emergency stop, reset at 1.300 s" in lines


def test_warnings_are_in_the_report_once_for_each_trip():
    from rig_nodes.analysis.trips import trip_lines, warnings_in

    said = "warning overspeed_w0: the speed of w0 is 680 rpm, near its limit of 750 rpm"
    events = [(t, "/rig/events", "rig_warning", f"{said}, at {t:.3f} s", 71.0) for t in (1.0, 2.0, 3.0)]
    warned = warnings_in([*events, (4.0, "/rig/events", "rig_ready", "the rig is ready", 1.0)])
    assert trip_lines({"trip_warnings": warned, "end": None}) == [f"{said}, at 1.000 s and 2 times more"]


def test_its_can_log_keeps_the_code_of_the_trip_beside_that_of_the_red_button_until_the_reset(folder, tmp_path):
    can = pytest.importorskip("can")
    assert main(["export", "log", str(folder), "--out", str(tmp_path / "run.log")]) == 0
    with can.LogReader(tmp_path / "run.log") as log:
        frames = [(round(one.timestamp * 1e3), one.arbitration_id, bytes(one.data)) for one in log if one.is_extended_id]
    trip = next(one for one in load_rig("hydmag").trips if one.name == "lost_oil_supply")
    first, button = Code(trip.spn, trip.fmi), Code(RULES["e_stop"].spn, RULES["e_stop"].fmi)
    alone = [(at, data) for at, number, data in frames if parts(number).pgn == DM1]
    assert alone == [(tripped_at(folder), dm1_data([first])), (RESET, dm1_data([]))]
    several = dm1_frames([first, button], 3)
    found = [(at, data) for at, number, data in frames if parts(number).pgn in (parts(one).pgn for one, _ in several)]
    assert found == [(STOPPED + 50 * k, data) for k, (_, data) in enumerate(several)]
