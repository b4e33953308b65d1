# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Settings, the reference controllers, and ways to make a controller of a few lines in Python and in C."""

import os
import socket
import subprocess
import sys
import textwrap
from pathlib import Path

import pymodbus.client  # here, because otherwise plug and example client would import them at the same time in two threads
import pymodbus.server  # noqa: F401
import pytest

import rig_nodes
from rig_nodes.base.errors import RigError
from rig_nodes.controllers import load_controller
from rig_nodes.controllers.ros.domain import allocate, use_own_transports
from rig_nodes.rig.configuration import load_rig

CONTROLLERS = Path(rig_nodes.__file__).parent / "controllers"
INCLUDE, EXAMPLES = CONTROLLERS / "include", CONTROLLERS / "examples"
RECORD = Path(__file__).parent  # has the rig_record.h of the rig hydmag
ALFA46_C = EXAMPLES / "alfa46.c"
SIMULINK_FOLDER = CONTROLLERS / "examples" / "simulink"
SIMULINK = f"simulink:{SIMULINK_FOLDER}"
PYTHON, C = "python:rig_nodes.controllers.examples.alfa46:Alfa46", f"c:{ALFA46_C}"
STRICT = ("-O2", "-ffp-contract=off", "-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", f"-I{INCLUDE}", f"-I{RECORD}")
SANITIZE = ("-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")

C_FRAME = """
#include "rig_record.h"
const rig_controller_abi_info *rig_controller_abi(void) { RIG_CONTROLLER_DESCRIBE(RIG_LEVEL_DUTY); }
int rig_controller_create(rig_controller_info *info, void **instance) {
  (void)info; *instance = 0; return RIG_OK;
}
int rig_controller_step(void *instance, const rig_controller_inputs *in, rig_controller_outputs *out) {
  (void)instance; (void)in; (void)out;
  STEP
  return RIG_OK;
}
void rig_controller_destroy(void *instance) { (void)instance; }
"""


@pytest.fixture(scope="session")
def config():
    return load_rig("hydmag")


@pytest.fixture
def python_controller(tmp_path, config):
    """Loads a class whose step has the given body; ``levels`` and ``initialize`` may be given too, and "@in-process"."""

    def make(step, head="", level=None, where=""):
        body = textwrap.indent(textwrap.dedent(step).strip(), " " * 8)
        path = tmp_path / "mine.py"
        path.write_text(
            "import math, sys\nfrom rig_nodes.controllers import ControllerOutputs as Out, Status\n\n\n"
            f"class Mine:\n    {head or 'pass'}\n    def initialize(self, info):\n        self.info = info\n"
            f"    def step(self, inputs):\n{body}\n"
            "    def terminate(self):\n        open(__file__ + '.ended', 'a').write('x')\n"
        )
        return load_controller(f"python:{path}:Mine{where}", config, level)

    return make


@pytest.fixture
def build(tmp_path):
    """Compiles C text into a shared library with a name of its own and returns the path."""
    count = iter(range(100))

    def make(text, *flags):
        stem = tmp_path / f"library{next(count)}"
        stem.with_suffix(".c").write_text(text)
        subprocess.run(
            [
                "cc",
                "-fPIC",
                "-shared",
                f"-I{INCLUDE}",
                f"-I{RECORD}",
                *flags,
                "-o",
                stem.with_suffix(".so"),
                stem.with_suffix(".c"),
                "-lm",
            ],
            check=True,
            capture_output=True,
        )
        return stem.with_suffix(".so")

    return make


@pytest.fixture
def free_udp_port():
    """Returns a port of loopback that is free."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        return free.getsockname()[1]


def ask(plug, sample=0, current=(0.0, 0.0, 0.0)):
    """Gives the plug one sample at standstill and returns its answer."""
    return plug.step(sample, current, [0.0, 0.0, 0.0, 0.0])


@pytest.fixture(scope="module")
def ros_domain():
    """A ROS domain of the file's own, also for the processes that its tests start; afterwards the environment is restored."""
    before = dict(os.environ)
    with allocate() as held:
        os.environ["ROS_DOMAIN_ID"] = str(held.number)
        use_own_transports()
        yield held.number
    os.environ.clear()
    os.environ.update(before)


@pytest.fixture(scope="module")
def ros_program(ros_domain):
    """Starts the Alfa46 as a ROS 2 node of its own on topics of a given name; it is ended with the file."""
    started = []

    def start(name):
        command = [sys.executable, "-m", "rig_nodes.controllers.examples.alfa46_ros", name]
        started.append(subprocess.Popen(command, stderr=subprocess.PIPE, text=True))
        return started[-1]

    yield start
    for process in started:
        process.kill()
        process.communicate()


MULTICAST = "239.74.163.2"


def multicast_works() -> str:
    """Returns the reason why udp_multicast does not work on this machine, empty when it works."""
    import can

    from rig_nodes.controllers.can.bus import open_bus

    try:
        one, other = (open_bus(MULTICAST, "udp_multicast", "probe", port=43200) for _ in range(2))
    except RigError as error:
        return str(error)
    try:
        one.send(can.Message(arbitration_id=1, data=b"x", is_extended_id=False, is_fd=False))
        return "" if other.recv(1.0) else "a multicast packet does not come back on this machine"
    except can.CanError as error:
        return str(error)
    finally:
        one.shutdown()
        other.shutdown()
