# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The drive of the chain saw Ural-2: its rows, its matrix, its resonances, and a detuned design that is run."""

import json
import math
import re

import numpy as np
import pytest
from ruamel.yaml import YAML

from rig_nodes.analysis.modes import system_of
from rig_nodes.base.config import RIGS_DIR
from rig_nodes.base.errors import RigError
from rig_nodes.cli.main import main
from rig_nodes.driveline.vibration import modes
from rig_nodes.rig.configuration import load_rig
from rig_nodes.rigs.ural2 import spectra
from rig_nodes.runs.calculations import Recorded, calculations_of, module_of
from rig_nodes.runs.recorded import record
from rig_nodes.runs.rig import Rig
from rig_nodes.runs.sequence import load_sequence

TRUE = {"effects.transducers": "off"}
RPM = math.pi / 30.0


def calculated(capsys, name, *arguments):
    """Returns the rows of a calculation as maps of column and value."""
    assert main(["calculate", name, "--rig", "ural2", *arguments, "--json", "-"]) == 0
    found = json.loads(capsys.readouterr().out)
    return [dict(zip(found["columns"], row)) for row in found["rows"]]


def peak(name, start, **settings):
    """Returns the largest torque of a shaft at work from a time on [Nm], with settings of the rig."""
    config = load_rig("ural2", TRUE | settings)
    run = record(config, load_sequence("work", {"hold": "1 s"}, "ural2"), rows_per_second=2000)
    assert run.end["state"] == "ended", run.end
    values = run.recording.channels[name]
    return float(np.abs(values[-round(start * 2000) :]).max())


@pytest.mark.campaign  # 14 s of processor time; test_hydmag_coupling.py and test_chain_saw.py have theirs in 3
def test_every_printed_number_is_met_or_shown_to_be_inconsistent(capsys):
    assert main(["validate", "--rig", "ural2", "--jobs", "1"]) == 0
    out = capsys.readouterr().out
    assert "predicted inside 21 of 21; calibrated inside 25 of 25; source contradicts itself: 7 of 7" in out
    assert all(name in out for name in ("monotony_flywheel", "folding_sum", "disc_modulus_kn"))


def test_every_number_of_the_paper_has_its_row():
    rows = YAML(typ="safe").load((RIGS_DIR / "ural2" / "validation.yaml").read_text())["rows"]
    printed = " ".join(f"{row.get('printed', '')} {row['text']} {row['source']} {row['low']} {row['high']}" for row in rows)
    numbers = (
        "5.23e2 17.46e2 2.24e4 3.30e4 1.64..1.84e2 500..2000 12 20e-4 620 1310 170 520 560 1190 3.6e3 650 1050 180 550 1030 "
        "1e4 5630 10 39 90 64 38.5 0.4 1.35"
    )
    assert [one for one in numbers.split() if not re.search(rf"(?<![\d.]){re.escape(one)}(?![\d])", printed)] == []


@pytest.mark.campaign  # 3 s of processor time
def test_the_bench_can_have_confirmed_the_print_to_12_percent_but_not_to_8(capsys):
    # idle and work contradict each other by 650 and 550 1/s: a saw between them is a twelfth away from either
    found = {row["what"]: row["deviation"] for row in calculated(capsys, "bench")}
    assert found["saw with the coupling"] == pytest.approx(100.0 / 12.0, abs=0.01)
    assert all(100.0 / 12.0 - 0.01 < one < 12.0 for one in found.values())


def test_the_torque_of_the_printed_safety_is_that_of_the_papers_stress(capsys):
    for row in calculated(capsys, "disc_safety"):
        stress = row["torque"] * 12.0 / (4.0 * 0.0255 * 0.0385 * 0.064)  # Pa, p. 3
        assert row["strength"] * 1e6 / stress == pytest.approx(1.35)


def test_the_verb_has_the_frequencies_of_the_papers_matrix():
    config = load_rig("ural2", {f"shaft_{k}.damping": "0 Nm s/rad" for k in (1, 2, 3, 4)})
    values = {name: config.sections[name] for name in ("flywheel", "crank", "shoes", "drum", "gearbox", "cutting")}
    c = [config.sections[f"shaft_{k}"].stiffness for k in (1, 2, 3, 4)]
    i = [one.inertia for one in values.values()]
    masses = [i[0], i[1], i[2] + i[3], i[4], i[5]]
    stiffness = np.diag([c[0], c[0] + c[1], c[1] + c[2], c[2] + c[3], c[3]]) - np.diag(c, 1) - np.diag(c, -1)
    exact = np.sqrt(np.sort(np.linalg.eigvals(stiffness / np.array(masses)[:, None]).real)[1:]) / (2 * math.pi)
    assert modes(system_of(config), ["clutch"]).frequencies[1:] == pytest.approx(exact, rel=1e-9)


def test_the_flywheel_has_the_largest_amplitude_and_shaft_2_the_largest_twist_as_the_paper_says():
    found = modes(system_of(load_rig("ural2")), ["clutch"])
    third = dict(zip(found.bodies, np.abs(found.shapes[3])))
    assert max(third, key=third.get) == "flywheel"
    fourth = dict(zip(found.bodies, found.shapes[4]))
    assert abs(fourth["crank"] - fourth["shoes"]) > 1.2 * abs(third["crank"] - third["shoes"])


def values_of_the_rig():
    return module_of(RIGS_DIR / "ural2" / "calculations.py")._values(load_rig("ural2"))


@pytest.mark.campaign  # 3 s of processor time
def test_the_calculation_identifies_what_the_rig_has():
    assert values_of_the_rig() == pytest.approx(spectra.identified(), rel=1e-3)


def test_the_slopes_of_the_spectra_are_those_of_their_differences():
    x = np.log(values_of_the_rig())
    slopes = spectra.spectra_of(x)[1]
    for k, one in enumerate(1e-6 * np.eye(10)):
        difference = (spectra.spectra_of(x + one)[0] - spectra.spectra_of(x - one)[0]) / 2e-6
        assert slopes[:, k] == pytest.approx(difference, rel=1e-4, abs=1e-2)


def test_at_idle_the_clutch_is_open_and_at_work_it_is_locked():
    one = Rig(load_rig("ural2", TRUE))
    one.set("motor", 2600.0 * RPM, True)
    one.advance(2.0)
    assert one.true("drum.speed") == pytest.approx(0.0, abs=0.1) and one.true("crank.speed") == pytest.approx(2600 * RPM, rel=0.1)
    one.set("motor", 6000.0 * RPM, True)
    one.advance(5.0)
    assert one.clutch_mode("clutch") == 2
    energies = one.energy()
    assert abs(energies["residual"]) < 1e-6 * energies["motor"]


def test_the_papers_flywheel_takes_the_resonance_out_of_work():
    serial, new = peak("M_2", 0.5), peak("M_2", 0.5, **{"flywheel.inertia": "20e-4 kg m2"})
    assert serial > 60.0 and new < 0.5 * serial


def test_a_detuned_design_is_run_and_its_peak_is_lower(capsys):
    assert main(["modes", "ural2", "--detune", "--json", "-"]) == 0
    found = json.loads(capsys.readouterr().out)["detuning"]
    before, after = found["smallest_margin"]
    assert before < 0.0 and after == pytest.approx(0.08, abs=2e-3)
    assert peak("M_2", 0.5, **found["new"]) < 0.5 * peak("M_2", 0.5)


def test_the_spectrum_of_a_recorded_run_has_the_peak_of_the_order_that_meets_a_frequency(tmp_path, capsys):
    assert main(["simulate", "work", "--rig", "ural2", "--with", "hold=1 s", "--out", str(tmp_path / "run")]) == 0
    capsys.readouterr()
    words = ["--run", str(tmp_path / "run"), "--signal", "M_2", "--window", "5.4 s", "6.4 s", "--json", "-"]
    assert main(["modes", "ural2", *words]) == 0
    first = json.loads(capsys.readouterr().out)["spectrum"]["peaks"][0]
    assert first["frequency_hz"] == pytest.approx(7300.0 / 60.0, rel=0.01) and first["amplitude"] > 40.0
    assert first["computed_hz"] == pytest.approx(122.07, abs=0.1)


def test_a_run_that_is_never_switched_off_has_no_ringing_and_says_so():
    # the error names the sequence in which the shafts ring
    ringing, config = calculations_of("ural2")["ringing"], load_rig("ural2")
    with pytest.raises(RigError, match="nothing is switched off; take a run of the sequence step"):
        ringing.table(config, Recorded(np.arange(10) * 1e-4, [(0.0, "step", "motor 3000 rpm", 1.0)], {}, str))
    with pytest.raises(RigError, match=r"switched off only 0.5 s before the end; take a run of the sequence step"):
        ringing.table(config, Recorded(np.arange(11) * 0.1, [(0.5, "step", "motor off", 1.0)], {}, str))
