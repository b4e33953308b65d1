# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A sequence on the rig without ROS traffic: same rig, same outputs, same bag, as fast as it goes.

Used by ``rig simulate`` and the tests.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from .. import __version__
from ..alfa46.settings import check_gains
from ..bags.writer import BagWriter
from ..clocks import COMMAND_TIMEOUT, TICK_SAMPLES
from ..config.schema import SWITCH
from ..controllers.plug import SAID, Answer, Plug
from ..controllers.seam import ControllerFailed
from ..description.settings import CHANGED, CONTROLLER, OWN, own_setting
from ..errors import RigError, ended_by
from ..uninterrupted import Uninterrupted
from .configuration import RigConfig
from .outputs import Outputs
from .rig import Rig
from .rig_base import RigStatus
from .sequence import Sequence, SequenceFailed, SequenceRunner

if TYPE_CHECKING:
    from .record import Listener

LONGEST_RUN = 24 * 3600.0  # s of simulated time
AFTER_TRIP = 100  # samples recorded after a trip, so that the bag shows the safe state


def run_record(config: RigConfig, sequence: Sequence, seed: int) -> dict:
    """What a bag says about its own making: configuration, sequence, seed and version, no clock and no host."""
    chosen = {"parameters": dict(sequence.parameters)} if sequence.parameters else {}
    return {
        "configuration": config.as_dict(),
        "sequence": sequence.name,
        "description": sequence.description,
        **chosen,
        "seed": seed,
        "versions": {"rig_nodes": __version__},
    }


class LocalBench:
    """The bench of a sequence in the same process; orders become events as the nodes would publish them."""

    def __init__(self, rig: Rig, outputs: Outputs | Listener, controller: Plug | None = None) -> None:
        self.rig, self.outputs = rig, outputs
        self.reading = outputs.reading
        self._order = controller.order if controller else rig.order_gear
        self._controller = controller
        self._ordered: int | None = None

    def ready(self) -> bool:
        """True: a rig in the same process takes orders at once."""
        return True

    def set(self, step: str, value: float, enable: bool) -> None:
        """Gives the rig a setpoint [SI] and sends it out."""
        self.rig.set(step, value, enable)
        self.outputs.setpoint(self.rig.settings.steps[step].setpoint.topic, value, enable)

    def order_gear(self, gear: int) -> None:
        """Orders a gear by its number from the controller, with an event."""
        self._order(gear)
        self._ordered = gear
        name = self.rig.config.transmission.names[gear]
        self.outputs.event("/controller/events", "shift_ordered", f"shift to {name} ordered", gear)

    def shift_done(self) -> bool:
        """True when the gear that was ordered last is in; tells of that once."""
        done = not self.rig.shifting and self._ordered in (None, self.rig.gear)
        if done and self._ordered is not None:
            self._ordered = None
            self.outputs.event("/controller/events", "shift_done", "the profiles of the shift have ended", self.rig.gear)
        return done

    def controller_says(self) -> tuple[int, bool]:
        """The controller's gear and whether it is shifting."""
        return self.rig.gear, self.rig.shifting

    def change(self, name: str, value: float) -> None:
        """Gives a setting another value [SI], with an event; RigError when it is refused."""
        own = name.removeprefix(f"{CONTROLLER}.{OWN}")
        if own != name:
            if self._controller is None:
                raise RigError(f"controller alfa46 has no setting '{own}'; it has none of its own")
            self._controller.set_value(own, value)
            setting = own_setting(name)
        else:
            setting = self.rig.settings.find(name)
            if setting.owner == CONTROLLER and self._controller is not None:
                check_gains(self.rig.level, [setting.key])
                changed = self.rig.config.with_values({name: value})
                self._controller.check_change(changed.alfa46)
                self._controller.change(changed.alfa46)
                self.rig.config = changed
            else:
                self.rig.set_value(name, value != 0.0 if setting.dimension == SWITCH else value)
        topic = "/controller/events" if setting.owner == CONTROLLER else "/rig/events"
        self.outputs.event(topic, CHANGED, setting.sentence(value), value)

    def changed(self) -> bool:
        """True: a setting has its value when it is given."""
        return True

    def event(self, name: str, text: str, value: float = 0.0) -> None:
        """Sends out an event of the sequence."""
        self.outputs.event("/sequencer/events", name, text, value)


def check_controller(config: RigConfig) -> None:
    """RigError for a rig on which no shift controller can act."""
    if not config.structure.shifts:
        raise RigError(f"the rig '{config.name}' has no valves for a shift controller; leave out --controller, --level and --delay")


def check_delay(delay: int, speed: float | None) -> None:
    """RigError for a controller without delay [samples] on the graph in real time (speed: None)."""
    if delay == 0 and speed is None:
        raise RigError("--delay 0: in real time time passes while the controller computes; use --speed or a delay of 1")


def rig_for(config: RigConfig, seed: int, controller: Plug | None = None, delay: int = 1) -> Rig:
    """The rig of a configuration with its embedded Alfa46, or for a plug whose answers act after ``delay`` samples."""
    if controller is None:
        return Rig(config, seed)
    check_controller(config)
    return Rig(config, seed, controller="external", level=controller.level, delay=delay)


def runner_on(
    rig: Rig, outputs: Outputs | Listener, config: RigConfig, sequence: Sequence, controller: Plug | None = None
) -> SequenceRunner:
    """The sequence on a rig in the same process; RigError when the rig has not what it asks for."""
    sequence.check_rig(config)
    return SequenceRunner(sequence, LocalBench(rig, outputs, controller), config)


def ask_controller(rig: Rig, controller: Plug) -> Answer | None:
    """The plug's answer to the newest sample, from what the wires carry; None when it discards the sample."""
    return controller.step(rig.sample, *rig.seen(), [rig.measurement(name) for name in controller.wants])


def give_answer(rig: Rig, controller: Plug, sample: int, answer: Answer) -> None:
    """Hand the answer to ``sample`` to the rig, at the level of the plug."""
    if controller.level == "current":
        rig.set_current(sample, answer.command, controller.gear, controller.shifting, controller.flags)
    else:
        rig.set_duty(sample, answer.command, answer.setpoint, controller.gear, controller.shifting)


def advance_with(rig: Rig, controller: Plug) -> bool:
    """One sample with a plugged controller; its answer acts ``rig.delay`` samples later, at 0 before the rig moves.

    A controller that fails, or that never answers, trips the rig with its sentence as the reason. True with an answer.
    """
    sample, answer = rig.sample, None
    try:
        answer = ask_controller(rig, controller)
    except ControllerFailed as failure:
        rig.trip(str(failure))
    if rig.delay > 0:
        rig.advance_samples(1)
    if answer is not None:
        give_answer(rig, controller, sample, answer)
    if rig.delay == 0:
        rig.advance_samples(1)
    if answer is None and rig.status == RigStatus.STARTING and rig.time > COMMAND_TIMEOUT:
        rig.trip(f"controller {controller.name} has not answered any of the first {sample + 1} samples")
    return answer is not None


def simulate(
    config: RigConfig,
    sequence: Sequence,
    folder: Path,
    seed: int = 1,
    progress: Callable[[float, str], None] | None = None,
    controller: Plug | None = None,
    delay: int = 1,
) -> dict:
    """Run the sequence into a bag in ``folder``; returns the ``run`` part of the report.

    ``controller``: a plug (controllers.load_controller) in place of the embedded Alfa46, whose answers act after
    ``delay`` samples; it is closed at the end. The bag is whole even when the sequence or the controller fails or the
    run is interrupted, by Ctrl-C or SIGTERM; ``end`` says why it ended.
    """
    sequence.check_rig(config)
    rig = rig_for(config, seed, controller, delay)
    record = run_record(config, sequence, seed)
    outputs = Outputs(rig, record, commands=config.structure.shifts, controller=controller)
    runner = runner_on(rig, outputs, config, sequence, controller)
    types = {name: topic.ros_type for name, topic in config.catalogue.all_topics.items()}
    end = {"state": "ended", "reason": "the sequence ended"}

    stops = Uninterrupted()

    def record_due() -> None:
        stops.held = True
        try:
            for topic, stamp, data in outputs.due():
                bag.write(topic, types[topic], data, stamp, made_here=True)
        finally:
            stops.let_in()

    with stops, BagWriter(folder, sequence.name, topics=config.catalogue.all_topics) as bag:
        try:
            done = False
            while not done and not rig.safe:
                if rig.sample and rig.sample % TICK_SAMPLES == 0:
                    done = runner.poll(rig.time) or rig.time > LONGEST_RUN
                    if progress:
                        progress(rig.time, runner.text)
                record_due()
                if controller is None:
                    rig.advance_samples(1)
                else:
                    sample = rig.sample
                    if advance_with(rig, controller) and controller.signals:
                        outputs.signals_row(sample, controller.signal_values)
            if rig.status == RigStatus.TRIPPED:
                end = {"state": "tripped", "reason": rig.reason}
                for _ in range(AFTER_TRIP):
                    record_due()
                    rig.advance_samples(1)
        except SequenceFailed as failure:
            end = {"state": "failed", "reason": str(failure)}
        except KeyboardInterrupt as stop:
            end = {"state": "interrupted", "reason": ended_by(stop)[0]}
        finally:
            if controller is not None:
                controller.close()
            stops.held = True  # the bag is closed now
    plugged = {}
    if config.structure.shifts:
        told = controller.record() if controller else {"name": "alfa46", "level": rig.level, "level_from": SAID}
        plugged = {"controller": {**told, "delay": rig.delay}}
    return {
        **record,
        "mode": "simulate",
        **plugged,
        "duration_s": rig.time,
        "lost": 0,
        "ticks": rig.sample // TICK_SAMPLES,
        "overruns": 0,
        "lateness_ms": None,
        "end": end,
    }
