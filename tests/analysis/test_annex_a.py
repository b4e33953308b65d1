# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The laboratory's own recipe on shifts made by hand, beside the plain definitions."""

from __future__ import annotations

import numpy as np
import pytest
from synthetic_shift import I1, I2, PERIOD, RPM, Shift

from rig_nodes.analysis.annex_a import shift_metrics_annex_a, shifts_annex_a
from rig_nodes.analysis.metrics import metric_keys
from rig_nodes.analysis.shift import shift_metrics, shifts
from rig_nodes.bags.logged import Recording
from rig_nodes.base.errors import RigError
from rig_nodes.rig.configuration import load_rig

BOX = load_rig("hydmag").transmission

UP = (1.0, 1, 2)
DOWN = (1.0, 2, 1)


def up(shift=Shift(), **kwargs):
    return shift_metrics_annex_a(shift.recording(), UP, **kwargs)


def test_clean_upshift_by_hand():
    row = up()
    assert set(row) == set(metric_keys()) and row["valid"], row["why"]
    # the fall is found at 1.45 s; slip of 25.8 % in 0.1 s passes 0.05 % 0.2 ms before 1.70 s
    assert row["t_dt_s"] == pytest.approx(0.25, abs=1.5e-3)
    # p2 grows by 36 bar/s from 1.25 s and is 0.5 bar above its rest 13.9 ms later
    assert row["t_c_s"] == pytest.approx(1.6998 - 1.2639 + 0.330576, abs=1.5e-3)
    # the torque falls linearly from 150 to 88 Nm between 1.70 and 1.80 s: 7.1 ms before the end it is still 5 % above 88 Nm,
    # and the first sample that counts must itself be within the 5 %
    assert row["t_o_s"] == pytest.approx(0.1 * (150.0 - 88.0 * 1.05) / 62.0, abs=1e-3)
    assert row["input_torque_max_nm"] == 250.0
    assert row["output_speed_min_rpm"] == pytest.approx(1500.0 / I1, rel=1e-9) and row["k"] == pytest.approx(1.0)
    assert row["overlap_s"] is None


def test_departure_of_the_speed_and_its_late_rule():
    """The departure is the first sample at which n_wyj will grow by 2.5 % within the next 10 ms."""
    row = up()
    # from 1.60 s the output gains 34.8 % in 0.1 s and 2.5 % in 7.2 ms; looking 50 samples ahead finds it 2.2 ms late
    assert row["t_p_s"] == pytest.approx(0.0998 - 0.0022, abs=1e-3)


def test_clean_downshift_by_hand():
    row = shift_metrics_annex_a(Shift(up=False).recording(), DOWN)
    assert row["valid"], row["why"]
    assert row["t_dt_s"] == pytest.approx(0.25, abs=1.5e-3)
    # p1 leaves exactly zero at 1.25 s
    assert row["t_c_s"] == pytest.approx(1.6998 - 1.25 + 0.19516, abs=1.5e-3)
    assert row["output_speed_min_rpm"] == pytest.approx(1500.0 / I1, rel=1e-6)


def test_a_dip_moves_the_end_of_a_downshift_behind_the_lowest_speed():
    plain = shift_metrics_annex_a(Shift(up=False, dip=0.10).recording(), DOWN)
    # lowest at 1.66 s, back at 1.70 s
    assert plain["t_dt_s"] == pytest.approx(0.25, abs=2e-3)
    assert plain["k"] == pytest.approx(0.90, abs=1e-3)


def test_energy_is_the_printed_sum():
    recording = Shift().recording()
    row = up()
    first, c = 14499, recording.channels  # the last sample of the mean before the fall
    last = first + int(round(row["t_dt_s"] / PERIOD))
    n_in, n_out = c["n_wej"] * RPM, c["n_wyj"] * RPM
    taken = given = 0.0
    for i in range(first, last + 1):
        taken += c["M_wej"][i] * 0.0001 * 2 * 3.14 * n_in[i] / 60 - 0.709 * (n_in[i] ** 2 - n_in[i - 1] ** 2) * 4 * 3.14**2 / (
            2 * 60 * 60
        )
        given += c["M_wyj"][i] * 0.0001 * 2 * 3.14 * n_out[i] / 60 + 0.1273 * (n_out[i] ** 2 - n_out[i - 1] ** 2) * 4 * 3.14**2 / (
            2 * 60 * 60 * I2**2
        )
    assert row["e_loss_j"] == pytest.approx(taken - given, abs=1.0)
    # the plain definition multiplies J_od by (41/40)^2 and contains pi, so that the kinetic energy of the output is larger
    plain = shift_metrics(recording, UP)
    assert 0.0 < row["e_loss_j"] - plain["e_loss_j"] < 0.15 * 0.5 * 0.1273 * (1500 / RPM) ** 2 + 20.0


def test_plain_and_annex_agree_where_the_recipe_is_sound():
    recording = Shift().recording(2)
    speeds = {name: Shift().channels()[name] for name in ("n_wej", "n_wyj")}
    recording = Recording(0.0, PERIOD, recording.channels | speeds, recording.orders, BOX)
    (mine,), (annex,) = shifts(recording), shifts_annex_a(recording)
    assert annex["t_dt_s"] == pytest.approx(mine["t_dt_s"], abs=10e-3)
    assert annex["t_p_s"] == pytest.approx(mine["t_p_s"], abs=5e-3)
    assert annex["k"] == pytest.approx(mine["k"], abs=2e-3)


def test_factors_are_settings():
    assert up(b=1.5)["t_o_s"] < up(b=1.05)["t_o_s"]
    rate = BOX.clutches[1].kiss_pressure / 1e5 / 0.1  # rate of the fill [bar/s]
    assert up(c=2.0)["t_c_s"] == pytest.approx(up(c=0.5)["t_c_s"] - 1.5 / rate, abs=1e-3)
    assert up(set_speed=1520 / RPM)["why"] == ["n_wej did not come back to its set speed"]
    with pytest.raises(RigError, match="upper edge of a band"):
        up(b=0.95)


def test_thresholds_in_bar_are_those_of_the_laboratory():
    """A rig whose clutches hold at 1.9 MPa never reaches 20 bar."""
    recording = Shift().recording()
    low = dict(recording.channels, p1=recording.channels["p1"] * 1.9 / 2.3)
    row = shift_metrics_annex_a(Recording(0.0, PERIOD, low, recording.orders, BOX), UP)
    assert row["t_dt_s"] is None and "20 bar" in row["why"][0]


def test_what_the_recipe_cannot_answer_has_its_reason():
    down = Shift(up=False).recording()
    rests = Recording(0.0, PERIOD, down.channels | {"p1": down.channels["p1"] + 0.1e6}, down.orders, BOX)
    row = shift_metrics_annex_a(rests, DOWN)
    assert row["t_c_s"] is None and len(row["why"]) == 1
    assert "p1 was not at zero 1 s before p2 fell" in row["why"][0]
    assert row["t_dt_s"] is not None
    neutral = shift_metrics_annex_a(Shift().recording(), (1.0, 0, 2))
    assert neutral["why"] == ["Annex A covers only changes between I and II"]
    short = up(Shift(length=2.2))
    assert short["t_o_s"] is None and "0.6 s" in short["why"][-1]
    with pytest.raises(RigError, match="10 kHz"):
        shift_metrics_annex_a(Recording(0.0, 1e-3, Shift().channels(), [UP], BOX), UP)


def test_rows_come_for_the_same_orders_as_the_plain_ones():
    recording = Shift().recording()
    channels = {name: np.concatenate([values, values]) for name, values in recording.channels.items()}
    twice = Recording(0.0, PERIOD, channels, [(1.0, 1, 2), (2.9, 2, 0), (4.0, 1, 2)], BOX)
    for rows in (shifts(twice), shifts_annex_a(twice)):
        assert [row["t_order_s"] for row in rows] == [1.0, 4.0]
