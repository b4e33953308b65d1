# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The notebooks of docs/notebooks run from the first cell to the last, and are kept without outputs."""

import ast
import sys
import types
from pathlib import Path

import nbformat
import pytest

FOLDER = Path(__file__).parents[2] / "docs" / "notebooks"


@pytest.fixture
def executed(tmp_path, monkeypatch):
    """Executes the cells of a notebook in one namespace, and returns it with what each cell showed, as text and as HTML."""

    def run(name):
        module = types.ModuleType(f"notebook_{name}")
        monkeypatch.setitem(sys.modules, module.__name__, module)
        monkeypatch.chdir(tmp_path)
        shown = []
        for cell in nbformat.read(FOLDER / f"{name}.ipynb", 4).cells:
            if cell.cell_type != "code":
                continue
            *body, last = ast.parse(cell.source).body
            value = None
            if isinstance(last, ast.Expr):
                exec(compile(ast.Module(body, []), name, "exec"), vars(module))
                value = eval(compile(ast.Expression(last.value), name, "eval"), vars(module))
            else:
                exec(compile(cell.source, name, "exec"), vars(module))
            html = getattr(value, "_repr_html_", lambda: None)() or ""
            shown.append((repr(value), html))
        return module, shown

    return run


@pytest.mark.parametrize("path", sorted(FOLDER.glob("*.ipynb")), ids=lambda path: path.stem)
def test_it_is_a_valid_notebook_without_outputs(path):
    notebook = nbformat.read(path, 4)
    nbformat.validate(notebook)
    assert all(not cell.outputs and cell.execution_count is None for cell in notebook.cells if cell.cell_type == "code")


def test_a_first_shift(executed, capsys):
    notebook, shown = executed("first_shift")
    assert "data:image/svg+xml" in shown[0][1] and "II" in shown[1][0] and shown[2][0].startswith("<Picture")
    assert "heat of friction in S2 over the run:" in capsys.readouterr().out
    peaks = [run.shifts["input_torque_max_nm"][0] for run in (notebook.run, notebook.softer)]
    assert "input_torque_max_nm" in shown[-1][0] and peaks[1] != peaks[0]


@pytest.mark.campaign  # half of the time of all notebooks; tests/api/test_api.py gives a run a class too
def test_my_controller_against_the_alfa46(executed):
    notebook, shown = executed("my_controller")
    assert notebook.mine.end["state"] == "ended" and notebook.mine.shifts["valid"].all()
    assert "M_wej max Nm" in shown[-2][0]
    assert len(set(notebook.peaks.values())) == 3


def test_t12_over_load(executed, tmp_path):
    notebook, shown = executed("t12_over_load")
    assert len(notebook.up) == 9 and (tmp_path / "t12_over_load.png").stat().st_size > 10_000
    assert "load [Nm]  temperature [degC]" in shown[-1][0]
