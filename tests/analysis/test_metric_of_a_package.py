# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A metric that another package adds by an entry point is found wherever ours are; a wrong one is a sentence."""

import json
from pathlib import Path

import pytest
from synthetic_shift import Shift

from rig_nodes.analysis import metrics
from rig_nodes.analysis.shift import shifts
from rig_nodes.base.errors import RigError
from rig_nodes.cli.main import main

SHORT = str(Path(__file__).resolve().parents[1] / "sweep" / "short.yaml")
pq = pytest.importorskip("pyarrow.parquet")
MODULE = """
from rig_nodes.analysis.metrics import SHORT, TABLE, Metric

def jump(shift):
    return shift.raw[shift.box.input.torque].max() - shift.before(shift.box.input.torque)

UP = "highest rise of the input torque"
JUMP = Metric("jump_nm", UP, jump, "{torque_in} jump", 1, lambda basis: 2.0 * basis.torque, (TABLE, SHORT))
FAILS = Metric("jump_nm", "fails", lambda shift: 1 / 0, "jump")
TAKEN = Metric("k", "as ours", jump)
NUMBER = 5
"""


@pytest.fixture
def package(tmp_path, monkeypatch):
    """A function that installs a package whose entry point names something of MODULE."""

    def install(what):
        info = tmp_path / "site" / "jumps-1.0.dist-info"
        info.mkdir(parents=True)
        (info.parent / "jumps.py").write_text(MODULE)
        (info / "METADATA").write_text("Metadata-Version: 2.1\nName: jumps\nVersion: 1.0\n")
        (info / "entry_points.txt").write_text(f"[rig_nodes.metrics]\njump = jumps:{what}\n")
        monkeypatch.syspath_prepend(info.parent)
        metrics.every_metric.cache_clear()

    yield install
    metrics.every_metric.cache_clear()


def test_a_metric_is_in_report_table_comparison_sweep_and_list(package, tmp_path, capsys):
    package("JUMP")
    run, sweep = str(tmp_path / "run"), tmp_path / "sweep"
    assert main(["simulate", SHORT, "--out", run]) == 0
    (row,), (errors,) = (json.loads((tmp_path / "run" / "report.json").read_text())[key] for key in ("shifts", "uncertainty"))
    assert row["jump_nm"] > 0.0 and errors["jump_nm"] == pytest.approx(2.02)
    assert "M_wej jump Nm" in capsys.readouterr().out
    assert main(["report", run, "--limit", "jump_nm=.. 1000 Nm"]) == 0 and "limit met" in capsys.readouterr().out
    assert main(["compare", run, run]) == 0 and "M_wej jump Nm" in capsys.readouterr().out
    assert main(["sweep", SHORT, "--vary", "rest=50 ms, 60 ms", "--jobs", "1", "--out", str(sweep)]) == 0
    assert "M_wej jump Nm" in capsys.readouterr().out
    table = pq.read_table(sweep / "results.parquet")
    assert table.column("jump_nm").to_pylist()[0] > 0.0 and table.schema.field("jump_nm").metadata == {b"unit": b"Nm"}
    assert main(["list", "metrics", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)[-1] == {
        "metric": "jump_nm",
        "unit": "Nm",
        "what it is": "highest rise of the input torque",
        "shown": "table, short",
        "of package": "jumps",
    }


@pytest.mark.parametrize(
    ("what", "sentence"), [("TAKEN", "has the key 'k', which is taken"), ("NUMBER", "is of type int"), ("NONE", "cannot be loaded")]
)
def test_a_wrong_metric_is_a_sentence_that_names_its_package(package, what, sentence):
    package(what)
    with pytest.raises(RigError, match=f"metric 'jump' of the package jumps 1.0: .*{sentence}"):
        metrics.every_metric()


def test_a_metric_that_fails_withholds_its_value_only(package):
    package("FAILS")
    (row,) = shifts(Shift().recording())
    assert row["valid"] and row["jump_nm"] is None and row["t_c_s"] == pytest.approx(0.7, abs=2e-3)
    assert row["undefined"]["jump_nm"] == "the package jumps failed (ZeroDivisionError: division by zero)"
