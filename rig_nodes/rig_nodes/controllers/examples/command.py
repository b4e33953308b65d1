# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""How the example programs begin and end: one sentence for what a person got wrong, nothing for Ctrl-C."""

import socket
import sys
from collections.abc import Callable

from rig_nodes.cli.main import Parser
from rig_nodes.errors import RigError, printable


def parser(text: str, module: str) -> Parser:
    """A parser of arguments that refuses in one sentence; text: the docstring of the program's module."""
    return Parser(prog=f"python -m rig_nodes.controllers.examples.{module}", description=text.splitlines()[0])


def port(text: str) -> int:
    """A port's number from the command line; RigError when it is none."""
    if not (text.isdecimal() and 0 < int(text) < 65536):
        raise RigError(f"'{text}' is no port; expected 1 to 65535")
    return int(text)


def address(text: str) -> str:
    """A machine's name or address from the command line; RigError when nobody knows it."""
    try:
        socket.getaddrinfo(text, None, socket.AF_INET)
    except (OSError, UnicodeError):
        raise RigError(f"there is no machine '{text}'; expected a name or an address such as 127.0.0.1") from None
    return text


def run(main: Callable[[], object]) -> None:
    """Call ``main`` and end the process: exit code 2 and its sentence for a RigError, 130 for Ctrl-C."""
    try:
        main()
    except RigError as error:
        print(f"{sys.argv[0].rpartition('/')[2]}: {printable(error)}", file=sys.stderr)
        sys.exit(error.exit_code)
    except KeyboardInterrupt:
        sys.exit(130)
