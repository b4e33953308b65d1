# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The parser of command lines: the rig's verbs and the example programs use it."""

from __future__ import annotations

import argparse

from .errors import RigError

TYPE_CHECKING = False  # as in typing, whose import would cost time that help does not need
if TYPE_CHECKING:
    from typing import Any, NoReturn


class Parser(argparse.ArgumentParser):
    """The argument parser of argparse with the rig's one-sentence errors."""

    def error(self, message: str) -> NoReturn:
        """Raise RigError instead of printing argparse's usage and exiting; it proposes the option that was probably meant."""
        start, _, rest = message.partition("unrecognized arguments: ")
        if not start and rest.startswith("--"):
            from .names import unknown

            options = [name for name in self._option_string_actions if name.startswith("--")]
            message = unknown("option", rest.split()[0].partition("=")[0], options)
        raise RigError(f"{message} (see '{self.prog} --help')")

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        """Check as argparse does, for everything with choices including verbs below a verb; propose what was probably meant."""
        if action.choices is not None and value not in action.choices:
            from .names import unknown

            raise argparse.ArgumentError(action, unknown("choice", value, action.choices))
