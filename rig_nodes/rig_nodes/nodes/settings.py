# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""ROS parameters of the rig's nodes: declared with text, unit and range, checked, and refused with the reason.

The devices that have settings use it and, through Settings, alfa46_settings. A check answers the caller; an accepted value is
enqueued, and the loop that owns the values takes it.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING

from rcl_interfaces.msg import FloatingPointRange, ParameterDescriptor, SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter

from ..base import RigError
from ..rig import CHANGED, Setting

if TYPE_CHECKING:
    from ..runs import Rig
    from .commands import Commands

FOLLOW = 0.1  # s: how long a parameter may lag behind a value that another way of setting changed


@dataclass(frozen=True)
class Declared:
    """A setting of the rig as a parameter of its node.

    Parameters
    ----------
    setting : Setting
        The setting.
    value : bool, float or list of float
        Value at the start [SI]; its type stays.
    rule : str
        Rule for the values of an array.
    """

    setting: Setting
    value: bool | float | list[float]
    rule: str = ""

    @property
    def name(self) -> str:
        """Name of the parameter."""
        return self.setting.key

    def descriptor(self) -> ParameterDescriptor:
        """Return what `ros2 param describe` shows."""
        setting = self.setting
        descriptor = ParameterDescriptor(
            name=self.name,
            description=f"{setting.text} [{setting.unit}]" if setting.unit else setting.text,
            additional_constraints=self.rule,
        )
        if isinstance(self.value, float):
            low, high = float(setting.low), float(setting.high)  # an int would be sent as a different number
            descriptor.floating_point_range = [FloatingPointRange(from_value=low, to_value=high, step=0.0)]
        return descriptor

    def refusal(self, parameter: Parameter) -> str | None:
        """Return why a value cannot be taken, or None; rclpy itself accepts a value beyond the range by a rounding error."""
        kind = Parameter.Type.from_parameter_value(self.value)
        if parameter.type_ != kind:
            return f"{self.name} must be a {kind.name}, found a {parameter.type_.name}"
        if kind == Parameter.Type.DOUBLE:
            try:
                self.setting.check(parameter.value)
            except RigError as error:
                return str(error)
        return None


class Settings(ABC):
    """Parameters of a node; subclasses define :meth:`refusal` and :meth:`take`."""

    def __init__(self, node: Node, settings: list[Declared]) -> None:
        self.node = node
        self.settings = {one.name: one for one in settings}
        self._following = False
        for one in settings:
            # an override would not be checked here, so take_overrides sets it
            node.declare_parameter(one.name, one.value, one.descriptor(), ignore_override=True)
        node.add_on_set_parameters_callback(self._check)
        node.add_post_set_parameters_callback(self._accepted)

    @abstractmethod
    def refusal(self, changes: dict) -> str | None:
        """Return why values that are right one by one cannot be taken now or together; None when they can."""

    @abstractmethod
    def take(self, changes: dict) -> None:
        """Enqueue values that were accepted."""

    def declare(self, one: Declared) -> None:
        """Declare one more parameter while the node is running."""
        self.settings[one.name] = one
        self._following = True
        try:
            self.node.declare_parameter(one.name, one.value, one.descriptor(), ignore_override=True)
        finally:
            self._following = False
        self.take_overrides([one.name])

    def take_overrides(self, names: list[str] | None = None) -> None:
        """Set the values of parameters from the command line and the launch file, all at once.

        Parameters
        ----------
        names : list of str, optional
            The parameters; by default all.

        Raises
        ------
        RigError
            When the values are refused.
        """
        given = [
            parameter
            for name, parameter in self.node._parameter_overrides.items()
            if name in (self.settings if names is None else names)
        ]
        if given:
            result = self.node.set_parameters_atomically(given)
            if not result.successful:
                raise RigError(f"parameters of /{self.node.get_name()} from the command line or a launch file: {result.reason}")

    def may_come(self, name: str) -> bool:
        """Return whether a parameter that does not exist yet may be declared later."""
        return False

    def follow(self, values: dict) -> None:
        """Set parameters to the values that the rig has already."""
        self._following = True
        try:
            self.node.set_parameters_atomically([Parameter(name, value=value) for name, value in values.items()])
        finally:
            self._following = False

    def _check(self, parameters: list[Parameter]) -> SetParametersResult:
        known = [parameter for parameter in parameters if parameter.name in self.settings]
        why = next(filter(None, (self.settings[parameter.name].refusal(parameter) for parameter in known)), None)
        if why is None and known and not self._following:
            why = self.refusal(changes_in(known))
        return SetParametersResult(successful=why is None, reason=why or "")

    def _accepted(self, parameters: list[Parameter]) -> None:
        known = [parameter for parameter in parameters if parameter.name in self.settings]
        if known and not self._following:
            self.take(changes_in(known))


def changes_in(parameters: list[Parameter]) -> dict:
    """Return values by name, with arrays as lists."""
    return {p.name: p.value if isinstance(p.value, (bool, float)) else list(p.value) for p in parameters}


class DeviceSettings(Settings):
    """What the rig takes at a node of its container; it is applied at the next sample boundary, in the order of arrival.

    The parameters follow the rig: setpoint topics, trips and resets change the same values, and the last change counts.
    """

    def __init__(self, node: Node, rig: Rig, commands: Commands) -> None:
        """Declare the parameters; the loop of the rig's queue ``commands`` writes the values and sends an event of each."""
        self.rig = rig
        super().__init__(node, [Declared(one, rig.value(one.name)) for one in rig.settings.at(node.get_name())])
        self._commands, self._sent, self._done = commands, 0, 0
        self._timer = node.create_timer(FOLLOW, self.on_follow)

    def refusal(self, changes: dict) -> str | None:
        """In the safe state, refuse to switch on what drives the rig."""
        for name, value in changes.items():
            setting = self.settings[name].setting
            if value is True and setting.setpoint and self.rig.refuses_drive(setting.setpoint):
                return f"{name} refused: the rig is tripped ({self.rig.reason}); call /rig/reset first"
        return None

    def take(self, changes: dict) -> None:
        """Put the values into the rig's queue."""
        for name, value in changes.items():
            self._sent += 1
            self._commands.put(f"/{self.node.get_name()}/set_parameters", self._write, self.settings[name], value)

    def _write(self, one: Declared, value: bool | float) -> None:
        try:
            self.rig.set_value(one.setting.name, value)
        finally:
            self._done += 1
        self._commands.event(CHANGED, one.setting.sentence(value), float(value))

    def on_follow(self) -> None:
        """Set the parameters to the rig's values, unless changes of this node are still on their way to the rig."""
        if self._done == self._sent:
            now = {name: self.rig.value(one.setting.name) for name, one in self.settings.items()}
            stale = {name: value for name, value in now.items() if self.node.get_parameter(name).value != value}
            if stale:
                self.follow(stale)
