# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A node of ROS 2 that works the rig by hand: oil, gear I, the motor, and gear II under load.

Start the rig with `./rig run`, which prints its domain, then in a second terminal, or in any shell with ROS 2 Jazzy and rig_msgs:

    ROS_DOMAIN_ID=1 .venv/bin/python docs/examples/ros/first_shift.py
"""

import sys
import time

import rclpy
from rclpy.action import ActionClient
from rclpy.node import Node
from rig_msgs.action import Shift
from rig_msgs.msg import Measurement, Setpoint

RPM = 0.10472  # rad/s; the graph has SI units


class FirstShift(Node):
    """Sends setpoints and orders of gears, and reads input speed and load."""

    def __init__(self):
        super().__init__("first_shift")
        self.commands = {
            name: self.create_publisher(Setpoint, f"/{name}/command", 1) for name in ("oil_supply", "motor", "load_pump")
        }
        self.create_subscription(Measurement, "/motor/n_wej", self.on_speed, 10)
        self.create_subscription(Measurement, "/load_pump/m_wyj", self.on_load, 10)
        self.shifts = ActionClient(self, Shift, "/controller/shift")
        self.speed, self.load = 0.0, 0.0  # rad/s, Nm

    def on_speed(self, message):
        self.speed = message.value

    def on_load(self, message):
        self.load = message.value

    def until(self, met, what, seconds=30.0):
        """Serve ROS until something is met."""
        deadline = time.monotonic() + seconds
        while not met():
            if time.monotonic() > deadline:
                sys.exit(f"{what}: not within {seconds:g} s")
            rclpy.spin_once(self, timeout_sec=0.1)

    def connect(self):
        """Wait for the rig: a setpoint that is sent before its receivers are there, the device and the recorder, is lost."""
        self.until(lambda: all(one.get_subscription_count() >= 2 for one in self.commands.values()), "the rig's devices")
        self.until(self.shifts.server_is_ready, "the shift controller")

    def set(self, name, value):
        """Switch a device on with a value in SI units."""
        self.commands[name].publish(Setpoint(value=value, enable=True))

    def order(self, gear):
        """Order a gear, and return the result once the shift has ended."""
        asked = self.shifts.send_goal_async(Shift.Goal(gear=gear), lambda told: self.phase(told.feedback))
        self.until(asked.done, "the answer of the controller")
        if not asked.result().accepted:
            sys.exit(f"there is no gear {gear}")
        result = asked.result().get_result_async()
        self.until(result.done, "the end of the shift")
        found = result.result().result
        if not found.success:
            sys.exit(found.message)
        return found

    def phase(self, feedback):
        """Say in which phase the shift is."""
        self.get_logger().info(f"{feedback.phase}, slip {100.0 * feedback.slip:.0f} %", throttle_duration_sec=0.2)


def main():
    rclpy.init()
    node = FirstShift()
    node.connect()
    node.set("oil_supply", 4e6)  # Pa
    node.order(1)
    node.set("motor", 1500 * RPM)
    node.until(lambda: node.speed > 1490 * RPM, "1490 rpm")
    node.set("load_pump", 5e6)  # Pa at its relief valve, some 80 Nm
    node.until(lambda: node.load > 60.0, "60 Nm")
    settled = time.monotonic() + 1.0
    node.until(lambda: time.monotonic() > settled and abs(node.speed - 1500 * RPM) < 8 * RPM, "1500 rpm under load")
    found = node.order(2)
    print(f"{found.message}: ordered at {found.t_order:.3f} s, ended at {found.t_end:.3f} s")
    rclpy.shutdown()


if __name__ == "__main__":
    main()
