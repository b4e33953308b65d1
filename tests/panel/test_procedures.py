# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Measuring procedures from the operator's page: start, progress, results and abort, with settings that a running rig keeps."""

import json
from contextlib import closing
from pathlib import Path

import pytest
from started_panel import READY, Panel, choose

from rig_nodes.base.config import RIGS_DIR

pytestmark = pytest.mark.against_the_clock
SAID = "document.getElementById('sequence-said').textContent"


@pytest.fixture(scope="module")
def panel(tmp_path_factory):
    """A page of HydmAG with a procedure of its own: the laboratory's coast-down, from a speed at which it takes a second."""
    place = tmp_path_factory.mktemp("panel")
    own = place / "brief" / "procedures"
    own.mkdir(parents=True)
    (own.parent / "rig.yaml").write_text("description: '<img src=x onerror=alert(1)> with a brief coast-down'\nbase: hydmag\n")
    laboratorys = (RIGS_DIR / "hydmag" / "procedures" / "coast_down.yaml").read_text(encoding="utf-8")
    (own / "brief_coast_down.yaml").write_text(laboratorys.replace("470", "60"), encoding="utf-8")
    with closing(Panel(place, str(own.parent))) as panel:
        yield panel


@pytest.fixture(scope="module")
def folder(panel):
    """The folder in which the page was started."""
    return Path(f"/proc/{panel.process.pid}/cwd").resolve() / "runs"


def test_a_procedure_runs_with_its_progress_and_its_results_are_there(page, folder):
    choose(page, "brief_coast_down")
    assert "1 series of 2 runs: 60rpm." in page.text("#sequence-text")
    assert page.text("#about").startswith("<img src=x") and page.js("document.querySelectorAll('img[src=x]').length") == 0
    for number in (1, 2):
        page.until(f"{SAID}.startsWith('run {number} of 2: series 60rpm, run {number} of 2: wait until n_wej')", 60)
    page.until(f"{SAID}.startsWith(\"procedure 'brief_coast_down' is done: 2 runs are in\")", 60)
    assert page.text("#found tr:nth-child(3)").startswith("60rpm2"), page.text("#found")
    written = json.loads((folder / "brief_coast_down-1/procedure.json").read_text())
    assert [one["runs"] for one in written["series"]] == [["60rpm-1", "60rpm-2"]]
    seeds = [json.loads((folder / f"brief_coast_down-1/60rpm-{k}/report.json").read_text())["run"]["seed"] for k in (1, 2)]
    assert seeds == [1, 2], "those of `rig procedure`"
    page.until(READY, 60)  # worked by hand again


def test_settings_that_a_running_rig_keeps_are_changed_and_an_abort_ends_the_procedure(page, folder):
    page.until(READY, 60)
    choose(page, "valve_response", "ZR-P2")
    page.until(f"{SAID}.startsWith('run 1 of 2: series ZR-P2, run 1 of 2: shift')", 90)
    ordered = json.loads((folder / "valve_response-1/ZR-P2-1/run.json").read_text())
    assert "4e-06" in json.dumps(ordered), "the step of this procedure"
    page.click("#abort")
    page.until(f"{SAID}.startsWith(\"procedure 'valve_response' was aborted: 0 of 2 runs\")", 60)
    page.until(READY, 90)
