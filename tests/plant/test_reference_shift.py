# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A shift of the rig, at its own step, against the reference solution of the same equations (reference_shift.py)."""

import dataclasses
import math

import numpy as np
import pytest
import reference_shift

from rig_nodes.analysis.shift import shift_metrics
from rig_nodes.bags.logged import Recording
from rig_nodes.plant.parts.load_pump import relief_setting_for
from rig_nodes.rig.configuration import load_rig
from rig_nodes.runs.rig import Rig

RPM = math.pi / 30.0
BEFORE, AFTER = 200, 1000  # ms recorded before and after the order
FINER = 100  # rows interpolated between two logger rows, because the metrics count in whole rows
METRICS = ("t_dt_s", "t_p_s", "t_c_s", "t_o_s", "input_torque_max_nm", "output_speed_min_rpm", "k", "e_loss_j", "e_loss_settled_j")
CLOSE = 2e-3


def whole_rig():
    """The rig with every effect on the plant, averaged PWM, the thesis's clutch models, and channels that show true values.

    Its supply pressure falls visibly with the flow; its oil keeps a temperature below that of its stated viscosity.
    """
    oil = {"relief_droop": "0.1 bar/(l/min)", "temperature": "35 degC", "tank_heat_capacity": "0 J/K"}
    config = load_rig("hydmag", {f"oil_supply.{name}": value for name, value in oil.items()})
    on = {f.name: f.name != "transducers" for f in dataclasses.fields(config.effects) if f.type == "bool"}
    models = {"friction_model": "thesis", "drag_model": "kitabayashi"}
    return config.replaced(
        effects=dataclasses.replace(config.effects, pwm_frequency=0.0, **on),
        clutch_s1=dataclasses.replace(config.clutch_s1, **models),
        clutch_s2=dataclasses.replace(config.clutch_s2, **models),
    )


def locked(rig):
    return [rig.clutch_mode(k) == 2 for k in range(2)]


def state_of(rig):
    """Returns the rig's present state in the form of the reference."""
    y = [
        rig.true("w0.speed"),
        rig.true("wk.speed"),
        rig.true("rotor.speed"),
        float(rig.entries("twist")[0]),
        rig.motor["torque"],
        rig.motor["integral"],
        rig.load["pressure"],
        rig.oil["pressure"],
    ]
    for k, (valve, clutch) in enumerate(zip(rig.valves, rig.clutches)):
        y += [
            valve["spool"],
            rig.fed_pressure(rig.config.structure.valves[k].name),
            *(clutch[name] for name in ("chamber", "piston", "empty")),
            *(clutch[name] for name in ("held", "rest", "boundary", "temperature", "wear")),
        ]
    modes = [reference_shift.STUCK if stuck else int(math.copysign(1, rig.slip(k))) for k, stuck in enumerate(locked(rig))]
    return reference_shift.Start(
        np.array(y),
        *([valve[name] for valve in rig.valves] for name in ("current", "magnet")),
        modes,
        rig.motor["setpoint"],
        rig.load["setting"],
        rig.oil["setting"],
    )


class RigShift:
    """One shift of a rig: state at the order, duty (ms, 2), channels (rows, 7), and the locked clutches after each ms."""

    def __init__(self, config, old, new, rpm, load):
        self.config, self.order = config, (BEFORE * 1e-3, old, new)
        rig = Rig(config)
        rig.set("oil", 4e6, True)
        rig.advance(0.3)
        rig.order_gear(old)
        rig.advance(1.5)
        rig.set("motor", rpm * RPM, True)
        rig.advance(4.0)
        rig.set("load", relief_setting_for(load, rig.true("wk.speed"), config.load_pump), True)
        rig.advance(3.0)
        assert rig.locked_gear() == old
        self.start, first = state_of(rig), rig.sample
        rows, self.locked = [rig.rows_at(1e-4, 10 * (first - BEFORE), 10 * BEFORE + 1)], []
        rig.order_gear(new)
        for _ in range(AFTER):
            rig.advance_samples(1)
            rows.append(rig.rows_at(1e-4, 10 * rig.sample - 9, 10))
            self.locked.append(locked(rig))
        rows = np.concatenate(rows)
        self.duty = rows[10 * BEFORE + 1 :: 10, [rig.channels.index(name) for name in ("U_zr_p1", "U_zr_p2")]]
        self.channels = rows[:, [rig.channels.index(name) for name in reference_shift.CHANNELS]]

    def metrics(self, channels):
        """Returns the shift metrics of the channels from the order on, together with those before it."""
        whole = np.concatenate([self.channels[: 10 * BEFORE], channels])
        rows = np.arange(len(whole))
        finer = np.arange(FINER * (len(whole) - 1) + 1) / FINER
        by_name = {name: np.interp(finer, rows, column) for name, column in zip(reference_shift.CHANNELS, whole.T)}
        return shift_metrics(Recording(0.0, 1e-4 / FINER, by_name, [], self.config.transmission), self.order)


def far_apart(one, other, close):
    """Returns the metrics that differ by more than a share; for the overlap, which may be 0, by more than a step."""
    far = {name: (one[name], other[name]) for name in METRICS if one[name] != pytest.approx(other[name], rel=close)}
    if one["overlap_s"] != pytest.approx(other["overlap_s"], abs=1e-4):
        far["overlap_s"] = one["overlap_s"], other["overlap_s"]
    return far


DOWN = pytest.param((2, 1, 120.0), id="II-I", marks=pytest.mark.campaign)  # 15 s of processor time, as each of the two


@pytest.fixture(scope="module", params=[pytest.param((1, 2, 60.0), id="I-II"), DOWN])
def shift(request):
    old, new, load = request.param
    return RigShift(whole_rig(), old, new, 1500.0, load)


@pytest.fixture(scope="module")
def reference(shift):
    return reference_shift.solve(shift.config, shift.start, shift.duty)


def test_every_metric_is_that_of_the_reference(shift, reference):
    rig, other = (shift.metrics(x) for x in (shift.channels[10 * BEFORE :], reference[0]))
    assert other["valid"], other["why"]
    assert not far_apart(rig, other, CLOSE)


def test_channels_and_lock_ups_are_those_of_the_reference(shift, reference):
    """Metrics consider a few moments; between them no channel is off by a tenth of a percent of its span on average.

    There is one exception: a pressure above its limit falls at 100 MPa/s, 10 kPa in a step, until the drain edge closes, and then
    stays constant for seconds.
    """
    rows, events = reference
    off = np.abs(shift.channels[10 * BEFORE :] - rows).mean(axis=0) / np.ptp(rows, axis=0)
    pressure = np.isin(reference_shift.CHANNELS, ("p1", "p2"))
    assert off[~pressure].max() < 1e-3 and off[pressure].max() < 4e-3, dict(zip(reference_shift.CHANNELS, off))
    locked, at = np.array(shift.locked), 1e-3 * np.arange(1, AFTER + 1)
    expected = np.repeat([[mode == reference_shift.STUCK for mode in shift.start.modes]], AFTER, axis=0)
    for t, k, mode in events:
        expected[at >= t, k] = mode == reference_shift.STUCK
    new = shift.order[2] - 1
    assert expected[-1, new] and not expected[0, new] and not expected[-1, 1 - new]
    assert np.count_nonzero(locked != expected) <= 1, "an event just beside a whole millisecond"


@pytest.mark.campaign
def test_the_reference_is_converged(shift, reference, monkeypatch):
    """Another method, and a tenth of the tolerance, of PULL and of FILLED."""
    first = shift.metrics(reference[0])
    monkeypatch.setattr(reference_shift, "PULL", 1e-7)
    monkeypatch.setattr(reference_shift, "FILLED", 1e-11)
    for method, rtol, pieces in (("LSODA", 1e-9, 1), ("Radau", 1e-9, 10), ("BDF", 1e-8, 10)):
        rows, _ = reference_shift.solve(shift.config, shift.start, shift.duty, rtol, method, pieces)
        assert not far_apart(shift.metrics(rows), first, 5e-4)


@pytest.mark.campaign
@pytest.mark.parametrize(
    "old, new, rpm, load", [(1, 2, 1000, 30), (1, 2, 1800, 100), (1, 2, 2000, 60), (2, 1, 1000, 60), (2, 1, 1800, 120)]
)
def test_other_speeds_and_loads(old, new, rpm, load):
    shift = RigShift(whole_rig(), old, new, rpm, load)
    rows, _ = reference_shift.solve(shift.config, shift.start, shift.duty)
    rig, other = (shift.metrics(x) for x in (shift.channels[10 * BEFORE :], rows))
    assert other["valid"], other["why"]
    assert not far_apart(rig, other, CLOSE)
