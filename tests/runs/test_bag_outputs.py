# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A bag that is written in blocks has the same messages, bit for bit and in the same order, as one written message by message."""

import numpy as np
import pytest
from mcap.reader import make_reader

from rig_nodes.bags.reader import Bag
from rig_nodes.bags.writer import BagWriter
from rig_nodes.base.errors import DiskFull
from rig_nodes.controllers.load import load_controller
from rig_nodes.rig.configuration import load_rig
from rig_nodes.runs.bag_outputs import BagOutputs
from rig_nodes.runs.outputs import Outputs
from rig_nodes.runs.rig import Rig
from rig_nodes.runs.sequence import load_sequence
from rig_nodes.runs.simulation import simulate

READ = ("n_wej", "p1", "gear_ordered", "s1_torque", "motor_work", "energy_residual")


def acts(rig, outputs):
    """Actions on the rig at samples of a run, each with its message: start, a shift, other noise, an emergency stop."""

    def give(step, value, enable=True):
        rig.set(step, value, enable)
        outputs.setpoint(rig.settings.steps[step].setpoint.topic, value, enable)

    def order(gear):
        rig.order_gear(gear)
        outputs.event("/controller/events", "shift_ordered", f"shift to {gear} ordered", gear)

    def change(name, value):
        rig.set_value(name, value)
        outputs.event("/rig/events", "changed", f"{name} is {value}", value)

    return {
        5: lambda: give("oil", 4e6),
        200: lambda: order(1),
        900: lambda: (give("motor", 100.0), give("load", 2e6)),
        1500: lambda: change("instruments.noise.p1", 2e3),
        1505: lambda: change("oil_supply.temperature", 60.0),
        2000: lambda: order(2),
        3100: rig.e_stop,
    }


def known(rig):
    """Returns those signals of the test that the rig has."""
    return [name for name in READ if name in rig.config.catalogue.signals]


def one_by_one(config, end):
    """Returns the messages of a run and the values read at some ticks; the rig advances one sample at a time."""
    rig = Rig(config, 3)
    outputs = Outputs(rig, {"seed": 3}, commands=config.structure.shifts)
    todo, messages, read = acts(rig, outputs), [], []
    for sample in range(end + 1):
        if sample % 35 == 0:
            read.append([outputs.reading(name) for name in known(rig)])
        if rig.shifts and sample in todo:
            todo[sample]()
        messages += [(topic, stamp, bytes(data)) for topic, stamp, data in outputs.due()]
        rig.advance_samples(1)
    return messages, read


def in_blocks(config, end, folder, step):
    """Returns the same of a run that advances as far as possible, but at most ``step`` samples at once."""
    rig = Rig(config, 3)
    with BagWriter(folder, "run", topics=config.catalogue.all_topics) as bag:
        outputs = BagOutputs(bag, rig, {"seed": 3}, commands=config.structure.shifts)
        todo, read = acts(rig, outputs), []
        stops = {*range(0, end + 1, 35), *todo, end, end + 1}
        while rig.sample <= end:
            if rig.sample % 35 == 0:
                read.append([outputs.reading(name) for name in known(rig)])
            if rig.shifts and rig.sample in todo:
                todo[rig.sample]()
            outputs.boundary()
            room = min(outputs.room, step, min(stop for stop in stops if stop > rig.sample) - rig.sample)
            rig.advance_samples(room)
        outputs.flush()
    with open(folder / "run_0.mcap", "rb") as file:
        found = make_reader(file, validate_crcs=True).iter_messages(log_time_order=False)
        return [(channel.topic, message.log_time, message.data) for _, channel, message in found], read


@pytest.fixture(scope="module")
def sent(config):
    return one_by_one(config, 3300)


@pytest.mark.parametrize("step", [1, 5, 10_000])
def test_blocks_hold_the_messages_that_are_sent_one_by_one(config, sent, tmp_path, step):
    messages, read = sent
    found, also_read = in_blocks(config, 3300, tmp_path, step)
    assert [(topic, stamp) for topic, stamp, _ in found] == [(topic, stamp) for topic, stamp, _ in messages]
    assert found == messages
    assert np.array_equal(read, also_read, equal_nan=True)


@pytest.mark.parametrize(
    "rig", ["hydmag_coupling", "ural2", *(pytest.param(rig, marks=pytest.mark.campaign) for rig in ("chain_saw", "three_speed"))]
)
def test_it_does_on_rigs_with_other_parts(tmp_path, rig):
    config = load_rig(rig)
    messages, read = one_by_one(config, 600)
    found, also_read = in_blocks(config, 600, tmp_path, 10_000)
    assert found == messages
    assert np.array_equal(read, also_read, equal_nan=True)


def test_a_block_ends_within_a_second(config, tmp_path):
    rig = Rig(config, 3)
    with BagWriter(tmp_path, "run") as bag:
        outputs = BagOutputs(bag, rig, {"seed": 3}, commands=True)
        while rig.sample < 4000:
            outputs.boundary()
            rig.advance_samples(outputs.room)
            assert outputs.room >= 1 and rig.sample - bag.counts.get("/instruments/controller", 0) <= 1005
        outputs.flush()


def sequence_of(tmp_path, steps):
    """Returns a sequence with steps of YAML."""
    path = tmp_path / "own.yaml"
    path.write_text("description: own\nready: {timeout: 20 s}\nsteps:\n" + "".join(f"  - {step}\n" for step in steps))
    return load_sequence(path, default="hydmag")


def answered(folder):
    """Returns the samples of a controller's inputs in a bag."""
    return [message.sample for _, message in Bag(folder).messages("/instruments/controller")]


def test_a_sequence_that_fails_behind_a_long_wait_keeps_all_of_it(config, tmp_path):
    steps = ["wait: {for: 950 ms}", "wait: {until: {signal: n_wej, above: 100 rpm}, timeout: 1 s}"]
    run = simulate(config, sequence_of(tmp_path, steps), tmp_path / "run")
    assert run["end"]["state"] == "failed"
    assert answered(tmp_path / "run") == list(range(round(run["duration_s"] * 1000))), "every sample before the failure"


def test_a_run_that_is_interrupted_keeps_all_of_it(config, tmp_path, monkeypatch):
    advance = Rig.advance_samples

    def interrupted(rig, samples=1):
        if rig.sample + samples > 1990:
            advance(rig, 1990 - rig.sample)
            raise KeyboardInterrupt
        advance(rig, samples)

    monkeypatch.setattr(Rig, "advance_samples", interrupted)
    run = simulate(config, sequence_of(tmp_path, ["wait: {for: 5 s}"]), tmp_path / "run")
    assert run["end"]["state"] == "interrupted" and answered(tmp_path / "run") == list(range(1990))


def test_a_run_ends_with_its_sequence(config, tmp_path):
    run = simulate(config, sequence_of(tmp_path, ["wait: {for: 2 s}"]), tmp_path / "run")
    times = [time for time, _, name, *_ in Bag(tmp_path / "run").events() if name == "sequence_done"]
    assert run["duration_s"] == pytest.approx(times[0] + 1e-3)


def test_a_disk_that_is_full_is_named_though_the_end_is_tried_again(config, tmp_path, monkeypatch):
    class Full(DiskFull):
        pass

    def write_columns(bag, columns):
        raise Full("the disk is full")

    monkeypatch.setattr(BagWriter, "write_columns", write_columns)
    with pytest.raises(Full):
        simulate(config, sequence_of(tmp_path, ["wait: {for: 3 s}"]), tmp_path / "run")


def test_a_sequence_can_wait_for_what_a_valve_says_under_a_plugged_controller(config, tmp_path):
    plug = load_controller("python:rig_nodes.controllers.examples.alfa46:Alfa46", config)
    steps = [
        "oil: {pressure: 4 MPa}",
        "shift: {to: I, timeout: 5 s}",
        "wait: {until: {signal: zr_p1_duty, above: 0.5}, timeout: 2 s}",
    ]
    run = simulate(config, sequence_of(tmp_path, steps), tmp_path / "run", controller=plug)
    assert run["end"]["state"] == "ended", run["end"]


def test_the_order_of_messages_holds_after_days(config, tmp_path, monkeypatch):
    start = 86_000_001  # samples, nearly a day; one behind a tick
    built = Rig.__init__

    def late(rig, *args, **named):
        built(rig, *args, **named)
        rig.sample, rig._drained = start, 10 * (start - 1)

    monkeypatch.setattr(Rig, "__init__", late)
    rig = Rig(config, 3)
    outputs = Outputs(rig, {"seed": 3}, commands=True)
    messages = []
    for sample in range(1500):
        if sample == 699:
            outputs.event("/rig/events", "changed", "a text", 1.0)
        messages += [(topic, stamp) for topic, stamp, _ in outputs.due()]
        rig.advance_samples(1)
    rig = Rig(config, 3)
    with BagWriter(tmp_path, "run") as bag:
        outputs = BagOutputs(bag, rig, {"seed": 3}, commands=True)
        outputs._begin(start - 1)
        while rig.sample < start + 1500:
            if rig.sample == start + 699:
                outputs.event("/rig/events", "changed", "a text", 1.0)
            outputs.boundary()
            rig.advance_samples(5 if rig.sample % 5 == 0 else 1)
        outputs.flush()
    with open(tmp_path / "run_0.mcap", "rb") as file:
        found = [(channel.topic, message.log_time) for _, channel, message in make_reader(file).iter_messages(log_time_order=False)]
    assert found == messages
