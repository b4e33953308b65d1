# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""All metrics of a shift, on a transmission in which a clutch stays engaged through it."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from synthetic_shift import RPM, FakeBag
from synthetic_three_speed import BOX, KISS, RATIOS, ThreeSpeedShift

from rig_nodes.analysis.energy import balance, clutch_heat, energies_of
from rig_nodes.analysis.engagement import engagement_metrics
from rig_nodes.analysis.measured_error import Instrument, instruments_of, uncertainty
from rig_nodes.analysis.plant_states import metrics_of_states, states_of
from rig_nodes.analysis.run_report import shown_transmission
from rig_nodes.analysis.shift import shifts
from rig_nodes.bags.exchange.orders import parse_orders
from rig_nodes.bags.logged import Recording
from rig_nodes.base.errors import RigError
from rig_nodes.rig.configuration import load_rig

INSTRUMENTS = {
    "torque": Instrument(500.0, 0.2),
    "speed": Instrument(300.0, 0.0, 0.1),
    "p_c1": Instrument(4e6, 0.25),
    "p_c2": Instrument(4e6, 0.25),
    "p_b1": Instrument(8e6, 0.25),
}


def tenth(kiss: float) -> float:
    """Returns the pressure at which a clutch has a tenth of its capacity at 2 MPa."""
    return kiss + 0.1 * (2e6 - kiss)


def only(recording: Recording) -> dict:
    (row,) = shifts(recording)
    return row


def test_the_clutches_of_a_shift_follow_from_the_gears():
    names = {
        way: tuple("".join(clutch.name for clutch in clutches) for clutches in (moved.releasing, moved.engaging))
        for way, moved in ((way, BOX.shift(*way)) for way in ((0, 1), (1, 2), (2, 3), (3, 1), (2, 0)))
    }
    assert names == {(0, 1): ("", "C1B1"), (1, 2): ("B1", "C2"), (2, 3): ("C1", "B1"), (3, 1): ("C2", "C1"), (2, 0): ("C1C2", "")}


@pytest.mark.parametrize(
    "old, new, releasing, engaging", [(1, 2, "B1", "C2"), (2, 1, "C2", "B1"), (2, 3, "C1", "B1"), (3, 1, "C2", "C1")]
)
def test_a_shift_is_measured_on_the_clutches_that_it_moves(old, new, releasing, engaging):
    case = ThreeSpeedShift(old, new)
    row = only(case.recording())
    assert row["valid"] and row["why"] == []
    assert row["t_c_s"] == pytest.approx(case.end, abs=1e-3)
    assert row["t_dt_s"] == pytest.approx(case.end - case.fall, abs=1e-3)
    assert row["t_p_s"] == pytest.approx(case.end - case.depart, abs=1e-3)
    assert row["overlap_s"] == pytest.approx(case.both(*(tenth(KISS[name]) for name in (releasing, engaging))), abs=1e-3)
    assert row["k"] == pytest.approx(1.0, abs=2e-3)  # relative to the slower of both gears
    assert row["output_speed_min_rpm"] == pytest.approx(1500.0 / max(RATIOS[old], RATIOS[new]), abs=3.0)
    by_hand = loss_by_hand(case)
    if by_hand < 0.0:  # the torques of this case are not those of a gearbox
        assert row["e_loss_j"] is None and "no loss is negative" in row["undefined"]["e_loss_j"]
    else:
        assert row["e_loss_j"] == pytest.approx(by_hand, rel=4e-3, abs=8.0)  # slip ends 1 ms early


def loss_by_hand(case: ThreeSpeedShift) -> float:
    """Returns (6.108) for torques at a constant input speed, with output speed and torque as straight lines."""
    w = case.rpm / RPM
    t = np.linspace(case.fall, case.end, 20_001)
    m_in = np.interp(t, [case.depart, case.end - 1e-2, case.end], [60.0, 200.0, 190.0])
    w_out = w * np.interp(t, [case.depart, case.end], [1.0 / RATIOS[case.old], 1.0 / RATIOS[case.new]])
    power = m_in * w - 100.0 * w_out
    return float(np.mean(power) * (case.end - case.fall) - 0.5 * 0.2 * (w_out[-1] ** 2 - w_out[0] ** 2))


def test_a_staying_clutch_that_is_weak_before_the_shift_does_not_matter():
    """C1 is engaged in both gears, so the motion of its pressure does not belong to the shift."""
    case = ThreeSpeedShift(1, 2)
    wandering = case.channels()["p_c1"] - np.linspace(0.0, 1.5e6, 30_000)
    changed, plain = only(case.recording(p_c1=wandering)), only(case.recording())
    assert changed == plain


def test_an_engagement_from_neutral_begins_with_the_first_pressure_and_needs_all():
    case = ThreeSpeedShift(0, 1)
    row = only(case.recording())
    assert row["valid"] and row["t_dt_s"] == pytest.approx(case.end - case.rise, abs=2e-3)
    assert row["k"] is None and row["overlap_s"] is None
    open_brake = only(case.recording(p_b1=np.zeros(30_000)))
    assert not open_brake["valid"]
    assert open_brake["why"] == ["p_b1 never rose above 0.25 MPa", "p_b1 did not rise above 0.25 MPa"]


def test_two_clutches_at_once_are_no_engagement_of_one():
    case = ThreeSpeedShift(0, 1)
    row = engagement_metrics(case.recording(), (1.0, 0, 1), instruments_of(load_rig("hydmag").as_dict()))
    assert row["why"] == ["gear 1. engages C1 and B1, and this is about an engagement of one clutch"]


def test_a_gear_whose_clutch_slips_names_it():
    case = ThreeSpeedShift(1, 2, end=9.0)
    row = only(case.recording())
    assert any(reason.startswith("clutch C2 still slips at the end by ") for reason in row["why"])


def test_the_error_of_the_overlap_is_that_of_the_worse_transducer_at_the_rates_of_the_shift():
    error = uncertainty(only(ThreeSpeedShift(1, 2).recording()), INSTRUMENTS, BOX)["overlap_s"]
    # B1's transducer is 20 kPa wrong; its pressure falls at 13 MPa/s while that of C2 rises at 4 MPa/s
    assert error == pytest.approx(2 * 1.1e-3 + 20e3 * (1 / 13e6 + 1 / 4e6), rel=1e-2)


def test_the_plants_states_are_read_of_every_clutch():
    t = np.arange(0.0, 3.0, 0.005)
    messages = {
        "/gearbox/state": [{"torque_in": 60.0, "speed_in": 150.0, "speed_out": 80.0} for _ in t],
        "/clutch_c1/state": [{"mode": 2, "heat": 0.0, "torque": 50.0} for _ in t],
        "/clutch_c2/state": [{"mode": 2 if now >= 1.6 else 1, "heat": 100.0 * now, "torque": 60.0} for now in t],
        "/clutch_b1/state": [{"mode": 0 if now > 1.3 else 2, "heat": 10.0, "torque": 0.0} for now in t],
    }
    bag = FakeBag(
        None, {topic: [(round(now * 1e9), SimpleNamespace(**one)) for now, one in zip(t, ones)] for topic, ones in messages.items()}
    )
    row = only(ThreeSpeedShift(1, 2).recording()) | {"t_o_s": None}
    truth = metrics_of_states(states_of(bag, BOX), row, BOX)
    assert truth["t_lock_s"] == pytest.approx(0.6, abs=0.006), "C1, which stays, does not count"
    assert truth["heat_c2_j"] == pytest.approx(60.0, abs=1.0) and truth["heat_c1_j"] == truth["heat_b1_j"] == 0.0


def test_the_energy_balance_has_the_heat_of_all_clutches():
    t = np.arange(0.0, 2.0, 0.005)

    def fields(topic, names):
        values = {
            "/motor/state": {"work": 100.0 * t},
            "/load_pump/state": {"work": 40.0 * t},
            "/clutch_c1/state": {"heat": 10.0 * t},
            "/clutch_c2/state": {"heat": 20.0 * t},
            "/clutch_b1/state": {"heat": 30.0 * t},
            "/gearbox/state": {"heat": 0.0 * t, "speed_in": 100.0 + 0.0 * t, "speed_out": 50.0 + 0.0 * t},
        }[topic]
        return t, [values[name] for name in names]

    account = balance(energies_of(SimpleNamespace(fields=fields, structure=load_rig("chapter9").structure), BOX), 0.0, 1.0, BOX)
    assert clutch_heat(account, BOX) == pytest.approx(60.0)
    assert account["residual_j"] == pytest.approx(0.0, abs=1e-9)


def test_orders_are_given_by_the_names_and_numbers_of_its_gears():
    assert parse_orders("1.0:1-2, 2:2-N", BOX) == [(1.0, 1, 2), (2.0, 2, 0)]
    with pytest.raises(RigError, match="'1:2-4' is no order"):
        parse_orders("1:2-4", BOX)


def test_a_report_whose_record_is_damaged_is_refused_and_has_not_another_rigs_gears():
    report = {"run": {"configuration": load_rig("three_speed").as_dict()}, "shifts": [{}]}
    assert list(shown_transmission(report).numbers) == ["neutral", "1", "2", "3"]
    del report["run"]["configuration"]["structure"]["gears"]
    with pytest.raises(RigError, match="the configuration of the run does not name its rig"):
        shown_transmission(report)


def test_a_report_of_a_bag_without_a_record_has_the_gears_of_the_rig_that_it_took():
    report = {"run": {"configuration": None}, "shifts": [{}], "basis": {"taken": True, "rig": "three_speed"}}
    assert list(shown_transmission(report).numbers) == ["neutral", "1", "2", "3"]
