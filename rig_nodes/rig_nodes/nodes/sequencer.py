# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The sequencer: it runs test sequences on the rig, one at once with --sequence, or others by the action /sequencer/run.

nodes.processes.supervisor starts it. It is polled at every graph tick of simulated time, which the samples bring.
"""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

from rclpy.action import CancelResponse
from rclpy.node import Node
from rig_msgs.action import RunSequence

from ..bags import stamp
from ..base import SAMPLE_NS, TICK_SAMPLES, Link, LinkClosed, RigError
from ..plant import LoadConfig, relief_setting_for
from ..runs import Sequence, SequenceFailed, SequenceRunner, load_sequence
from .action_server import GoalServer, finish
from .device import own_nodes, pace_of, setpoints_taken
from .diagnostics import OK, WARN, Diagnostics, Health
from .matching import meet, silent
from .message_class import message_class
from .process import RIG_OPTIONS, SEQUENCE_PARAMETERS, Process, ordered, run
from .qos import recorder_profile
from .realtime import STEPS, prefer_process
from .ros_bench import EVENTS, RosBench

if TYPE_CHECKING:
    from rclpy.action.server import ServerGoalHandle

    from ..rig import RigConfig

FEEDBACK_TICKS = 100  # feedback at 2 Hz, and at every new step
OPTIONS = [
    *RIG_OPTIONS,
    SEQUENCE_PARAMETERS,
    ("--sequence", {"metavar": "NAME", "help": "name or file of a sequence to run at once"}),
    ("--once", {"action": "store_true", "help": "end with the sequence of --sequence, with exit code 1 when it failed"}),
]


class Sequencer(Node):
    """Publishes setpoints and /sequencer/events, and serves /sequencer/run."""

    def __init__(self, config: RigConfig, rig: str, process: Process) -> None:
        super().__init__("sequencer")
        self.process, self._config, self._rig = process, config, rig
        self.link = process.links().get("container")  # of a run in lockstep
        self.bench = RosBench(self, config, self.link is not None)
        self._samples = pace_of(config)
        self._tick = -1
        self._runner: SequenceRunner | None = None
        self._goal: ServerGoalHandle | None = None
        self._steps_reported = 0
        self._cancelled = False  # True when the goal is to be ended at the next tick
        self._failed = ""  # why the newest sequence did not reach its end
        self.outcome: dict | None = None  # result of the sequence of --sequence, when it is over
        self.diagnostics = Diagnostics(self, self.health, lambda: self.bench.stamp_ns)
        self._server = GoalServer(
            self, RunSequence, "/sequencer/run", self.on_goal, self.on_cancel, on_cancel_all=self.on_cancel_all
        )

    def listen(self) -> None:
        """Subscribe to the samples; called when the receivers of the setpoints are connected."""
        self.create_subscription(
            message_class(self._samples.ros_type), self._samples.name, self.on_sample, recorder_profile(self._samples.qos), raw=True
        )

    def on_frame(self, frame: dict) -> dict:
        """Do one graph tick in lockstep.

        Parameters
        ----------
        frame : dict
            The frame of the container, with the readings.

        Returns
        -------
        dict
            What was sent, whether the sequence is over, and when the next tick is needed.
        """
        self._tick = frame["sample"] // TICK_SAMPLES
        self.bench.stamp_ns = frame["sample"] * SAMPLE_NS
        self.bench.take(frame)
        had = self._runner is not None
        # the run ends with its own sequence, not with one that a client has started
        own = had and self._goal is None
        if had:
            self.poll(self.bench.stamp_ns * 1e-9)
        return {
            "need": sorted(self.bench.needed),
            "sent": self.bench.sent(),
            "done": own and self._runner is None,
            **self._next_look(),
        }

    def _next_look(self) -> dict:
        """When the container must ask again: at the sample ``next``, or earlier when the condition ``watch`` is met."""
        feedback_tick = (self._tick // FEEDBACK_TICKS + 1) * FEEDBACK_TICKS
        if self._runner is None:
            return {"next": feedback_tick * TICK_SAMPLES, "watch": {}}
        watch = self._runner.next_look()
        due = int(watch.pop("until") * 1e9 / (TICK_SAMPLES * SAMPLE_NS))
        return {"next": max(self._tick + 1, min(feedback_tick, due)) * TICK_SAMPLES, "watch": watch}

    def on_sample(self, data: bytes) -> None:
        """Continue the sequence at every graph tick."""
        stamp_ns = stamp(data)
        tick = stamp_ns // (TICK_SAMPLES * SAMPLE_NS)
        if tick <= self._tick:
            return
        self._tick, self.bench.stamp_ns = tick, stamp_ns
        if self._runner is not None:
            self.poll(self.bench.stamp_ns * 1e-9)

    def health(self) -> list[Health]:
        """Return the health of the sequencer, for /diagnostics."""
        runner = self._runner
        if runner is not None:
            step = f"step {runner.step + 1} of {runner.steps}: " if runner.step >= 0 else ""
            return [Health("sequencer", OK, f"runs '{runner.sequence.name}', {step}{runner.text}")]
        if self._failed:
            return [Health("sequencer", WARN, f"no sequence runs; the last one ended early: {self._failed}")]
        return [Health("sequencer", OK, "no sequence runs")]

    # ---- one sequence

    def on_goal(self, goal: ServerGoalHandle) -> None:
        """Start a sequence for a client, or end the goal at once with the reason why it is refused."""
        try:
            if self._runner is not None:
                raise RigError(f"sequence refused: '{self._runner.sequence.name}' is still running")
            self.start(load_sequence(goal.request.name, None, self._rig, config=self._config))
            self._goal = goal
        except RigError as error:
            self.process.tell(f"sequence '{goal.request.name}' was ordered: {error}", self.bench.stamp_ns * 1e-9)
            result = RunSequence.Result(success=False, message=str(error), steps_done=0)
            finish(goal, result)

    def on_cancel(self, goal: ServerGoalHandle) -> CancelResponse:
        """Cancel the running sequence of a client at the next tick; any other goal is ending already."""
        if goal is not self._goal:
            return CancelResponse.REJECT
        self._cancelled = True
        self.wake()
        return CancelResponse.ACCEPT

    def on_cancel_all(self) -> bool:
        """Cancel the sequence with which the rig was started at the next tick; return False when none runs."""
        self._cancelled = self._runner is not None
        self.wake()
        return self._cancelled

    def start(self, sequence: Sequence) -> None:
        """Start a sequence at the next tick; RigError when the rig lacks something that it asks for."""
        sequence.check_rig(self._config)
        self.bench.need(sequence)
        self._steps_reported, self._cancelled = 0, False
        self._runner = SequenceRunner(sequence, self.bench, self._config)
        self.wake()

    def wake(self) -> None:
        """In lockstep, make the container ask at its next tick, whatever was agreed."""
        if self.link is not None:
            self.link.send_json({"wake": True})

    def poll(self, t: float) -> None:
        """Do one tick of the running sequence at simulated time t [s]."""
        runner = self._runner
        if self._cancelled:
            text = cancelled(runner)
            self.process.tell(text, t)
            self.bench.event("sequence_cancelled", text, float(max(0, runner.step)))
            self.finish(False, text, t)
            return
        try:
            reason = self.bench.trip_reason()
            if reason is not None:
                raise SequenceFailed(f"the rig is in its safe state: {reason}")
            done = runner.poll(t)
        except RigError as error:
            self._report_steps(runner, t)
            step = (
                f"step {runner.step + 1} of {runner.steps} failed: "
                if runner.step >= 0
                else f"sequence '{runner.sequence.name}' failed: "
            )
            self.process.tell(f"{step}{error}", t)
            self.bench.event("sequence_failed", str(error), float(runner.step + 1))
            self.finish(False, str(error), t)
            return
        if done:
            self.finish(True, f"sequence '{runner.sequence.name}' is done", t)
        elif (self._report_steps(runner, t) or self._tick % FEEDBACK_TICKS == 0) and self._goal is not None:
            self._goal.publish_feedback(RunSequence.Feedback(step=runner.step + 1, steps=runner.steps, text=runner.text, t=t))

    def _report_steps(self, runner: SequenceRunner, t: float) -> bool:
        """Report to /rosout and the supervisor which steps have begun since the last tick; False when none has."""
        begun = runner.sequence.steps[self._steps_reported : runner.step + 1]
        for step in begun:
            self._steps_reported += 1
            self.get_logger().info(f"step {self._steps_reported} of {runner.steps}: {step.text}")
            self.process.status("step", step=self._steps_reported, steps=runner.steps, text=step.text, t=t)
        return bool(begun)

    def finish(self, success: bool, text: str, t: float) -> None:
        """Report to supervisor and client that the sequence is over, at simulated time t [s]."""
        runner, self._runner = self._runner, None
        self._failed = "" if success else text
        self._report_steps(runner, t)
        goal, self._goal = self._goal, None
        self.process.status("done", success=success, text=text, t=t)
        if goal is None:
            self.outcome = {"success": success, "text": text}
            if self.process.arguments.once:
                self.process.stop()
            return
        done = min(max(0, runner.step), runner.steps)
        finish(goal, RunSequence.Result(success=success, message=text, steps_done=done))


def cancelled(runner: SequenceRunner) -> str:
    """Return one sentence on the state in which a sequence that is cancelled now leaves the rig."""
    if runner.step < 0:
        return f"sequence '{runner.sequence.name}' was cancelled before its first step; nothing was set"
    *others, last = runner.config.settings.steps
    devices = f"{', '.join(others)} and {last}" if others else last
    shift = runner.sequence.steps[runner.step].kind == "shift"
    return (
        f"sequence '{runner.sequence.name}' was cancelled in step {runner.step + 1} of {runner.steps} "
        f"({runner.text}); {devices} stay as they are set" + (", the shift goes on to its end" if shift else "")
    )


def work(process: Process) -> None:
    """Run the process: wait for the receivers, run the sequence, end in order."""
    arguments = process.arguments
    config, rig, sequence, *_ = ordered(arguments)
    executor = process.start_ros()
    node = Sequencer(config, rig, process)
    executor.add_node(node)
    process.take_parameters([node])
    if sequence is not None:
        node.start(sequence)
    for device in config.structure.devices:
        if isinstance(values := config.values(device.name), LoadConfig):
            relief_setting_for(0.0, 0.0, values)  # compiled now, not in the middle of a sequence
    recorder = {"recorder"} if arguments.recorded else set()
    wanted = {one.topic: {one.node} | recorder for one in setpoints_taken(config)} | {EVENTS: recorder}
    while not process.stopping and silent(node, node.bench.outputs, wanted):
        process.spin(0.02)
    meet(process, node, node.bench.outputs, own_nodes(config))
    if node.link is not None:
        serve_in_lockstep(process, node, node.link)
    elif not process.stopping:
        # a sequencer for which a busy machine has no time sees samples of seconds later before the answer to its order
        prefer_process(STEPS)
        node.listen()
    while not process.stopping:
        process.spin(0.05)
    process.leave([node], node.bench.outputs.values(), published=node.bench.counts, outcome=node.outcome)
    if arguments.once and node.outcome is not None and not node.outcome["success"]:
        raise SequenceFailed(node.outcome["text"])


def serve_in_lockstep(process: Process, node: Sequencer, link: Link) -> None:
    """Answer the container's ticks until one of the two processes ends; ROS is served while waiting."""
    try:
        while not process.stopping and not node.bench.connected():
            process.spin(0.02)
        link.send_json({"need": sorted(node.bench.needed)})
        while not process.stopping:
            frame = link.receive_json(0.01)
            if frame is not None:
                link.send_json(node.on_frame(frame))
            process.spin(0.0)  # goals and cancels arrive while the rig goes on
    except LinkClosed:
        pass  # the supervisor sees it too and ends this process


def main() -> int:
    """Entry point."""
    return run(lambda start: work(start("sequencer", "The sequencer.", OPTIONS)))


if __name__ == "__main__":
    sys.exit(main())
