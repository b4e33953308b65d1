# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A controller as an FMU: the reference one in both versions of FMI, and faults of other ones."""

import os
import re
import shutil
import signal
import tempfile
import zipfile
from pathlib import Path

import pytest

from rig_nodes.bags.reader import Bag
from rig_nodes.base.errors import RigError
from rig_nodes.controllers import ControllerFailed, Status, load_controller
from rig_nodes.controllers.load import level_line
from rig_nodes.rig.configuration import load_rig
from rig_nodes.runs.rig import Rig
from rig_nodes.runs.sequence import load_sequence
from rig_nodes.runs.simulation import advance_with, simulate

from .conftest import ALFA46_C, ask
from .test_own_process import is_gone

FAULTS = """
#include "rig_controller.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
const rig_controller_abi_info *rig_controller_abi(void) { RIG_CONTROLLER_DESCRIBE(RIG_LEVEL_CURRENT); }
int rig_controller_create(rig_controller_info *info, void **instance) { (void)info; *instance = 0; return RIG_OK; }
int rig_controller_step(void *instance, const rig_controller_inputs *in, rig_controller_outputs *out) {
  volatile int endless = 1;
  (void)instance;
  switch (in->gear_request ? in->sample : 0) {
    case 1: strcpy(out->message, "100 %n%s of the \033[31msignal lost"); return RIG_DISCARD;
    case 2: strcpy(out->message, "no speed signal"); return RIG_ERROR;
    case 3: strcpy(out->message, "memory is gone"); return RIG_FATAL;
    case 4: puts("\033[31mred\tline"); fflush(stdout); abort();
    case 5: while (endless) {} break;
    case 6: out->gear = 0xFFFFFFFFu; break;
    case 7: out->flags = 0xFFFFFFFFu; break;
  }
  out->command[0] = 0.25;
  return RIG_OK;
}
void rig_controller_destroy(void *instance) { (void)instance; }
"""


QUICKLY = "-O0"  # compiles in half the time, where no bits are compared
DUTY = FAULTS.replace("RIG_LEVEL_CURRENT", "RIG_LEVEL_DUTY | RIG_LEVEL_CURRENT")


@pytest.fixture(scope="module")
def build(tmp_path_factory):
    """Builds the reference controller, or another C text, as an FMU of a version of FMI."""
    from rig_nodes.runs.fmu.build import build_controller_fmu

    folder, built = tmp_path_factory.mktemp("fmu"), {}

    def get(fmi, text=None):
        key = fmi, text
        if key not in built:
            source, flags = ALFA46_C, ["-Werror"]
            if text:
                source, flags = folder / "other.c", ["-Werror", QUICKLY]
                source.write_text(text)
            built[key] = folder / f"controller{len(built)}.fmu"
            build_controller_fmu([source], built[key], load_rig("hydmag"), fmi, flags)
        return built[key]

    return get


@pytest.fixture(scope="module")
def hashes(tmp_path_factory):
    """Returns canonical_hash of the sample sequence under the late settings with a controller."""

    def get(spec):
        config = load_rig("hydmag", {"alfa46.t12": "200 ms", "alfa46.output_2.P1": "100 ms 200 mA"})
        folder = tmp_path_factory.mktemp("run")
        plug = load_controller(str(spec), config)
        run = simulate(config, load_sequence("sample"), folder, controller=plug)
        assert run["end"]["state"] == "ended", run["end"]["reason"]
        return Bag(folder).canonical_hash()

    return get


@pytest.fixture(scope="module")
def built_in(hashes):
    return hashes("alfa46")


@pytest.mark.parametrize(("fmi", "level"), [(2, ""), (3, "@current")])
def test_the_reference_controller_gives_the_bits_of_the_built_in_one(build, hashes, built_in, fmi, level):
    found = hashes(f"fmu:{build(fmi)}{level}")
    other = {"/controller/command", "all"} if level else set()
    assert {topic for topic, value in found.items() if built_in[topic] != value} == other
    assert found.keys() == built_in.keys()


def test_fmpy_finds_nothing_wrong_with_it(build):
    from fmpy.validation import validate_fmu

    assert [validate_fmu(str(build(fmi))) for fmi in (2, 3)] == [[], []]


def faulty(build, config, fmi, sample):
    """Returns the plug after all samples before a given one, which is then the first to carry an order."""
    plug = load_controller(f"fmu:{build(fmi, FAULTS)}", config)
    assert plug.level == "current"
    for before in range(sample):
        assert ask(plug, before).command == (0.25, 0.0, 0.0)
    plug.order(1)
    return plug


@pytest.mark.parametrize("fmi", [2, 3])
def test_a_discarded_sample_and_an_error_are_what_they_are_in_c(build, config, fmi):
    plug = faulty(build, config, fmi, 1)
    assert ask(plug, 1) is None
    with pytest.raises(ControllerFailed, match="sample 2: status error: no speed signal$") as failure:
        ask(plug, 2)
    assert failure.value.status == Status.ERROR and plug.end_fault == "", "the process has ended in order"


@pytest.mark.parametrize(("sample", "sentence"), [(6, r"gear is -\d+, expected 0"), (7, r"flags is -\d+, expected 0 to 7")])
def test_a_number_out_of_its_range_is_not_taken_for_0(build, config, sample, sentence):
    plug = faulty(build, config, 2, sample)
    with pytest.raises(ControllerFailed, match=f"sample {sample}: {sentence}"):
        ask(plug, sample)


@pytest.mark.parametrize("fmi", [2, 3])
def test_what_it_said_before_it_crashed_stands_in_the_sentence(build, config, capfd, fmi):
    """A text with conversions is not used as a format, and no text of the FMU acts on the terminal as a control sequence."""
    plug = faulty(build, config, fmi, 1)
    assert ask(plug, 1) is None
    os.kill(plug.process_id, signal.SIGKILL)
    with pytest.raises(
        ControllerFailed, match=re.escape(r"SIGKILL (killed); its last message: 100 %n%s of the \u001b[31msignal lost")
    ):
        ask(plug, 2)
    plug = faulty(build, config, fmi, 4)
    with pytest.raises(ControllerFailed, match=r"SIGABRT \(aborted\)$"):
        ask(plug, 4)
    assert capfd.readouterr().err == "\\u001b[31mred\tline\n"


@pytest.mark.parametrize(
    ("sample", "sentence"),
    [
        (3, "status fatal: memory is gone"),
        (4, "the FMU's process was ended by SIGABRT (aborted)"),
        (5, "no answer for 200 ms (--step-timeout)"),
    ],
)
def test_what_cannot_be_trusted_is_fatal_and_its_process_is_gone(build, config, sample, sentence, tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    plug = faulty(build, config, 2, sample)
    assert len(list(tmp_path.iterdir())) == 1
    plug.pace(0.2)
    with pytest.raises(ControllerFailed, match=re.escape(sentence)) as failure:
        ask(plug, sample)
    assert failure.value.status == Status.FATAL and is_gone(plug.process_id, 0.0)
    assert not list(tmp_path.iterdir()), "the unpacked files do not stay"
    plug.close()


def changed(source, target, edit):
    """Returns the FMU with its files edited: (name, bytes) -> (name, bytes) or None."""
    with zipfile.ZipFile(source) as old, zipfile.ZipFile(target, "w") as new:
        for name in old.namelist():
            kept = edit(name, old.read(name))
            if kept is not None:
                new.writestr(*kept)
    return target


@pytest.mark.parametrize(
    ("edit", "sentence"),
    [
        (
            lambda n, d: (n.replace("linux64", "win64").replace(".so", ".dll"), d),
            "no binary for this platform, linux64; it has win64",
        ),
        (lambda n, d: None if n.startswith("binaries") else (n, d), "no binary for this platform, linux64; it has none"),
        (lambda n, d: (n, d.replace(b'name="command_2"', b'name="y"')), "no variable command_2; it has level, .*command_1, y"),
        (
            lambda n, d: (n, re.sub(rb'(name="n_wej"[^>]*)causality="input"', rb'\1causality="local"', d)),
            "variable n_wej has causality local, expected input",
        ),
        (
            lambda n, d: (n, re.sub(rb'(name="rig_record".*?start=")\d+', rb"\g<1>7", d, flags=re.S)),
            "made for the record of another rig; make it anew with ./rig export controller-fmu FILE.c --rig hydmag",
        ),
        (lambda n, d: (n, d.replace(b"<CoSimulation", b"<ModelExchange")), "model exchange only; expected co-simulation"),
        (lambda n, d: (n, d.replace(b'fmiVersion="2.0"', b'fmiVersion="1.0"')), "cannot be read as an FMU"),
        (lambda n, d: (n, d[:100] if n.endswith(".so") else d), "cannot be loaded: .*controller0.so"),
        (lambda n, d: (n, d.replace(b'guid="{', b'guid="{0')), "GUID or instantiation token is not that"),
        (lambda n, d: (n.replace("modelDescription", "other"), d), "cannot be read as an FMU"),
    ],
)
def test_an_fmu_that_does_not_fit_is_refused_in_one_sentence(build, config, tmp_path, edit, sentence, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    other = changed(build(2), tmp_path / "other.fmu", edit)
    with pytest.raises(RigError, match=sentence) as refusal:
        load_controller(f"fmu:{other}", config)
    assert str(refusal.value).startswith(f"controller fmu:{other}: ") and "\n" not in str(refusal.value)
    assert refusal.value.exit_code == 2 and list(tmp_path.iterdir()) == [other]


def test_no_file_and_no_level_are_said(build, config, tmp_path):
    with pytest.raises(RigError, match="no such file"):
        load_controller("fmu:nowhere.fmu", config)
    (tmp_path / "text.fmu").write_text("no zip")
    with pytest.raises(RigError, match="cannot be read as an FMU"):
        load_controller(f"fmu:{tmp_path / 'text.fmu'}", config)
    with pytest.raises(RigError, match="works at level current, not at level 'duty'"):
        load_controller(f"fmu:{build(2, FAULTS)}", config, "duty")


def test_c_code_that_does_not_compile_is_said(tmp_path, config):
    from rig_nodes.runs.fmu.build import build_controller_fmu

    path = tmp_path / "mine.c"
    path.write_text(FAULTS.replace("volatile int endless", "int never, endless"))
    build_controller_fmu([path], tmp_path / "warned_of.fmu", config, flags=[QUICKLY])
    path.write_text(FAULTS.replace("return RIG_DISCARD;", "return RIG_DISCARDED;"))
    with pytest.raises(RigError, match="does not compile: .*mine.c.*RIG_DISCARDED"):
        build_controller_fmu([path], tmp_path / "mine.fmu", config)
    assert shutil.which("cc") and not (tmp_path / "mine.fmu").exists()


UNIT = re.compile(rb'(name="command_.".*?<Real)(?: unit="[^"]*")?', re.DOTALL)
DEFINED = b'<Unit name="x"><BaseUnit A="1" factor="0.01"/></Unit><Unit name="y"><BaseUnit kg="1"/></Unit></UnitDefinitions>'


def with_unit(source, target, unit):
    """Returns the FMU with another name for its parameter level, and with its commands in this unit."""

    def edit(name, data):
        if name == "modelDescription.xml":
            data = data.replace(b'name="level"', b'name="other"').replace(b"</UnitDefinitions>", DEFINED)
            data = UNIT.sub(rb'\1 unit="%s"' % unit if unit else rb"\1", data)
        return name, data

    return changed(source, target, edit)


@pytest.mark.parametrize(
    ("unit", "level", "level_from", "command"),
    [
        (b"A", "current", "the unit of its commands", 0.25),
        (b"mA", "current", "the unit of its commands", 0.25e-3),
        (b"x", "current", "the unit of its commands", 0.25e-2),
        (b"%", "duty", "the unit of its commands", 0.25e-2),
        (b"", "duty", None, 0.25),
    ],
)
def test_the_level_is_what_the_fmu_says(build, config, tmp_path, unit, level, level_from, command):
    plug = load_controller(f"fmu:{with_unit(build(2, DUTY), tmp_path / 'other.fmu', unit)}", config)
    assert plug.level == level
    assert plug.level_from == (
        f"as the controller declares ({level_from})" if level_from else "by default, the controller declares none"
    )
    assert ask(plug, 0).command == pytest.approx((command, 0.0, 0.0))
    plug.close()


def test_a_level_that_is_asked_for_and_one_of_a_parameter_are_said_to_be(build, config, tmp_path):
    for spec, level_from in (
        (f"fmu:{build(2)}", "as the controller declares (its parameter level)"),
        (f"fmu:{build(2)}@current", "as given"),
    ):
        plug = load_controller(spec, config)
        assert plug.level_from == level_from
        plug.close()


def test_a_unit_that_no_command_has_is_refused(build, config, tmp_path):
    with pytest.raises(RigError, match=r"output command_1 is in y; expected A \(level current\), or 1 or %"):
        load_controller(f"fmu:{with_unit(build(2, DUTY), tmp_path / 'other.fmu', b'y')}", config)


CPP = """
#include "gain.h"
#include <stdexcept>
#include <vector>
extern "C" double gained(double value);
const rig_controller_abi_info *rig_controller_abi(void) { RIG_CONTROLLER_DESCRIBE(RIG_LEVEL_CURRENT); }
int rig_controller_create(rig_controller_info *, void **instance) { *instance = new std::vector<double>(3, GAIN); return RIG_OK; }
int rig_controller_step(void *instance, const rig_controller_inputs *, rig_controller_outputs *out) {
  try { throw std::runtime_error("caught"); } catch (const std::exception &) { out->command[0] = gained(0.1); }
  return static_cast<std::vector<double> *>(instance)->size() == 3 ? RIG_OK : RIG_ERROR;
}
void rig_controller_destroy(void *instance) { delete static_cast<std::vector<double> *>(instance); }
"""


def test_c_and_cpp_files_become_one_fmu_wherever_they_stand(config, tmp_path, monkeypatch, capsys):
    from rig_nodes.cli.main import main

    monkeypatch.chdir(tmp_path)
    (tmp_path / "headers").mkdir()
    (tmp_path / "headers" / "gain.h").write_text('#include "rig_controller.h"\n#define GAIN 3.0\n')
    (tmp_path / "a.cpp").write_text(CPP)
    (tmp_path / "b.c").write_text('#include "gain.h"\ndouble gained(double value) { return GAIN * value; }\n')
    assert main(["export", "controller-fmu", "a.cpp", "-I", "headers", "--fmi", "3", "-o", "mine.fmu", "b.c"]) == 0
    plug = load_controller("fmu:mine.fmu", config)
    assert ask(plug, 0).command == pytest.approx((0.3, 0.0, 0.0))
    plug.close()
    for wrong, sentence in (
        ("a.cpp", "a.cpp:2:10: fatal error: gain.h: No such file or directory"),
        ("headers/gain.h", "headers/gain.h: expected a source file that ends in .c, .cpp, .cc, .cxx"),
        ("a.cpp --include nowhere", "include nowhere: there is no such folder"),
    ):
        assert main(["export", "controller-fmu", *wrong.split(), "-o", "other.fmu"]) == 2
        assert sentence in capsys.readouterr().err and not (tmp_path / "other.fmu").exists()


def test_an_archive_that_leads_astray_is_no_controller(build, config, tmp_path):
    other = changed(build(2), tmp_path / "other.fmu", lambda n, d: (n, d))
    with zipfile.ZipFile(other, "a") as file:
        file.writestr(zipfile.ZipInfo("/tmp/planted"), "x")
    with pytest.raises(RigError, match="^controller fmu:.*other.fmu: it cannot be read as an FMU: its archive has the entry"):
        load_controller(f"fmu:{other}", config)


def test_other_inputs_are_transducers_and_other_outputs_are_recorded(build, config, tmp_path):
    """The reference controller has some of its variables under other names; their values show in both directions."""
    names = {b"current_3": b"T_oil", b"setpoint_3": b"mine", b"setpoint_1": b"asked"}

    def rename(name, data):
        if name == "modelDescription.xml":
            for old, new in names.items():
                data = data.replace(b'name="%s"' % old, b'name="%s"' % new)
        return name, data

    plug = load_controller(f"fmu:{changed(build(2), tmp_path / 'other.fmu', rename)}", config)
    assert plug.wants == ("T_oil",) and dict(plug.signals) == {"asked": "A", "mine": "A"}
    plug.order(1)
    for sample in range(101):
        plug.step(sample, [0.0] * 3, [0.0, 0.0, 0.0, 0.0], [40.0])
    assert plug.signal_values == pytest.approx((0.08, 0.0)), "half-way to P1, 160 mA at 200 ms"
    plug.close()


ARRAYS = b"""
    <Float64 name="gains" valueReference="901" causality="parameter" variability="tunable" start="1 2 3">
      <Dimension start="3"/>
    </Float64>
    <Float64 name="shares" valueReference="902" causality="output" variability="continuous"><Dimension start="2"/></Float64>
    <Float64 name="T_oil" valueReference="903" causality="input" start="0 0"><Dimension start="2"/></Float64>
"""


def test_arrays_of_fmi_3_are_left_alone_and_none_is_taken_for_a_number(build, config, tmp_path):
    def with_arrays(name, data):
        return name, data.replace(b"</ModelVariables>", ARRAYS + b"</ModelVariables>")

    plug = load_controller(f"fmu:{changed(build(3), tmp_path / 'arrays.fmu', with_arrays)}", config)
    assert (dict(plug.settings), dict(plug.signals), plug.wants) == ({}, {}, ())
    assert ask(plug).command == (0.0, 0.0, 0.0)
    plug.close()

    def of_an_output(name, data):
        one = rb'(<Float64 name="current_3"[^>]*)/>'
        return name, re.sub(one, rb'\1><Dimension start="3"/></Float64>', data)

    with pytest.raises(RigError, match="the FMU's variable current_3 is an array, expected a single number"):
        load_controller(f"fmu:{changed(build(3), tmp_path / 'array.fmu', of_an_output)}", config)


def test_an_fmu_that_does_not_say_its_level_is_taken_at_duty_with_a_word(build, config, tmp_path):
    """A tool that writes neither the parameter level nor units exports such an FMU: 0.74 A would be 74 %."""
    mute = tmp_path / "mute.fmu"
    with zipfile.ZipFile(build(2)) as whole, zipfile.ZipFile(mute, "w") as part:
        for name in whole.namelist():
            data = whole.read(name)
            if name == "modelDescription.xml":
                text = re.sub(r' (unit|displayUnit)="A"', "", data.decode()).replace('name="level"', 'name="another"')
                data = text.encode()
            part.writestr(name, data)
    plug = load_controller(f"fmu:{mute}", config)
    try:
        assert level_line(plug) == (
            f"controller fmu:{mute} sends shares of the supply: level duty, by default, the controller declares none; "
            "if it sends currents in A, choose --level current"
        )
    finally:
        plug.close()
    plug = load_controller(f"fmu:{build(2)}", config)
    plug.close()
    assert level_line(plug) == (
        f"controller fmu:{build(2)} sends shares of the supply: level duty, as the controller declares (its parameter level)"
    )


ENDING = """
#include <sys/mman.h>
#include <unistd.h>
int fmi2Terminate(void *it);
static int is(const char *ending) { return getenv("ENDING") && strcmp(getenv("ENDING"), ending) == 0; }
__attribute__((constructor)) static void refuse(void) { /* it returns 3 (error) from now on */
  unsigned char *code = (unsigned char *)fmi2Terminate, *page = (unsigned char *)((unsigned long)code & ~4095UL);
  if (!is("error")) return;
  mprotect(page, 8192, PROT_READ | PROT_WRITE | PROT_EXEC);
  code[0] = 0xb8, code[1] = 3, code[2] = code[3] = code[4] = 0, code[5] = 0xc3;
}
__attribute__((destructor)) static void last(void) { if (is("crash on unloading")) abort(); }
void rig_controller_destroy(void *instance) {
  (void)instance;
  if (is("crash") || is("crash in freeInstance")) abort();
  if (is("exit")) exit(0);
  if (is("hang")) for (;;) pause();
  if (is("crash at exit")) atexit(abort);
  if (is("child") && fork() == 0) { setsid(); for (;;) pause(); }
}
"""
ENDINGS = {  # what the controller does at its end: the sentence
    "crash": "in terminate the FMU's process was ended by SIGABRT (aborted)",
    "exit": "in terminate the FMU's process ended itself with exit code 0",
    "hang": "terminate did not return within 2 s",
    "crash in freeInstance": "in freeInstance the FMU's process was ended by SIGABRT (aborted)",
    "crash on unloading": "in freeInstance the FMU's process was ended by SIGABRT (aborted)",
    "crash at exit": "in freeInstance the FMU's process was ended by SIGABRT (aborted)",
    "error": "terminate failed: terminate ended with status error",
    "child": "",
    "order": "",
}


def open_command(process):
    """Returns the command line of a process, empty when it has ended."""
    try:
        return (process / "cmdline").read_bytes()
    except OSError:
        return b""


@pytest.mark.parametrize("ending", ENDINGS)
def test_the_end_of_an_fmu_is_watched(build, config, monkeypatch, ending):
    path = build(2, FAULTS[: FAULTS.index("void rig_controller_destroy")] + ENDING)
    monkeypatch.setenv("ENDING", ending)
    plug = load_controller(f"fmu:{path}", config)
    ask(plug)
    if ending == "crash in freeInstance":
        ask(plug, 1)
        plug.order(1)
        with pytest.raises(ControllerFailed, match="status error"):
            ask(plug, 2)
    plug.close()
    assert plug.end_fault == ENDINGS[ending] and is_gone(plug.process_id, 0.0)
    assert all(str(path).encode() not in open_command(process) for process in Path("/proc").glob("[0-9]*")), "no child stays"


def test_an_fmu_that_discards_every_sample_is_the_reason_of_the_trip(build, config):
    plug = load_controller(f"fmu:{build(2, FAULTS.replace('? in->sample : 0', '? 1 : 0'))}", config)
    rig = Rig(config, controller="external", level=plug.level)
    for sample in range(140):
        if sample == 20:
            plug.order(1)
        advance_with(rig, plug)
    plug.close()
    assert rig.reason.startswith(f"valve commands older than 100 ms: controller {plug.name} does not answer: 100 %n%s of the ")
    assert rig.reason.endswith("signal lost")
