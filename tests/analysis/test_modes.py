# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Natural frequencies of a rig by its folder: closed forms, sensitivities, responses, spectra, detuning, and what is refused."""

import json
import math
import re

import numpy as np
import pytest

from rig_nodes.analysis import modes as analysis
from rig_nodes.analysis.modes import beside, spectrum, system_of
from rig_nodes.cli.main import main
from rig_nodes.driveline.builder import Driveline
from rig_nodes.driveline.run import run
from rig_nodes.driveline.vibration import modes, response, sensitivities
from rig_nodes.rig.configuration import load_rig
from rig_nodes.view import draw_figure, figure_of_modes

from ..labels import hidden

HEAD = """\
description: written by a test
step: [100 us, "test"]
parts: {}
transducers: {}
instruments: {hum_frequency: [50 Hz, "test"], anti_alias: [1 kHz, "test"], resolution_bits: [12 -, "test"]}
"""


def body(name, inertia):
    return f'  {name}: {{inertia: [{inertia!r} kg m2, "test"]}}\n'


def shaft(name, a, b, stiffness, damping=0.0):
    return f'  {name}: {{joins: [{a}, {b}], stiffness: [{stiffness!r} Nm/rad, "test"], damping: [{damping!r} Nm s/rad, "test"]}}\n'


def written(folder, text):
    folder.mkdir(exist_ok=True)
    (folder / "rig.yaml").write_text(HEAD + text, encoding="utf-8")
    return str(folder)


@pytest.fixture
def two_masses(tmp_path):
    return written(
        tmp_path / "two", "bodies:\n" + body("a", 0.7) + body("b", 0.3) + "shafts:\n" + shaft("s", "a", "b", 4000.0, 2.0)
    )


@pytest.fixture
def coupled(tmp_path):
    """Two pairs of masses with a clutch between them."""
    bodies = "bodies:\n" + body("a", 0.5) + body("b", 0.1) + body("c", 0.2) + body("d", 3.0)
    shafts = "shafts:\n" + shaft("ab", "a", "b", 2000.0) + shaft("cd", "c", "d", 900.0)
    return written(tmp_path / "coupled", bodies + shafts + "clutches:\n  bc: {joins: [b, c]}\nbrakes:\n  held: {body: d}\n")


def printed(capsys, *arguments):
    """Returns what ``rig modes ... --json -`` prints."""
    assert main(["modes", *arguments, "--json", "-"]) == 0
    return json.loads(capsys.readouterr().out)


# ---- closed forms


def test_two_masses(two_masses, capsys):
    found = printed(capsys, two_masses, "--set", "s.damping=0 Nm s/rad")
    assert found["frequencies_hz"] == pytest.approx([0.0, math.sqrt(4000.0 * (1 / 0.7 + 1 / 0.3)) / (2 * math.pi)], rel=1e-12)


def test_a_uniform_chain_of_ten(tmp_path, capsys):
    text = "bodies:\n" + "".join(body(f"J{i}", 0.2) for i in range(10))
    text += "shafts:\n" + "".join(shaft(f"s{i}", f"J{i}", f"J{i + 1}", 1500.0) for i in range(9))
    found = printed(capsys, written(tmp_path / "chain", text))
    exact = [2.0 * math.sqrt(1500.0 / 0.2) * math.sin(i * math.pi / 20) / (2.0 * math.pi) for i in range(10)]
    assert found["frequencies_hz"] == pytest.approx(exact, rel=1e-9, abs=1e-9)


def test_a_geared_branch(tmp_path, capsys):
    text = "bodies:\n" + body("motor", 0.1) + "  pinion: massless\n  wheel: massless\n" + body("mill", 9.0) + body("fan", 0.4)
    text += "shafts:\n" + shaft("coupling", "motor", "pinion", 800.0) + shaft("belt", "wheel", "fan", 300.0)
    text += (
        "meshes:\n  - {bodies: [pinion, wheel], teeth: [20, 120], reversed: yes, source: test}\n"
        "  - {bodies: [mill, wheel], teeth: [40, 20], source: test}\n"
    )
    found = printed(capsys, written(tmp_path / "branch", text))
    jm, jw, jf, km, kf = 36 * 0.1, 9.0 / 4, 0.4, 36 * 800.0, 300.0
    half = 0.5 * (km * (1 / jm + 1 / jw) + kf * (1 / jw + 1 / jf))
    product = km * kf * (jm + jw + jf) / (jm * jw * jf)
    exact = [math.sqrt(half - math.sqrt(half**2 - product)), math.sqrt(half + math.sqrt(half**2 - product))]
    assert found["frequencies_hz"] == pytest.approx([0.0, *(w / (2 * math.pi) for w in exact)], rel=1e-9, abs=1e-9)


# ---- states


def test_the_default_locks_clutches_between_bodies_and_the_other_states_stand_below(coupled, capsys):
    found = printed(capsys, coupled)
    assert found["locked"] == ["bc"] and [one["state"] for one in found["states"]] == ["bc locked", "all open", "held locked"]
    system = system_of(load_rig(coupled))
    for one in found["states"]:
        assert one["frequencies_hz"] == pytest.approx(modes(system, one["locked"]).frequencies.tolist(), abs=1e-9)
    assert found["frequencies_hz"] == found["states"][0]["frequencies_hz"]
    both = printed(capsys, coupled, "--locked", "bc", "held")
    assert both["frequencies_hz"] == pytest.approx(modes(system, ["bc", "held"]).frequencies.tolist())
    assert printed(capsys, coupled, "--locked")["state"] == "all open"


def test_an_installed_gearbox_has_a_state_for_each_gear(capsys):
    found = printed(capsys, "three_speed", "--gear", "2")
    assert found["locked"] == ["clutch_2"] and {one["state"] for one in found["states"]} == {
        "gear 1",
        "gear 2",
        "gear 3",
        "all open",
    }
    assert found["frequencies_hz"] == [0.0], "none of its shafts can twist"
    shape = dict(zip(found["bodies"], found["shapes"][0]))
    assert shape["input"] / shape["output"] == pytest.approx(1.6)
    assert main(["modes", "chapter9"]) == 0
    assert "no shaft can twist" in capsys.readouterr().out
    stiff = 8000.0 * (1 / 0.6546 + 1 / 0.0544)  # HydmAG's rotor and gearbox on its input shaft
    assert printed(capsys, "hydmag", "--locked")["frequencies_hz"][-1] == pytest.approx(math.sqrt(stiff) / (2 * math.pi), rel=1e-9)


def test_the_clutch_bench_has_the_frequency_of_its_torque_meter(capsys):
    found = printed(capsys, "clutch_bench")
    assert found["frequencies_hz"] == pytest.approx([0.0, math.sqrt(50000 * (1 / 0.02 + 1 / 0.03)) / (2 * math.pi)], rel=1e-9)
    locked = printed(capsys, "clutch_bench", "--locked", "clutch_pack")
    assert locked["frequencies_hz"] == pytest.approx([math.sqrt(50000 / 0.02) / (2 * math.pi)], rel=1e-9)


# ---- sensitivities, speeds, response


def damped_chain(scale=None):
    """Four bodies with much damping and a branch; ``scale`` is the name of a value and the factor by which it is larger."""
    name, factor = scale or ("", 1.0)
    d = Driveline()
    for one, j in (("a", 0.5), ("b", 0.1), ("c", 0.2), ("d", 3.0)):
        d.inertia(one, j * (factor if one == name else 1.0))
    for one, x, y, k, h in (("ab", "a", "b", 2000.0, 3.0), ("bc", "b", "c", 5000.0, 0.5), ("cd", "c", "d", 900.0, 6.0)):
        d.shaft(one, x, y, stiffness=k * (factor if one == name else 1.0), damping=h)
    d.shaft("held", "d", "ground", stiffness=400.0 * (factor if name == "held" else 1.0))
    return d.build()


def test_sensitivities_agree_with_differences():
    those = sensitivities(damped_chain())
    for names, values in ((those.bodies, those.inertia), (those.shafts, those.stiffness)):
        for name, column in zip(names, values.T):
            up, down = (modes(damped_chain((name, factor))).frequencies for factor in (1.0 + 1e-5, 1.0 - 1e-5))
            assert column == pytest.approx((np.log(up) - np.log(down)) / 2e-5, rel=1e-5, abs=1e-7), name
    # one per cent more of all inertias lowers an undamped frequency by half a per cent
    free = Driveline()
    for one, j in (("a", 0.7), ("b", 0.3)):
        free.inertia(one, j)
    free.shaft("s", "a", "b", stiffness=4000.0)
    those = sensitivities(free.build())
    assert those.inertia[1] == pytest.approx([-0.5 * 0.3, -0.5 * 0.7]) and those.stiffness[1] == pytest.approx([0.5])
    assert np.isnan(those.inertia[0]).all()


def test_an_order_meets_a_frequency_at_its_critical_speed(two_masses, capsys):
    found = printed(capsys, two_masses, "--body", "b", "--orders", "1", "3", "--speeds", "100 rpm", "2000 rpm")
    f = found["frequencies_hz"][1]
    rows = [(one["mode"], one["order"], one["speed_rpm"], one["share_of_body"]) for one in found["critical_speeds"]]
    assert rows == [(2, 3.0, pytest.approx(20.0 * f), 1.0), (2, 1.0, pytest.approx(60.0 * f), 1.0)]
    assert printed(capsys, two_masses, "--speeds", "1 rpm", "100 rpm")["critical_speeds"] == []


def test_the_response_of_two_masses_is_that_of_the_closed_form():
    d = Driveline()
    d.inertia("a", 0.7)
    d.inertia("b", 0.3)
    d.shaft("s", "a", "b", stiffness=4000.0, damping=2.0)
    frequencies = np.array([0.1, 5.0, 22.0, 60.0])
    found, w = response(d.build(), "a", frequencies), 2.0 * math.pi * frequencies
    spring = 4000.0 + 2j * w
    twist = (1.0 / 0.7) / (spring * (1 / 0.7 + 1 / 0.3) - w**2)
    assert found.torques[:, 0] == pytest.approx(spring * twist, rel=1e-9)
    assert found.torques[0, 0] == pytest.approx(0.3, rel=1e-3), "slowly, the shaft accelerates b alone"
    assert found.speeds[:, 1] == pytest.approx(spring * twist / (1j * w * 0.3), rel=1e-9)


def test_the_verb_tells_the_response_and_draws_all_charts(two_masses, tmp_path, capsys):
    picture = tmp_path / "modes.svg"
    assert main(["modes", two_masses, "--response", "--band", "5 Hz", "100 Hz", "--picture", str(picture)]) == 0
    assert "steady response to a harmonic torque on a, 5 to 100 Hz" in capsys.readouterr().out
    words = re.findall(r"<!-- (.*?) -->", picture.read_text())
    for one in ("Mode shapes: amplitude, the largest 1", "Critical speeds", "order 2", "Torque in the shafts under 1 Nm on a"):
        assert one in words
    assert any(re.fullmatch(r"\d+ rpm", one) for one in words), "critical speeds are named"


def test_the_figure_of_modes_has_real_logarithmic_axes_and_names_each_critical_speed(two_masses):
    config = load_rig(two_masses)
    system, (state, *_) = analysis.system_of(config), analysis.states_of(config)
    found = analysis.found_in(system, state)
    critical = analysis.critical_speeds(found.modes, "a", [1.0, 2.0], (50.0, 1000.0))
    answer = analysis.response_of(system, state, "a", (5.0, 100.0))
    described = figure_of_modes(config, found, ("a", [1.0, 2.0], (50.0, 1000.0), critical), answer, None)
    shapes, speeds, response = described.panels
    assert shapes.across.names == ("a", "b")
    assert sorted(one.text for one in speeds.rings) == sorted(f"{one.speed * 30.0 / np.pi:.0f} rpm" for one in critical) != []
    assert response.log and response.across.log
    for curve, ring in zip(response.curves, response.rings):
        assert ring.y == curve.y.max() == np.abs(answer.torques).max(), "the peak in the table is the one that is marked"
    picture = draw_figure(described)
    assert hidden(picture) == hidden(draw_figure(described, width=370)) == []
    for axes in picture.axes[1:]:
        for axis, (low, high) in ((axes.xaxis, axes.get_xlim()), (axes.yaxis, axes.get_ylim())):
            assert sum(low <= one <= high for one in axis.get_majorticklocs()) >= 4


# ---- spectra


def test_the_peaks_of_a_step_response_are_the_natural_frequencies():
    d = Driveline()
    for one, j in (("a", 0.02), ("b", 0.01), ("c", 0.03)):
        d.inertia(one, j)
    d.shaft("ab", "a", "b", stiffness=900.0, damping=0.02)
    d.shaft("bc", "b", "c", stiffness=400.0, damping=0.02)
    system = d.build()
    result = run(system, 4.0, 1e-4, {"a": 10.0})
    found = spectrum(result.torque("ab"), 1e-4)
    computed = modes(system).frequencies[1:]
    measured = sorted(at for at, _ in found.peaks[:2])
    assert measured == pytest.approx(computed.tolist(), rel=5e-3)


def test_check_says_the_highest_frequency_and_a_run_of_a_stiff_shaft_shows_it(tmp_path, capsys):
    """Nobody is to look for detuning in the drive that the step has made."""

    def said(inertia, stiffness):
        stiff = "bodies:\n" + body("a", 0.3) + body("b", inertia) + "shafts:\n" + shaft("s", "a", "b", stiffness)
        assert main(["check", written(tmp_path / "stiff", stiff), "--picture", str(tmp_path / "p.svg")]) == 0
        return capsys.readouterr().out

    usual = said(0.05, 1e6)
    assert "highest frequency: 768.79 Hz (all open), 0.077 periods a step of 100 us" in usual and "warning" not in usual
    assert "warning: a step of 100 us resolves oscillations up to 2.04e+05 Hz" in said(1e-6, 1e8)
    d = Driveline()
    d.inertia("a", 0.3)
    d.inertia("b", 0.05)
    d.shaft("s", "a", "b", stiffness=1e6)
    system = d.build()
    natural = modes(system).frequencies.tolist()
    found = spectrum(run(system, 1.0, 1e-4, {"a": 100.0}).torque("s"), 1e-4)
    ((_, _, near, off),) = beside(found.peaks[:1], natural)
    assert near == pytest.approx(768.791, abs=1e-3) and abs(off) < 1e-4


def test_check_names_a_shaft_whose_table_makes_a_run_slower_than_real_time(tmp_path, capsys):
    """A part of a step must not let a bend of the table be passed and passed back."""

    def said(stiffness, more=""):
        table = f'[[[-1 rad, -{stiffness} Nm], [0 rad, 0 Nm], [1 rad, {stiffness} Nm]], "test"]'
        text = f'  s: {{joins: [a, b], table: {table}, damping: [0 Nm s/rad, "test"]{more}}}\n'
        folder = written(tmp_path / "bent", "bodies:\n" + body("a", 0.3) + body("b", 0.05) + "shafts:\n" + text)
        assert main(["check", folder, "--picture", str(tmp_path / "p.svg")]) == 0
        return capsys.readouterr().out

    sliding = ', hysteresis: [[[1 Nm/rad, 2 Nm]], "test"]'
    assert "shaft s divides a step of 100 us into up to 31 parts to resolve its table" in said(10000000, sliding)
    # measured 28 us a step of shafts alone, whose bends divide no step
    assert "divides" not in said(1000000000) + said(1000000, sliding)


def test_a_harmonic_has_its_frequency_and_its_amplitude_in_the_spectrum():
    t = 1e-3 * np.arange(8000)
    found = spectrum(5.0 + 0.3 * t + 2.0 * np.sin(2 * math.pi * 37.3 * t) + 0.5 * np.sin(2 * math.pi * 121.7 * t), 1e-3)
    assert [at for at, _ in found.peaks[:2]] == pytest.approx([37.3, 121.7], rel=1e-3)
    assert [size for _, size in found.peaks[:2]] == pytest.approx([2.0, 0.5], rel=0.01)


# ---- detuning

TASK = """\
settings:
  a.inertia: {low: 0.1 kg m2, high: 2 kg m2}
  s.stiffness: {low: 1000 Nm/rad, high: 20000 Nm/rad}
away: 20 %
orders: [1, 2]
speeds: [900 rpm, 1400 rpm]
body: a
"""


def test_detuning_reaches_the_margin_with_little_change_and_its_set_line_gives_the_new_frequencies(two_masses, tmp_path, capsys):
    (tmp_path / "two" / "detuning.yaml").write_text(TASK, encoding="utf-8")
    found = printed(capsys, two_masses, "--detune")["detuning"]
    before, after = found["smallest_margin"]
    assert before < 0.0 < 0.199 <= after
    again = printed(capsys, two_masses, *(word for one in found["new"].items() for word in ("--set", "=".join(one))))
    f = again["frequencies_hz"][1]
    assert f == pytest.approx(found["after"][0]["frequency_hz"], rel=1e-6)
    assert f >= 1.199 * 2 * 1400 / 60 or f <= 0.801 * 900 / 60 or 1.199 * 1400 / 60 <= f <= 0.801 * 2 * 900 / 60
    same = printed(capsys, two_masses, "--detune", str(tmp_path / "two" / "detuning.yaml"))["detuning"]
    assert same == found, "the same task has the same answer"


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ("a.inertia: {", "a.inertja: {", "detuning.yaml:2: 'a.inertja' is no inertia of a body and no stiffness of a shaft"),
        ("low: 0.1 kg m2", "low: 0.1 kg", "is a mass, expected an inertia"),
        ("low: 0.1 kg m2", "low: 3 kg m2", "detuning.yaml:2: a.inertia.low is '3 kg m2'; it is to be above 0 and below high"),
        ("away: 20 %", "away: 0 %", "away is '0 %', expected above 0 %"),
        ("orders: [1, 2]\n", "", "speeds stands alone; orders and speeds go together"),
        ("orders: [1, 2]", "orders: [1, -2]", "an order is '-2', expected above 0"),
        ("[900 rpm, 1400 rpm]", "[1400 rpm, 900 rpm]", "expected two rising values above 0"),
        ("body: a", "body: x", "there is no body 'x'"),
        ("body: a", "states: [[x]]", "the rig 'two' has no clutch"),
        ("body: a", "bands: [5 Hz]", "bands is '5 Hz', expected two values"),
        ("orders: [1, 2]\nspeeds: [900 rpm, 1400 rpm]\n", "", "there is nothing to keep away from"),
    ],
)
def test_a_wrong_detuning_is_one_sentence(two_masses, tmp_path, capsys, old, new, sentence):
    (tmp_path / "two" / "detuning.yaml").write_text(TASK.replace(old, new), encoding="utf-8")
    assert main(["modes", two_masses, "--detune"]) == 2
    error = capsys.readouterr().err
    assert sentence in error and error.count("\n") == 1


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["--gear", "1"], "the rig 'two' has no gears"),
        (["--locked", "x"], "the rig 'two' has no clutch, brake or free-wheel"),
        (["--gear", "1", "--locked", "x"], "--gear and --locked are both given"),
        (["--body", "x"], "there is no body 'x'"),
        (["--orders", "0"], "an order is a number above 0"),
        (["--speeds", "100 rpm", "50 rpm"], "expected two rising values above 0"),
        (["--speeds", "100", "200 rpm"], "'100' has no unit, expected an angular velocity"),
        (["--band", "1 Hz", "2 Hz"], "--band is for --response"),
        (["--run", "nowhere"], "--run and --signal go together"),
        (["--run", "nowhere", "--signal", "x"], "there is no such file or folder"),
        (["--detune"], "has no detuning.yaml"),
        (["--picture", "x.jpg"], "a file that ends in .png or .svg"),
        (["--set", "s.stiffnes=1 Nm/rad"], "did you mean"),
    ],
)
def test_wrong_arguments_are_one_sentence(two_masses, capsys, arguments, sentence):
    assert main(["modes", two_masses, *arguments]) == 2
    error = capsys.readouterr().err
    assert sentence in error and error.count("\n") == 1


def test_wrong_gears_and_clutches_are_named(coupled, capsys):
    assert main(["modes", "three_speed", "--gear", "9"]) == 2
    assert "there is no gear '9'" in capsys.readouterr().err
    assert main(["modes", coupled, "--locked", "bd"]) == 2
    assert "there is no clutch, brake or free-wheel 'bd'" in capsys.readouterr().err
    assert main(["modes", coupled, "--locked", "bc", "bc"]) == 2
    assert "bc is named twice" in capsys.readouterr().err
