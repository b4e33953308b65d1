# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Every plug in a short run: the transducers that it wants, signals of its own and settings that a sequence sets."""

import subprocess
import sys

import numpy as np
import pytest
from fmpy.validation import validate_fmu

from rig_nodes.bags.reader import Bag
from rig_nodes.controllers import load_controller
from rig_nodes.runs.fmu.build import build_controller_fmu
from rig_nodes.runs.sequence import load_sequence
from rig_nodes.runs.simulation import simulate

from .conftest import CONTROLLERS, INCLUDE, SANITIZE

SEQUENCE = """
description: pressure comes, and the held current is set from 250 mA to 500 mA
steps:
  - oil: {pressure: 4 MPa}
  - wait: {for: 100 ms}
  - controller: {held: 0.5}
  - wait: {for: 100 ms}
"""
PYTHON = """
import sys
from types import SimpleNamespace
sys.path.insert(0, "FOLDER/udp")
from frames import serve

class Mine:
    levels = ("current",)
    wants, signals, settings = ("p_p", "M_wej"), {"twice": "Pa", "held_now": "A"}, {"held": 0.25, "other": 1.0}

    def initialize(self, info):
        pass

    def step(self, inputs):
        held = inputs.settings["held"] * inputs.settings["other"]
        return SimpleNamespace(command=[held, 0.0, 0.0], setpoint=None, gear=0, shifting=False, flags=0,
                               signals={"held_now": held, "twice": 2.0 * inputs.others["p_p"]})

    def terminate(self):
        pass

if __name__ == "__main__":
    serve(Mine(), "127.0.0.1", int(sys.argv[1]), Mine.levels)
"""
C = """
#include "rig_controller.h"
static double held, other, p_p;
const rig_controller_abi_info *rig_controller_abi(void) { RIG_CONTROLLER_DESCRIBE(RIG_LEVEL_CURRENT); }
int rig_controller_create(rig_controller_info *info, void **instance) { (void)info; *instance = 0; return RIG_OK; }
const char *const *rig_controller_wants(void) { static const char *const n[] = {"p_p", "M_wej", 0}; return n; }
void rig_controller_wanted(void *instance, const double *values, uint32_t count) {
  (void)instance; if (count == 2) p_p = values[0];
}
const char *const *rig_controller_signals(void) { static const char *const n[] = {"twice", "held_now", 0}; return n; }
void rig_controller_signal_values(void *instance, double *values, uint32_t count) {
  (void)instance; if (count == 2) { values[0] = 2.0 * p_p; values[1] = held * other; }
}
const rig_parameter *rig_controller_settings(void) {
  static const rig_parameter mine[] = {{"held", 0.25}, {"other", 1.0}, {0, 0.0}};
  return mine;
}
void rig_controller_set(void *instance, const double *values, uint32_t count) {
  (void)instance; if (count == 2) { held = values[0]; other = values[1]; }
}
int rig_controller_step(void *instance, const rig_controller_inputs *in, rig_controller_outputs *out) {
  (void)instance; (void)in; out->command[0] = held * other; return RIG_OK;
}
void rig_controller_destroy(void *instance) { (void)instance; }
"""
MODEL_C = """
#include "my_model.h"
ExtU rtU; ExtY rtY; P rtP = {0.25, 1.0};
void my_model_initialize(void) {}
void my_model_step(void) { rtY.i = rtP.held * rtP.other; rtY.twice = 2.0 * rtU.p_p; }
void my_model_terminate(void) {}
"""
MODEL_H = """
typedef struct { double p_p; } ExtU; typedef struct { double i, twice; } ExtY; typedef struct { double held, other; } P;
extern ExtU rtU; extern ExtY rtY; extern P rtP;
void my_model_initialize(void); void my_model_step(void); void my_model_terminate(void);
"""
SHIM = """
#include "my_model.h"
#define RIG_MODEL my_model
#define RIG_LEVELS RIG_LEVEL_CURRENT
#define RIG_WANTS "p_p", "M_wej"
#define RIG_SIGNALS "twice", "held_now"
#define RIG_SETTINGS {"held", 0.25}, {"other", 1.0}
#include "rig_simulink.h"
static void rig_inputs(const rig_controller_inputs *in) { (void)in; rtU.p_p = rig_wanted[0]; }
static void rig_outputs(rig_controller_outputs *out) { out->command[0] = rtY.i; }
static void rig_parameters(void) {}
static void rig_signals(double *values) { values[0] = rtY.twice; values[1] = rtY.i; }
static void rig_settings(const double *values) { rtP.held = values[0]; rtP.other = values[1]; }
"""
WARNINGS = ["-Wall", "-Wextra", "-Werror"]


def c_library(folder, _config, _port):
    subprocess.run(
        ["cc", "-std=c99", "-pedantic", *WARNINGS, "-fPIC", "-shared", f"-I{INCLUDE}", "-o", folder / "mine.so", folder / "mine.c"],
        check=True,
    )
    return f"c:{folder / 'mine.so'}", None


def model(folder, _config, _port):
    (folder / "model").mkdir()
    for name, text in (("my_model.c", MODEL_C), ("my_model.h", MODEL_H), ("rig_shim.c", SHIM)):
        (folder / "model" / name).write_text(text)
    subprocess.run(
        ["cc", "-std=c99", *WARNINGS, f"-I{INCLUDE}", "-c", "-o", folder / "shim.o", folder / "model" / "rig_shim.c"], check=True
    )
    return f"simulink:{folder / 'model'}", None


def udp_c(folder, _config, port):
    program, main = folder / "mine", CONTROLLERS / "examples" / "udp_main.c"
    flags = ["-std=gnu99", *WARNINGS, *SANITIZE, f"-I{INCLUDE}"]  # a fault would end the program and so the run
    subprocess.run(["cc", *flags, "-o", program, main, folder / "mine.c", "-lm"], check=True)
    return f"udp:{port}@current", [program, "127.0.0.1", str(port)]


def udp_python(folder, _config, port):
    (folder / "mine.py").write_text(PYTHON.replace("FOLDER", str(CONTROLLERS)))
    return f"udp:{port}@current", [sys.executable, folder / "mine.py", str(port)]


def fmu(folder, config, _port):
    build_controller_fmu([folder / "mine.c"], folder / "mine.fmu", config, flags=["-Werror", "-O0"])
    assert validate_fmu(str(folder / "mine.fmu")) == []
    return f"fmu:{folder / 'mine.fmu'}", None


@pytest.mark.parametrize("made", [c_library, model, udp_c, udp_python, fmu])
def test_it_gets_what_it_wants_is_set_and_recorded(made, config, tmp_path, free_udp_port):
    (tmp_path / "mine.c").write_text(C)
    (tmp_path / "sequence.yaml").write_text(SEQUENCE)
    spec, command = made(tmp_path, config, free_udp_port)
    program = command and subprocess.Popen(command)
    try:
        plug = load_controller(spec, config)
        plug.wait(20.0)
        assert set(plug.wants) == {"p_p", "M_wej"} and dict(plug.settings) == {"held": 0.25, "other": 1.0}
        run = simulate(config, load_sequence(tmp_path / "sequence.yaml", default="hydmag"), tmp_path / "run", controller=plug)
    finally:
        if program:
            program.kill()
            program.wait()
    assert run["end"]["state"] == "ended", run["end"]["reason"]
    bag = Bag(tmp_path / "run")
    t, asked = bag.series("I_set_zr_p1")
    changes = [(round(t[k], 3), asked[k]) for k in np.flatnonzero(np.diff(asked, prepend=-1.0))]
    assert changes == [(0.0, 0.25), (0.105, 0.5)], "the sequence looks every 5 ms"
    own = bag.logger("/controller/signals").channels
    assert set(own) == {"twice", "held_now"} and np.array_equal(own["held_now"], asked[: len(own["held_now"])])
    pressure = own["twice"] / 2.0
    assert 3.8e6 < pressure[-1] < 4.2e6 and pressure[0] < 1e6, "the supply's pressure as it is measured"
    changed = [text for _, _, name, text, _ in bag.events() if name == "setting_changed"]
    assert changed == ["alfa46.controller.held = 0.5"]
