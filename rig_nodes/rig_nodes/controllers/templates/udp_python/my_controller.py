"""A shift controller of your own over UDP: the law of my_law.py, answering each sample of the rig.

It needs rig_udp.py beside it and any Python 3.8 or newer, on this machine or another.
"""

import sys

from my_law import MyController
from rig_udp import PORT, serve

if __name__ == "__main__":
    host, port = (sys.argv[1:] + ["127.0.0.1", str(PORT)][len(sys.argv) - 1:])[:2]
    try:
        serve(MyController(), host, int(port), levels=("current",))  # setpoints in A; "duty" would be 0 to 1
    except KeyboardInterrupt:
        sys.exit(130)
