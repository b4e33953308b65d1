# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A network that goes away with a controller behind it: one sentence at whichever call it shows, and other programs end nothing."""

import errno
import os
import socket
import struct

import pytest

from rig_nodes.controllers import load_controller
from rig_nodes.controllers.udp.frames import HELLO, INFO, READY, Client, pack
from rig_nodes.runs.rig import Rig
from rig_nodes.runs.rig_base import RigStatus
from rig_nodes.runs.simulation import advance_with


class Failing:
    """A socket of which one function fails, as over a network that has gone; to one address only, or so many times only."""

    def __init__(self, real, function, number, to=None, times=1000):
        self._real, self._function, self._number, self._to, self._times = real, function, number, to, times

    def __getattr__(self, name):
        return self._fail if name == self._function else getattr(self._real, name)

    def _fail(self, *given):
        if self._times == 0 or self._to not in (None, given[-1]):
            return getattr(self._real, self._function)(*given)
        self._times -= 1
        raise OSError(self._number, os.strerror(self._number))


class Reported:
    """A socket with a notice of the kernel: a router has said that an address cannot be reached."""

    def __init__(self, real, address):
        self._real, self._address = real, address

    def __getattr__(self, name):
        return getattr(self._real, name)

    def recvfrom(self, size):
        if self._address is None:
            return self._real.recvfrom(size)
        raise OSError(errno.EHOSTUNREACH, os.strerror(errno.EHOSTUNREACH))

    def recvmsg(self, *_):
        if self._address is None:
            raise BlockingIOError
        address, self._address = self._address, None
        return b"", [(socket.IPPROTO_IP, 11, struct.pack("=I12x", errno.EHOSTUNREACH))], 0, address


@pytest.fixture
def plug(config, free_udp_port):
    made = load_controller(f"udp:{free_udp_port}", config)
    made.reports, made.port = [], free_udp_port
    made.say = made.reports.append
    yield made
    made.close()


@pytest.fixture
def other(plug):
    """A bare socket in place of a controller."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as made:
        made.connect(("127.0.0.1", plug.port))
        yield made


def be_ready(plug, other):
    """Lets the other side say that it is ready, and the plug hear it."""
    other.send(pack(READY, plug._session, 0, 0, 0))
    plug.wait(20.0)
    assert plug.awaited() == ""


@pytest.mark.parametrize(
    ("number", "sentence"), [(errno.ENETUNREACH, "Network is unreachable"), (errno.EINVAL, "Invalid argument")]
)
def test_a_sample_that_cannot_be_sent_trips_the_rig_in_one_sentence(plug, other, config, number, sentence):
    be_ready(plug, other)
    rig = Rig(config, controller="external")
    plug._socket = Failing(plug._socket, "sendto", number)
    advance_with(rig, plug)
    assert rig.status == RigStatus.TRIPPED
    assert rig.reason == f"controller {plug.name}, sample 0: no frame can be sent to it ({sentence})"


def test_a_controller_that_a_router_reports_as_unreachable_trips_the_rig_in_one_sentence(plug, other, config):
    be_ready(plug, other)
    rig = Rig(config, controller="external")
    plug._socket = Reported(plug._socket, plug._peer)
    other.send(b"anything, so that there is something to look at")
    advance_with(rig, plug)
    assert rig.reason == f"controller {plug.name}, sample 0: it cannot be reached any more (No route to host)"


def test_the_end_of_a_run_needs_no_network(plug, other):
    be_ready(plug, other)
    real = plug._socket
    plug._socket = Failing(real, "sendto", errno.ENETUNREACH)
    plug.close()
    assert plug.end_fault == "" and real.fileno() == -1, "the port is free again"


def test_a_program_that_cannot_be_answered_and_an_old_notice_end_no_wait(plug, other):
    real = plug._socket
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
        stranger.connect(("127.0.0.1", plug.port))
        stranger.send(pack(HELLO, 0, 0, 3, 0, ""))
        mute = Failing(real, "sendto", errno.ENETUNREACH, to=stranger.getsockname())
        plug._socket = Failing(mute, "recvfrom", errno.EHOSTUNREACH, times=1)
        be_ready(plug, other)
    assert any("a program has sent a frame and cannot be sent one (Network is unreachable)" in text for text in plug.reports)


def test_a_controller_in_python_waits_for_a_network_that_comes_back(plug):
    client = Client(object(), "127.0.0.1", plug.port)
    real = client.socket
    client.socket = Failing(Failing(real, "send", errno.ENETUNREACH, times=1), "recv", errno.EHOSTUNREACH, times=1)
    with real:
        client.send(HELLO, 3, 0, "")
        real.send(pack(HELLO, 0, 0, 3, 0, ""))
        plug._serve(0.0)
        assert client.receive(5.0)[0] == INFO
