# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The figures of many runs: metrics over what was varied, of procedures, sweeps and tables, and comparisons shift by shift."""

import itertools
import json
from types import SimpleNamespace

import numpy as np
import pytest

from rig_nodes.analysis.metrics import metric_keys
from rig_nodes.analysis.run_report import write_report
from rig_nodes.analysis.runs_table import Member, write_procedure
from rig_nodes.api.table import Table
from rig_nodes.base.errors import RigError
from rig_nodes.cli.main import main
from rig_nodes.rig.configuration import load_rig
from rig_nodes.view import campaign_of_sweep, draw, draw_figure, figures_of_campaign, read_campaign
from rig_nodes.view.campaign import Campaign, conditions_of
from rig_nodes.view.figure import POINTS, SOLID

from ..labels import hidden


def campaign(folder):
    """Writes reports of a grid of two speeds and three loads, with both ways of shifting."""
    record = json.loads(json.dumps(load_rig("hydmag").as_dict()))
    for n, (speed, load) in enumerate(itertools.product((1000, 1500), (40, 80, 120))):
        rows = [
            dict.fromkeys(metric_keys())
            | {
                "from_gear": a,
                "to_gear": b,
                "valid": True,
                "why": [],
                "t_order_s": 1.0,
                "t_c_s": 0.3 + 1e-3 * load + 1e-4 * speed + 0.1 * a,  # no two points at the same place
                "k": 0.9,
            }
            for a, b in ((1, 2), (2, 1))
        ]
        run = {"configuration": record, "parameters": {"speed": f"{speed} rpm", "load": f"{load} Nm", "wait": "3 s"}}
        path = folder / f"series-{n}"
        path.mkdir(parents=True)
        write_report(path, {"run": run, "shifts": rows})
    return folder


def test_the_conditions_of_a_campaign_are_what_the_series_of_its_procedure_vary(tmp_path):
    series = []
    for t12 in (-0.22, -0.12):
        (tmp_path / f"{t12}").mkdir()
        row = {"from_gear": 1, "to_gear": 2, "t_c_s": 0.5 - t12, "valid": True}
        run = {"configuration": load_rig("hydmag").as_dict(), "parameters": {"speed": "500 rpm"}}
        write_report(tmp_path / f"{t12}", {"run": run, "shifts": [row]})
        conditions = {"series": len(series) + 1, "t12": t12, "n_wej": 52.36}
        series.append({"label": f"{t12}", "conditions": conditions, "units": {"t12": "s", "n_wej": "rad/s"}, "runs": [f"{t12}"]})
    write_procedure(tmp_path, {"procedure": "x"}, series, [Member(one["label"], one["label"], []) for one in series])
    found = read_campaign(tmp_path)
    assert found.conditions == {"t12": ("s", pytest.approx([-0.12, -0.22]), ())}
    assert [row["t_c_s"] for row in found.rows] == pytest.approx([0.62, 0.72])


def test_drawn_values_of_a_sweep_keep_their_unit(tmp_path):
    for name, t12 in (("a", "-162.2041 ms"), ("b", "-246.3962 ms")):
        (tmp_path / name).mkdir()
        row = {"from_gear": 1, "to_gear": 2, "t_c_s": 0.5, "valid": True}
        write_report(
            tmp_path / name, {"run": {"configuration": load_rig("hydmag").as_dict(), "parameters": {"t12": t12}}, "shifts": [row]}
        )
    assert read_campaign(tmp_path).conditions == {"t12": ("ms", [-162.2041, -246.3962], ())}


def test_a_metric_is_drawn_over_each_condition_with_a_line_for_each_value_of_the_other(tmp_path):
    up, down = figures_of_campaign(read_campaign(campaign(tmp_path / "grid")))
    assert "I → II" in up.title and "II → I" in down.title and [one.title for one in up.columns] == ["speed [rpm]", "load [Nm]"]
    panels = {one.title: one for one in up.panels}
    lines = [one for one in panels["t_c"].curves if one.style == SOLID]
    over_speed, over_load = ([one for one in lines if one.column == place] for place in (0, 1))
    assert [one.text for one in over_speed] == ["40 Nm", "80 Nm", "120 Nm"] and [len(one.t) for one in over_load] == [3, 3]
    points = np.concatenate([one.y for one in panels["t_c"].curves if one.style == POINTS and one.column == 0])
    assert sorted(points) == pytest.approx([540.0, 580.0, 590.0, 620.0, 630.0, 670.0]), "every run of the table is a point"
    assert all((low <= one.y).all() and (one.y <= high).all() for one in lines for low, high in [one.band])


def test_what_was_varied_keeps_lines_apart_also_a_fourth_condition_words_and_faults(tmp_path):
    """The time grows with each condition, so that a line of means has a spread only where it mixes values of another one."""
    box, varied = load_rig("hydmag").transmission, list(itertools.product((1000, 1500), (40, 80), (30, 90), ("cubic", "linear")))
    given = [{"speed": f"{n} rpm", "load": f"{load} Nm", "oil": f"{oil} degC", "law": law} for n, load, oil, law in varied]
    rows = [
        {"from_gear": 1, "to_gear": 2, "t_c_s": 1e-4 * n + 1e-3 * load + 1e-2 * oil + 0.1 * (law == "linear")}
        for n, load, oil, law in varied
    ]
    (figure,) = figures_of_campaign(Campaign("grid", conditions_of(given), rows, box))
    assert [one.title for one in figure.columns] == ["speed [rpm]", "load [Nm]", "oil [degC]"]
    assert figure.conditions == "16 shifts; points are runs, lines their means, and the bands their spread. Varied too: law."
    lines = [one for panel in figure.panels for one in panel.curves if one.style == SOLID and one.column == 0]
    assert len(lines) == 8 and all((one.band[0] == one.band[1]).all() for one in lines)
    assert {"40 Nm, 30 degC, cubic", "80 Nm, 90 degC, linear"} <= {one.text for one in lines}
    folder = campaign(tmp_path / "grid")
    ill = json.loads((folder / "series-0" / "report.json").read_text())
    ill["run"]["faults"] = [{"name": "leak", "text": "leak: 1", "size": 1.0, "from_s": 0.5, "to_s": None}]
    write_report(folder / "series-0", ill)
    found = read_campaign(folder)
    assert found.conditions["faults"].words == ("leak", "no fault")
    (first, _) = figures_of_campaign(found)
    assert first.columns[2].names == ("leak", "no fault") and "40 Nm, leak" in {one.text for one in first.panels[0].curves}


def test_seeds_of_a_sweep_are_the_spread():
    plan = SimpleNamespace(name="x", varied=[SimpleNamespace(name=name, of=name, unit="") for name in ("seed", "t12")])
    rows = [
        {"from_gear": 1, "to_gear": 2, "seed": seed, "t12": t12, "t_c_s": 0.1 * (seed + t12)} for seed in (1, 2) for t12 in (5, 6)
    ]
    found = campaign_of_sweep(plan, rows, load_rig("hydmag").transmission)
    (figure,) = figures_of_campaign(found)
    (line,) = (one for one in figure.panels[0].curves if one.style == SOLID)
    assert list(found.conditions) == ["t12"] and line.band[1] - line.band[0] == pytest.approx([100.0, 100.0])


def test_each_axis_of_a_campaign_has_four_numbers_no_two_lines_look_alike_and_labels_hide_nothing(tmp_path):
    (first, _) = figures_of_campaign(read_campaign(campaign(tmp_path / "grid")))
    for panel in first.panels:
        looks = [(one.colour, one.style, one.column) for one in panel.curves]
        assert len(set(looks)) == len(looks)
    picture = draw_figure(first)
    assert hidden(picture) == hidden(draw_figure(first, width=370)) == []
    for axes in picture.axes:
        for axis, (low, high) in ((axes.xaxis, axes.get_xlim()), (axes.yaxis, axes.get_ylim())):
            assert sum(low <= one <= high for one in axis.get_majorticklocs()) >= 4


def test_a_folder_of_runs_is_drawn_by_report_and_view_says_so(tmp_path, capsys):
    folder = campaign(tmp_path / "grid")
    assert main(["report", str(folder), "--picture", str(tmp_path / "grid.png"), "--shift", "2"]) == 0
    assert (tmp_path / "grid.png").read_bytes()[:4] == b"\x89PNG"
    assert main(["report", str(folder), "--picture", str(tmp_path / "grid.png"), "--shift", "3"]) == 2
    assert "--shift 3: these runs have 2 changes of gears" in capsys.readouterr().err
    assert main(["view", str(folder)]) == 2
    assert f"is a folder of runs; their figures are made by ./rig report {folder} --html FILE" in capsys.readouterr().err
    with pytest.raises(RigError, match="this table has no figure; that of rig_nodes.sweep has one"):
        Table({"t_c_s": "s"}, [{"t_c_s": 0.5}]).plot()


@pytest.mark.parametrize(
    "ends", [(15.0, 60.0), (40.0, 60.0), (3.3, 30.0), (15.0, 150.0), (21.0, 420.0), (60.0, 1790.0), (2.0, 2100.0), (2.0, 9e4)]
)
def test_a_log_axis_has_four_numbers_however_long_it_is(ends):
    low, high = ends
    assert sum(low <= one <= high for one in draw._log_locator(high / low).tick_values(low, high)) >= 4
