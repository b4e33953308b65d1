# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Coast-down and single engagement on the rig itself, through its transducers."""

from __future__ import annotations

import dataclasses
from math import pi

import numpy as np
import pytest

from rig_nodes.analysis.coasting import coast_down
from rig_nodes.analysis.engagement import engagement_metrics
from rig_nodes.analysis.measured_error import instruments_of
from rig_nodes.bags.logged import Recording
from rig_nodes.plant.parts.load_pump import relief_setting_for
from rig_nodes.rig.configuration import load_rig
from rig_nodes.runs.rig import Rig

HYDMAG = load_rig("hydmag")

BASE = load_rig("hydmag")


class Logged:
    """A rig whose 10 kHz rows are kept."""

    def __init__(self, config):
        self.rig, self.rows = Rig(config, 1), []

    def advance(self, seconds):
        for _ in range(round(seconds * 200)):
            self.rig.advance_samples(5)
            self.rows.append(self.rig.take_rows(50)[1].copy())

    def channels(self):
        return dict(zip(self.rig.logger_names, np.concatenate(self.rows).T))


@pytest.mark.parametrize("share", [0.8, 1.0, 1.2])
def test_a_changed_inertia_comes_back_within_2_percent(share):
    true = BASE.transmission.inertias.driving * share
    bench = Logged(BASE.replaced(rotor=dataclasses.replace(BASE.rotor, inertia=true - BASE.w0.inertia)))
    bench.rig.set("motor", 470.0 * pi / 30.0, True)
    bench.advance(4.0)
    bench.rig.set("motor", 0.0, False)
    bench.advance(10.0)
    channels = bench.channels()
    t = 1e-4 * np.arange(len(channels["n_wej"]))
    found = coast_down(t, channels["n_wej"], channels["M_wej"])
    assert found["t_cut_s"] == pytest.approx(4.0, abs=0.02)
    assert found["inertia"] == pytest.approx(true, rel=0.02)
    assert found["inertia_half"] == pytest.approx(true, rel=0.02)


def test_an_engagement_whose_current_stays_level_has_a_hold_phase():
    """Series 30 of Annex B: 250 mA from 125 to 400 ms, 740 mA at 700 ms."""
    profiles = np.array(BASE.alfa46.profiles)
    profiles[0, :3] = [[0.125, 0.250], [0.400, 0.250], [0.700, 0.740]]
    bench = Logged(dataclasses.replace(BASE, alfa46=dataclasses.replace(BASE.alfa46, profiles=profiles)))
    rig, w = bench.rig, 500.0 * pi / 30.0
    rig.set("oil", 4e6, True)
    bench.advance(0.3)
    rig.order_gear(1)
    bench.advance(1.0)
    rig.set("motor", w, True)
    rig.set("load", relief_setting_for(30.0, w * 34 / 47, BASE.load_pump), True)
    bench.advance(2.5)
    rig.order_gear(0)
    bench.advance(2.5)
    ordered = rig.time
    rig.order_gear(1)
    bench.advance(1.5)
    row = engagement_metrics(
        Recording(0.0, 1e-4, bench.channels(), [], HYDMAG.transmission), (ordered, 0, 1), instruments_of(HYDMAG.as_dict())
    )
    assert row["valid"], row["why"]
    assert row["hold"] == "hold" and 0.05 < row["hold_s"] < 0.35
    # between fill and end pressure; the valve's friction may let it exceed the pressure of 250 mA
    assert 0.1 * row["p_end"] < row["hold_pressure"] < 0.8 * row["p_end"]
    # only the clutch slips: it closes before the end of the pressure's rise, with a peak above the torque of the closed clutch
    assert row["rise_start_s"] < row["kiss_s"] < row["slip_end_s"]
    assert row["engagement_peak_nm"] > 1.5 * row["input_torque_mean_nm"] > 0.0
