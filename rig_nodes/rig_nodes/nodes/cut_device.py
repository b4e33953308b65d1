# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A device in a separate process, outside the plant: it answers the port of a rig whose device is cut out (docs/how_to/cuts.md).

`rig device NAME`, `ros2 run rig_nodes device NAME` or the module with the name starts it. It contains the rig's own physics of the
device and serves one rig after the other until it is stopped.
"""

from __future__ import annotations

import os
import sys
import time
from typing import TYPE_CHECKING

from rclpy.node import Node

from ..bags import Fields, encoder
from ..base import SAMPLE_NS, RigError
from ..plant import OtherSide, Port, check_device
from ..runs import topic_of
from .message_class import message_class
from .process import RIG_OPTIONS, Process, ordered, run
from .qos import publisher_profile, recorder_profile
from .realtime import MESSAGES, prefer_process

if TYPE_CHECKING:
    from collections.abc import Callable

    from ..rig import RigConfig

NOTICE = 3.0  # s without a rig after which that is logged
SILENCE = 1.0  # s without a port after which that is logged
MOST_TICKS = 100  # ticks that one port may make up for


class CutDevice(Node):
    """Node ``<device>_device``: takes /<device>/cut/port, publishes /<device>/cut/answer."""

    def __init__(self, device: str, config: RigConfig) -> None:
        super().__init__(f"{device}_device")
        self.device, self.config = device, config
        self.newest_port_at: float | None = None  # time of the newest port; None before the first of a rig
        self.answered, self.missed = 0, 0
        port, answer = (config.catalogue.cut_topics[topic_of(device, end)] for end in ("port", "answer"))
        self._port, self._answer = port, answer
        self._fields = Fields(port.ros_type)
        self._encode = encoder(answer.ros_type).encode
        self.publisher = self.create_publisher(message_class(answer.ros_type), answer.name, publisher_profile(answer.qos))
        self._subscription = None
        self._side: OtherSide | None = None
        self._last: int | None = None  # newest sample
        self._seq = 0
        OtherSide(device, config).step(Port(tick=config.cut.tick))  # compiles, so that the first answer is on time

    @property
    def rigs(self) -> int:
        """Number of rigs whose port this device could answer."""
        return self.count_publishers(self._port.name)

    def has_subscribers(self) -> bool:
        """Return whether all subscribers of the answers are connected."""
        connected = self.publisher.get_subscription_count()
        return 0 < connected >= self.count_subscribers(self._answer.name)

    def listen(self) -> None:
        """Begin to receive ports; called only when the answers will arrive, because the rig then starts."""
        port = self._port
        self._subscription = self.create_subscription(
            message_class(port.ros_type), port.name, self.on_port, recorder_profile(port.qos), raw=True
        )

    def leave(self) -> None:
        """Forget a rig that is gone."""
        self.destroy_subscription(self._subscription)
        self._subscription, self._side, self._last, self.newest_port_at = None, None, None, None

    @property
    def listens(self) -> bool:
        """True while ports of a rig are received."""
        return self._subscription is not None

    def on_port(self, data: bytes) -> None:
        """Answer one port."""
        record = self._fields.of(data)
        sample, port = int(record["sample"]), Port(*(record[name].item() for name in Port._fields))
        self.newest_port_at = time.monotonic()
        if self._last is None or sample < self._last:  # another rig, or the same one from its start
            self._side, self._seq, ticks = OtherSide(self.device, self.config), 0, 1
        else:
            ticks = round((sample - self._last) * SAMPLE_NS * 1e-9 / port.tick)
            if ticks < 1:
                return
            self.missed += ticks - 1
        self._last = sample
        answer = self._side.step(port, min(ticks, MOST_TICKS))
        self.publisher.publish(self._encode(sample * SAMPLE_NS, self._seq, sample, *answer))
        self._seq += 1
        self.answered += 1


def work(process: Process, device: str) -> None:
    """Serve one rig after the other, and log which rig is there and which is missing."""
    config = ordered(process.arguments).config
    check_device(config.structure, device)
    executor = process.start_ros()
    node = CutDevice(device, config)
    executor.add_node(node)
    process.take_parameters([node])
    prefer_process(MESSAGES)
    domain = os.environ.get("ROS_DOMAIN_ID") or "0"
    since, warned = time.monotonic(), False
    silent = False
    process.log.info("waits for a rig with %s.source=topic in ROS domain %s", device, domain)
    while not process.stopping:
        process.spin(0.02 if not node.listens else 0.1)
        if not node.listens:
            if node.rigs and node.has_subscribers():
                node.listen()
                process.log.info("answers the rig in ROS domain %s", domain)
                silent = False
            elif not warned and time.monotonic() - since > NOTICE:
                warned = True
                if node.count_publishers("/rig/state"):
                    process.log.warning(
                        "the rig in ROS domain %s has its own %s; start it with --set %s.source=topic", domain, device, device
                    )
                else:
                    process.log.warning("there is no rig in ROS domain %s yet", domain)
        elif not node.rigs:
            node.leave()
            since, warned = time.monotonic(), True
            process.log.info("the rig has left; waits for another one")
        elif node.newest_port_at is not None and silent != (time.monotonic() - node.newest_port_at > SILENCE):
            silent = not silent
            process.log.info("no port for %g s" % SILENCE if silent else "ports come again")
    process.leave([node], [node.publisher], answered=node.answered, missed=node.missed)


def main() -> int:
    """Run the process; the first word of the command line names the device."""
    if len(sys.argv) < 2 or sys.argv[1].startswith("-"):
        print("name the device that the rig has cut out, e.g. device motor", file=sys.stderr)
        return RigError.exit_code
    device = sys.argv.pop(1)

    def serve(start: Callable[..., Process]) -> None:
        process = start(f"{device}_device", f"The device {device} outside the plant of a rig.", RIG_OPTIONS)
        work(process, device)

    return run(serve)


if __name__ == "__main__":
    sys.exit(main())
