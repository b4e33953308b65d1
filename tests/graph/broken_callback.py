# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A process of the graph one of whose callbacks throws, started in the real one's place (test_callbacks_that_throw.py).

BROKEN is "module:label" of the callback, whose label is its kind with what it belongs to; the labels of all callbacks that the
process gives to ROS are written, one a line, to the file LABELS. It throws as soon as there is a file ARMED.
"""

import importlib
import os

from rclpy.action import ActionServer
from rclpy.node import Node

# method of Node -> place of what names it, place of the callback
PLACES = {
    "create_subscription": (1, 2),
    "create_service": (1, 2),
    "create_timer": (0, 1),
    "add_on_set_parameters_callback": (None, 0),
    "add_post_set_parameters_callback": (None, 0),
}


def main():
    module, label = os.environ["BROKEN"].split(":", 1)

    def thrower(kind, node, what, callback):
        if str(getattr(callback, "__module__", "")).startswith("rclpy"):
            return callback  # of rclpy itself
        mine = f"{kind} {node.get_name()} {what}".strip()
        with open(os.environ["LABELS"], "a") as file:
            file.write(f"{mine}\n")
        if mine != label:
            return callback

        def throw(*arguments):
            if os.path.exists(os.environ["ARMED"]):
                raise ValueError(f"thrown by {kind}")
            return callback(*arguments)

        return throw

    for method, (name, place) in PLACES.items():

        def create(self, *args, _method=getattr(Node, method), _kind=method, _name=name, _place=place, **keywords):
            args = list(args)
            what = "" if _name is None else args[_name]
            args[_place] = thrower(_kind, self, what, args[_place])
            return _method(self, *args, **keywords)

        setattr(Node, method, create)
    make = ActionServer.__init__

    def server(self, node, kind, name, **keywords):
        for key in ("goal_callback", "handle_accepted_callback"):
            keywords[key] = thrower(key, node, name, keywords[key])
        make(self, node, kind, name, **keywords)

    ActionServer.__init__ = server
    return importlib.import_module(module).main()
