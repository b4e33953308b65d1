# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The example programs, started with wrong arguments: one sentence, an exit code of its own, no traceback."""

import importlib
import socket
import sys

import pytest

from rig_nodes.controllers.examples.command import run


@pytest.mark.parametrize(
    ("module", "arguments", "sentence"),
    [
        ("can_alfa46", "x --interface virtual --rig nowhere", "there is no rig 'nowhere'; known are "),
        ("can_alfa46", "x --interface virtual --rig clutch_bench", "this example is for a rig with gears"),
        ("can_alfa46", "x --interface telepathy --rig hydmag", "the bus x cannot be opened with the interface telepathy"),
        ("can_alfa46", "", "the following arguments are required: channel, --rig"),
        ("modbus_alfa46", "5020 --rig nowhere.yaml", "nowhere.yaml: there is no such file"),
        ("modbus_alfa46", "5020 --rig clutch_bench", "this example is for a rig with gears"),
        ("modbus_alfa46", "70000", "'70000' is no port; expected 1 to 65535"),
        ("modbus_alfa46", "5020 --host no.such.machine.invalid --rig hydmag", "there is no machine 'no.such.machine.invalid'"),
        ("alfa46_ros", "9lives", "'9lives' is no name of topics; expected letters, digits and single underscores"),
        ("alfa46_udp", "127.0.0.1 plc", "'plc' is no port"),
        ("alfa46_udp", "no.such.machine.invalid", "there is no machine 'no.such.machine.invalid'"),
    ],
)
def test_what_is_wrong_is_one_sentence(module, arguments, sentence, monkeypatch, capsys):
    known = socket.getaddrinfo

    def nobody(host, *rest):  # replaces the lookup, so that no name server is asked
        if host.endswith(".invalid"):
            raise socket.gaierror(socket.EAI_NONAME, "Name or service not known")
        return known(host, *rest)

    monkeypatch.setattr(socket, "getaddrinfo", nobody)
    monkeypatch.setattr(sys, "argv", [f"{module}.py", *arguments.split()])
    with pytest.raises(SystemExit) as end:
        run(importlib.import_module(f"rig_nodes.controllers.examples.{module}").main)
    error = capsys.readouterr().err
    assert end.value.code == 2
    assert error.startswith(f"{module}.py: ") and sentence in error and error.count("\n") == 1
