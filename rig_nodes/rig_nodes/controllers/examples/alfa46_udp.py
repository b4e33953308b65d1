"""The Alfa46 law of alfa46.py at the other end of a UDP port.

``.venv/bin/python -m rig_nodes.controllers.examples.alfa46_udp`` in one terminal (with ADDRESS PORT for another rig),
``./rig simulate demo --controller udp:9002`` in another, before or after.
"""

import sys

from rig_nodes.controllers.examples.alfa46 import Alfa46
from rig_nodes.controllers.udp_frames import PORT, serve

if __name__ == "__main__":
    try:
        serve(Alfa46(), *sys.argv[1:2] or ["127.0.0.1"], int(sys.argv[2]) if len(sys.argv) > 2 else PORT, Alfa46.levels)
    except KeyboardInterrupt:
        sys.exit(130)
