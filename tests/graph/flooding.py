# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A user's program that sends one kind of orders far more often than any user does: flooding.py KIND SECONDS.

It prints a line as it begins, and at its end how many it has sent and how many were answered. Valve commands are stale ones, which
the rig refuses.
"""

import sys
import time

import rclpy
from rcl_interfaces.srv import SetParameters
from rclpy.action import ActionClient
from rclpy.experimental import EventsExecutor
from rclpy.parameter import Parameter
from rclpy.serialization import serialize_message
from rclpy.task import Future
from rig_msgs.action import Shift
from rig_msgs.msg import ValveCommand
from std_srvs.srv import Trigger

FAULT = "p2.offset"
PERIOD = 0.01  # s between two looks of a program at its clock
AFTER = 15.0  # s for answers to what was sent last, on a machine whose cores the floods take
AT_ONCE = {"valves": 50, "shifts": 1, "faults": 1, "resets": 1}  # orders in a period


def sender(node, kind):
    """Returns the function that sends order number n; it returns the future of the answer, None where there is none."""
    if kind == "valves":
        publisher = node.create_publisher(ValveCommand, "/controller/command", 1000)
        stale = serialize_message(ValveCommand(sample=1, duty=[0.0] * 3, setpoint=[0.0] * 3))
        return lambda n: publisher.publish(stale)
    if kind == "shifts":
        action = ActionClient(node, Shift, "/controller/shift")
        return lambda n: action.send_goal_async(Shift.Goal(gear=1 + n % 2)) if action.server_is_ready() else None
    service, name = (SetParameters, "/rig/set_parameters") if kind == "faults" else (Trigger, "/rig/reset")
    client = node.create_client(service, name)
    if kind == "resets":
        return lambda n: client.call_async(Trigger.Request())
    orders = [
        SetParameters.Request(parameters=[Parameter("fault", value=order).to_parameter_msg()])
        for order in (f"{FAULT}, size=1 %", f"{FAULT}, off=true")
    ]
    return lambda n: client.call_async(orders[n % 2])


def main(kind: str, seconds: float) -> None:
    """Send until the time is over, and receive the answers."""
    rclpy.init()
    node, executor = rclpy.create_node(f"flood_of_{kind}"), EventsExecutor()
    executor.add_node(node)
    send, sent, answered = sender(node, kind), 0, []
    print("it begins", flush=True)
    began = due = time.monotonic()
    while time.monotonic() < began + seconds:
        for _ in range(AT_ONCE[kind]):
            answer = send(sent)
            if answer is not None:
                answer.add_done_callback(lambda _: answered.append(True))
            sent += 1
        due += PERIOD
        executor.spin_until_future_complete(Future(), max(0.0, due - time.monotonic()))
    over = time.monotonic() + AFTER
    while len(answered) < sent and time.monotonic() < over:
        executor.spin_until_future_complete(Future(), PERIOD)
    print(f"{sent} {kind} sent, {len(answered)} answered", flush=True)
    rclpy.shutdown()


if __name__ == "__main__":
    main(sys.argv[1], float(sys.argv[2]))
