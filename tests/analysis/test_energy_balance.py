# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Energy balance of a window, compared with an account by hand."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from rig_nodes.analysis.energy import balance, energies_of
from rig_nodes.base.errors import RigError
from rig_nodes.rig.configuration import load_rig
from rig_nodes.rig.transmission import Inertias

BOX = load_rig("hydmag").transmission

T = np.arange(0.0, 2.0001, 0.005)


def account(leak=0.0):
    """Returns an account of 500 W in; 300 W load, 120 + 30 W clutch heat, 10 W losses, `leak` W lost, the rest stored."""
    return {
        "motor_work": (T, 500.0 * T),
        "load_work": (T, 300.0 * T),
        "heat_s1": (T, 120.0 * T),
        "heat_s2": (T, 30.0 * T),
        "heat_losses": (T, 10.0 * T),
        "stored_kinetic": (T, (40.0 - leak) * T),
    }


def test_closed_account():
    result = balance(account(), 0.5, 1.5, BOX)
    assert result["motor_work_j"] == pytest.approx(500.0)
    assert result["stored_kinetic_j"] == pytest.approx(40.0)
    assert result["stored_hydraulic_j"] is None
    assert result["residual_j"] == pytest.approx(0.0, abs=1e-9)


def test_missing_energy_shows_as_a_share_of_the_clutch_heat():
    result = balance(account(leak=3.0), 0.5, 1.5, BOX)
    assert result["residual_j"] == pytest.approx(3.0)
    assert result["residual_of_heat"] == pytest.approx(3.0 / 150.0)
    with_hydraulic = account(leak=3.0) | {"stored_hydraulic": (T, 3.0 * T)}
    assert balance(with_hydraulic, 0.5, 1.5, BOX)["residual_j"] == pytest.approx(0.0, abs=1e-9)


def test_window_is_widened_to_samples_and_cut_to_the_recording():
    result = balance(account(), 0.5012, 1.4988, BOX)
    assert (result["t_start_s"], result["t_end_s"]) == (pytest.approx(0.5), pytest.approx(1.5))
    assert balance(account(), 0.5, 1.5, BOX)["t_start_s"] == pytest.approx(0.5)
    assert balance(account(), 1.5, 9.0, BOX)["t_end_s"] == pytest.approx(2.0)


def test_no_clutch_heat_has_no_share():
    still = dict.fromkeys(account(), (T, 0.0 * T))
    assert balance(still, 0.0, 1.0, BOX)["residual_of_heat"] is None


def test_what_cannot_be_balanced_is_said():
    incomplete = account()
    del incomplete["heat_s2"]
    with pytest.raises(RigError, match="has no heat_s2"):
        balance(incomplete, 0.0, 1.0, BOX)
    with pytest.raises(RigError, match="3.000 s to 4.000 s"):
        balance(account(), 3.0, 4.0, BOX)


def test_energies_out_of_a_bag():
    def fields(topic, names):
        values = topics.get(topic)
        return (T, [values[name] for name in names]) if values else (T[:0], [T[:0] for _ in names])

    topics = {
        "/motor/state": {"work": 500.0 * T},
        "/load_pump/state": {"work": 300.0 * T},
        "/clutch_s1/state": {"heat": 120.0 * T},
        "/clutch_s2/state": {"heat": 30.0 * T},
        "/gearbox/state": {"heat": 10.0 * T, "speed_in": 100.0 + T, "speed_out": 80.0 - T},
    }
    bag = SimpleNamespace(fields=fields, structure=load_rig("chapter9").structure, transmission=BOX)  # all turns with its shafts
    box = replace(BOX, inertias=Inertias(driving=2.0, driven=1.0, reduction=41 / 40))
    energies = energies_of(bag, box)
    result = balance(energies, 0.0, 1.0, BOX)
    stored = (101.0**2 - 100.0**2) + 0.5 * (41 / 40) ** 2 * (79.0**2 - 80.0**2)
    assert result["stored_kinetic_j"] == pytest.approx(stored)
    assert result["residual_j"] == pytest.approx(500.0 - 460.0 - stored)
    del topics["/motor/state"]
    with pytest.raises(RigError, match="has no motor_work"):
        balance(energies_of(bag, BOX), 0.0, 1.0, BOX)
