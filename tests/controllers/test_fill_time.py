# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The example that learns its fill times (docs/examples/fill_time): same bits as C, FMU and over CAN, when it learns, how far."""

import math
import sys
from pathlib import Path

import pytest

from rig_nodes.bags.reader import Bag
from rig_nodes.controllers import ControllerOutputs, load_controller
from rig_nodes.controllers.can.database import database
from rig_nodes.controllers.can.frames import RigFrames
from rig_nodes.controllers.examples.can_alfa46 import CanController
from rig_nodes.controllers.plug import Plug
from rig_nodes.controllers.wire import commands, currents, measured
from rig_nodes.runs.sequence import load_sequence
from rig_nodes.runs.simulation import simulate

EXAMPLE = Path(__file__).parents[2] / "docs" / "examples" / "fill_time"
SOURCE = EXAMPLE / "fill_time.c"
UP = """
description: up; the way down comes after a pause in which the line drains
steps:
  - oil: {pressure: 4 MPa}
  - wait: {for: 300 ms}
  - shift: {to: I}
  - motor: {speed: 500 rpm}
  - wait: {for: 700 ms}
  - load: {torque: 30 Nm}
  - wait: {for: 300 ms}
  - shift: {to: II}
"""
DOWN = "  - wait: {for: 7.2 s}\n  - shift: {to: I}\n"


class OverCan(Plug):
    """Carries each sample to a CanController and its answer back as frames of the bus, one after the other."""

    def __init__(self, config):
        import can

        super().__init__("over CAN", config, "current")
        self.frames = RigFrames(self.rig_record, "current", self.put)
        self.frame, self.answered = can.Message, {}
        self.controller = CanController(self, config, f"c:{SOURCE}")
        self.messages = {message.frame_id: message for message in database(self.rig_record).messages}

    def put(self, number, data, extended):
        self.controller.hear(self.frame(arbitration_id=number, data=data, is_extended_id=extended))

    def send(self, frame):
        message = self.messages[frame.arbitration_id]
        self.answered |= message.decode_simple(bytes(frame.data), decode_choices=False, scaling=False)

    def _answer(self, inputs):
        self.frames.take(inputs, False, False)
        raw, wires = self.answered, commands(self.rig_record, "current")
        return ControllerOutputs([wire.decode(raw[wire.name]) for wire in wires], None, raw["gear"], bool(raw["shifting"]))

    def _end(self):
        self.controller.end()


def on_the_wire(plug):
    """Gives a plug its samples, and the rig its commands, with the resolution of the bus."""
    answer, record = plug._answer, plug.rig_record

    def rounded(wires, values):
        return tuple(wire.decode(wire.encode(value)) for wire, value in zip(wires, values, strict=True))

    def through(inputs):
        seen = rounded(currents(record), inputs.current), rounded(measured(record), inputs.measured)
        given = plug._inputs(inputs.sample, inputs.time, inputs.gear_request, *seen, inputs.others, inputs.settings)
        out = answer(given)
        command = rounded(commands(record, "current"), out.command)
        return ControllerOutputs(command, None, out.gear, out.shifting, out.flags, out.status, out.message, out.signals)

    plug._answer = through
    return plug


@pytest.mark.parametrize("steps", [UP, pytest.param(UP + DOWN, marks=pytest.mark.campaign)], ids=["up", "up and down"])
def test_it_learns_the_same_bits_as_c_as_fmu_and_over_can(config, tmp_path, steps):
    from rig_nodes.runs.fmu.build import build_controller_fmu

    (tmp_path / "steps.yaml").write_text(steps)
    sequence = load_sequence(tmp_path / "steps.yaml", default="hydmag")
    build_controller_fmu([SOURCE], tmp_path / "fill_time.fmu", config)
    found = {}
    for name, plug in (
        ("C", on_the_wire(load_controller(f"c:{SOURCE}", config))),
        ("FMU", on_the_wire(load_controller(f"fmu:{tmp_path / 'fill_time.fmu'}", config))),
        ("CAN", OverCan(config)),
    ):
        run = simulate(config, sequence, tmp_path / name, controller=plug)
        assert run["end"]["state"] == "ended", run["end"]["reason"]
        bag = Bag(tmp_path / name)
        asked = {name: bag.series(name)[1].tobytes() for name in ("I_set_zr_p1", "I_set_zr_p2", "p1", "p2", "s2_piston")}
        law = plug.controller.law if name == "CAN" else plug
        found[name] = asked, dict(zip(law.signals, law.signal_values))
    assert found["C"] == found["FMU"] == found["CAN"]
    learned = found["C"][1]
    assert learned["fill_2"] > 0.7 * 0.455 and (learned["fill_1"] != 0.7 * 0.075) == (steps != UP), "it has learned from each shift"


# ---- alone, with pressures made up for it

FIRST, LIMIT = 0.7 * 0.455, 0.08  # s: fill time of S2 with which it begins, most that one shift changes
LEARNED, NOT_GEARS, NOT_OIL, NOT_SPEED, NOT_EMPTY, NOT_READ, BROKEN_OFF = range(7)  # its verdicts


@pytest.fixture(scope="module")
def library(tmp_path_factory, config):
    """The example, compiled once."""
    from rig_nodes.controllers.c.library import CLibrary, compile_library
    from rig_nodes.controllers.c.record_header import NAME, header_text
    from rig_nodes.controllers.record import record_of

    folder = tmp_path_factory.mktemp("library")
    (folder / NAME).write_text(header_text(record_of(config)))
    compile_library([SOURCE], folder / "fill_time.so", CLibrary.prefix, (f"-I{folder}", "-std=c99", "-pedantic", "-Werror"))
    return folder / "fill_time.so"


class Bench:
    """The controller in gear I, and a clutch S2 whose piston touches the plates at a given time after the order."""

    def __init__(self, library, config):
        self.plug, self.sample = load_controller(f"c:{library}", config), 0
        self.released = 0.0  # Pa, pressure of S2 while it is open
        self.order("I", math.inf)

    def order(self, gear, knee, last=2.1, speed=lambda elapsed: 100.0, oil=40.0, lost=False):
        """Orders a gear and gives samples for a time; returns how much the learned fill time of S2 has changed and the verdict."""
        before = dict(zip(self.plug.signals, self.plug.signal_values)).get("fill_2", FIRST)
        self.plug.order({"neutral": 0, "I": 1, "II": 2}[gear])
        for n in range(round(last * 1e3)):
            elapsed = n * 1e-3
            p2 = math.nan if lost else 1e6 * ((elapsed > 0.03) * (0.1 + elapsed) + min(max(0.0, 40.0 * (elapsed - knee)), 1.5))
            self.plug.step(self.sample, [0.0] * 3, [speed(elapsed), 70.0, 0.0, p2 if gear == "II" else self.released], [oil])
            self.sample += 1
        now = dict(zip(self.plug.signals, self.plug.signal_values))
        return now["fill_2"] - before, now["verdict"]


@pytest.fixture
def bench(library, config):
    bench = Bench(library, config)
    yield bench
    bench.plug.close()


@pytest.mark.parametrize(("error", "learned"), [(0.03, 0.021), (-0.03, -0.021), (0.2, LIMIT), (-0.2, -LIMIT), (math.inf, LIMIT)])
def test_a_share_of_an_error_is_learned_up_to_a_limit(bench, error, learned):
    assert bench.order("II", FIRST + error) == (pytest.approx(learned, abs=2e-3), LEARNED)


def test_in_all_it_stays_between_half_of_its_data_and_twice_them(bench):
    bench.plug.set_value("begin_2", 0.235)
    changed, verdict = bench.order("II", 0.1)
    assert verdict == LEARNED and FIRST + changed == pytest.approx(0.5 * 0.455)
    bench.order("I", math.inf, 9.2)
    bench.plug.set_value("begin_2", 0.9)
    changed, verdict = bench.order("II", 1.1)
    assert verdict == LEARNED and 0.5 * 0.455 + changed == pytest.approx(2.0 * 0.455)


@pytest.mark.parametrize(
    ("given", "verdict"),
    [
        ({"oil": 111.0}, NOT_OIL),
        ({"oil": 14.0}, NOT_OIL),
        ({"oil": math.nan}, LEARNED),  # nobody tells it
        ({"speed": lambda elapsed: 20.0}, NOT_SPEED),
        ({"speed": lambda elapsed: 100.0 * (1.0 + 0.2 * elapsed)}, NOT_SPEED),
        ({"lost": True}, NOT_READ),
        ({"speed": lambda elapsed: 100.0 if elapsed < 0.2 else math.nan}, NOT_SPEED),
    ],
)
def test_it_learns_only_under_its_conditions(bench, given, verdict):
    changed, found = bench.order("II", 0.35, **given)
    assert found == verdict and (changed != 0.0) == (verdict == LEARNED)


def test_it_learns_from_no_shift_out_of_neutral_soon_after_another_or_broken_off(bench):
    bench.order("neutral", math.inf)
    assert bench.order("II", 0.35) == (0.0, NOT_GEARS)
    bench.order("I", math.inf, 8.5)
    assert bench.order("II", 0.35) == (0.0, NOT_EMPTY)
    bench.released = 0.15e6
    bench.order("I", math.inf, 9.2)
    assert bench.order("II", 0.35) == (0.0, NOT_EMPTY)
    bench.released = 0.0
    bench.order("I", math.inf, 9.2)
    bench.order("II", math.inf, 0.1)
    bench.plug.force_neutral()
    for _ in range(2):
        bench.plug.step(bench.sample, [0.0] * 3, [100.0, 70.0, 0.0, 0.0], [40.0])
        bench.sample += 1
    values = dict(zip(bench.plug.signals, bench.plug.signal_values))
    assert (values["fill_2"], values["verdict"]) == (FIRST, BROKEN_OFF)


# ---- on the rig


@pytest.fixture
def plants(monkeypatch):
    monkeypatch.syspath_prepend(str(EXAMPLE))
    import plants

    yield plants
    sys.modules.pop("plants")


@pytest.mark.campaign  # 15 s of processor time
def test_the_errors_on_a_new_and_a_worn_gearbox_shrink_with_the_first_shift(plants):
    for gearbox in plants.gearboxes(0)[:2]:
        found = plants.fills(gearbox, {"1": 0.0525, "2": 0.3185}, 2)
        (first_1, then_1), (first_2, then_2) = ([kiss - assumed for assumed, kiss in found[k]] for k in "12")
        print(f"{gearbox['name']}: S1 {1e3 * first_1:.1f}, {1e3 * then_1:.1f} ms, S2 {1e3 * first_2:.1f}, {1e3 * then_2:.1f} ms")
        assert first_1 > 15e-3 and abs(then_1) < 0.6 * first_1
        assert first_2 - then_2 > 60e-3, "about as far as the limit of 80 ms allows"


@pytest.mark.campaign
def test_twenty_gearboxes_drawn_at_random_are_learned_within_twelve_shifts(plants, capfd, monkeypatch):
    monkeypatch.setattr(sys, "argv", ["plants.py"])
    code = plants.main()
    printed = capfd.readouterr().out
    print(printed)
    assert code == 0 and printed.count("below 10 ms from shift") == 2 * 23
