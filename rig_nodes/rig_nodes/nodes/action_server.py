# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The rig's action servers: the node itself moves a goal on, ends it with a result, and grants or refuses to cancel it.

alfa46 (shift) and sequencer (run) use them.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any, NoReturn

from action_msgs.msg import GoalInfo
from action_msgs.srv import CancelGoal
from builtin_interfaces.msg import Time
from rclpy._rclpy_pybind11 import RCLError
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.action.server import GoalEvent, ServerGoalHandle

if TYPE_CHECKING:
    from collections.abc import Callable

    from rclpy.node import Node
    from rig_msgs.action import RunSequence, Shift


class GoalServer(ActionServer):
    """An action whose goals the node itself moves on; :func:`finish` ends a goal.

    A cancel request that the node refuses is answered with ERROR_REJECTED, as action_msgs defines it and as rclcpp does.
    rclpy's own server would answer ERROR_NONE with an empty list.

    Parameters
    ----------
    node : Node
        The node that owns the action.
    kind : type
        Type of the action.
    name : str
        Name of the action.
    on_goal : callable
        It is called with the handle of an accepted goal.
    on_cancel : callable
        It is called with the handle of a goal and returns a CancelResponse.
    on_request : callable
        It is called with a request, before ``on_goal``, and returns a GoalResponse.
    on_cancel_all : callable
        It is called for a request for all goals while there is none, and returns whether it cancels what no goal has begun.
    """

    def __init__(
        self,
        node: Node,
        kind: type,
        name: str,
        on_goal: Callable[[ServerGoalHandle], None],
        on_cancel: Callable[[ServerGoalHandle], CancelResponse],
        on_request: Callable[[Any], GoalResponse] = lambda request: GoalResponse.ACCEPT,
        on_cancel_all: Callable[[], bool] = lambda: False,
    ) -> None:
        """Open the action; the class describes the parameters."""
        super().__init__(
            node,
            kind,
            name,
            execute_callback=lambda handle: None,
            goal_callback=on_request,
            handle_accepted_callback=on_goal,
            cancel_callback=on_cancel,
        )
        self._on_cancel, self._on_cancel_all = on_cancel, on_cancel_all

    async def execute(self, taken_data: Any) -> None:
        """Handle what has come; an exception ends the process as that of any other callback does, where rclpy would keep it."""
        try:
            await super().execute(taken_data)
        except Exception as error:
            self._node.create_timer(0.0, partial(_throw_of_action, error))

    async def _execute_cancel_request(self, request_header_and_message: tuple[object, CancelGoal.Request]) -> None:
        header, request = request_header_and_message
        with self._lock:
            response = self._handle.process_cancel_request(request, CancelGoal.Response)
        asked, response.goals_canceling = list(response.goals_canceling), []
        for goal in asked:
            handle = self._goal_handles.get(bytes(goal.goal_id.uuid))
            if handle is not None and self._on_cancel(handle) == CancelResponse.ACCEPT:
                handle._update_state(GoalEvent.CANCEL_GOAL)
                response.goals_canceling.append(goal)
        info = request.goal_info  # without an id and without a stamp it is for all goals
        if not asked and not any(info.goal_id.uuid) and info.stamp == Time() and self._on_cancel_all():
            response.goals_canceling.append(GoalInfo())
        if asked and not response.goals_canceling:
            response.return_code = CancelGoal.Response.ERROR_REJECTED
        try:
            self._handle.send_cancel_response(header, response)
        except RCLError:
            pass  # the client is gone


def _throw_of_action(error: Exception) -> NoReturn:
    raise error


def finish(goal: ServerGoalHandle, result: Shift.Result | RunSequence.Result) -> None:
    """End a goal with its result: canceled if that was granted, otherwise succeeded or aborted as the result states."""

    def end(handle: ServerGoalHandle) -> Shift.Result | RunSequence.Result:
        if handle.is_cancel_requested:
            handle.canceled()
        elif result.success:
            handle.succeed()
        else:
            handle.abort()
        return result

    goal.execute(end)
