# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The Alfa46 law of alfa46.py at the other end of a UDP port.

``.venv/bin/python -m rig_nodes.controllers.examples.alfa46_udp`` in one terminal (with ADDRESS PORT for another rig),
``./rig simulate demo --controller udp:9002`` in another, before or after.
"""

from rig_nodes.controllers.examples.alfa46 import Alfa46
from rig_nodes.controllers.examples.command import address, parser, port, run
from rig_nodes.controllers.udp.frames import PORT, serve


def main() -> None:
    """Serve the controller until it is stopped."""
    given = parser(__doc__, "alfa46_udp")
    given.add_argument("address", nargs="?", type=address, default="127.0.0.1")
    given.add_argument("port", nargs="?", type=port, default=PORT)
    arguments = given.parse_args()
    serve(Alfa46(), arguments.address, arguments.port, Alfa46.levels)


if __name__ == "__main__":
    run(main)
