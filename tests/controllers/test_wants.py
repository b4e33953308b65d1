# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Transducers that a controller asks for by name, in Python and in C, and controllers that packages provide by name."""

import pytest

from rig_nodes.base.errors import RigError
from rig_nodes.controllers import load_controller
from rig_nodes.runs.rig import Rig
from rig_nodes.runs.simulation import advance_with

from .conftest import C_FRAME

C_WANTS = (
    C_FRAME.replace("STEP", "out->setpoint[0] = seen[0]; out->setpoint[1] = seen[1];").replace(
        '#include "rig_record.h"', '#include "rig_record.h"\nstatic double seen[2];'
    )
    + """
const char *const *rig_controller_wants(void) {
  static const char *const names[] = {"p_p", "T_oil", 0};
  return names;
}
void rig_controller_wanted(void *instance, const double *values, uint32_t count) {
  (void)instance;
  if (count == 2) { seen[0] = values[0]; seen[1] = values[1]; }
}
"""
)


def seen_on_the_rig(config, plug, samples=300):
    """Returns for each sample (the values on the wires, the values that the controller gave as its setpoints)."""
    rig, out = Rig(config, controller="external"), []
    rig.set("oil", 4.0e6, True)
    for _ in range(samples):
        wires = rig.measurement("p_p"), rig.measurement("T_oil")
        advance_with(rig, plug)
        out.append((wires, tuple(rig.setpoint[:2])))
    plug.close()
    return out


def check(pairs):
    assert all(wires == shown for wires, shown in pairs)
    pressures = [wires[0] for wires, _ in pairs]
    assert pressures[-1] > 3.5e6 > 1e6 > pressures[0], "it is measured, not constant"


def test_a_class_gets_what_it_wants(config, python_controller):
    plug = python_controller("return Out(setpoint=[inputs.others['p_p'], inputs.others['T_oil'], 0.0])", "wants = ('p_p', 'T_oil')")
    assert plug.wants == ("p_p", "T_oil")
    check(seen_on_the_rig(config, plug))


def test_a_library_gets_what_it_wants(config, build):
    plug = load_controller(f"c:{build(C_WANTS, '-Wall', '-Wextra', '-Werror')}", config)
    assert plug.wants == ("p_p", "T_oil")
    check(seen_on_the_rig(config, plug))


def test_half_of_the_pair_is_refused(config, build):
    text = C_FRAME.replace("STEP", "") + "const char *const *rig_controller_wants(void) { return 0; }\n"
    with pytest.raises(RigError, match="does not export rig_controller_wanted"):
        load_controller(f"c:{build(text)}", config)


@pytest.mark.parametrize(
    ("wants", "sentence"),
    [
        ("('M_wej', 'p_9')", "transducer 'p_9'; did you mean 'p_p'"),
        ("'M_wej'", "wants is 'M_wej', expected names"),
        ("('p_p', 'p_p')", "wants has the name 'p_p' twice, expected each name once"),
        ("5", "wants is 5, expected names"),
        ("(1,)", r"wants is \(1,\), expected names"),
        ("('gear_ordered',)", "transducer 'gear_ordered'; "),
    ],
)
def test_what_is_no_transducer_is_refused(python_controller, wants, sentence):
    with pytest.raises(RigError, match=sentence):
        python_controller("return Out()", f"wants = {wants}")


def test_an_installed_package_brings_a_controller_by_name(tmp_path, config, monkeypatch):
    info = tmp_path / "boxes-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: boxes\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[rig_nodes.controllers]\nmy_box = rig_nodes.controllers.examples.alfa46:Alfa46\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    plug = load_controller("python:my_box@current", config)
    assert (plug.name, plug.level) == ("python:my_box", "current")
    plug.close()
    with pytest.raises(RigError, match="entry point of the group rig_nodes.controllers 'your_box'; .*my_box"):
        load_controller("python:your_box", config)
