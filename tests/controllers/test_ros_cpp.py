# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The C++ side of a ROS 2 controller: the code between messages and rig_controller.h, and the node where rclcpp is installed."""

import struct
import subprocess
from pathlib import Path

import pytest
from ament_index_python.packages import PackageNotFoundError, get_package_prefix
from rig_msgs.msg import ControllerReady

from rig_nodes.controllers import load_controller
from rig_nodes.rig.configuration import load_rig

from .conftest import ALFA46_C, CONTROLLERS, INCLUDE, RECORD
from .test_parity import C

STRICT = ("-std=c++17", "-O1", "-ffp-contract=off", "-Wall", "-Wextra", "-Werror")
# reads the messages that a rig would send, and writes the answers of the box
MAIN = r"""
#include "rig_ros_box.hpp"
#include "rig_record.h"

template <typename T> T get() {
  T value{};
  if (std::fread(&value, sizeof value, 1, stdin) != 1) std::exit(3);
  return value;
}

int main() {
  rig_ros::Box box;
  rig_msgs::msg::ControllerStart start;
  start.session = 5;
  start.record.outputs = {"output_1", "output_2", "output_3"};
  start.record.transducers = {"n_wej", "n_wyj", "p1", "p2"};
  start.record.units = {"rad/s", "rad/s", "Pa", "Pa"};
  start.record.gears = {0, 1, 2};
  start.record.gear_names = {"neutral", "I", "II"};
  start.record.id = "another";
  const auto refused = box.start(start);
  if (refused->state != rig_msgs::msg::ControllerReady::REFUSES ||
      refused->message.find("of another rig, this one's is another; write rig_record.h anew") == std::string::npos) return 7;
  start.record.id = RIG_CONTROLLER_RECORD;
  start.level = get<uint8_t>();
  start.period = 1e-3;
  start.command_high = get<double>();
  for (uint32_t count = get<uint32_t>(); count; --count) {
    char name[48];
    if (std::fread(name, sizeof name, 1, stdin) != 1) return 3;
    start.parameter_names.push_back(name);
    start.parameter_values.push_back(get<double>());
  }
  const auto ready = box.start(start);
  std::printf("%u %d %d %u\n", ready->session, ready->state, ready->levels, ready->process_id == (uint32_t)getpid());
  rig_msgs::msg::ControllerStep step;
  for (uint32_t count = get<uint32_t>(); count; --count) {
    step.session = 5;
    step.seq += 1;
    step.sample = get<uint64_t>();
    step.time = 1e-3 * static_cast<double>(step.sample);
    step.gear_request = get<uint8_t>();
    step.current.resize(3);
    for (double &value : step.current) value = get<double>();
    step.measured.assign(4, 0.0);
    const auto *answer = box.step(step);
    const auto first = *answer;
    if (*box.step(step) != first) return 4;  // the same again: computed once
    step.session = 6;
    if (box.step(step)) return 5;  // of another run
    for (double value : first.command) std::printf("%a ", value);
    for (double value : first.setpoint) std::printf("%a ", value);
    std::printf("%d %d %d\n", first.gear, first.shifting, first.flags);
  }
  const auto gone = box.leave("enough");
  if (!gone) return 6;
  std::printf("%d %s %d\n", gone->state, gone->message.c_str(), box.leave("again").has_value());
  start.over = true;
  return box.start(start).has_value();
}
"""


def includes(*packages):
    """Returns -isystem for headers of ROS packages; skips the test where one is not installed."""
    out = []
    for package in packages:
        try:
            folder = Path(get_package_prefix(package)) / "include" / package
        except PackageNotFoundError:
            pytest.skip(f"{package} is not installed here")
        if not folder.is_dir():
            pytest.skip(f"{package} has no headers here")
        out += ["-isystem", str(folder)]
    return out


@pytest.fixture(scope="module")
def messages():
    return includes(
        "rig_msgs",
        "std_msgs",
        "builtin_interfaces",
        "rosidl_runtime_cpp",
        "rosidl_runtime_c",
        "rosidl_typesupport_interface",
        "rcutils",
    )


@pytest.fixture(scope="module")
def box(messages, tmp_path_factory):
    """The program of MAIN with the Alfa46 law, under the sanitizers where the machine has them."""
    folder = tmp_path_factory.mktemp("box")
    (folder / "main.cpp").write_text(MAIN)
    of_a_rig = ["-include", RECORD / "rig_record.h"]  # so that it refuses every other one
    law = ["cc", "-std=c99", "-O1", "-ffp-contract=off", f"-I{INCLUDE}", *of_a_rig, "-c", ALFA46_C, "-o", folder / "law.o"]
    subprocess.run(law, check=True)
    command = ["c++", *STRICT, f"-I{INCLUDE}", f"-I{RECORD}", *messages, folder / "main.cpp", folder / "law.o", "-lm"]
    sanitized = ["-O0", "-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"]  # compiles in half the time
    if subprocess.run([*command, *sanitized, "-o", folder / "box"], capture_output=True).returncode:
        subprocess.run([*command, "-o", folder / "box"], check=True)
    return folder / "box"


@pytest.mark.parametrize("level", ["duty", "current"])
def test_the_law_behind_the_messages_gives_the_bits_of_the_built_in_one(box, level):
    plug = load_controller("alfa46", load_rig("hydmag"), level)
    samples, orders = 1500, {10: 1, 900: 2}
    data = struct.pack("<BdI", ("duty", "current").index(level), plug.info.command_high, len(plug.info.parameters))
    data += b"".join(struct.pack("<48sd", name.encode(), value) for name, value in plug.info.parameters.items())
    data += struct.pack("<I", samples)
    expected, gear = [], 0
    for sample in range(samples):
        if sample in orders:
            gear = orders[sample]
            plug.order(gear)
        current = (0.0004 * sample, 0.1, 0.0)
        data += struct.pack("<QB3d", sample, gear, *current)
        answer = plug.step(sample, current, [1.0, 2.0, 3.0, 4.0])
        expected.append([*answer.command, *answer.setpoint, plug.gear, plug.shifting, plug.flags])
    done = subprocess.run([box], input=data, capture_output=True)
    assert (done.returncode, done.stderr) == (0, b"")
    first, *lines, last = done.stdout.decode().splitlines()
    assert first == f"5 {ControllerReady.READY} {ControllerReady.DUTY + ControllerReady.CURRENT} 1"
    found = [[*map(float.fromhex, line.split()[:6]), *map(int, line.split()[6:])] for line in lines]
    assert found == expected
    assert last == f"{ControllerReady.LEAVES} enough 0"


# one controller with names of its own; the rig offers another set of these names in each run
NAMES_MAIN = r"""
#include "rig_ros_box.hpp"

int main() {
  using Start = rig_msgs::msg::ControllerStart;
  rig_ros::Box box;
  Start start;
  const auto tell = [&] {
    start.session += 1;
    start.record.id = "any";
    start.record.outputs = {"a", "b", "c"};
    start.record.transducers = {"d", "e", "f", "g"};
    const auto said = box.start(start);
    std::printf("%d %s\n", said->state, said->message.c_str());
  };
  start.level = Start::LEVEL_DUTY;
  tell();
  start.level = Start::LEVEL_CURRENT;
  tell();
  start.wants = {"M_wyj", "M_wej", "p_p"};
  tell();
  start.settings = {"other", "held"};
  tell();
  start.signals = {"held_now", "slip", "twice"};
  tell();
  start.signals = {"held_now", "twice"};
  tell();
  rig_msgs::msg::ControllerStep step;
  step.session = start.session;
  step.seq = 1;
  step.current = {0.0, 0.0, 0.0};
  step.measured = {0.0, 0.0, 0.0, 0.0};
  step.others = {1.0, 2.0, 4e6};
  step.settings = {0.5, 0.25};
  const auto *answer = box.step(step);
  std::printf("%g %zu %g %g\n", answer->command[0], answer->signals.size(), answer->signals[0], answer->signals[1]);
  step.seq = 2;
  step.others.pop_back();
  answer = box.step(step);
  std::printf("%d %s\n", answer->status, answer->message.c_str());
  start.level = 7;
  tell();
}
"""


def test_what_it_needs_is_said_and_what_it_names_as_its_own_is_brought(messages, tmp_path):
    """The rig's order of names is not the controller's, and the rig may have more transducers than it wants."""
    (tmp_path / "main.cpp").write_text(NAMES_MAIN)
    (tmp_path / "mine.cpp").write_text(C)
    sources = [tmp_path / "main.cpp", tmp_path / "mine.cpp"]
    subprocess.run(["c++", *STRICT, f"-I{INCLUDE}", *messages, *sources, "-o", tmp_path / "box"], check=True)
    lines = subprocess.run([tmp_path / "box"], capture_output=True, text=True, check=True).stdout.splitlines()
    refuses = ControllerReady.REFUSES
    assert lines == [
        f"{refuses} this run is at level duty, at which the controller does not work; choose with --level",
        f"{refuses} it needs p_p, M_wej, held, other, twice, held_now; start the rig with "
        "ros:NAME?wants=p_p,M_wej&settings=held:VALUE,other:VALUE&signals=twice,held_now",
        f"{refuses} it needs held, other, twice, held_now; start the rig with "
        "ros:NAME?wants=M_wyj,M_wej,p_p&settings=held:VALUE,other:VALUE&signals=twice,held_now",
        f"{refuses} it needs twice, held_now; start the rig with "
        "ros:NAME?wants=M_wyj,M_wej,p_p&settings=other:VALUE,held:VALUE&signals=twice,held_now",
        f"{refuses} it has no signal slip, which ros:NAME?signals= names",
        f"{ControllerReady.READY} ",
        "0.125 2 0.125 8e+06",
        "2 the step has other numbers than the start of the run has names",
        f"{refuses} the level of this run, 7, is unknown here",
    ]


BEYOND = """
#include "rig_controller.h"
extern "C" {
const rig_controller_abi_info *rig_controller_abi(void) { RIG_CONTROLLER_DESCRIBE(RIG_LEVEL_DUTY); }
int rig_controller_create(rig_controller_info *, void **) { return RIG_OK; }
int rig_controller_step(void *, const rig_controller_inputs *in, rig_controller_outputs *out) {
  if (in->sample == 1) out->gear = 258;
  if (in->sample == 2) out->flags = 256;
  return in->sample == 3 ? 256 : in->sample == 4 ? -1 : RIG_OK;
}
void rig_controller_destroy(void *) {}
}
"""
BEYOND_MAIN = """
#include "rig_ros_box.hpp"

int main() {
  rig_ros::Box box;
  rig_msgs::msg::ControllerStart start;
  start.session = 1;
  box.start(start);
  rig_msgs::msg::ControllerStep step;
  step.session = 1;
  for (; step.sample < 5; ++step.sample) {
    step.seq += 1;
    const auto *answer = box.step(step);
    std::printf("%d %s\\n", answer->status, answer->message.c_str());
  }
}
"""


def test_a_number_that_a_message_cannot_hold_is_an_error_and_not_another_number(messages, tmp_path):
    (tmp_path / "main.cpp").write_text(BEYOND_MAIN)
    (tmp_path / "mine.cpp").write_text(BEYOND)
    sources = [tmp_path / "main.cpp", tmp_path / "mine.cpp"]
    subprocess.run(["c++", *STRICT, f"-I{INCLUDE}", *messages, *sources, "-o", tmp_path / "box"], check=True)
    lines = subprocess.run([tmp_path / "box"], capture_output=True, text=True, check=True).stdout.splitlines()
    what = ("gear is 258", "flags is 256", "status is 256", "status is -1")
    assert lines == ["0 ", *(f"2 {one}, expected 0 to 255" for one in what)]


def test_the_node_compiles_without_a_warning(messages):
    """The test runs only where a ROS 2 with rclcpp is installed."""
    folder = Path(includes("rclcpp")[1]).parent
    more = [word for path in sorted(folder.iterdir()) if path.is_dir() for word in ("-isystem", str(path))]
    subprocess.run(
        [
            "c++",
            *STRICT,
            f"-I{INCLUDE}",
            *messages,
            *more,
            "-fsyntax-only",
            CONTROLLERS / "examples" / "ros_cpp" / "alfa46_node.cpp",
        ],
        check=True,
    )
