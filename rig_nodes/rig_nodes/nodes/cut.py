# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The rig container's side of the cuts: the node of each cut device sends its ports and receives its answers.

The rig container uses it; the other side is a device node (nodes.cut_device) or a user's own node.
"""

from __future__ import annotations

import os
import threading
import time
from typing import TYPE_CHECKING

from ..plant import Answer
from ..rig import NO_ANSWER
from ..runs import Rig, RigStatus, topic_of
from .device import Device, receive
from .message_class import message_class
from .qos import publisher_profile, recorder_profile, stream_profile

if TYPE_CHECKING:
    from collections.abc import Iterable

    import numpy as np

    from .commands import Commands
    from .process import Process

POLL = 0.05  # s between checks whether the device that is awaited still exists


class CutEnds:
    """Ports and answers on the nodes of cut devices; in lockstep a tick waits for the answers to the last one.

    Parameters
    ----------
    rig : Rig
        The rig.
    commands : Commands
        The rig's queue.
    nodes : iterable of Device
        The nodes of the rig container.
    process : Process
        The process of the rig container.
    step_timeout : float or None
        Real time in which a device must answer in lockstep [s]; None for no limit.
    """

    def __init__(self, rig: Rig, commands: Commands, nodes: Iterable[Device], process: Process, step_timeout: float | None) -> None:
        """Open the topics; the class describes the parameters."""
        self.devices = rig.cuts.devices
        self._rig, self._commands, self._process, self._timeout = rig, commands, process, step_timeout
        self._came = threading.Event()
        self.tap = None  # in lockstep the recorder gets the answers from here, so that it cannot fall behind them
        self._nodes = {node.get_name(): node for node in nodes}
        for device in self.devices:
            self._open(self._nodes[device], device)

    def _open(self, node: Device, device: str) -> None:
        port, answer = (self._rig.config.catalogue.cut_topics[topic_of(device, end)] for end in ("port", "answer"))
        node.outputs[port.name] = node.create_publisher(message_class(port.ros_type), port.name, publisher_profile(port.qos))

        def take(message: np.void) -> None:
            if self.tap is not None:
                self.tap.put([(answer.name, message.tobytes())])
            self._commands.put(
                answer.name,
                self._rig.cuts.answer,
                device,
                int(message["sample"]),
                Answer(*(float(message[name]) for name in Answer._fields)),
            )
            self._came.set()

        # in real time no answer may wait for a lost one to be sent again; in lockstep none may be lost
        in_lockstep = self._process.arguments.speed is not None
        profile = recorder_profile(answer.qos) if in_lockstep else stream_profile(answer.qos)
        node.inputs[answer.name] = receive(node, answer, take, profile, self._commands.refuse)

    @property
    def answers(self) -> list[str]:
        """The topics on which the devices answer."""
        return [topic_of(device, "answer") for device in self.devices]

    def missing(self) -> list[str]:
        """Return sentences on the devices whose ports no node answers yet."""
        out = []
        for device in self.devices:
            node, port = self._nodes[device], topic_of(device, "port")
            listeners = {info.node_name for info in node.get_subscriptions_info_by_topic(port)} - {"recorder"}
            if not listeners or not node.inputs[topic_of(device, "answer")].get_publisher_count():
                domain = os.environ.get("ROS_DOMAIN_ID", "0")
                out.append(
                    f"{device} is cut out and no node answers {port}; start its node with: ./rig device {device} --domain {domain}"
                )
        return out

    def wait(self) -> None:
        """Before a tick in lockstep, wait for the answers to the last ports; a device that does not answer trips the rig."""
        rig = self._rig
        if not self.devices or rig.sample == 0 or not rig.cuts.is_due():
            return
        due, began = rig.sample - rig.cuts.samples, time.monotonic()
        for device in self.devices:
            while rig.status != RigStatus.TRIPPED and not self._process.stopping:
                self._came.clear()
                self._commands.apply()
                if rig.cuts.answered(device)[0] >= due:
                    break
                if not self._came.wait(POLL):
                    self._look_after(device, time.monotonic() - began)

    def _look_after(self, device: str, waited: float) -> None:
        answer = topic_of(device, "answer")
        if not self._nodes[device].inputs[answer].get_publisher_count():
            self._rig.trip(f"{device}: nobody sends {answer} any more", NO_ANSWER)
        elif self._timeout is not None and waited > self._timeout:
            self._rig.trip(f"{device}: no answer on {answer} within {self._timeout:g} s of real time", NO_ANSWER)
