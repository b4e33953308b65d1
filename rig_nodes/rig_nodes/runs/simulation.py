# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Run a sequence on the rig without ROS traffic: same rig, same outputs, same bag, as fast as the machine can.

``rig simulate`` and the tests use it.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from .. import __version__
from ..bags import LIBRARY_OF_RUN, BagWriter
from ..base import COMMAND_TIMEOUT, SAMPLE, SAMPLE_NS, SWITCH, TICK_SAMPLES, RigError, Uninterrupted, ended_by
from ..controllers import DECLARED, Answer, ControllerFailed, Plug
from ..rig import (
    BAD_CONTROLLER,
    CHANGED,
    CONTROLLER,
    CONTROLLER_EVENTS,
    NO_COMMAND,
    OWN,
    SHIFT_ORDERED,
    RigConfig,
    check_gains,
    own_setting,
)
from .bag_outputs import BagOutputs
from .outputs import Outputs
from .rig import Rig
from .rig_base import RigStatus
from .sequence import Sequence
from .sequence_runner import SequenceFailed, SequenceRunner

if TYPE_CHECKING:
    from .recorded import Listener

LONGEST_RUN = 24 * 3600.0  # s of simulated time
AFTER_TRIP = 100  # samples recorded after a trip, so that the bag shows the safe state


def run_record(config: RigConfig, sequence: Sequence, seed: int, delay: int = 1) -> dict:
    """Return the record of a run that goes into its bag.

    Parameters
    ----------
    config : RigConfig
        The rig's configuration.
    sequence : Sequence
        The sequence that is run.
    seed : int
        Seed of the run.
    delay : int
        Number of samples after which the controller's answers act; it is in the record when it is not one.

    Returns
    -------
    dict
        Configuration, sequence, seed and version; no time of a clock and no name of a host.
    """
    chosen: dict = {"parameters": dict(sequence.parameters)} if sequence.parameters else {}
    if loops := sequence.loops():
        chosen["loops"] = loops
    return {
        "configuration": config.as_dict(),
        "sequence": sequence.name,
        "description": sequence.description,
        **chosen,
        "seed": seed,
        **({} if delay == 1 else {"delay": delay}),  # a re-run needs it
        "versions": {"rig_nodes": __version__},
    }


class LocalBench:
    """The bench of a sequence in the same process; orders become the same events as the nodes would publish.

    Parameters
    ----------
    rig : Rig
        The rig on which the sequence runs.
    outputs : Outputs or Listener
        Takes the setpoints and events, and gives the readings.
    controller : Plug, optional
        The plugged controller, in place of the embedded Alfa46.
    """

    def __init__(self, rig: Rig, outputs: Outputs | Listener, controller: Plug | None = None) -> None:
        self.rig, self.outputs = rig, outputs
        self.reading = outputs.reading
        self._order = controller.order if controller else rig.order_gear
        self._controller = controller
        self._ordered: int | None = None

    def ready(self) -> bool:
        """Return True, because a rig in the same process takes orders at once."""
        return True

    def set(self, step: str, value: float, enable: bool) -> None:
        """Give the rig a setpoint [SI] and send it out."""
        self.rig.set(step, value, enable)
        self.outputs.setpoint(self.rig.settings.steps[step].setpoint.topic, value, enable)

    def order_gear(self, gear: int) -> None:
        """Order a gear by its number from the controller, and send an event."""
        self._order(gear)
        self._ordered = gear
        name = self.rig.config.transmission.names[gear]
        self.outputs.event(CONTROLLER_EVENTS, SHIFT_ORDERED, f"shift to {name} ordered", gear)

    def shift_done(self) -> bool:
        """Return whether the gear that was ordered last is engaged; the event of it is sent once."""
        done = not self.rig.shifting and self._ordered in (None, self.rig.gear)
        if done and self._ordered is not None:
            self._ordered = None
            self.outputs.event(CONTROLLER_EVENTS, "shift_done", "the profiles of the shift have ended", self.rig.gear)
        return done

    def controller_gear(self) -> tuple[int, bool]:
        """Return the controller's gear, and True when it is shifting."""
        return self.rig.gear, self.rig.shifting

    def change(self, name: str, value: float) -> None:
        """Give a setting another value and send an event.

        Parameters
        ----------
        name : str
            Name of the setting, of the rig or of the controller.
        value : float
            The new value [SI]; 1 or 0 for a switch.

        Raises
        ------
        RigError
            When the change is refused.
        """
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
        topic = CONTROLLER_EVENTS if setting.owner == CONTROLLER else "/rig/events"
        self.outputs.event(topic, CHANGED, setting.sentence(value), value)

    def fault(self, order: str) -> None:
        """Order a fault or its end; the rig's events name it."""
        self.rig.order_fault(order)

    def changed(self) -> bool:
        """Return True, because a setting here takes its value at once."""
        return True

    def event(self, name: str, text: str, value: float = 0.0) -> None:
        """Send out an event of the sequence."""
        self.outputs.event("/sequencer/events", name, text, value)


def check_controller(config: RigConfig) -> None:
    """Raise RigError for a rig on which no shift controller can act."""
    if not config.structure.shifts:
        raise RigError(f"the rig '{config.name}' has no valves for a shift controller; leave out controller, level and delay")


def check_delay(delay: int, speed: float | None) -> None:
    """Refuse a controller without delay on the graph in real time.

    Parameters
    ----------
    delay : int
        Delay of the controller's answers [samples].
    speed : float or None
        Speed of the run as a multiple of real time; None for real time itself.

    Raises
    ------
    RigError
        When the delay is 0 in real time.
    """
    if delay == 0 and speed is None:
        raise RigError("--delay 0: in real time time passes while the controller computes; use --speed or a delay of 1")


def rig_for(config: RigConfig, seed: int, controller: Plug | None = None, delay: int = 1) -> Rig:
    """Make the rig of a configuration for its embedded Alfa46 or for a plugged controller.

    Parameters
    ----------
    config : RigConfig
        The rig's configuration.
    seed : int
        Seed of the run.
    controller : Plug, optional
        A plugged controller in place of the embedded Alfa46.
    delay : int
        Number of samples after which the plug's answers act.

    Returns
    -------
    Rig
        The rig at time 0.

    Raises
    ------
    RigError
        When there is a plug but no shift controller can act on the rig.
    """
    if controller is None:
        return Rig(config, seed)
    check_controller(config)
    return Rig(config, seed, controller="plugged", level=controller.level, delay=delay)


def runner_on(
    rig: Rig, outputs: Outputs | Listener, config: RigConfig, sequence: Sequence, controller: Plug | None = None
) -> SequenceRunner:
    """Return the runner of a sequence on a rig in the same process.

    Parameters
    ----------
    rig : Rig
        The rig on which the sequence runs.
    outputs : Outputs or Listener
        Takes the setpoints and events, and gives the readings.
    config : RigConfig
        The rig's configuration.
    sequence : Sequence
        The sequence to run.
    controller : Plug, optional
        A plugged controller in place of the embedded Alfa46.

    Returns
    -------
    SequenceRunner
        The runner, before its first step.

    Raises
    ------
    RigError
        When the rig lacks something that the sequence asks for.
    """
    sequence.check_rig(config)
    return SequenceRunner(sequence, LocalBench(rig, outputs, controller), config)


def ask_controller(rig: Rig, controller: Plug) -> Answer | None:
    """Return the plug's answer to the newest sample, from what reaches it of that; None when the plug discards the sample."""
    return controller.step(rig.sample, *rig.handed(controller.wants))


def give_answer(rig: Rig, controller: Plug, sample: int, answer: Answer) -> None:
    """Give the rig a plug's answer to a sample, at the level of the plug.

    Parameters
    ----------
    rig : Rig
        The rig that takes the answer.
    controller : Plug
        The plugged controller.
    sample : int
        The sample that is answered.
    answer : Answer
        The plug's answer.
    """
    if controller.level == "current":
        rig.set_current(sample, answer.command, controller.gear, controller.shifting, controller.flags)
    else:
        rig.set_duty(sample, answer.command, answer.setpoint, controller.gear, controller.shifting)


def advance_with(rig: Rig, controller: Plug) -> bool:
    """Advance one sample with a plugged controller.

    The answer acts ``rig.delay`` samples later; with a delay of 0 it acts before the rig moves. A controller that fails, or
    that never answers, trips the rig, with its message as the reason.

    Parameters
    ----------
    rig : Rig
        The rig to move.
    controller : Plug
        The plugged controller.

    Returns
    -------
    bool
        True when the controller answered the sample.
    """
    sample, answer = rig.sample, None
    controller.notice(rig.reason if rig.safe else "")
    try:
        answer = ask_controller(rig, controller)
        if answer is None:
            rig.explain_silence(controller.trouble)
    except ControllerFailed as failure:
        rig.trip(str(failure), BAD_CONTROLLER)
    if rig.delay > 0:
        rig.advance_samples(1)
    if answer is not None:
        give_answer(rig, controller, sample, answer)
    if rig.delay == 0:
        rig.advance_samples(1)
    asked = rig.sample - rig.asked_from
    if answer is None and rig.newest_command < 0 and not rig.safe and asked * SAMPLE > COMMAND_TIMEOUT:
        after = " after the reset" if rig.asked_from else ""
        rig.trip(f"none of the first {asked} samples{after} was answered: {controller.trouble}", NO_COMMAND)
    return answer is not None


def next_poll(runner: SequenceRunner, rig: Rig, period: Callable[[str], int], controller: Plug | None = None) -> int:
    """Return the sample of the next tick at which a sequence may have something to do.

    Parameters
    ----------
    runner : SequenceRunner
        The runner of the sequence.
    rig : Rig
        The rig.
    period : callable
        Returns the number of samples between two messages with a signal.
    controller : Plug, optional
        The plugged controller.

    Returns
    -------
    int
        The sample.
    """
    tick = rig.sample // TICK_SAMPLES
    if controller is not None:  # what a plug will do cannot be known beforehand
        return (tick + 1) * TICK_SAMPLES
    look = runner.next_look()
    due = int(look["until"] * 1e9 / (TICK_SAMPLES * SAMPLE_NS))
    if "gear" in look:  # before the order is taken, shift_end is still that of the shift before
        due = min(due, -(-(rig.shift_end + 1) // TICK_SAMPLES))
    if "signal" in look:
        every = max(1, period(look["signal"]) // TICK_SAMPLES)
        due = min(due, -(-tick // every) * every + 1)  # the tick after the next message
    return max(tick + 1, due) * TICK_SAMPLES


def simulate(
    config: RigConfig,
    sequence: Sequence,
    folder: Path,
    seed: int = 1,
    progress: Callable[[float, str], None] | None = None,
    controller: Plug | None = None,
    delay: int = 1,
) -> dict:
    """Run a sequence and write it into a bag.

    The bag is complete even when the sequence or the controller fails, or when Ctrl-C or SIGTERM interrupts the run.

    Parameters
    ----------
    config : RigConfig
        The rig's configuration.
    sequence : Sequence
        The sequence to run.
    folder : Path
        Folder of the bag.
    seed : int
        Seed of the run.
    progress : callable, optional
        It is called with the simulated time [s] and the text of the present step.
    controller : Plug, optional
        A plug (controllers.load_controller) in place of the embedded Alfa46; it is closed at the end.
    delay : int
        Number of samples after which the plug's answers act.

    Returns
    -------
    dict
        The ``run`` part of the report; its ``end`` gives the reason why the run ended.

    Raises
    ------
    RigError
        When the sequence or the controller does not fit the rig.
    """
    sequence.check_rig(config)
    rig = rig_for(config, seed, controller, delay)
    record = run_record(config, sequence, seed, delay)
    stops = Uninterrupted()
    with stops, BagWriter(folder, sequence.name, topics=config.catalogue.all_topics, library=LIBRARY_OF_RUN) as bag:
        outputs = BagOutputs(bag, rig, record, config.structure.shifts, controller)
        runner = runner_on(rig, outputs, config, sequence, controller)

        try:
            end = _moved(runner, rig, outputs, controller, progress, stops)
        finally:
            if controller is not None:
                controller.close()
            stops.held = True  # the bag is finished now
            outputs.finish()
        bag.end(**end)
    plugged = {}
    if config.structure.shifts:
        of_controller = controller.record() if controller else {"name": "alfa46", "level": rig.level, "level_from": DECLARED}
        plugged = {"controller": {**of_controller, "delay": rig.delay}}
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


def _moved(
    runner: SequenceRunner,
    rig: Rig,
    outputs: BagOutputs,
    controller: Plug | None,
    progress: Callable[[float, str], None] | None,
    stops: Uninterrupted,
) -> dict[str, str]:
    """Move a rig until its sequence has ended, and return state and reason of the end; the arguments are as in :func:`simulate`."""
    tell = progress or (lambda _time, _text: None)

    def uninterrupted(action: Callable[[], None]) -> None:
        stops.held = True
        try:
            action()
        finally:
            stops.let_in()

    try:
        done, upto = False, TICK_SAMPLES  # upto: sample of the next poll
        while not done and not rig.safe:
            if rig.sample >= upto:
                done = runner.poll(rig.time) or rig.time > LONGEST_RUN
                upto = rig.sample + 1 if done else next_poll(runner, rig, outputs.period, controller)
                tell(rig.time, runner.text)
            uninterrupted(outputs.boundary)
            if controller is None:
                rig.advance_samples(min(upto - rig.sample, outputs.room))
            else:
                sample = rig.sample
                if advance_with(rig, controller) and controller.signals:
                    outputs.signals_row(sample, controller.signal_values)
        if rig.status != RigStatus.TRIPPED:
            return {"state": "ended", "reason": "the sequence ended"}
        tell(rig.time, f"the rig is tripped: {rig.reason}")
        for _ in range(AFTER_TRIP):
            uninterrupted(outputs.boundary)
            rig.advance_samples(1)
        return {"state": "tripped", "reason": rig.reason, "trip": rig.tripped_by}
    except SequenceFailed as failure:
        tell(rig.time, f"failed: {failure}")
        return {"state": "failed", "reason": str(failure)}
    except KeyboardInterrupt as stop:
        return {"state": "interrupted", "reason": ended_by(stop)[0]}
