# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Signals at an end of their transducer's range: they are named, and nothing is concluded from them."""

import dataclasses

import numpy as np
import pytest
from synthetic_shift import PERIOD, RPM, FakeBag, Shift

from rig_nodes.analysis.clipped import Clipping, at_an_end
from rig_nodes.analysis.quality import quality_of, sentence_of
from rig_nodes.analysis.report_text import format_report
from rig_nodes.analysis.run_report import build_report
from rig_nodes.analysis.shift import shifts
from rig_nodes.bags.logged import Recording
from rig_nodes.rig.configuration import load_rig
from rig_nodes.rig.transmission import Gear

HYDMAG = load_rig("hydmag")
BOX = HYDMAG.transmission

ORDERS = [(0.0, "/controller/events", "shift_ordered", "", 1.0), (1.0, "/controller/events", "shift_ordered", "", 2.0)]
UP = Shift(peak=250.0)


def measured(ranges, box=None, **changed):
    """Returns the row of a shift whose channels are limited to ranges, as a transducer limits them, and its verdict."""
    box = dataclasses.replace(box or BOX, ranges=ranges)
    channels = UP.channels() | changed
    channels |= {name: np.clip(channels[name], *ends) for name, ends in ranges.items()}
    (row,) = shifts(Recording(0.0, PERIOD, channels, [(1.0, 1, 2)], box))
    return row, quality_of(row, box)


def backwards():
    """Returns the laboratory's transmission with a first gear that turns the output backwards, and the speed of its output."""
    box = BOX
    gears = tuple(dataclasses.replace(one, ratio=-2.0) if one.name == "I" else one for one in box.gears)
    t = np.arange(int(UP.length / PERIOD)) * PERIOD - 1.0
    n_wyj = np.interp(t, [UP.depart, UP.end], [-750.0, 1500.0 / 1.025]) / RPM
    return dataclasses.replace(box, gears=gears), n_wyj


def test_a_peak_above_the_range_of_the_torque_meter_is_a_lower_bound():
    row, verdict = measured({"M_wej": (-200.0, 200.0)})
    assert row["input_torque_max_nm"] is None and row["input_torque_high_nm"] is None and row["e_loss_j"] is None
    assert row["t_c_s"] == pytest.approx(UP.end, abs=1e-3), "the speeds are not in doubt"
    assert not row["valid"] and row["why"] == [
        "M_wej is at the end of its range, 200 Nm, for 0.073 s; its true values lie beyond, and nothing is concluded from it"
    ]
    assert sentence_of(verdict) == "fair: M_wej rose to at least 2.6 times the 78 Nm that the load asks in gear II"


def test_without_an_excess_that_is_certain_a_clipped_peak_is_not_called_good():
    _, verdict = measured({"M_wej": (-160.0, 160.0)})
    assert verdict["grade"] is None and verdict["reasons"] == []


@pytest.mark.parametrize("name", ["p1", "p2"])
def test_a_pressure_above_its_range_takes_what_begins_with_it_and_no_more(name):
    row, _ = measured({name: (-0.005e6, 2.0e6)})
    assert row["overlap_s"] is None and row["t_dt_s"] is None and row["k"] is None
    assert row["t_c_s"] == pytest.approx(UP.end, abs=1e-3) and row["input_torque_high_nm"] == pytest.approx(250.0, abs=0.1)
    assert len(row["why"]) == 1 and row["why"][0].startswith(f"{name} is at the end of its range, 2 MPa, for ")


def test_a_speed_beyond_its_range_is_no_gear_that_was_not_reached():
    row, verdict = measured({"n_wyj": (0.0, 1200.0 / RPM)})
    assert row["t_c_s"] is None and row["k"] is None and row["interrupted_s"] is None
    (reason,) = row["why"]
    assert reason.startswith("n_wyj is at the end of its range, 1200 rpm, for ")
    assert verdict["grade"] is None and sentence_of(verdict) == ""


def test_an_output_that_turns_backwards_is_not_read_as_standing_from_a_transducer_without_sign():
    box, n_wyj = backwards()
    row, verdict = measured({"n_wyj": (0.0, 3600.0 / RPM)}, box, n_wyj=n_wyj)
    assert row["why"][0].startswith("n_wyj is at the end of its range, 0 rpm, for ") and len(row["why"]) == 1
    assert verdict["grade"] is None


def test_a_change_of_direction_passes_standstill_by_intent():
    box, n_wyj = backwards()
    row, verdict = measured({"n_wyj": (-3600.0 / RPM, 3600.0 / RPM)}, box, n_wyj=n_wyj)
    assert row["valid"] and row["why"] == [] and row["t_c_s"] == pytest.approx(UP.end, abs=2e-3)
    assert row["k"] is None and row["reversed_s"] is None
    assert "interrupted" not in sentence_of(verdict) and "stood still" not in sentence_of(verdict)


def test_a_shift_between_two_gears_that_turn_backwards_has_its_k_and_no_standstill():
    box = BOX
    gears = tuple(dataclasses.replace(one, ratio=-one.ratio) if isinstance(one, Gear) and one.ratio else one for one in box.gears)
    mirrored = {name: -UP.channels()[name] for name in ("n_wyj", "M_wyj")}
    ahead, _ = measured({})
    back, _ = measured({}, dataclasses.replace(box, gears=gears), **mirrored)
    assert back["valid"] and back["k"] == pytest.approx(ahead["k"]) and back["t_c_s"] == pytest.approx(ahead["t_c_s"])
    assert back["output_speed_min_rpm"] == pytest.approx(-ahead["output_speed_min_rpm"])


def test_rest_at_zero_and_a_signal_of_another_transducer_are_not_at_an_end():
    assert not at_an_end(np.zeros(5), (-0.1e6, 40e6)).any(), "a released clutch has no pressure"
    assert at_an_end(np.array([-500.0, 0.0, 499.9]), (-500.0, 500.0)).tolist() == [True, False, True]
    assert not at_an_end(np.array([500.0, 700.0]), (-500.0, 500.0)).any(), "it goes beyond, so its range is another one"


def test_every_signal_of_a_run_that_was_at_the_end_of_its_range_is_named():
    channels = UP.channels() | {"M_wyj": np.full(30_000, 500.0)}
    report = build_report(FakeBag(Recording(0.0, PERIOD, channels, [], BOX), events=ORDERS), {})
    sentence = "M_wyj was at the end of its range, 500 Nm, for 3 s, 100 % of the run: its true values there lie beyond"
    assert sentence in report["run"]["problems"] and f"problem: {sentence}" in format_report(report)
    pieces = Clipping({"p1": (-0.1e6, 2.3e6)})
    for _ in range(2):
        pieces.add({"p1": np.array([0.0, 2.3e6, np.nan, 2.3e6])}, 0.1)
    (said,) = pieces.sentences(HYDMAG.catalogue.signals)
    assert said.startswith("p1 was at the end of its range, 2.3 MPa, for 0.4 s, 66.7 % of the run: ")


def test_a_torque_at_the_lower_end_of_its_range_alone_is_no_lower_bound_of_the_peak():
    torque = UP.channels()["M_wej"].copy()
    torque[14_000:14_200] = -400.0
    row, verdict = measured({"M_wej": (-300.0, 300.0)}, M_wej=torque)
    assert row["input_torque_at_least_nm"] is None and "at least" not in sentence_of(verdict)
    assert row["why"][0].startswith("M_wej is at the end of its range, -300 Nm, for 0.02")
    row, _ = measured({"M_wej": (-200.0, 200.0)}, M_wej=torque)
    assert row["input_torque_at_least_nm"] == 200.0
    assert row["why"][0].startswith("M_wej is at the end of its range, -200 Nm and 200 Nm, for ")


@pytest.mark.parametrize(
    "values, said", [([-500.0] * 4, "-500 Nm"), ([500.0] * 4, "500 Nm"), ([500.0, 0.0, -500.0, -500.0], "-500 Nm and 500 Nm")]
)
def test_the_sentence_on_a_run_names_the_end_that_was_reached(values, said):
    clipping = Clipping({"M_wyj": (-500.0, 500.0)})
    for part in (values[:2], values[2:]):
        clipping.add({"M_wyj": np.array(part)}, 0.1)
    (sentence,) = clipping.sentences(HYDMAG.catalogue.signals)
    assert sentence.startswith(f"M_wyj was at the end of its range, {said}, for 0.")
