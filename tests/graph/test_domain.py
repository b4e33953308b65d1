# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The allocator of ROS domains."""

import os
import signal
import socket
import subprocess
import sys
from xml.etree import ElementTree

import pytest

from rig_nodes.base.errors import RigError
from rig_nodes.controllers.ros.domain import BASE_PORT, PORTS, Domain, allocate, environment, from_environment


def test_two_runs_get_two_domains_and_a_released_one_is_free_again():
    with allocate() as first:
        with allocate() as second:
            assert second.number != first.number
        with allocate() as third:
            assert third.number == second.number


def test_a_killed_holder_leaves_no_domain_behind():
    domain = "from rig_nodes.controllers.ros.domain import allocate; d = allocate()"
    code = f"import signal; {domain}; print(d.number, flush=True); signal.pause()"
    # the folders of another user make no difference
    holder = subprocess.Popen(
        [sys.executable, "-c", code], stdout=subprocess.PIPE, text=True, env={**os.environ, "TMPDIR": "/", "XDG_RUNTIME_DIR": "/"}
    )
    number = int(holder.stdout.readline())
    with allocate() as other:
        assert other.number != number
    holder.send_signal(signal.SIGKILL)
    holder.communicate()
    with allocate() as again:
        assert again.number == number


def test_a_domain_with_somebody_elses_ports_is_left_alone():
    with allocate() as domain:
        number = domain.number
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("127.0.0.1", BASE_PORT + PORTS * number + 11))
        with allocate() as domain:
            assert domain.number != number


def test_the_users_domain_is_respected(monkeypatch):
    monkeypatch.setenv("ROS_DOMAIN_ID", "57")
    assert from_environment().number == 57
    monkeypatch.delenv("ROS_DOMAIN_ID")
    assert from_environment(keep=True).number == 0
    for wrong in ("x", "-1", "233"):
        monkeypatch.setenv("ROS_DOMAIN_ID", wrong)
        with pytest.raises(RigError, match="0 to 232"):
            from_environment()


def test_dds_stays_on_this_host_whatever_the_user_has_set(monkeypatch):
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "SUBNET")
    monkeypatch.setenv("ROS_STATIC_PEERS", "192.0.2.1")
    monkeypatch.setenv("ROS_LOCALHOST_ONLY", "0")
    monkeypatch.setenv("FASTDDS_BUILTIN_TRANSPORTS", "DEFAULT")
    env = environment(Domain(5))
    assert env["ROS_STATIC_PEERS"] == "" and env["ROS_DOMAIN_ID"] == "5"
    assert "ROS_LOCALHOST_ONLY" not in env and "FASTDDS_BUILTIN_TRANSPORTS" not in env
    profiles = ElementTree.parse(env["FASTRTPS_DEFAULT_PROFILES_FILE"]).getroot()
    text = {element.tag.rpartition("}")[2]: element for element in profiles.iter()}
    assert [element.text for element in text["interfaceWhiteList"]] == ["127.0.0.1"]
    assert text["useBuiltinTransports"].text == "false"
