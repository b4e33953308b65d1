# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""What can be set at the Alfa46 while it runs: delays, gains and profiles as parameters, or a whole profile by a service.

The node alfa46 uses it. The rules of rig.alfa46 check the values; the controller takes them with its next sample.
"""

from __future__ import annotations

from collections import deque
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from rclpy.node import Node
from rclpy.parameter import Parameter
from rig_msgs.srv import SetProfile

from ..base import RigError
from ..rig import OUTPUT_KEYS, OWN, POINTS, Alfa46Config, RigConfig, check_gains, check_profile, own_setting
from .settings import Declared, Settings

if TYPE_CHECKING:
    from ..controllers import Plug

COLUMNS = ("times", "currents")


class BoxSettings(Settings):
    """The parameters of the Alfa46; ``news`` has accepted changes (text, value) that the node has not yet sent as events."""

    def __init__(self, node: Node, box: Plug, rig: RigConfig) -> None:
        """Declare the parameters; ``box`` is the plug of the controller."""
        self.box, self.config, self.news = box, rig.alfa46, deque()
        config = self.config
        rules = {
            "times": "6 numbers, P1 to P6; P1-P3 count from switch-on, P4-P6 from switch-off, each half increases",
            "currents": f"6 numbers, P1 to P6; 0 to {config.values.current_limit:g} A",
        }
        settings = []
        for one in rig.settings.at("alfa46"):
            if one.numbers == 1:
                settings.append(Declared(one, getattr(config.values, one.key)))
            else:
                output, _, column = one.key.partition(".")
                values = config.profiles[OUTPUT_KEYS.index(output), :, COLUMNS.index(column)].tolist()
                settings.append(Declared(one, values, rules[column]))
        super().__init__(node, [*settings, *self._own()])
        self._service = node.create_service(SetProfile, "~/set_profile", self.on_set_profile)

    def _own(self) -> list[Declared]:
        return [Declared(own_setting(f"alfa46.{OWN}{name}"), value) for name, value in self.box.settings.items()]

    def declare_own(self) -> None:
        """Declare the settings of a controller that has named them after the start."""
        for setting in self._own():
            self.declare(setting)

    def may_come(self, name: str) -> bool:
        """Return whether a name may be a setting of a controller that has not named its settings yet."""
        return self.box.named_later and name.startswith(OWN)

    def changed(self, changes: dict) -> Alfa46Config:
        """Return the settings with these changes; RigError when they are not right."""
        scalars = {name: value for name, value in changes.items() if hasattr(self.config.values, name)}
        values, profiles = replace(self.config.values, **scalars), self.config.profiles.copy()
        for k, key in enumerate(OUTPUT_KEYS):
            for column, name in enumerate(COLUMNS):
                numbers = changes.get(f"{key}.{name}")
                if numbers is None:
                    continue
                if len(numbers) != len(POINTS):
                    raise RigError(f"{key}.{name} must have {len(POINTS)} numbers, one for each of P1 to P6, found {len(numbers)}")
                profiles[k, :, column] = numbers
            if not np.array_equal(profiles[k], self.config.profiles[k]):
                check_profile(profiles[k], key, values.current_limit)
        return Alfa46Config(values, profiles)

    def refusal(self, changes: dict) -> str | None:
        """Return why the changes are refused, by the level, by the rules for profiles or by the controller; otherwise None."""
        own = {name.removeprefix(OWN): value for name, value in changes.items() if name.startswith(OWN)}
        try:
            check_gains(self.box.level, changes)
            for name, value in own.items():
                self.box.check_value(name, value)
            if len(own) < len(changes):
                self.box.check_change(self.changed(changes))
        except RigError as error:
            return str(error)
        return None

    def take(self, changes: dict) -> None:
        """Give the settings to the controller first, and enqueue their events after that, so that no event comes too early."""
        if not all(name.startswith(OWN) for name in changes):
            self.config = self.changed(changes)
            self.box.change(self.config)
        for name, value in changes.items():
            if name.startswith(OWN):
                self.box.set_value(name.removeprefix(OWN), value)
            number = float(name[len("output_")]) if isinstance(value, list) else value
            self.news.append((self.settings[name].setting.sentence(value), number))

    def on_set_profile(self, request: SetProfile.Request, response: SetProfile.Response) -> SetProfile.Response:
        """Set a whole profile through the parameters, so that these stay equal to what the controller has."""
        if not 1 <= request.output <= len(OUTPUT_KEYS):
            response.success = False
            response.message = f"there is no output {request.output}; expected 1 to {len(OUTPUT_KEYS)}"
            return response
        key = OUTPUT_KEYS[request.output - 1]
        columns = {"times": request.times, "currents": request.currents}
        result = self.node.set_parameters_atomically(
            [Parameter(f"{key}.{name}", value=[float(v) for v in numbers]) for name, numbers in columns.items()]
        )
        response.success = result.successful
        response.message = result.reason or f"profile of {key} set"
        return response
