# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Begin and end of the example programs: one sentence for a user's mistake, no message for Ctrl-C."""

import socket
import sys
from collections.abc import Callable

from rig_nodes.base import Parser, RigError, printable


def parser(text: str, module: str) -> Parser:
    """Return a parser of arguments that refuses in one sentence; ``text`` is the docstring of the program's module."""
    return Parser(prog=f"python -m rig_nodes.controllers.examples.{module}", description=text.splitlines()[0])


def port(text: str) -> int:
    """Return a port's number from the command line; RigError when it is no port."""
    if not (text.isdecimal() and 0 < int(text) < 65536):
        raise RigError(f"'{text}' is no port; expected 1 to 65535")
    return int(text)


def address(text: str) -> str:
    """Return a machine's name or address from the command line; RigError when there is no such machine."""
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
