# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The controller's record: what it contains of a rig, and that everything that carries samples has its size from it."""

import subprocess
from dataclasses import replace

import pytest

from rig_nodes.base.errors import RigError
from rig_nodes.controllers import ControllerFailed, ControllerInputs, load_controller
from rig_nodes.controllers.c.record_header import NAME, header_text
from rig_nodes.controllers.can.database import database
from rig_nodes.controllers.modbus.registers import register_map
from rig_nodes.controllers.record import ControllerRecord, Gear, Output, controller_info, record_of
from rig_nodes.controllers.seam import ControllerOutputs, checked
from rig_nodes.controllers.wire import measured
from rig_nodes.rig.configuration import load_rig
from rig_nodes.runs.conformance import Desk

from .conftest import C_FRAME, INCLUDE, RECORD, ask


@pytest.fixture
def other():
    """A record of another rig: four outputs, two transducers, two gears."""
    signals = load_rig("hydmag").catalogue.signals
    outputs = tuple(Output(f"v{k}", f"valve_{k}", signals["I_zr_p1"]) for k in range(4))
    gears = Gear(0, "N"), Gear(5, "fast", 1.5, (("p_p", 1e5),))
    return ControllerRecord(
        "other",
        outputs,
        (signals["T_oil"], signals["p_p"]),
        gears,
        {"duty": signals["zr_p1_duty"], "current": signals["I_set_zr_p1"]},
        "T_oil",
        "p_p",
    )


def test_a_sample_has_its_transducers_by_name_and_in_order(other):
    given = other.inputs(7, 0.007, 5, (0.1, 0.2, 0.3, 0.4), (60.0, 3e6))
    assert isinstance(given, ControllerInputs)
    assert (given.T_oil, given.p_p, given.measured, len(given.current)) == (60.0, 3e6, (60.0, 3e6), 4)
    with pytest.raises(AttributeError):
        _ = given.n_wej


def test_the_id_is_that_of_names_units_and_order(config, other):
    record = record_of(config)
    assert record.id == record_of(load_rig("hydmag")).id != other.id
    assert record.id == record_of(load_rig("hydmag", {"wiring": "swapped"})).id, "which valve is where is the rig's own"
    assert replace(record, transducers=record.transducers[::-1]).id != record.id
    assert replace(record, outputs=record.outputs[:2]).id != record.id
    assert replace(record, gears=record.gears[:2]).id != record.id


def test_an_answer_is_checked_by_the_record(config, other):
    info = controller_info(other, config.alfa46, "duty")
    assert checked(ControllerOutputs([0.1] * 4, gear=5, flags=15), info)[2:] == (5, False, 15)
    assert checked(ControllerOutputs(), info)[0] == (0.0,) * 4
    for wrong, sentence in (
        (ControllerOutputs([0.1] * 3), "command has 3 numbers, expected 4"),
        (ControllerOutputs(gear=1), "gear is 1, expected 0 .N. or 5 .fast."),
        (ControllerOutputs(flags=16), "flags is 16, expected 0 to 15"),
    ):
        with pytest.raises(RigError, match=sentence):
            checked(wrong, info)


def test_a_transducer_that_would_hide_another_part_of_a_sample_is_refused(config):
    record = record_of(config)
    with pytest.raises(RigError, match="transducer 'time' cannot be one of the controller's"):
        replace(record, transducers=(replace(record.transducers[0], name="time"),), input_speed="time", output_speed="time")


def test_a_wire_without_room_for_the_record_is_refused_in_one_sentence(other):
    with pytest.raises(RigError, match="has 18 transducers, the CAN frames have room for 16; bring"):
        database(replace(other, transducers=other.transducers * 9))
    rows = register_map(other)
    assert [row.name for row in rows if row.access == "read"][4:] == [*(f"current_{k}" for k in range(1, 5)), "T_oil", "p_p"]
    assert [row.address for row in rows if row.access == "write"] == [*range(32, 41)]
    with pytest.raises(RigError, match="takes 46 registers to read, Modbus has 32"):
        register_map(replace(other, outputs=other.outputs * 10))


ANOTHER = """
#undef RIG_CONTROLLER_RECORD
#define RIG_CONTROLLER_RECORD "0123456789abcdef"
"""


def test_a_library_of_another_record_is_refused_with_what_to_do(build, config):
    text = C_FRAME.replace("STEP", "")
    plug = load_controller(f"c:{build(text)}", config)
    assert ask(plug).command == (0.0, 0.0, 0.0)
    plug.close()
    with pytest.raises(
        RigError,
        match="the library was made for the record 0123456789abcdef of another rig, this one's is "
        f"{record_of(config).id}; write rig_record.h anew with ./rig export record --rig hydmag",
    ):
        load_controller(
            f"c:{build(text.replace('const rig_controller_abi_info', ANOTHER + 'const rig_controller_abi_info'))}", config
        )


def test_a_library_without_a_record_finds_its_signals_by_name(build, config):
    plug = load_controller(f"c:{build(BY_NAME)}", config)
    assert plug.step(0, [0.0] * 3, [0.0, 0.0, 0.25, 0.0]).command == (0.25, 0.0, 0.0)
    plug.close()


BY_NAME = (
    C_FRAME.replace("rig_record.h", "rig_controller.h")
    .replace(
        "(void)info;",
        """
  for (place = 0; place < info->transducer_count && strcmp(info->transducers[place].name, "p1"); place++) ;
  if (info->output_count != 3 || strcmp(info->outputs[2], "output_3") || strcmp(info->transducers[place].unit, "Pa") ||
      info->gear_count != 3 || strcmp(info->gears[2].name, "II")) return RIG_ERROR;
""",
    )
    .replace("const rig_controller_abi_info", "#include <string.h>\nstatic uint32_t place;\nconst rig_controller_abi_info", 1)
    .replace("STEP", "out->command[0] = in->measured[place];")
)


def test_a_library_that_moves_the_arrays_is_ended_with_the_reason(build, config):
    plug = load_controller(f"c:{build(C_FRAME.replace('STEP', 'static double mine[3]; out->command = mine;'))}", config)
    with pytest.raises(ControllerFailed, match="the library moved command or setpoint to an array of its own; the numbers go"):
        ask(plug)


@pytest.mark.parametrize("beyond", ["out->command[3] = 1.0;", "out->setpoint[3] = 1.0;"])
def test_a_number_behind_the_outputs_of_the_rig_is_seen(build, config, beyond):
    plug = load_controller(f"c:{build(C_FRAME.replace('STEP', beyond))}", config)
    with pytest.raises(ControllerFailed, match="the library wrote . bytes behind"):
        ask(plug)


def test_the_header_of_these_tests_is_that_of_the_rig(config):
    """When it differs, write it anew: ./rig export record -o tests/controllers/rig_record.h"""
    assert (RECORD / NAME).read_text(encoding="utf-8") == header_text(record_of(config))


def test_the_header_of_any_record_is_c_and_cpp(other, tmp_path):
    (tmp_path / NAME).write_text(header_text(other))
    (tmp_path / "mine.c").write_text(
        '#include "rig_record.h"\nint main(void) { rig_controller_inputs in = {sizeof in, 0, 0, 0, '
        "NULL, NULL};\n  return RIG_V2 - 2 + RIG_GEAR_FAST - 5 + (rig_measured_of(&in) != NULL); }\n"
    )
    for compiler, *language in (("cc", "-std=c99"), ("c++", "-x", "c++", "-std=c++11")):
        subprocess.run(
            [compiler, *language, "-Wall", "-Wextra", "-Werror", f"-I{INCLUDE}", "-o", tmp_path / "mine", tmp_path / "mine.c"],
            check=True,
        )
        assert subprocess.run([tmp_path / "mine"], check=False).returncode == 0


HARD = """
#include "rig_record.h"
#include <stddef.h>
int main(void) {
  return (RIG_GEAR_L_ != 1) + (RIG_GEAR_L__2 != 2) + (RIG_GEAR_1A != 3) + (RIG_GEAR_1A_4 != 4) +
         (offsetof(rig_measured, double_) != 0) + (offsetof(rig_measured, class_) != sizeof(double));
}
"""


def test_the_header_of_hard_names_is_c_and_cpp(other, tmp_path):
    """Gears that differ by other signs than letters, transducers with words of the languages as names, and signs of comments."""
    texts = "The */ int torque; /* of the shaft/*/.", "Pressure */"
    transducers = tuple(
        replace(signal, name=name, text=text)
        for signal, name, text in zip(other.transducers, ("double", "class"), texts, strict=True)
    )
    gears = tuple(Gear(number, name) for number, name in enumerate(("N", "L+", "L-", "1a", "1A")))
    (tmp_path / NAME).write_text(header_text(replace(other, transducers=transducers, gears=gears, rig="a*/b")))
    for language, standard in (("c", "-std=c99"), ("c++", "-std=c++17")):
        path = tmp_path / f"mine.{language}"
        path.write_text(HARD)
        flags = ["-x", language, standard, "-Wall", "-Wextra", "-Werror", f"-I{INCLUDE}"]
        subprocess.run(["cc", *flags, "-o", tmp_path / "mine", path], check=True)
        assert subprocess.run([tmp_path / "mine"], check=False).returncode == 0


def test_a_wire_carries_both_ends_of_a_range_and_one_of_zeros(other):
    signals = other.transducers
    below, nothing = replace(signals[0], low=-5.0 * signals[0].high), replace(signals[1], low=0.0, high=0.0)
    first, second = measured(replace(other, transducers=(below, nothing)))
    assert first.decode(first.encode(below.low)) == pytest.approx(below.low, rel=1e-4)
    assert first.decode(first.encode(below.high)) == pytest.approx(below.high, rel=1e-3)
    assert second.decode(second.encode(0.0)) == 0.0


def test_the_desk_of_the_conformance_set_follows_the_record(config, other):
    desk = Desk(record_of(config))
    desk.follow((0.4, 0.2, 0.0))
    wires = desk.wires()
    assert wires.measured == pytest.approx((157.0, 60.0, 3e6 * 0.02, 3e6 * 0.01))
    assert len(Desk(other).wires().current) == 4
