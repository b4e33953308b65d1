"""A controller as an FMU: the reference one in both versions of FMI, and what is wrong with others."""

import re
import shutil
import zipfile

import pytest

from rig_nodes.bags.reader import Bag
from rig_nodes.controllers import ControllerFailed, Status, load_controller
from rig_nodes.errors import RigError
from rig_nodes.testbench.configuration import load_rig
from rig_nodes.testbench.sequence import load_sequence
from rig_nodes.testbench.simulate import simulate

from .conftest import ALFA46_C, ask

FAULTS = """
#include "rig_controller.h"
#include <stdlib.h>
#include <string.h>
const rig_controller_abi_info *rig_controller_abi(void) { RIG_CONTROLLER_DESCRIBE(RIG_LEVEL_CURRENT); }
int rig_controller_create(rig_controller_info *info, void **instance) { (void)info; *instance = 0; return RIG_OK; }
int rig_controller_step(void *instance, const rig_controller_inputs *in, rig_controller_outputs *out) {
  volatile int endless = 1;
  (void)instance;
  switch (in->gear_request ? in->sample : 0) {
    case 1: return RIG_DISCARD;
    case 2: strcpy(out->message, "no speed signal"); return RIG_ERROR;
    case 3: strcpy(out->message, "memory is gone"); return RIG_FATAL;
    case 4: abort();
    case 5: while (endless) {}
  }
  out->command[0] = 0.25;
  return RIG_OK;
}
void rig_controller_destroy(void *instance) { (void)instance; }
"""


@pytest.fixture(scope="module")
def build(tmp_path_factory):
    """Builds the reference controller, or another C text, as an FMU of a version."""
    from rig_nodes.fmu.build import build_controller_fmu

    folder, built = tmp_path_factory.mktemp("fmu"), {}

    def get(fmi, text=None):
        key = fmi, text
        if key not in built:
            source = ALFA46_C
            if text:
                source = folder / "other.c"
                source.write_text(text)
            built[key] = folder / f"controller{len(built)}.fmu"
            build_controller_fmu([source], built[key], load_rig().alfa46, fmi, ["-Werror"])
        return built[key]

    return get


@pytest.fixture(scope="module")
def hashes(tmp_path_factory):
    """canonical_hash of the sample sequence under the late settings with a controller."""
    def get(spec):
        config = load_rig("hydmag", {"alfa46.t12": "200 ms", "alfa46.output_2.P1": "100 ms 200 mA"})
        folder = tmp_path_factory.mktemp("run")
        plug = load_controller(str(spec), config.alfa46)
        run = simulate(config, load_sequence("sample"), folder, controller=plug)
        assert run["end"]["state"] == "ended", run["end"]["reason"]
        return Bag(folder).canonical_hash()

    return get


@pytest.fixture(scope="module")
def built_in(hashes):
    return hashes("alfa46")


@pytest.mark.parametrize(("fmi", "level"), [(2, ""), (3, ""), (3, "@current")])
def test_the_reference_controller_gives_the_bits_of_the_built_in_one(build, hashes, built_in, fmi, level):
    found = hashes(f"fmu:{build(fmi)}{level}")
    other = {"/alfa46/command", "all"} if level else set()
    assert {topic for topic, value in found.items() if built_in[topic] != value} == other
    assert found.keys() == built_in.keys()


def test_fmpy_finds_nothing_wrong_with_it(build):
    from fmpy.validation import validate_fmu

    assert [validate_fmu(str(build(fmi))) for fmi in (2, 3)] == [[], []]


def faulty(build, config, fmi, sample):
    """The plug, asked until before a sample, which is the first to carry an order."""
    plug = load_controller(f"fmu:{build(fmi, FAULTS)}", config.alfa46)
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
    assert failure.value.status == Status.ERROR and plug._process.poll() == 0, "the process has ended in order"


@pytest.mark.parametrize(("sample", "sentence"), [
    (3, "status fatal: memory is gone"), (4, "the FMU's process was ended by SIGABRT (aborted)"),
    (5, "no answer for 200 ms (--step-timeout)"),
])
def test_what_cannot_be_trusted_is_fatal_and_its_process_is_gone(build, config, sample, sentence):
    plug = faulty(build, config, 2, sample)
    plug.pace(0.2)
    with pytest.raises(ControllerFailed, match=re.escape(sentence)) as failure:
        ask(plug, sample)
    assert failure.value.status == Status.FATAL and plug._process.poll() is not None
    plug.close()


def changed(source, target, edit):
    """The FMU with its files edited: name, bytes -> name, bytes or None."""
    with zipfile.ZipFile(source) as old, zipfile.ZipFile(target, "w") as new:
        for name in old.namelist():
            kept = edit(name, old.read(name))
            if kept is not None:
                new.writestr(*kept)
    return target


@pytest.mark.parametrize(("edit", "sentence"), [
    (lambda n, d: (n.replace("linux64", "win64").replace(".so", ".dll"), d),
     "no binary for this platform, linux64; it has win64"),
    (lambda n, d: None if n.startswith("binaries") else (n, d), "no binary for this platform, linux64; it has none"),
    (lambda n, d: (n, d.replace(b'name="command_2"', b'name="y"')),
     "no variable command_2; it has level, .*command_1, y"),
    (lambda n, d: (n, re.sub(rb'(name="n_wej"[^>]*)causality="input"', rb'\1causality="local"', d)),
     "variable n_wej has causality local, expected input"),
    (lambda n, d: (n, d.replace(b"<CoSimulation", b"<ModelExchange")), "model exchange only; expected co-simulation"),
    (lambda n, d: (n, d.replace(b'fmiVersion="2.0"', b'fmiVersion="1.0"')), "cannot be read as an FMU"),
    (lambda n, d: (n, d[:100] if n.endswith(".so") else d), "cannot be loaded: .*controller0.so"),
    (lambda n, d: (n, d.replace(b'guid="{', b'guid="{0')), "GUID or instantiation token is not that"),
    (lambda n, d: (n.replace("modelDescription", "other"), d), "cannot be read as an FMU"),
])
def test_an_fmu_that_does_not_fit_is_refused_in_one_sentence(build, config, tmp_path, edit, sentence):
    other = changed(build(2), tmp_path / "other.fmu", edit)
    with pytest.raises(RigError, match=sentence) as refusal:
        load_controller(f"fmu:{other}", config.alfa46)
    assert str(refusal.value).startswith(f"controller fmu:{other}: ") and "\n" not in str(refusal.value)
    assert refusal.value.exit_code == 2


def test_no_file_and_no_level_are_said(build, config, tmp_path):
    with pytest.raises(RigError, match="no such file"):
        load_controller("fmu:nowhere.fmu", config.alfa46)
    (tmp_path / "text.fmu").write_text("no zip")
    with pytest.raises(RigError, match="cannot be read as an FMU"):
        load_controller(f"fmu:{tmp_path / 'text.fmu'}", config.alfa46)
    with pytest.raises(RigError, match="works at level current, not at level 'duty'"):
        load_controller(f"fmu:{build(2, FAULTS)}", config.alfa46, "duty")


def test_c_code_that_does_not_compile_is_said(tmp_path, config):
    from rig_nodes.fmu.build import build_controller_fmu

    path = tmp_path / "mine.c"
    path.write_text(FAULTS.replace("volatile int endless", "int never, endless"))
    build_controller_fmu([path], tmp_path / "warned_of.fmu", config.alfa46)
    path.write_text(FAULTS.replace("return RIG_DISCARD;", "return RIG_DISCARDED;"))
    with pytest.raises(RigError, match="does not compile: .*mine.c.*RIG_DISCARDED"):
        build_controller_fmu([path], tmp_path / "mine.fmu", config.alfa46)
    assert shutil.which("cc") and not (tmp_path / "mine.fmu").exists()


def test_other_inputs_are_transducers_and_other_outputs_are_recorded(build, config, tmp_path):
    """The reference controller with some of its variables under other names: what they carry shows both ways."""
    names = {b"current_3": b"T_oil", b"setpoint_3": b"mine", b"setpoint_1": b"asked"}

    def rename(name, data):
        if name == "modelDescription.xml":
            for old, new in names.items():
                data = data.replace(b'name="%s"' % old, b'name="%s"' % new)
        return name, data

    plug = load_controller(f"fmu:{changed(build(2), tmp_path / 'other.fmu', rename)}", config.alfa46)
    assert plug.wants == ("T_oil",) and dict(plug.signals) == {"asked": "A", "mine": "A"}
    plug.order(1)
    for sample in range(101):
        plug.step(sample, [0.0] * 3, 0.0, 0.0, 0.0, 0.0, [40.0])
    assert plug.signal_values == pytest.approx((0.08, 0.0)), "half-way to P1, 160 mA at 200 ms"
    plug.close()
