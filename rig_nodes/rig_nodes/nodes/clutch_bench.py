# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Nodes of the clutch bench and its force benches (thesis chapter 8), one for each device; no physics.

Used by the rig container; what they publish is encoded by testbench.outputs.
"""

from ..testbench.clutch_bench_configuration import KIND
from ..testbench.clutch_bench_topics import COMMANDS
from .device import Device
from .rig_node import RigNode


class HydraulicMotor(Device):
    """Motor SH with flow regulator RP and torque meter: publishes /hydraulic_motor/*, takes its speed [rad/s]."""

    def __init__(self, rig, commands):
        super().__init__("hydraulic_motor", commands, KIND)
        self.on_drive(COMMANDS["motor"], rig)


class ValveZp2(Device):
    """Maximum valve of the motor's line: takes /valve_zp2/command, the pressure [Pa, gauge] that it is turned to."""

    def __init__(self, rig, commands):
        super().__init__("valve_zp2", commands, KIND)
        self.on_setpoint(COMMANDS["relief"], rig.set_relief)


class Cylinder(Device):
    """Cylinder S_z with lever valve and relief valve ZP_1: publishes /cylinder/*, takes its pressure [Pa, gauge]."""

    def __init__(self, rig, commands):
        super().__init__("cylinder", commands, KIND)
        self.on_setpoint(COMMANDS["cylinder"], rig.set_cylinder)


class TestingMachine(Device):
    """Testing machine of the spring bench: takes /testing_machine/command, the travel [m] that it moves to."""

    def __init__(self, rig, commands):
        super().__init__("testing_machine", commands, KIND)
        self.on_setpoint(COMMANDS["press"], rig.set_press)


class ClutchPack(Device):
    """The plates in their held housing: publishes /clutch_pack/*."""

    def __init__(self, commands):
        super().__init__("clutch_pack", commands, KIND)


class Instruments(Device):
    """The logger: publishes /instruments/*."""

    def __init__(self, commands):
        super().__init__("instruments", commands, KIND)


def bench_nodes(rig, commands) -> list:
    """All nodes of a bench; the testing machine only where there is one."""
    nodes = [RigNode(rig, commands, valve_commands=False), HydraulicMotor(rig, commands), ValveZp2(rig, commands),
             Cylinder(rig, commands), ClutchPack(commands), Instruments(commands)]
    if rig.config.cylinder.testing_machine:
        nodes.append(TestingMachine(rig, commands))
    return nodes


def receivers(config) -> dict[str, str]:
    """Topic of each setpoint -> the node that takes it, on a bench with this configuration."""
    out = {topic: topic.split("/")[1] for topic in COMMANDS.values()}
    if not config.cylinder.testing_machine:
        del out[COMMANDS["press"]]
    return out
