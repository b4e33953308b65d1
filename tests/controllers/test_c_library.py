# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""C libraries: built without a warning, clean under the sanitizers, refused when they do not fit."""

import re
import shutil
import subprocess
from pathlib import Path

import pytest

from rig_nodes.base.errors import RigError
from rig_nodes.controllers import ControllerFailed, Status, load_controller

from .conftest import ALFA46_C, C_FRAME, INCLUDE, RECORD, SANITIZE, SIMULINK_FOLDER, STRICT, ask


def load(config, path, level=None):
    return load_controller(f"c:{path}", config, level)


def frame(step):
    return C_FRAME.replace("STEP", step)


def test_a_library_answers_and_is_asked_in_its_own_units(build, config):
    plug = load(
        config,
        build(
            frame("""
        out->command[0] = in->current[1]; out->command[1] = rig_measured_of(in)->n_wej / 1000.0;
        out->command[2] = rig_measured_of(in)->p2 / 1e7;
        out->setpoint[2] = in->time; out->gear = in->gear_request; out->shifting = in->sample == 7;
        out->flags = 5;
        if (in->size != sizeof *in || out->size != sizeof *out) return RIG_ERROR;
        if (rig_measured_of(in)->p1 != 1e5 || rig_measured_of(in)->n_wyj != 50.0) return RIG_ERROR;
    """),
            "-Wall",
            "-Wextra",
            "-Werror",
        ),
    )
    plug.order(2)
    answer = plug.step(7, [0.0, 0.5, 0.0], [100.0, 50.0, 1e5, 1e6])
    assert answer == ((0.5, 0.1, 0.1), (0.0, 0.0, 0.007))
    assert (plug.gear, plug.shifting, plug.flags) == (2, True, 5)
    assert plug.step(8, [0.0, 0.5, 0.0], [100.0, 50.0, 1e5, 1e6]) is not None and not plug.shifting
    plug.close()


@pytest.mark.parametrize(
    ("step", "status", "sentence"),
    [
        ("out->command[1] = 0.0 / out->command[0];", Status.ERROR, r"command\[1\] is -?nan, expected 0 to 1"),
        ("out->command[2] = -0.5;", Status.ERROR, r"command\[2\] is -0.5"),
        ("out->gear = 9;", Status.ERROR, "gear is 9"),
        ("return 17;", Status.ERROR, "status is 17, expected 0"),
        ('__builtin_strcpy(out->message, "no speed signal"); return RIG_ERROR;', Status.ERROR, "error: no speed signal$"),
        ("return RIG_FATAL;", Status.FATAL, "status fatal: it gave no reason"),
    ],
)
def test_what_no_valve_can_be_given_trips(build, config, step, status, sentence):
    plug = load(config, build(frame(step)))
    with pytest.raises(ControllerFailed, match=sentence) as failure:
        ask(plug, 3)
    assert failure.value.status == status and "sample 3" in str(failure.value)
    plug.close()


def test_discard_is_no_answer(build, config):
    assert ask(load(config, build(frame("return RIG_DISCARD;")))) is None


def test_another_abi_is_named_found_and_wanted(build, config):
    text = frame("").replace(
        "RIG_CONTROLLER_DESCRIBE(RIG_LEVEL_DUTY);", "static rig_controller_abi_info d = {7, 1, 0, 0, 0, 0, 0}; return &d;"
    )
    with pytest.raises(
        RigError,
        match="made for ABI 7 of rig_controller.h, this rig has ABI 2; compile it again with this rig's header and rig_record.h",
    ):
        load(config, build(text))


def test_structs_of_another_size_are_refused(build, config):
    text = "#pragma pack(1)\n" + frame("")
    with pytest.raises(RigError, match=r"library's info struct has 20\d bytes, this rig's 216"):
        load(config, build(text))


def test_missing_functions_are_named(build, config):
    text = frame("").replace("void rig_controller_destroy", "void rig_controller_free")
    with pytest.raises(RigError, match="does not export rig_controller_destroy;"):
        load(config, build(text))


def test_a_function_that_the_library_itself_lacks_is_named(build, config):
    with pytest.raises(RigError, match="cannot be loaded: .*undefined symbol: model_step"):
        load(config, build("void model_step(void);\n" + frame("model_step();")))


def test_create_may_refuse_with_its_reason(build, config):
    text = frame("").replace("(void)info;", '__builtin_strcpy(info->message, "licence is missing"); return RIG_ERROR;')
    with pytest.raises(RigError, match="create refused with status 2: licence is missing"):
        load(config, build(text))


def test_a_level_that_the_library_does_not_know_is_refused(build, config):
    with pytest.raises(RigError, match="works at level duty, not at level 'current'"):
        load(config, build(frame("")), "current")


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (lambda data: b"this is my controller\n" * 10, "no shared library"),
        (lambda data: b"", "no shared library"),
        (lambda data: data[:40], "cut off: 40 bytes"),
        (lambda data: data[: len(data) // 2], "cut off: .* bytes of at least"),
        (lambda data: data[:18] + bytes([183, 0]) + data[20:], "is for aarch64, 64 bits; this machine is"),
        (lambda data: data[:16] + bytes([1, 0]) + data[18:], "link it with -shared"),
    ],
)
def test_files_that_are_no_library_for_this_machine_are_refused(build, config, change, sentence):
    path = build(frame(""))
    path.write_bytes(change(path.read_bytes()))
    with pytest.raises(RigError, match=sentence) as refusal:
        load(config, path)
    assert str(path) in str(refusal.value) and "\n" not in str(refusal.value)


def test_a_file_that_does_not_exist_is_refused(config):
    with pytest.raises(RigError, match="no such file"):
        load(config, "nowhere.so")


def test_c_that_does_not_compile_is_refused_with_its_line(tmp_path, config):
    path = tmp_path / "mine.c"
    path.write_text(frame("out->no_such_member = 1;"))
    with pytest.raises(RigError, match=r"does not compile: .*mine.c:9:6: error: .*no_such_member") as refusal:
        load(config, path)
    assert "\n" not in str(refusal.value)


def test_without_a_compiler_the_sentence_says_what_to_do(tmp_path, config, monkeypatch):
    (tmp_path / "mine.c").write_text(frame(""))
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.delenv("CC", raising=False)
    with pytest.raises(RigError, match="no C compiler here"):
        load(config, tmp_path / "mine.c")


@pytest.mark.parametrize("compiler", ["cc", *filter(shutil.which, ("gcc", "clang"))])
def test_the_example_compiles_without_a_warning(tmp_path, compiler):
    subprocess.run([compiler, *STRICT, "-fPIC", "-shared", "-o", tmp_path / "alfa46.so", ALFA46_C, "-lm"], check=True)


def test_the_header_is_usable_from_cpp(tmp_path):
    (tmp_path / "mine.cpp").write_text(frame(""))
    subprocess.run(
        [
            "c++",
            "-std=c++11",
            "-pedantic",
            "-Wall",
            "-Wextra",
            "-Werror",
            f"-I{INCLUDE}",
            f"-I{RECORD}",
            "-fPIC",
            "-shared",
            "-o",
            tmp_path / "mine.so",
            tmp_path / "mine.cpp",
        ],
        check=True,
    )
    names = subprocess.run(["nm", "-D", "--defined-only", tmp_path / "mine.so"], capture_output=True, text=True, check=True)
    assert " T rig_controller_step\n" in names.stdout


# shifts through all gears at all levels, checks that wrong values are refused, and releases everything
DRIVER = r"""
#include "rig_record.h"
#include <stdio.h>
#include <string.h>
static rig_parameter given[64];
static const rig_gear gears[] = {{0, "neutral"}, {1, "I"}, {2, "II"}};
static char names[64][32];
static uint32_t count;
static void give(const char *name, double value) {
  snprintf(names[count], sizeof names[count], "%s", name);
  given[count].name = names[count];
  given[count++].value = value;
}
int main(void) {
  char name[32];
  give("sample_time", 1e-3); give("t12", -0.22); give("t21", 0.1); give("t23", 0); give("t32", 0);
  give("supply_voltage", 24); give("gain_p", 20); give("gain_i", 1000);
  give("gain_d", 1); give("derivative_time", 0.02);
  for (int k = 1; k <= 3; k++) for (int n = 1; n <= 6; n++) {
    snprintf(name, sizeof name, "output_%d.P%d.time", k, n); give(name, 0.1 * ((n - 1) % 3 + 1));
    snprintf(name, sizeof name, "output_%d.P%d.current", k, n); give(name, n < 4 ? 0.2 * n : 0.2 * (6 - n));
  }
  for (uint32_t level = RIG_LEVEL_DUTY; level <= RIG_LEVEL_CURRENT; level++) {
    rig_controller_info info = {sizeof info, level, 1e-3, 1.0, given, count, "", RIG_CONTROLLER_RECORD, NULL, NULL, gears,
                                RIG_OUTPUTS, 0, 3};
    double current[RIG_OUTPUTS] = {0}, measured[RIG_TRANSDUCERS] = {0}, command[RIG_OUTPUTS], setpoint[RIG_OUTPUTS];
    rig_controller_inputs in = {sizeof in, 0, 0, 0, current, measured};
    void *box = NULL;
    double sum = 0;
    if (rig_controller_abi()->abi != RIG_CONTROLLER_ABI) return 6;
    if (rig_controller_create(&info, &box) != RIG_OK) return 1;
    for (in.sample = 0; in.sample < 6000; in.sample++) {
      rig_controller_outputs out;
      memset(&out, 0, sizeof out);
      out.size = sizeof out;
      out.command = command;
      out.setpoint = setpoint;
      in.gear_request = (uint32_t)(in.sample / 700 % 3);
      if (rig_controller_step(box, &in, &out) != RIG_OK) return 2;
      for (int k = 0; k < 3; k++) { current[k] = out.setpoint[k]; sum += out.command[k]; }
    }
    rig_controller_outputs out = {sizeof out, 0, 0, 0, command, setpoint, ""};
    in.gear_request = 4000000000u;
    if (rig_controller_step(box, &in, &out) != RIG_ERROR || !out.message[0]) return 3;
    rig_controller_destroy(box);
    info.parameter_count = 20;
    if (rig_controller_create(&info, &box) != RIG_ERROR || !info.message[0]) return 4;
    printf("%.3f\n", sum);
    if (!(sum > 100.0)) return 5;
  }
  return 0;
}
"""


@pytest.mark.parametrize("example", ["c", "simulink"])
def test_the_example_is_clean_under_the_sanitizers(tmp_path, example):
    (tmp_path / "driver.c").write_text(DRIVER)
    sources = [ALFA46_C] if example == "c" else sorted(SIMULINK_FOLDER.glob("*.c"))
    subprocess.run(
        ["cc", *STRICT, *SANITIZE, f"-I{SIMULINK_FOLDER}", "-o", tmp_path / "driver", tmp_path / "driver.c", *sources, "-lm"],
        check=True,
    )
    done = subprocess.run([tmp_path / "driver"], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0 and done.stderr == "", done.stderr


# ---- Simulink Coder's form


def model(tmp_path, shim, period=""):
    """Writes a folder of generated code on a small scale: the step copies an input to an output and counts."""
    folder = tmp_path / "model"
    folder.mkdir()
    (folder / "small.h").write_text(
        "extern struct { double u; } rtU; extern struct { double y, steps; } rtY;\n"
        "void small_initialize(void); void small_step(void); void small_terminate(void);\n"
    )
    (folder / "small.c").write_text(
        "struct { double u; } rtU; struct { double y, steps; } rtY;\n"
        "void small_initialize(void) { rtY.steps = 0; }\nvoid small_terminate(void) {}\n"
        "void small_step(void) { rtY.y = rtU.u; rtY.steps += 1; }\n"
    )
    (folder / "ert_main.c").write_text("int main(void) { return not_for_a_library; }\n")
    shutil.copy(RECORD / "rig_record.h", folder)
    (folder / "rig_shim.c").write_text(
        f'#include "small.h"\n#include "rig_record.h"\n#define RIG_MODEL small\n#define RIG_LEVELS RIG_LEVEL_DUTY\n{period}\n'
        '#include "rig_simulink.h"\n'
        "static void rig_inputs(const rig_controller_inputs *in) { rtU.u = rig_measured_of(in)->n_wej / 1000.0; }\n"
        "static void rig_outputs(rig_controller_outputs *out) {\n"
        "  out->command[0] = rtY.y; out->setpoint[0] = rtY.steps; }\n"
        f"static void rig_parameters(void) {{ {shim} }}\n"
    )
    return folder


def answers(config, folder, samples):
    plug = load_controller(f"simulink:{folder}", config)
    out = [plug.step(k, (0.0, 0.0, 0.0), [125.0 * k, 0.0, 0.0, 0.0]) for k in range(samples)]
    plug.close()
    return [(answer.command[0], answer.setpoint[0]) for answer in out]  # eighths, which floating-point numbers hold exactly


def test_a_model_is_stepped_once_per_sample(tmp_path, config):
    assert answers(config, model(tmp_path, ""), 4) == [(0.0, 1), (0.125, 2), (0.25, 3), (0.375, 4)]


def test_a_slower_model_is_stepped_at_its_own_period(tmp_path, config):
    folder = model(tmp_path, "", "#define RIG_MODEL_PERIOD 0.003")
    assert answers(config, folder, 5) == [(0.0, 1), (0.0, 1), (0.0, 1), (0.375, 2), (0.375, 2)]


FORMS = {
    "a step for each rate": (
        "void small_step0(void); void small_step1(void);",
        "void small_step0(void) { rtY.y = rtU.u; }\nvoid small_step1(void) { rtY.steps += 1; }",
        "static unsigned long tick;\nstatic void rates(void) { small_step0(); if (tick++ % 3 == 0) small_step1(); }\n"
        "#define RIG_STEP() rates()",
        (1, 1, 1, 2, 2),
    ),
    "one step with the number of the rate": (
        "void small_step(int tid);",
        "void small_step(int tid) { if (tid == 0) rtY.y = rtU.u; else rtY.steps += 1; }",
        "static unsigned long tick;\nstatic void rates(void) { small_step(0); if (tick++ % 3 == 0) small_step(1); }\n"
        "#define RIG_STEP() rates()",
        (1, 1, 1, 2, 2),
    ),
    "inputs and outputs as arguments": (
        "void small_step(double u, double *y, double *steps);",
        "void small_step(double u, double *y, double *steps) { *y = u; *steps += 1; }",
        "#define RIG_STEP() small_step(rtU.u, &rtY.y, &rtY.steps)",
        (1, 2, 3, 4, 5),
    ),
}


@pytest.mark.parametrize("form", FORMS)
def test_generated_code_of_another_form_of_step_is_called_by_the_lines_of_the_page(form, tmp_path, config):
    declared, defined, shim, steps = FORMS[form]
    folder = model(tmp_path, "", shim)
    for name, old, new in (
        ("small.h", "void small_step(void);", declared),
        ("small.c", "void small_step(void) { rtY.y = rtU.u; rtY.steps += 1; }", defined),
    ):
        text = (folder / name).read_text()
        assert old in text
        (folder / name).write_text(text.replace(old, new))
    assert answers(config, folder, 5) == [(k / 8.0, count) for k, count in enumerate(steps)]


@pytest.mark.parametrize(
    ("shim", "period", "sentence"),
    [
        ('rig_setting("t13");', "", "create refused with status 2: parameter t13 is not given"),
        ("", "#define RIG_MODEL_PERIOD 0.0015", "the model's 0.0015 s are no whole multiple of the rig's 0.001 s"),
        ("", '#define RIG_ERROR_STATUS "solver diverged"', "create refused with status 2: solver diverged"),
        ("", "#undef RIG_LEVELS", "does not compile: .*define RIG_MODEL"),
    ],
)
def test_a_model_that_does_not_fit_is_refused(tmp_path, config, shim, period, sentence):
    with pytest.raises(RigError, match=sentence):
        load_controller(f"simulink:{model(tmp_path, shim, period)}", config)


def test_folders_without_a_model_are_refused(tmp_path, config):
    with pytest.raises(RigError, match="no such folder"):
        load_controller("simulink:nowhere", config)
    with pytest.raises(RigError, match="the folder has no rig_shim.c or rig_shim.cpp; './rig controller new simulink DIR'"):
        load_controller(f"simulink:{tmp_path}", config)


CLASS_H = """
#ifndef SMALL_H
#define SMALL_H
#include "shared_types.h"
class small {
 public:
  struct ExtU_small_T { real_T u; };
  struct ExtY_small_T { real_T y, steps; };
  ExtU_small_T small_U;
  ExtY_small_T small_Y;
  void initialize();
  void step();
  static void terminate();
};
#endif
"""
CLASS_CPP = """
#include "small.h"
#include "shared_utils.h"
void small::initialize() { small_Y.steps = 0; }
void small::step() { small_Y.y = shared_half(2.0 * small_U.u); small_Y.steps += 1; }
void small::terminate() {}
"""
CLASS_SHIM = """
#include "small.h"
#include "rig_record.h"
static small model;
#define RIG_MODEL small
#define RIG_LEVELS RIG_LEVEL_DUTY
#define RIG_INITIALIZE() model.initialize()
#define RIG_STEP() model.step()
#define RIG_TERMINATE() small::terminate()
#define RIG_WANTS "M_wej"
#define RIG_SIGNALS "steps"
#define RIG_SETTINGS {"gain", 2.0}
#include "rig_simulink.h"
static void rig_inputs(const rig_controller_inputs *in) { model.small_U.u = rig_measured_of(in)->n_wej / 1000.0 + 0.0 *
rig_wanted[0]; }
static void rig_outputs(rig_controller_outputs *out) {
  out->command[0] = model.small_Y.y; out->setpoint[0] = model.small_Y.steps; }
static void rig_parameters(void) {}
static void rig_signals(double *values) { values[0] = model.small_Y.steps; }
static void rig_settings(const double *) {}
"""


def generated_cpp(folder):
    """Writes a folder as the generator leaves C++ class code: the model's folder, and beside it shared utilities in C."""
    files = {
        "rig_shim.cpp": CLASS_SHIM,
        "small_grt_rtw/small.h": CLASS_H,
        "small_grt_rtw/small.cpp": CLASS_CPP,
        "small_grt_rtw/rt_cppclass_main.cpp": "int main() { return not_for_a_library; }\n",
        "slprj/grt/_sharedutils/shared_types.h": "typedef double real_T;\n",
        "slprj/grt/_sharedutils/shared_utils.h": '#ifdef __cplusplus\nextern "C"\n#endif\ndouble shared_half(double value);\n',
        # this is C but not C++, because a variable is called class
        "slprj/grt/_sharedutils/shared_utils.c": '#include "shared_utils.h"\n'
        "double shared_half(double class) { return class / 2.0; }\n",
    }
    shutil.copy(RECORD / "rig_record.h", folder)
    for name, text in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)


def test_cpp_class_code_in_its_folders_is_taken(tmp_path, config):
    generated_cpp(tmp_path)
    plug = load_controller(f"simulink:{tmp_path}", config)
    answer = [plug.step(k, (0.0, 0.0, 0.0), [125.0 * k, 0.0, 0.0, 0.0], [0.0]) for k in range(3)][-1]
    assert (answer.command[0], answer.setpoint[0], plug.signal_values) == (0.25, 3.0, (3.0,))
    assert dict(plug.settings) == {"gain": 2.0} and plug.wants == ("M_wej",)
    plug.close()


def test_two_shims_are_refused(tmp_path, config):
    generated_cpp(tmp_path)
    (tmp_path / "slprj" / "rig_shim.c").write_text("")
    with pytest.raises(RigError, match="the folder has 2 shims, expected one: rig_shim.cpp, slprj/rig_shim.c$"):
        load_controller(f"simulink:{tmp_path}", config)


RT_MODEL_H = """
typedef struct { double u; } ExtU_small_T;
typedef struct { double y, steps; } ExtY_small_T;
typedef struct { const char *errorStatus; ExtU_small_T *inputs; ExtY_small_T *outputs; } RT_MODEL_small_T;
#define rtmGetErrorStatus(rtm) ((rtm)->errorStatus)
RT_MODEL_small_T *small(void);
void small_initialize(RT_MODEL_small_T *const small_M);
void small_step(RT_MODEL_small_T *const small_M);
void small_terminate(RT_MODEL_small_T *const small_M);
"""
RT_MODEL_C = """
#include "small.h"
static ExtU_small_T u;
static ExtY_small_T y;
static RT_MODEL_small_T rt_model;
RT_MODEL_small_T *small(void) { rt_model.inputs = &u; rt_model.outputs = &y; return &rt_model; }
void small_initialize(RT_MODEL_small_T *const small_M) { small_M->outputs->steps = 0; }
void small_step(RT_MODEL_small_T *const small_M) {
  small_M->outputs->y = small_M->inputs->u;
  if (++small_M->outputs->steps > 3) small_M->errorStatus = "overrun"; }
void small_terminate(RT_MODEL_small_T *const small_M) { (void)small_M; }
"""


def test_the_rt_model_form_of_the_page_is_taken(tmp_path, config):
    """Reusable code of GRT has this form: a constructor, and functions with the model structure; the shim is that of the page."""
    page = (Path(__file__).parents[2] / "docs" / "how_to" / "controllers.md").read_text(encoding="utf-8")
    (shim,) = [block for block in re.findall(r"```c\n(.*?)```", page, re.S) if "RT_MODEL_your_model_T" in block]
    shim = shim.replace("your_model", "small")
    shutil.copy(RECORD / "rig_record.h", tmp_path)
    (tmp_path / "small.h").write_text(RT_MODEL_H)
    (tmp_path / "small.c").write_text(RT_MODEL_C)
    (tmp_path / "rig_shim.c").write_text(shim)
    plug = load_controller(f"simulink:{tmp_path}", config)
    for k in range(3):
        answer = plug.step(k, (0.0, 0.0, 0.0), [125.0 * k, 0.0, 0.0, 0.0])
    assert answer.command[0] == 0.25
    with pytest.raises(ControllerFailed, match="status error: overrun"):
        plug.step(3, (0.0, 0.0, 0.0), [0.0, 0.0, 0.0, 0.0])


def test_the_example_in_generated_form_compiles_without_a_warning(tmp_path):
    sources = sorted(SIMULINK_FOLDER.glob("*.c"))
    subprocess.run(["cc", *STRICT, "-fPIC", "-shared", "-o", tmp_path / "alfa46.so", *sources, "-lm"], check=True)
