# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Run a bag again: its commands through a plant, or its transducers through a controller, into a new bag.

``rig rerun`` uses it. No sequence is needed: what a sequence, a person or a controller ordered is in the bag.
"""

from __future__ import annotations

import json
import math
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from .. import __version__
from ..analysis import Gathered
from ..bags import BagWriter, OpenedBags, canonical_hash, describe, encoder
from ..base import SAMPLE, SAMPLE_NS, SWITCH, RigError, Uninterrupted
from ..controllers import LEVELS, ControllerFailed, Plug
from ..plant import MEASUREMENTS
from ..rig import (
    BAD_CONTROLLER,
    CHANGED,
    CONTROLLER,
    CONTROLLER_COMMAND,
    CONTROLLER_EVENTS,
    FAULT_ON,
    FAULT_ORDERED,
    RED_BUTTON,
    RESET_EVENT,
    SHIFT_ORDERED,
    TRIPPED,
    RigConfig,
    Settings,
    trips_named,
)
from .bag_outputs import BagOutputs
from .outputs import Outputs
from .rig import Rig

SAMPLES = "/instruments/controller"
RUN_INFO = "/rig/run_info"
AHEAD = 1000  # samples by which commands are read ahead; a later one would not be an answer
RIG_EVENTS = "/rig/events"
EVENT = "rig_msgs/msg/Event"
SETPOINT = "rig_msgs/msg/Setpoint"


def rerun_record(bag: Gathered, config: RigConfig, through: str) -> dict:
    """Return the record of a re-run, which names its parent.

    Parameters
    ----------
    bag : Gathered
        The bag that is run again.
    config : RigConfig
        The configuration of the re-run.
    through : str
        "plant", or the specification of the controller.

    Returns
    -------
    dict
        The parent's record with this configuration and version; ``parent`` holds the name of the parent's file and its
        canonical hash.
    """
    return {
        **bag.run_info(),
        "configuration": config.as_dict(),
        "versions": {"rig_nodes": __version__},
        "parent": {"bag": bag.path.name, "hash": canonical_hash(bag.source)["all"], "through": through},
    }


@dataclass
class _Inputs:
    """What came to the plant from outside, by the sample before which it acts, and the valve commands in their order."""

    commands: _Commands
    setpoints: dict[int, list[tuple[str, float, bool]]] = field(default_factory=lambda: defaultdict(list))
    events: dict[int, list[tuple[str, str, str, float]]] = field(default_factory=lambda: defaultdict(list))
    last: int = 0
    delay: int = 1


def _inputs_of(bag: Gathered, config: RigConfig) -> _Inputs:
    found = _Inputs(commands=_Commands(bag), last=bag.recorded_to // SAMPLE_NS, delay=bag.run_info().get("delay", 1))
    keys = {one.setpoint.topic: key for key, one in config.settings.steps.items()}
    for topic, ros_type in bag.types.items():
        if ros_type == SETPOINT:
            if topic not in keys and bag.counts[topic]:
                raise RigError(f"{bag.path}: sets {topic}, which the rig '{config.name}' does not have; name one like its own")
            for _, message in bag.messages(topic):
                found.setpoints[_sample(message)].append((keys[topic], float(message.value), bool(message.enable)))
        elif ros_type == EVENT:
            for _, message in bag.messages(topic):
                one = topic, str(message.name), str(message.text), float(message.value)
                found.events[_sample(message)].append(one)
    return found


def _sample(message: Any) -> int:
    """Return the controller sample of a message's stamp."""
    return _stamp(message) // SAMPLE_NS


def _stamp(message: Any) -> int:
    stamp = message.header.stamp
    return int(stamp.sec) * 10**9 + int(stamp.nanosec)


def _changed(settings: Settings, text: str, value: float) -> str | None:
    """Return the name of the setting whose change the text of an event reports; None when it is not of this rig."""
    name = text.partition(" = ")[0]
    return name if name in settings and settings[name].sentence(value) == text else None


def check_whole(bag: Gathered) -> None:
    """Refuse a bag that does not hold a whole run of a rig in lockstep.

    Parameters
    ----------
    bag : Gathered
        The bag.

    Raises
    ------
    RigError
        When it holds no run, lacks its beginning or messages, or has devices outside the plant.
    """
    bag.check_began()
    if "configuration" not in bag.run_info():
        raise RigError(f"{bag.path}: does not name the rig that ran; expected a bag of `rig run` or `rig simulate`")
    if bag.recorded_from > 0.0:
        raise RigError(f"{bag.path}: begins {bag.recorded_from:.3f} s after the run; a re-run needs the run from its start")
    if gaps := bag.gaps():
        topic, lost = next(iter(gaps.items()))
        raise RigError(f"{bag.path}: {topic} lost {lost} messages; a re-run needs all of them")


def rerun_plant(bag: Gathered, config: RigConfig, folder: Path) -> tuple[list[str], dict[str, str]]:
    """Feed the recorded commands of a bag to a plant, and write what the plant does into a new bag.

    Setpoints, valve commands, changed settings, resets and what stopped the run from outside act at the samples at which
    they acted in the recorded run. A rig of the bag's own configuration therefore repeats the run bit for bit.

    Parameters
    ----------
    bag : Gathered
        The bag.
    config : RigConfig
        The rig; that of the bag or another one with the same setpoints and outputs.
    folder : Path
        Folder of the new bag.

    Returns
    -------
    list of str
        What could not be fed, as sentences.
    dict of str to str
        How the re-run ended, as a report has it: ended, or tripped with the name of the trip.

    Raises
    ------
    RigError
        When the bag does not fit the rig.
    """
    check_whole(bag)
    if config.cut_out:
        raise RigError(
            f"{', '.join(config.cut_out)}: stands outside the plant; a re-run has no device outside, set its source to plant"
        )
    found = _inputs_of(bag, config)
    first = found.commands.first
    if config.structure.shifts and first is None:
        raise RigError(f"{bag.path}: holds no valve commands, which the rig '{config.name}' needs")
    level = LEVELS[first.level] if first is not None else None
    rig = Rig(config, int(bag.run_info().get("seed", 1)), "plugged", level, delay=found.delay)  # as that of the bag may be
    notes: list[str] = []
    stops = Uninterrupted()
    with stops, BagWriter(folder, bag.path.stem.rpartition("_")[0] or bag.path.stem, topics=config.catalogue.all_topics) as new:
        outputs = BagOutputs(new, rig, rerun_record(bag, config, "plant"), commands=config.structure.shifts)
        try:
            for sample in range(found.last + 1):
                _act(rig, outputs, found, sample, notes)
                stops.held = True
                try:
                    outputs.boundary()
                finally:
                    stops.let_in()
                if sample == found.last:
                    break
                if rig.delay == 0:
                    _command(rig, found, sample)
                _stop(rig, found, sample + 1)
                rig.advance_samples(1)
                if rig.delay > 0:
                    _command(rig, found, sample)
        finally:
            stops.held = True  # the bag is finished now
            outputs.finish()
        end = {"state": "ended", "reason": f"the recorded commands of {bag.path.name} ended"}
        if rig.safe:
            end = {"state": "tripped", "reason": rig.reason, "trip": rig.tripped_by}
        new.end(**end)
    return notes, end


def _act(rig: Rig, outputs: Outputs, found: _Inputs, sample: int, notes: list[str]) -> None:
    """Give the rig what people did at a sample, and send it and the events on; red button and reset come before all else."""
    events = found.events.get(sample, ())
    for topic, name, text, value in events:
        if topic == RIG_EVENTS and name in (RED_BUTTON, RESET_EVENT):
            if name == RESET_EVENT and not rig.safe:
                notes.append(f"at {rig.time:.3f} s the reset was not repeated, as the rig had not tripped")
                continue
            rig.e_stop() if name == RED_BUTTON else rig.reset()
            outputs.event(topic, name, text, value)
    for key, value, enable in found.setpoints.get(sample, ()):
        rig.set(key, value, enable)
        outputs.setpoint(rig.settings.steps[key].setpoint.topic, value, enable)
    for topic, name, text, value in events:
        if topic == RIG_EVENTS and name == CHANGED:
            setting = _changed(rig.settings, text, value)
            if setting is None:
                notes.append(f"at {rig.time:.3f} s '{text}' could not be repeated, as the rig has no such setting")
                continue
            rig.set_value(setting, value != 0.0 if rig.settings[setting].dimension == SWITCH else value)
        elif topic == RIG_EVENTS and name == FAULT_ORDERED:
            if rig.faults is None:
                notes.append(f"at {rig.time:.3f} s the fault '{text}' was not repeated, as the rig has its faults disabled")
                continue
            rig.order_fault(text)  # which the rig says itself
            continue
        elif topic == RIG_EVENTS:
            continue  # the rig says itself what happens to it
        outputs.event(topic, name, text, value)


def _stop(rig: Rig, found: _Inputs, sample: int) -> None:
    """Stop the rig where a controller that failed stopped the recorded one."""
    for topic, name, text, _ in found.events.get(sample, ()):
        if topic == RIG_EVENTS and name == TRIPPED and trips_named(text) == [BAD_CONTROLLER] and not rig.safe:
            rig.trip(text, BAD_CONTROLLER)


def _command(rig: Rig, found: _Inputs, sample: int) -> None:
    """Give the rig the recorded valve command that answers a sample."""
    message = found.commands.get(sample)
    if message is not None and rig.shifts:
        rig.set_command(
            message.level, sample, message.duty, message.setpoint, int(message.gear), bool(message.shifting), int(message.flags)
        )


@dataclass
class Answers:
    """How the answers of a controller compare with the recorded ones.

    Attributes
    ----------
    samples : int
        Number of samples that both answered.
    same : int
        Number of them with equal bits.
    largest : float
        Largest difference of a command (duty, or [A] at level current).
    first : float or None
        Time of the first different answer [s].
    gears : int
        Number of answers with another gear or state of shifting.
    missing : int
        Number of samples that only one of both answered.
    end : str
        Why the controller ended early; empty when it answered to the end.
    """

    samples: int = 0
    same: int = 0
    largest: float = 0.0
    first: float | None = None
    gears: int = 0
    missing: int = 0
    end: str = ""

    def add(self, sample: int, ours: tuple, recorded: tuple) -> None:
        """Count one sample; an answer is (command, gear, shifting, flags)."""
        self.samples += 1
        if ours == recorded:
            self.same += 1
            return
        if self.first is None:
            self.first = sample * SAMPLE_NS * 1e-9
        self.largest = max([self.largest, *(abs(a - b) for a, b in zip(ours[0], recorded[0]))])
        self.gears += ours[1:3] != recorded[1:3]


def rerun_controller(bag: Gathered, config: RigConfig, controller: Plug, spec: str, folder: Path) -> Answers:
    """Feed the recorded transducers of a bag to a controller, and write its answers with the recorded rest into a new bag.

    Parameters
    ----------
    bag : Gathered
        The bag.
    config : RigConfig
        The rig for which the controller was loaded.
    controller : Plug
        The controller; it is closed at the end.
    spec : str
        Its specification, for the record.
    folder : Path
        Folder of the new bag.

    Returns
    -------
    Answers
        The comparison of its answers with the recorded ones.

    Raises
    ------
    RigError
        When the bag does not hold what the controller sees.
    """
    try:
        return _through(bag, config, controller, spec, folder)
    finally:
        controller.close()


def _through(bag: Gathered, config: RigConfig, controller: Plug, spec: str, folder: Path) -> Answers:
    check_whole(bag)
    if SAMPLES not in bag.types or CONTROLLER_COMMAND not in bag.types:
        raise RigError(f"{bag.path}: holds no samples and commands of a shift controller")
    found, others = _inputs_of(bag, config), _others(bag, controller.wants)
    begun = [text for events in found.events.values() for _, name, text, _ in events if name == FAULT_ON]
    if ill := [text for text in begun if text.startswith(f"{MEASUREMENTS}.")]:
        raise RigError(f"{bag.path}: holds what was measured, and not what its controller was told with the fault {ill[0]}")
    level = LEVELS.index(controller.level)
    recorded_level = found.commands.first.level
    if level != recorded_level:
        raise RigError(
            f"{bag.path}: its commands are at level {LEVELS[recorded_level]}, and controller {controller.name} gives level "
            f"{controller.level}; only answers of one level can be compared"
        )
    name = bag.path.stem.rpartition("_")[0] or bag.path.stem
    kept = [topic for topic in bag.types if topic not in (RUN_INFO, CONTROLLER_COMMAND)]
    # the log times of another recorder may be dates; the answers have the time of the run
    zero = next((time - _stamp(message) for time, message in bag.messages(SAMPLES)), 0)
    with OpenedBags([bag.source]) as opened:
        recorded = ((max(0, time - zero), message) for time, message in opened.timeline(kept))
        writer = BagWriter(folder, name, topics=config.catalogue.all_topics)
        try:
            with writer:
                for topic in kept:
                    if topic not in config.catalogue.all_topics:  # of users, whose types need not be installed here
                        describe(writer, opened, topic)
                record = rerun_record(bag, _changed_by(found, config), spec)
                answers = _answered(bag, config, controller, found, others, _Answered(bag, record, writer, recorded))
                writer.end("ended", "the re-run ended")
            return answers
        except BaseException:
            for path in (writer.path, folder / "metadata.yaml"):  # half a bag is no use; what else is in the folder is of others
                path.unlink(missing_ok=True)
            raise


def _answered(
    bag: Gathered, config: RigConfig, controller: Plug, found: _Inputs, others: Callable[[int], Sequence[float]], new: _Answered
) -> Answers:
    """Give the controller each recorded sample, write its answers, and compare them with the recorded ones."""
    answers, level = Answers(), LEVELS.index(controller.level)
    try:
        for _, message in bag.messages(SAMPLES):
            sample = int(message.sample)
            recorded = found.commands.get(sample)
            if recorded is None and sample:
                break  # the run ended, or its rig was in the safe state
            for topic, name, text, value in found.events.get(sample, ()):
                if topic == CONTROLLER_EVENTS and name == SHIFT_ORDERED:
                    controller.order(int(value))
                elif topic == CONTROLLER_EVENTS and name == CHANGED:
                    config = _change(config, controller, text, value)
            answer = controller.step(sample, message.current, message.measured, others(sample))
            if answer is None or recorded is None:
                answers.missing += answer is not None or recorded is not None
                continue
            duty, flags = (answer.command, 0) if level == 0 else ((0.0,) * len(answer.command), controller.flags)
            new.add(sample, controller.gear, controller.shifting, level, flags, duty, answer.setpoint)
            commanded = recorded.duty if level == 0 else recorded.setpoint
            answers.add(
                sample,
                (tuple(answer.command), controller.gear, controller.shifting, flags),
                (tuple(map(float, commanded)), int(recorded.gear), bool(recorded.shifting), int(recorded.flags)),
            )
    except ControllerFailed as failure:
        answers.end = str(failure)
    new.copy()
    return answers


def _changed_by(found: _Inputs, config: RigConfig) -> RigConfig:
    """Return the configuration with the controller's settings as the recorded events changed them."""
    for sample in sorted(found.events):
        for topic, name, text, value in found.events[sample]:
            setting = _changed(config.settings, text, value) if (topic, name) == (CONTROLLER_EVENTS, CHANGED) else None
            if setting is not None and config.settings[setting].owner == CONTROLLER:
                config = config.with_values({setting: value})
    return config


def _change(config: RigConfig, controller: Plug, text: str, value: float) -> RigConfig:
    """Give the controller a setting that was changed while the recorded one ran."""
    setting = _changed(config.settings, text, value)
    if setting is None or config.settings[setting].owner != CONTROLLER:
        own = text.partition(" = ")[0].rpartition(".")[2]
        controller.set_value(own, value)
        return config
    config = config.with_values({setting: value})
    controller.change(config.alfa46)
    return config


class _Commands:
    """The recorded valve commands, which are read as their samples come due.

    Attributes
    ----------
    first : message or None
        The first one.
    """

    def __init__(self, bag: Gathered) -> None:
        self._messages = (
            (message for _, message in bag.messages(CONTROLLER_COMMAND)) if CONTROLLER_COMMAND in bag.types else iter(())
        )
        self._held: dict[int, Any] = {}
        self._read = -1  # sample up to which they are read
        self.first = next(self._messages, None)
        if self.first is not None:
            self._take(self.first)

    def get(self, sample: int) -> Any:
        """Return the command that answers a sample, or None; samples are asked for in their order, each once."""
        while self._read < sample + AHEAD and (message := next(self._messages, None)) is not None:
            self._take(message)
        if len(self._held) > 4 * AHEAD:
            self._held = {number: message for number, message in self._held.items() if number >= sample}
        return self._held.pop(sample, None)

    def _take(self, message: Any) -> None:
        self._held[int(message.sample)] = message
        self._read = max(self._read, int(message.sample))


def _others(bag: Gathered, wants: Sequence[str]) -> Callable[[int], Sequence[float]]:
    """Return a function of the sample that gives the transducers that a controller wants beyond those of every controller."""
    if not wants:
        return lambda _: ()
    stretches = bag.rows()
    newest = next(stretches, None)
    lacking = [name for name in wants if newest is None or name not in newest.channels]
    if lacking:
        raise RigError(f"{bag.path}: the logger has no {', '.join(lacking)}, which the controller needs at each sample")

    def at(sample: int) -> list[float]:
        nonlocal newest
        row = sample * round(SAMPLE / newest.period)
        while row >= newest.first + newest.rows and (more := next(stretches, None)) is not None:
            newest = more
        return [float(newest.channels[name][min(row - newest.first, newest.rows - 1)]) for name in wants]

    return at


class _Answered:
    """The bag with the answers in place of the recorded commands; nothing is left of one that is not finished."""

    def __init__(self, bag: Gathered, record: dict, writer: BagWriter, kept: Iterator[tuple[int, tuple[str, bytes]]]) -> None:
        self._types, self._writer, self._kept = bag.types, writer, kept
        self._next = next(kept, None)
        self._encode, self._count = encoder("rig_msgs/msg/ValveCommand").encode, 0
        text = json.dumps(record, sort_keys=True)
        writer.write(RUN_INFO, self._types[RUN_INFO], encoder("rig_msgs/msg/RunInfo").encode(0, 0, text), 0)

    def add(self, sample: int, *fields: Any) -> None:
        """Write the answer to a sample, behind all recorded messages up to its time."""
        time = sample * SAMPLE_NS
        self.copy(time)
        self._writer.write(
            CONTROLLER_COMMAND, self._types[CONTROLLER_COMMAND], self._encode(time, self._count, sample, *fields), time
        )
        self._count += 1

    def copy(self, until: float = math.inf) -> None:
        """Write the recorded messages up to a time [ns]."""
        while self._next is not None and self._next[0] <= until:
            time, (topic, data) = self._next
            self._writer.write(topic, self._types[topic], data, time)
            self._next = next(self._kept, None)


def different_topics(parent: Gathered, new: Gathered) -> list[str]:
    """Return the topics whose messages differ between a bag and its re-run.

    The record of the run differs by its nature, and what nodes recorded beside the rig (/rosout) is not run again.
    """
    known = {name for name in parent.types if name in parent.catalogue.all_topics}
    topics = sorted((known | {*new.types}) - {RUN_INFO})
    ours, theirs = canonical_hash(parent.source), canonical_hash(new.source)
    return [topic for topic in topics if ours.get(topic) != theirs.get(topic)]
