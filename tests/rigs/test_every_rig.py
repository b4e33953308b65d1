# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Every rig that consists of a folder only, with each verb with which the laboratory's rig is tested.

Rigs with gears shift on a short sequence, because their demos are long; the others run their demo.

Rigs with tests of the same kind elsewhere are left out: the laboratory's, its benches and the three-speed gearbox.
"""

import json
import re
import subprocess
import sys

import numpy as np
import pyarrow.parquet
import pytest

from rig_nodes.bags.reader import Bag
from rig_nodes.base.names import installed
from rig_nodes.cli.main import main
from rig_nodes.rig.configuration import load_rig
from rig_nodes.runs.fmu.drive import main as drive

ELSEWHERE = ("hydmag", "chapter9", "three_speed", "clutch_bench", "cylinder_bench", "spring_bench")
SHIFTS = """\
description: up through the first two gears
steps:
  - oil: {{pressure: 4 MPa}}
  - wait: {{for: 500 ms}}
  - motor: {{speed: 1200 rpm}}
  - wait: {{for: 1500 ms}}
  - shift: {{to: {}, timeout: 5 s}}
  - wait: {{for: 1 s}}
  - shift: {{to: {}, timeout: 5 s}}
  - wait: {{for: 500 ms}}
"""
# rig without gears -> sequence, value with two numbers, and calculation of a sweep; a rig with gears has the metrics of its shifts
SWEPT = {
    "chain_saw": ("demo", "chain.bar=13 in, 15 in", "engagement"),
    "frame_saw": ("demo", "feed=25 mm, 31.5 mm", "ripple"),
    "ural2": ("step", "engine.irregularity=0 %, 0.5 %", "ringing"),
}
RIGS = [name for name in installed("rigs") if name not in ELSEWHERE]
FEW = ("chain_saw", "hydmag_coupling")  # without gears, and with gears and a shaft
A_FEW = pytest.mark.parametrize(
    "rig", [pytest.param(name, marks=[] if name in FEW else pytest.mark.campaign) for name in RIGS], indirect=True, scope="module"
)


@pytest.fixture(scope="module", params=RIGS)
def rig(request):
    """Name of a rig; all tests of one rig run together."""
    return request.param


@pytest.fixture(scope="module")
def sequence(rig, tmp_path_factory):
    """The sequence that is run: the name of its demo, or the file of the short one."""
    structure = load_rig(rig).structure
    if not structure.shifts:
        return "demo"
    file = tmp_path_factory.mktemp("sequences") / "shifts.yaml"
    file.write_text(SHIFTS.format(*(gear.name for gear in structure.gears)))
    return str(file)


@pytest.fixture(scope="module")
def simulated(rig, sequence, tmp_path_factory):
    """The folder of its simulated run."""
    folder = tmp_path_factory.mktemp("runs") / rig
    assert main(["simulate", sequence, "--rig", rig, "--out", str(folder)]) == 0
    return folder


def verb(*arguments):
    done = subprocess.run([sys.executable, "-m", "rig_nodes", *arguments], text=True, capture_output=True, timeout=200)
    assert done.returncode == 0, done.stdout + done.stderr


def test_its_run_ends_well_and_its_energy_closes(simulated, capsys):
    report = json.loads((simulated / "report.json").read_text())
    assert report["run"]["end"]["state"] == "ended" and report["run"]["lost"] == 0
    bag = Bag(simulated)
    _, residual = bag.series("energy_residual")
    flowed = max(abs(bag.series(name)[1]).max() for name in bag.catalogue.signals if name.endswith("_work"))
    assert abs(residual[-1]) < 1e-9 * flowed, f"{residual[-1]} J of {flowed} J"
    assert main(["report", str(simulated)]) == 0
    assert capsys.readouterr().out.strip()


@A_FEW
def test_its_page_has_every_section_and_none_is_empty(simulated):
    assert main(["report", str(simulated), "--html", str(simulated / "page.html")]) == 0
    page, report = (simulated / "page.html").read_text(encoding="utf-8"), json.loads((simulated / "report.json").read_text())
    sections = re.split("<h2>", page)
    assert all(re.search(r"<(td|p|svg)\b", section) for section in sections), "no section is empty"
    assert "<h2>The run</h2>" in page and ("<h2>Shifts</h2>" in page) == bool(report["shifts"])
    assert ("<h2>Signals</h2>" in page) == ("signals" in report)


@A_FEW
def test_its_nodes_in_lockstep_give_the_same_bits(rig, sequence, simulated, tmp_path):
    verb("run", sequence, "--rig", rig, "--speed", "max", "--out", str(tmp_path / "run"))
    mine, its = Bag(tmp_path / "run").canonical_hash(), Bag(simulated).canonical_hash()
    # orders reach a controller over ROS, so the time of its events may differ
    topics = set(its) - {"/controller/events", "all"}
    assert len(topics) > 10 and {topic: mine[topic] for topic in topics} == {topic: its[topic] for topic in topics}


@pytest.mark.campaign
def test_its_nodes_run_in_real_time(rig, sequence, tmp_path):
    verb("run", sequence, "--rig", rig, "--out", str(tmp_path / "run"))
    report = json.loads((tmp_path / "run" / "report.json").read_text())
    assert report["run"]["end"]["state"] == "ended" and report["run"]["lost"] == 0


@A_FEW
def test_its_view_is_written(simulated):
    pytest.importorskip("rerun")
    assert main(["view", str(simulated), "--no-open"]) == 0
    assert (simulated / "view.rrd").stat().st_size > 50_000


@pytest.mark.campaign
def test_its_picture_is_written(simulated, tmp_path):
    pytest.importorskip("rerun")
    verb("view", str(simulated), "--picture", str(tmp_path / "view.png"))
    assert (tmp_path / "view.png").stat().st_size > 10_000


def test_a_sweep_changes_its_result(rig, sequence, tmp_path):
    if load_rig(rig).structure.shifts:
        words = [sequence, "--vary", "alfa46.t12=-250 ms, -100 ms"]
    else:
        its_sequence, varied, calculation = SWEPT[rig]
        words = [its_sequence, "--vary", varied, "--calculate", calculation]
    assert main(["sweep", *words, "--rig", rig, "--jobs", "1", "--out", str(tmp_path / "s")]) == 0
    table = pyarrow.parquet.read_table(tmp_path / "s" / "results.parquet").to_pydict()
    assert set(table["end"]) == {"ended"} and set(table["member"]) == {0, 1}
    rows = list(zip(table["member"], *(table[name] for name in results_of(table)), strict=True))
    first, second = ([row[1:] for row in rows if row[0] == member] for member in (0, 1))
    assert first and first != second


def results_of(table: dict) -> list[str]:
    """Columns with results of a sweep: those of a calculation, or time and largest torque of a shift."""
    return [name for name in table if name.startswith("table.")] or ["t_c_s", "input_torque_max_nm"]


@A_FEW
def test_an_fmu_of_it_gives_the_same_rows(rig, sequence, simulated, tmp_path):
    fmu = tmp_path / f"{rig}.fmu"
    assert main(["export", "fmu", "--rig", rig, "-o", str(fmu)]) == 0
    assert drive([str(fmu), sequence, "--rig", rig, "--out", str(tmp_path / "run")]) == 0
    mine, its = Bag(tmp_path / "run").logger(), Bag(simulated).logger()
    assert set(mine.channels) == set(its.channels)
    for name, values in its.channels.items():
        assert np.array_equal(mine.channels[name], values), name
