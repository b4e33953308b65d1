# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The examples of docs/how_to/driveline_examples.md run as they stand, in at most 30 lines each, and have their pictures."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest

PICTURES = Path(__file__).parents[2] / "docs" / "pictures"
_SPEC = importlib.util.spec_from_file_location("driveline_examples", PICTURES / "driveline_examples.py")
drawing = importlib.util.module_from_spec(_SPEC)
_SPEC.loader.exec_module(drawing)


@pytest.fixture(scope="module", params=drawing.examples(), ids=lambda example: example[0])
def example(request):
    title, code, name = request.param
    return title, code, name, drawing.left_by(code)


def test_it_runs_and_its_picture_is_beside_the_page(example):
    title, code, name, names = example
    assert len(code.splitlines()) <= 30
    assert all(np.isfinite(y).all() and len(y) == len(names["over"][1]) for y in names["lines"].values())
    drawn = drawing.picture(title, names)
    svg = (PICTURES / name).read_text(encoding="utf-8")
    assert all(f"<!-- {word} -->" in svg for word in (title, *(one.text for one in drawn.panels[0].curves)))
    if "result" in names:
        result = names["result"]
        assert result.capped == 0
        assert np.abs(result.residual()).max() < 1e-9 * (1.0 + np.abs(np.diff(result.e_in)).sum() + result.stored.max())


def test_there_are_ten():
    assert len(drawing.examples()) == 10


def by_title(part):
    return next(drawing.left_by(code) for title, code, _ in drawing.examples() if part in title)


def test_the_gearbox_has_its_three_ratios():
    names = by_title("planetary gearbox")
    result, k = names["result"], names["k"]
    ratio = result.speed("input") / result.speed("output")
    at = [ratio[np.searchsorted(result.t, t)] for t in (0.9, 1.95, 2.99)]
    assert at == pytest.approx([(2.0 * k + 1.0) / k, (1.0 + k) / k, 1.0], rel=1e-9)


def test_the_hoist_stands_lifts_stands_and_is_lowered():
    result = by_title("hoist")["result"]
    speed = result.speed("drum")
    at = [speed[np.searchsorted(result.t, t)] for t in (0.9, 1.9, 2.9, 3.9)]
    assert abs(at[0]) < 1e-12 and at[1] > 0.1 and abs(at[2]) < 1e-12 and at[3] < -0.01
