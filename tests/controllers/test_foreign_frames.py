# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Frames of others on the rig's bus: a second rig is refused or trips, and no program ends by a frame that is not the rig's."""

import subprocess
import sys
import threading
import time

import can
import pytest

from rig_nodes.base.errors import RigError
from rig_nodes.cli.main import main
from rig_nodes.controllers import ControllerFailed, load_controller
from rig_nodes.controllers.can.bus import open_bus
from rig_nodes.controllers.can.loopback import LoopbackBus
from rig_nodes.controllers.examples.can_alfa46 import CanController
from rig_nodes.controllers.examples.modbus_alfa46 import ModbusController

from .conftest import ask, multicast_works

REQUEST, MEASURED, CURRENTS = 0x100, 0x101, 0x102


def put(bus, number, data, **more):
    bus.send(can.Message(arbitration_id=number, data=data, **{"is_extended_id": False, "is_fd": False, **more}))


# ---- two rigs


@pytest.mark.parametrize("options", ["virtual", "udp_multicast&port=43221"])
def test_a_second_rig_on_the_bus_is_refused_at_its_start_and_the_first_one_goes_on(config, options):
    if "multicast" in options and (why := multicast_works()):
        pytest.skip(why)
    spec, over = f"can:239.74.163.80?interface={options}", threading.Event()
    first, samples = load_controller(spec, config), [0]

    def run():
        while not over.wait(1e-3):
            ask(first, samples[0])
            samples[0] += 1

    thread = threading.Thread(target=run)
    thread.start()
    try:
        with pytest.raises(
            RigError, match=r"another rig is at work on CAN .*: the frame RIG_\w+ \(0x10\d\) comes from .* too; give"
        ) as refusal:
            load_controller(spec, config)
        seen = samples[0]
        while thread.is_alive() and samples[0] < seen + 20:
            time.sleep(1e-3)
    finally:
        over.set()
        thread.join()
        first.close()
    assert samples[0] >= seen + 20 and not first.conflict, "the second one has sent nothing"
    assert refusal.value.exit_code == 2


@pytest.mark.parametrize("number", [REQUEST, MEASURED, CURRENTS])
def test_a_foreign_frame_with_an_identifier_of_the_rig_trips_the_run(config, number):
    bus, plug = open_bus(f"foreign{number}", "virtual", "test"), load_controller(f"can:foreign{number}?interface=virtual", config)
    try:
        ask(plug)
        put(bus, number, b"", is_remote_frame=True, dlc=8)
        put(bus, number, bytes(8), is_extended_id=True)
        ask(plug, 1)  # a request of the frame, and a frame of another form, are none of the rig's
        put(bus, number, bytes(8))
        with pytest.raises(
            ControllerFailed, match=rf"sample 2: another rig is at work on CAN .*0x{number:x}\) comes from another program"
        ):
            ask(plug, 2)
    finally:
        plug.close()
        bus.shutdown()


def test_another_rig_that_comes_while_a_controller_is_waited_for_ends_the_wait(config):
    bus, plug = open_bus("waiting", "virtual", "test"), load_controller("can:waiting?interface=virtual", config)
    put(bus, CURRENTS, bytes(8))
    try:
        with pytest.raises(RigError, match="another rig is at work"):
            plug.wait(20.0)
    finally:
        bus.shutdown()


# ---- programs on the bus

RIGHT = ((REQUEST, bytes([1, 1] + [0] * 6)), (MEASURED, bytes(8)), (CURRENTS, bytes([1] + [0] * 7)))
WRONG = (
    (REQUEST, bytes([1, 7] + [0] * 6)),  # no such level
    (REQUEST, bytes([9, 1] + [0] * 6)),  # no such gear
    (REQUEST, b""),
    (CURRENTS, b"\0"),
    (CURRENTS, bytes(7)),
)


def test_the_example_on_a_bus_answers_only_what_its_rig_sends(config, capsys):
    bus, ears = open_bus("example", "virtual", "test"), open_bus("example", "virtual", "test")
    controller, over = CanController(bus, config), threading.Event()
    thread = threading.Thread(target=controller.run, args=(over,))
    thread.start()
    try:
        for number, data in RIGHT[1:]:
            put(ears, number, data)
        for _ in range(20):
            for number, data in WRONG:
                put(ears, number, data)
            put(ears, CURRENTS, bytes(8), is_extended_id=True)
            put(ears, MEASURED, b"", is_remote_frame=True, dlc=8)
            put(ears, MEASURED, b"\x00\x80" + bytes(6))  # a transducer without a reading
        assert ears.recv(0.2) is None, "nothing of that is answered"
        for number, data in RIGHT:
            put(ears, number, data)
        frame = ears.recv(10.0)
        assert frame.arbitration_id == 0x200 and frame.data[2] == 1
    finally:
        over.set()
        thread.join()
        bus.shutdown()
        ears.shutdown()
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 8 and "asks for gear 1 at level 7, which this rig does not have" in lines[0]
    assert "a frame RIG_MEASURED has no reading of n_wej" in " ".join(lines) and "140 times in all" in lines[-1]


def test_the_template_on_a_bus_outlives_short_frames_and_gears_that_it_does_not_have(tmp_path):
    if why := multicast_works():
        pytest.skip(why)
    group = "239.74.163.81"
    assert main(["controller", "new", "can", str(tmp_path / "mine")]) == 0
    assert main(["export", "dbc", "-o", str(tmp_path / "mine" / "rig.dbc")]) == 0
    path = tmp_path / "mine" / "my_tcu.py"
    path.write_text(path.read_text().replace("239.74.163.2", group))
    ears = LoopbackBus(group)
    process = subprocess.Popen([sys.executable, path], stderr=subprocess.PIPE, text=True)
    try:

        def answer(request):
            """Returns gear and status of the answer to a sample, which is sent until the program listens."""
            until = time.monotonic() + 20.0
            while time.monotonic() < until:
                put(ears, REQUEST, b"\x01")
                put(ears, CURRENTS, b"")
                put(ears, CURRENTS, bytes(8), is_extended_id=True)
                put(ears, REQUEST, bytes([request, 1] + [0] * 6))
                put(ears, CURRENTS, bytes(8))
                frame = ears.recv(0.2)
                while frame is not None and frame.arbitration_id != 0x200:
                    frame = ears.recv(0.2)
                if frame is not None:
                    return frame.data[2], frame.data[5]
            raise AssertionError("the program does not answer")

        assert answer(1) == (1, 0)
        assert answer(200)[1] == 2, "an error, with which the rig trips"
        assert process.poll() is None
    finally:
        process.terminate()
        errors = process.communicate()[1].splitlines()
        ears.shutdown()
    assert errors == ["my_tcu: frame 0x100 has 1 bytes instead of 8; it is left out, as are others like it"]


@pytest.mark.parametrize(
    ("registers", "why"),
    [
        ([0, 1, 1], "the server has sent 3 registers, expected 11"),
        ([0, 1, 1, 7, *[0] * 7], "asks for gear 1 at level 7, which this rig does not have"),
        ([0, 1, 77, 1, *[0] * 7], "asks for gear 77 at level 1, which this rig does not have"),
        ([0, 1, 1, 1, 0x8000, *[0] * 6], "a transducer has no reading"),
    ],
)
def test_the_modbus_example_says_what_no_rig_sends(config, registers, why):
    controller = ModbusController(1, config)
    assert why in controller.wrong(registers)
    assert controller.wrong([0, 1, 1, 1, *[0] * 7]) == ""
