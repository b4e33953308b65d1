# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Values at the ends of their ranges give a possible run, or a trip that names what is impossible, but never a wrong result."""

import dataclasses
import random

import numpy as np
import pytest

from rig_nodes.base.errors import RigError
from rig_nodes.rig.configuration import load_rig
from rig_nodes.rig.cross_checks import cross_check
from rig_nodes.runs.recorded import record
from rig_nodes.runs.rig import Rig
from rig_nodes.runs.rig_base import RigStatus
from rig_nodes.runs.sequence import load_sequence

RPM = np.pi / 30.0
VACUUM = -0.1013e6
HEAVY_PUMP = {"z5.inertia": "3 kg m2", "M_wyj.inertia": "2.7 kg m2"}
STIFF_VALVE = {
    "valve_zr_p2.full_opening_pressure": "1 kPa",
    "valve_zr_p2.spool_time": "0.1 ms",
    "valve_zr_p2.drain_area": "1000 mm2",
}

# without a dead band of the spool the valve reacts to every motion of the piston
STIFF_PACK = {"clutch_s1.pack_rate": "10000000 N/mm", "valve_zr_p1.spool_dead_band": "0 mm", "load_pump.mechanical_loss": "1.5 Nm"}


def shift_up_and_down(settings):
    """Returns (channels of 6 s with true values, rig): gear I, 1000 rpm, load, up, down."""
    rig = Rig(load_rig("hydmag", {"effects.transducers": "off", "trips.watched": "off", **settings}))
    rows = []

    def go(seconds):
        for _ in range(round(seconds * 10)):
            rig.advance(0.1)
            rows.append(rig.rows_at(1e-4, round(rig.time * 1e4) - 999, 1000))

    rig.set("oil", 4e6, True)
    rig.order_gear(1)
    go(0.8)
    rig.set("motor", 1000.0 * RPM, True)
    go(1.6)
    rig.set("load", 5e6, True)
    go(0.4)
    for gear in (2, 1):
        if rig.status != RigStatus.TRIPPED:
            rig.order_gear(gear)
        go(1.6)
    return dict(zip(rig.channels, np.concatenate(rows).T)), rig


def longest_alternation(values, least):
    """Returns the largest number of consecutive steps that each reverse the one before by more than ``least``."""
    step = np.diff(values)
    turns = (step[1:] * step[:-1] < 0.0) & (np.minimum(abs(step[1:]), abs(step[:-1])) > least)
    ends = np.flatnonzero(np.diff(np.concatenate([[0], turns, [0]]).astype(int)))
    return max(ends[1::2] - ends[::2], default=0)


def nonsense(channels, rig):
    """Returns sentences on all impossible values in a run; none for a possible run."""
    sentences = [f"{name} is not finite" for name, x in channels.items() if not np.isfinite(x).all()]
    sentences += [f"{name} falls to {x.min():g} Pa" for name, x in channels.items() if name[0] == "p" and x.min() < VACUUM]
    sentences += [
        f"{name} alternates from step to step"
        for name in ("M_wej", "M_wyj")
        if rig.status != RigStatus.TRIPPED and longest_alternation(channels[name], 1.0) > 6
    ]
    energy = rig.energy()
    if not abs(energy["residual"]) < 1e-6 * (1.0 + sum(map(abs, energy.values()))):
        sentences.append(f"{energy['residual']:g} J come from nowhere")
    return sentences


@pytest.mark.parametrize(
    "settings",
    [
        {"plate_pack.heat_capacity": "10 J/K", "plate_pack.cooling": "300000 W/K"},
        HEAVY_PUMP,
        {**HEAVY_PUMP, "loss_out.torque_side": "driven"},
        {"loss_in.square": "0.003 1/Nm"},
        {**HEAVY_PUMP, "loss_in.square": "0.01 1/Nm"},
        STIFF_VALVE,
        STIFF_PACK,
    ],
    ids=["cold plates", "heavy pump", "heavy pump behind the clutches", "steep loss", "both", "stiff valve", "stiff pack"],
)
def test_a_shift_with_stiff_parts_is_one_that_can_be(settings):
    channels, rig = shift_up_and_down(settings)
    assert rig.status == RigStatus.RUNNING, rig.reason
    assert nonsense(channels, rig) == []


def test_no_pressure_falls_below_the_tank_when_a_wide_drain_shuts():
    channels, _ = shift_up_and_down(STIFF_VALVE)
    assert min(channels["p1"].min(), channels["p2"].min()) > -0.011e6


@pytest.mark.parametrize(
    "name, spoil, reason",
    [
        ("hydmag", lambda rig: rig.clutches[0].__setitem__("wear", np.inf), "clutch_s1: "),
        ("clutch_bench", lambda rig: rig.clutches[0].__setitem__("temperature", np.nan), "clutch_pack: temperature became nan "),
    ],
)
def test_a_value_that_is_no_number_is_a_trip_that_names_it_and_is_in_no_row(name, spoil, reason):
    rig = Rig(load_rig(name))
    rig.advance(0.02)
    spoil(rig)
    rig.advance(0.02)
    assert rig.status == RigStatus.TRIPPED and rig.sample == 21
    assert reason in rig.reason
    assert "between 0.020 s and 0.021 s" in rig.reason
    rig.advance(0.02)
    assert rig.time == pytest.approx(0.041), "time goes on in the safe state"
    assert np.isfinite(rig.rows_at(1e-4, 0, 400)).all()


def test_a_recorded_run_ends_with_that_trip(monkeypatch):
    move, seen = Rig.move, []

    def spoiled(rig, samples):
        if rig.sample > 300 and not seen:
            seen.append(rig.sample)
            rig.clutches[1]["heat"] = np.nan
        return move(rig, samples)

    monkeypatch.setattr(Rig, "move", spoiled)
    run = record(load_rig("hydmag"), load_sequence("sample"))
    assert run.end["state"] == "tripped" and "is no finite number" in run.end["reason"]
    assert all(np.isfinite(x).all() for x in run.recording.channels.values())


def drawn(rng):
    """Returns two to five settings of the plant at the ends of their ranges or anywhere between."""
    config, out = load_rig("hydmag"), {}
    for _ in range(rng.randint(2, 5)):
        part = rng.choice(
            [
                "motor",
                "rotor",
                "w0",
                "z5",
                "input_shaft",
                "M_wyj",
                "loss_in",
                "loss_out",
                "plate_pack",
                "clutch_s1",
                "clutch_s2",
                "valve_zr_p1",
                "valve_zr_p2",
                "oil_supply",
                "load_pump",
            ]
        )
        field = rng.choice([name for name, value in vars(getattr(config, part)).items() if isinstance(value, float)])
        setting = config.settings.find(f"{part}.{field}")
        low, high = setting.low, setting.high
        kind = rng.random()
        value = (
            low if kind < 0.3 else high if kind < 0.6 else getattr(getattr(config, part), field) * rng.choice((0.1, 0.3, 3.0, 10.0))
        )
        out[part, field] = min(max(value, low), high)
    return out


def run_drawn(seed):
    """Returns sentences on the faults of a run of a drawn rig."""
    values, config = drawn(random.Random(seed)), load_rig("hydmag", {"effects.transducers": "off"})
    for (part, field), value in values.items():
        config = config.replaced(**{part: dataclasses.replace(getattr(config, part), **{field: value})})
    drawn_values = {f"{part}.{field}": value for (part, field), value in values.items()}
    try:
        cross_check(config, lambda keys: "")
        rig = Rig(config)
    except RigError:
        return None
    rows = []
    rig.set("oil", 4e6, True)
    for seconds, act in (
        (0.8, lambda: rig.order_gear(1)),
        (1.0, lambda: rig.set("motor", 100.0, True)),
        (0.3, lambda: rig.set("load", 5e6, True)),
        (1.5, lambda: rig.order_gear(2)),
        (1.0, lambda: rig.order_gear(1)),
    ):
        if rig.status != RigStatus.TRIPPED:
            act()
        for _ in range(round(seconds * 10)):
            begin = rig.sample
            rig.advance_samples(100)
            rows.append(rig.rows_at(1e-4, 10 * begin + 1, 10 * (rig.sample - begin)))
    wrong = nonsense(dict(zip(rig.channels, np.concatenate(rows).T)), rig)
    return (seed, drawn_values, wrong) if wrong else None


def test_drawn_rigs_are_ones_that_can_be_or_trip():
    assert [wrong for wrong in map(run_drawn, range(8)) if wrong] == []


@pytest.mark.campaign
def test_hundreds_of_drawn_rigs_are_ones_that_can_be_or_trip():
    assert [wrong for wrong in map(run_drawn, range(1000, 1500)) if wrong] == []
