# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The orders of gears at the node `alfa46`: the action /controller/shift from an order to its end, its refusal or its cancel.

nodes.alfa46 makes it. What the rig's state means for an order is decided here too.
"""

from __future__ import annotations

import threading
from collections.abc import Sequence
from typing import TYPE_CHECKING

from rclpy.action import CancelResponse, GoalResponse
from rig_msgs.action import Shift

from ..base import RigError
from ..controllers import refusal
from ..rig import SHIFT_ORDERED
from ..runs import RigStatus
from .action_server import GoalServer, finish
from .shift_phase import ShiftPhase

if TYPE_CHECKING:
    from rclpy.action.server import ServerGoalHandle

    from .alfa46 import Alfa46Node

FEEDBACK_SAMPLES = 50  # 20 Hz


class ShiftOrders:
    """The server of /controller/shift.

    Attributes
    ----------
    refused : int
        Number of refused orders.
    lock : RLock
        Held while the controller is asked or an order changes: in lockstep one thread handles samples and another serves ROS.
    setpoint : sequence of float
        Newest setpoint of each output [A].

    Parameters
    ----------
    node : Alfa46Node
        The node, whose controller is loaded.
    """

    def __init__(self, node: Alfa46Node) -> None:
        self._node, self._box = node, node.box
        self.refused, self.lock, self.setpoint = 0, threading.RLock(), ()
        self._phase: ShiftPhase | None = None  # of the running shift; None when no shift runs
        self._goal: ServerGoalHandle | None = None  # goal handle of the shift, as soon as it is known
        self._t_order: float | None = None  # time of its order [s], as soon as it is known
        self._ordered_at = -1  # newest sample at the order, which the controller takes with the next sample
        self._refusal: str | None = None  # why the order that is being handled is refused
        self._rig_status: int | None = None  # as received last, with its reason
        self._rig_reason = ""
        self._server = GoalServer(node, Shift, "/controller/shift", self._on_goal, self._on_cancel, self._on_request)

    def _on_request(self, request: Shift.Goal) -> GoalResponse:
        """Order a gear before the goal is answered, so that an accepted goal means that the order stands.

        A gear that does not exist is rejected. Any other refused order is accepted as a goal all the same, and is then ended
        with the reason.
        """
        gear = int(request.gear)
        if gear not in self._node.gears:
            self._refuse(f"shift refused: {refusal(gear, self._box.gear, False, self._node.transmission)}", gear)
            return GoalResponse.REJECT
        try:
            if self._phase is not None:
                raise RigError(f"shift refused: a shift to {self._node.gears[self._phase.new]} is still running; wait for its end")
            if self._node.last_sample is None:
                raise RigError("shift refused: the rig does not run yet; wait for its first sample")
            with self.lock:
                self._check_status()
                old = self._box.gear
                self._box.order(gear)
                self._goal, self._t_order, self._ordered_at = None, None, self._node.last_sample
                self._phase = ShiftPhase(self._node.transmission, old, gear)
                self._refusal = None
        except RigError as error:
            self._refusal = str(error)
        return GoalResponse.ACCEPT

    def _on_goal(self, goal: ServerGoalHandle) -> None:
        """Keep the goal of the shift that was just ordered, or end the goal with the reason why the order was refused."""
        with self.lock:
            why = self._refusal
            if why is None:
                self._goal = goal
                return
        self._refuse(why, int(goal.request.gear))
        finish(goal, Shift.Result(success=False, message=why, gear=self._box.gear))

    def _refuse(self, why: str, gear: int) -> None:
        """Count a refused order and report the reason."""
        self.refused += 1
        self._node.get_logger().warning(why)
        self._node.event("shift_refused", why, float(gear))

    def _check_status(self) -> None:
        """Raise RigError when the rig would not obey the command that follows from an order."""
        if self._rig_status == RigStatus.TRIPPED:
            raise RigError(f"shift refused: the rig is in its safe state ({self._rig_reason}); call /rig/reset first")
        if self._rig_status == RigStatus.STARTING:
            raise RigError("shift refused: the rig is starting; wait until /rig/state is ready")

    def receive_status(self, status: int, reason: str) -> None:
        """Take the rig's state: after a trip the controller continues in neutral, and the running order has failed.

        Parameters
        ----------
        status : int
            The rig's state, a RigStatus.
        reason : str
            Why the rig is in this state.
        """
        if status == RigStatus.STARTING and self._rig_status is None:
            return  # the rig waits for this node's first command
        with self.lock:
            was, self._rig_status, self._rig_reason = self._rig_status, status, reason
            self._box.notice(reason if status == RigStatus.TRIPPED else "")
            # a second start means a trip that was over before its state arrived
            again = status == RigStatus.STARTING and was in (RigStatus.READY, RigStatus.RUNNING)
            if not again and (status != RigStatus.TRIPPED or was == status):
                return
            self._box.force_neutral()
            phase, goal, self._phase, self._goal = self._phase, self._goal, None, None
            if phase is None:
                return
            why = "the rig was reset" if again else f"the rig is in its safe state: {reason}"
            text = f"{why}; the shift to {self._node.gears[phase.new]} was given up"
            if goal is None:
                self._refusal = text  # the goal of this order has not arrived yet and will be ended with this reason
        self._node.event("shift_aborted", text, float(phase.new))
        if goal is not None:
            finish(
                goal,
                Shift.Result(
                    success=False, message=text, gear=self._box.gear, t_order=self._t_order or 0.0, t_end=self._node.stamp * 1e-9
                ),
            )

    def _on_cancel(self, goal: ServerGoalHandle) -> CancelResponse:
        """Withdraw an order that the controller has not seen; a shift that has begun is carried to its end.

        Half a shift has no safe end: if it were held there, either both clutches would slip under load or neither would carry it.
        """
        gear = int(goal.request.gear)
        with self.lock:
            withdrawn = goal is self._goal and self._box.withdraw()
            if withdrawn:
                self._phase = self._goal = None
        if not withdrawn:
            text = (
                f"cancel refused: the shift to {self._node.gears.get(gear, gear)} has begun and is carried to its end; "
                "order another gear then, or stop the rig with /rig/e_stop"
            )
            self._node.get_logger().warning(text)
            self._node.event("cancel_refused", text, float(gear))
            return CancelResponse.REJECT
        text = f"shift to {self._node.gears[gear]} withdrawn before the controller took it"
        self._node.event("shift_withdrawn", text, float(gear))
        finish(goal, Shift.Result(success=False, message=text, gear=self._box.gear))
        return CancelResponse.ACCEPT

    def follow(self, sample: int, measured: Sequence[float]) -> None:
        """Publish events, feedback and result of the running shift, if one runs and the controller has taken a sample since."""
        if self._phase is None or sample <= self._ordered_at:
            return
        t, gear, goal = self._node.stamp * 1e-9, self._phase.new, self._goal
        if self._t_order is None:
            self._t_order = t
            self._node.event(SHIFT_ORDERED, f"shift to {self._node.gears[gear]} ordered", float(gear))
        if goal is None:
            return
        if not self._box.shifting and self._box.gear == gear:
            self._phase = None
            self._node.event("shift_done", "the profiles of the shift have ended", float(gear))
            message = f"gear {self._node.gears[gear]} after {t - self._t_order:.3f} s"
            finish(goal, Shift.Result(success=True, message=message, gear=gear, t_order=self._t_order, t_end=t))
        elif sample % FEEDBACK_SAMPLES == 0:
            n_in, n_out = self._box.rig_record.speeds(measured)
            phase = self._phase.name(n_in, n_out, [pressure(measured) for pressure in self._node.pressures])
            goal.publish_feedback(
                Shift.Feedback(phase=phase, slip=float(self._phase.slip(n_in, n_out)), setpoint=list(self.setpoint))
            )
