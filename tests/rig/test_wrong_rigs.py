# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Wrong folders of rigs: one sentence for each fault, with file and line and what would be right."""

import re
import shutil

import pytest

from rig_nodes.base.config import RIGS_DIR
from rig_nodes.base.errors import RigError
from rig_nodes.cli.main import main
from rig_nodes.rig.configuration import load_rig
from rig_nodes.runs import Rig
from rig_nodes.runs.plan import plan_of

THREE = (RIGS_DIR / "three_speed" / "rig.yaml").read_text()
MESH = (
    "  - {bodies: [input, wheel_2], teeth: [35, 56], "
    'source: "assumed: with an idler between them, so both turn the same way; 1.6"}\n'
)
SET = 'set_1: {sun: input, ring: ring, carrier: output, teeth: [40, 72], source: "assumed: 1 + 72/40 = 2.8 with the ring held"}'
N_IN = "n_in: {type: speed, shows: input.speed, at: motor, range: [0 rpm, 3000 rpm]"

NO_DRIVE = """\
description: two bodies and a free-wheel
step: [100 us, "x"]
bodies:
  a: {inertia: [1 kg m2, "x"]}
  b: {inertia: [1 kg m2, "x"]}
parts:
  free: {part: freewheel, joins: [a, b]}
transducers:
  n: {type: speed, shows: a.speed, at: free, range: [0 rad/s, 300 rad/s], text: Speed of a.}
instruments: {speed_range: [3600 rpm, "x"], speed_gate: [2 ms, "x"], hum_frequency: [50 Hz, "x"], anti_alias: [1 kHz, "x"],
  resolution_bits: [12 -, "x"]}
"""

WRONG = {
    # the driveline
    "a loop of wheels": (MESH, MESH + MESH.replace("[35, 56]", "[36, 56]"), r"rig\.yaml:\d+: gear .* closes a loop"),
    "a loop of wheels that fits": (MESH, MESH + MESH, None),
    "no body": (
        "bodies: [input, wheel_2]",
        "bodies: [input, wheel_3]",
        r"rig\.yaml:\d+: mesh 1\.bodies names the body 'wheel_3'; did you mean 'wheel_2'",
    ),
    "a mesh with itself": (
        "bodies: [input, wheel_2]",
        "bodies: [input, input]",
        "joins 'input' with itself; two bodies are needed",
    ),
    "teeth of 0": (
        "teeth: [35, 56]",
        "teeth: [0, 56]",
        r"rig\.yaml:\d+: mesh 1\.teeth: 0 is no number of teeth; expected 1 to 1000",
    ),
    "half a tooth": ("teeth: [35, 56]", "teeth: [35.5, 56]", "35.5 is no number of teeth"),
    "one wheel": ("teeth: [35, 56]", "teeth: [35]", "must be two whole numbers"),
    "no source": (
        ', source: "assumed: with an idler between them, so both turn the same way; 1.6"}',
        "}",
        "mesh 1 lacks the key 'source'",
    ),
    "nobody holds it": (MESH, MESH.replace("input, wheel_2", "wheel_2, wheel_9"), "names the body 'wheel_9'"),
    "a body without inertia": (
        '  ring:\n    inertia: [0.02 kg m2, "assumed"]',
        "  ring: massless\n  loose: massless",
        r"rig\.yaml:\d+: .*'loose'",
    ),
    "inertia of 0": ("inertia: [0.02 kg m2", "inertia: [0 kg m2", r"rig\.yaml:\d+: ring\.inertia is 0 kg m2, outside"),
    "a sun larger than its ring": ("teeth: [40, 72]", "teeth: [72, 40]", "give the sun first, which has fewer"),
    "a set of two bodies": ("ring: ring, carrier: output", "ring: output, carrier: output", "must be three bodies"),
    "a set without ring": (SET, SET.replace("ring: ring, ", ""), "set_1 lacks the key 'ring'"),
    "a list for a map": ("planetary_sets:\n  " + SET, "planetary_sets:\n  - " + SET, "planetary_sets must be a map of names"),
    # clutches, gears, valves
    "a clutch onto itself": ("joins: [wheel_2, output]", "joins: [output, output]", "joins 'output' with itself"),
    "a clutch of tied bodies": (
        "joins: [wheel_2, output]",
        "joins: [wheel_2, input]",
        r"rig\.yaml:\d+: gears\.2: clutch_2 held alone: they hold the input",
    ),
    "a clutch that is a brake too": (
        "    joins: [wheel_2, output]\n",
        "    joins: [wheel_2, output]\n    brakes: ring\n",
        "must have one of the keys joins",
    ),
    "a clutch of nothing": ("    joins: [wheel_2, output]\n", "", "must have one of the keys joins"),
    "two valves on a clutch": (
        "feeds: clutch_2",
        "feeds: clutch_3",
        r"rig\.yaml:\d+: parts\.valve_c3\.feeds: the clutch clutch_3 has the valve valve_c2 already",
    ),
    "a clutch without a valve": ("    feeds: clutch_2\n", "    feeds: motor\n", "names 'motor', expected a clutch"),
    "two valves on an output": ("output: 2", "output: 1", "the output of the controller 1 has the valve valve_b1 already"),
    "an output that is not there": ("output: 3", "output: 9", "expected output 1 to 8 of the controller"),
    "a gear of no clutch": ("  2: [clutch_2]", "  2: []", "gears.2 must be a list of the clutches that hold it"),
    "a gear of an unknown clutch": ("  2: [clutch_2]", "  2: [clutch_4]", "names the clutch 'clutch_4'; did you mean"),
    "a gear that locks": (
        "  2: [clutch_2]",
        "  2: [clutch_2, clutch_3]",
        r"rig\.yaml:\d+: gears\.2: clutch_2, clutch_3 held alone: they let nothing turn",
    ),
    "a gear twice": ("  2: [clutch_2]", "  2: [brake_1]", "is held by the same clutches as 1"),
    "a clutch twice in a gear": ("  2: [clutch_2]", "  2: [clutch_2, clutch_2]", "names a clutch twice"),
    "a gear called neutral": ("  2: [clutch_2]", "  neutral: [clutch_2]", "is no name for the gear of number 2"),
    "gears that are not in order": (
        "  2: [clutch_2]\n  3: [clutch_3]",
        "  2: [clutch_3]\n  3: [clutch_2]",
        r"rig\.yaml:31: gears\.3 has the ratio 1\.6 and 2 before it 1; gears go from the slowest output up, so 3 stands before 2",
    ),
    "gears that do not count up": ("  2: [clutch_2]", "  5: [clutch_2]", "'5' is no name for the gear of number 2"),
    "gears without an output": (
        "output: {body: output, speed: n_out, torque: M_out}\n",
        "",
        "a rig with gears needs the keys input and output",
    ),
    "an input of an unknown speed": ("speed: n_in", "speed: M_in", "expected a transducer of type speed; did you mean 'n_in'"),
    # parts
    "an unknown part": (
        "part: dc_motor",
        "part: ac_motor",
        r"rig\.yaml:\d+: parts\.motor\.part: there is no part 'ac_motor'; did you mean 'dc_motor'",
    ),
    "a list of types": ("type: speed", "type: [speed]", r"rig\.yaml:\d+: transducers\.\w+\.type is \['speed'\], expected one of"),
    "a list of parts": (
        "part: dc_motor",
        "part: [dc_motor]",
        r"rig\.yaml:\d+: parts\.motor\.part: there is no part \['dc_motor'\]",
    ),
    "no part": ("    part: dc_motor\n", "", "parts.motor lacks the key 'part'; known are centrifugal_clutch,"),
    "a part without its body": ("    part: dc_motor\n    body: input\n", "    part: dc_motor\n", "lacks the key 'body', a body"),
    "a name twice": ("  loss_in:\n", "  ring:\n", r"rig\.yaml:\d+: parts\.ring: there is 'ring' among the bodies already"),
    "a name of the rig's own": ("  loss_in:\n", "  alfa46:\n", "the name 'alfa46' is taken by the rig itself"),
    "a key twice": ("    side: [within,", '    side: [within, "x"]\n    side: [within,', "duplicate key 'side'"),
    "a name with a space": ("  loss_in:\n", "  loss in:\n", "has other characters than letters"),
    "a meter of nothing": ("    source: motor\n", "", "must name one of source and load"),
    "a unit of another dimension": ("torque_limit: [500 Nm", "torque_limit: [500 kW", "is a power, expected a torque"),
    "no unit": ("torque_limit: [500 Nm", "torque_limit: [500", "write a number with its unit"),
    "a value without a source": ('torque_limit: [500 Nm, "assumed: as in the rig hydmag"]', "torque_limit: 500 Nm", "its source"),
    "a value that is not there": (
        "    torque_limit:",
        "    torqe_limit:",
        "unknown key 'torqe_limit' in motor; did you mean 'torque_limit'",
    ),
    "a value that is missing": (
        '    braking_limit: [200 Nm, "assumed: as in the rig hydmag"]\n',
        "",
        "motor lacks the key 'braking_limit'",
    ),
    "no oil supply": ("  oil_supply:\n    part: oil_supply\n", "  oil_supply:\n    part: load_pump\n", "expected|lacks|unknown"),
    # transducers
    "a type that is not there": (N_IN, N_IN.replace("speed, shows", "tacho, shows"), "type is 'tacho', expected one of"),
    "what nobody can show": (N_IN, N_IN.replace("input.speed", "inputs.speed"), "'inputs.speed'; did you mean 'input.speed'"),
    "a device without a state": (N_IN, N_IN.replace("input.speed", "plate_pack.speed"), "a plate_pack has no state of its own"),
    "more than the meter": ("torque, shows: M_in,", "torque, shows: M_in.torque,", "'M_in.torque'; known are M_in"),
    "a device that is not there": (N_IN, N_IN.replace("at: motor", "at: moter"), "did you mean 'motor'"),
    "a range the wrong way round": (N_IN, N_IN.replace("[0 rpm, 3000 rpm]", "[3000 rpm, 0 rpm]"), "give the lowest value first"),
    "a range of another dimension": (N_IN, N_IN.replace("3000 rpm]", "3000 Nm]"), "expected an angular velocity"),
    "nothing measures what is set": (
        "  p_load: {type: pressure, shows: load_pump.pressure, at: load_pump",
        "  p_load: {type: pressure, shows: load_pump.pressure, at: motor",
        "nothing measures its pressure",
    ),
    "a name for no signal": (
        "output: {body: output,",
        "names: {motor_torqe: T_motor}\noutput: {body: output,",
        r"rig\.yaml:\d+: names\.motor_torqe: there is no signal 'motor_torqe'; did you mean 'motor_torque'",
    ),
    "a logged one behind": ("p_oil: {type: pressure, logged: no,", "p_oil: {type: pressure,", None),
    # the file as a whole
    "no bodies": ("bodies:\n", "bodys:\n", "unknown key 'bodys' in the rig; did you mean 'bodies'"),
    "no controller's settings": ("controller: controller.yaml", "controller: contoller.yaml", "there is no such file"),
    "no controller": ("controller: controller.yaml\n", "", "lacks the key 'controller'"),
    "a step that divides nothing": ("step: [100 us", "step: [70 us", None),
}


def folder(tmp_path, text=THREE):
    into = tmp_path / "mine"
    shutil.copytree(RIGS_DIR / "three_speed", into)
    (into / "rig.yaml").write_text(text)
    return into


@pytest.mark.parametrize("what", [what for what, (*_, sentence) in WRONG.items() if sentence is not None])
def test_a_wrong_rig_is_refused_in_one_sentence(tmp_path, what, capsys):
    old, new, sentence = WRONG[what]
    assert old in THREE, "the edit fits no line of the rig"
    into = folder(tmp_path, THREE.replace(old, new, 1))
    with pytest.raises(RigError, match=sentence) as refused:
        plan_of(load_rig(into))
    error = str(refused.value)
    assert "rig.yaml:" in error and "\n" not in error and "driveline:" not in error
    assert main(["check", str(into), "--picture", str(tmp_path / "picture.svg")]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1 and not (tmp_path / "picture.svg").exists()


def test_a_rig_without_a_drive_is_refused_before_it_is_run(tmp_path):
    (tmp_path / "rig.yaml").write_text(NO_DRIVE)
    with pytest.raises(RigError, match=r"cannot be run without a drive among its parts, e\.g\. part: dc_motor"):
        Rig(load_rig(tmp_path))


def test_there_are_at_least_forty_of_them():
    assert sum(sentence is not None for *_, sentence in WRONG.values()) >= 40


@pytest.mark.parametrize(
    "text, sentence",
    [
        ("description: x\nbase: {here}\n", "leads back to this rig"),
        ("description: x\nbase: nobody\n", r"rig\.yaml:2: base: there is no rig 'nobody'"),
        (
            'description: x\nbase: three_speed\nparts:\n  motor:\n    rmap: [1 rpm/s, "x"]\n',
            r"rig\.yaml:5: unknown key 'rmap' in motor",
        ),
        (
            'description: x\nbase: three_speed\nparts:\n  moter:\n    ramp: [1 rpm/s, "x"]\n',
            r"rig\.yaml:4: parts\.moter lacks the key 'part', and its base has no such device; did you mean 'motor'",
        ),
        ("", "it is empty, expected a map of keys"),
        ("- 1\n", "must be a map of keys"),
    ],
)
def test_a_wrong_variant_is_refused_where_it_stands(tmp_path, text, sentence):
    into = folder(tmp_path)
    (into / "rig.yaml").write_text(text.replace("{here}", str(into)))
    with pytest.raises(RigError, match=sentence):
        load_rig(into)


def test_a_folder_without_its_file_is_refused_however_it_is_named(tmp_path, monkeypatch):
    (tmp_path / "empty").mkdir()
    monkeypatch.chdir(tmp_path)
    for name in (tmp_path / "empty", "./empty", "empty/", "empty"):
        with pytest.raises(RigError, match=r"the folder has no rig\.yaml; \./rig new rig FOLDER writes one"):
            load_rig(str(name))
    (tmp_path / "hydmag").mkdir()
    assert load_rig("hydmag").name == "hydmag", "an installed rig, though a folder of that name is no rig"


def test_gears_without_an_entry_are_none(tmp_path):
    text = re.sub(r"^(gears):\n(  .*\n)+", r"\1:\n", THREE, flags=re.MULTILINE)
    with pytest.raises(RigError, match=r"rig\.yaml:\d+: controller: the rig has no gears"):
        load_rig(folder(tmp_path, text))


ONE_CLUTCH = """\
description: one clutch
base: chapter9
gears: {II: ~}
parts: {clutch_s2: ~, valve_zr_p2: ~}
transducers: {p2: ~, I_zr_p2: ~}
instruments: {p2_noise: ~, p2_range: ~, p2_class: ~, p2_hum: ~, p2_pickup: ~}
prescribed:
  clutch_s2: ~
"""


def test_an_output_between_the_speeds_of_two_clutches_needs_two(tmp_path):
    into = folder(tmp_path, ONE_CLUTCH)
    with pytest.raises(RigError, match=r"rig\.yaml:\d+: prescribed\.output_speed: bounded keeps .*; choose free") as refused:
        load_rig(into)
    assert "\n" not in str(refused.value)
    (into / "rig.yaml").write_text(ONE_CLUTCH + "  output_speed: free\n")
    plan_of(load_rig(into))
