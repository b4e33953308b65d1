# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Difference of the rig's channels from the true values: each transducer's error, hum, pickup and steps, one by one."""

import math

import numpy as np
import pytest

from rig_nodes.base.errors import RigError
from rig_nodes.rig.configuration import load_rig
from rig_nodes.runs.rig import Rig

RPM = math.pi / 30
CHANNELS = Rig(load_rig("hydmag")).channels
QUIET = {
    f"instruments.{name}": value
    for name, value in {
        "torque_noise": "0 Nm",
        "torque_class": "0 %",
        "torque_hum": "0 Nm",
        "speed_noise": "0 rpm",
        "speed_step": "0 rpm",
        "p1_noise": "0 Pa",
        "p1_class": "0 %",
        "p1_hum": "0 Pa",
        "p1_pickup": "0 Pa",
        "p2_noise": "0 Pa",
        "p2_class": "0 %",
        "p2_hum": "0 Pa",
        "p2_pickup": "0 Pa",
        "p_po_noise": "0 Pa",
        "p_po_class": "0 %",
        "current_noise": "0 A",
        "temperature_offset": "0 degC",
        "temperature_gain": "0 %",
        "anti_alias": "0 Hz",
        "resolution_bits": "0 -",
    }.items()
}
# largest errors of tab. 7.1 and, for 40 degC, of (7.2), without the 0.01 Nm and the 1 MPa of reading by eye
LARGEST = {"M_wej": 1.0, "M_wyj": 1.0, "p1": 0.1e6, "p2": 0.0625e6, "p_po": 0.2e6, "T_oil": 0.5}


def rows(rig, seconds: float) -> np.ndarray:
    """Returns the logger's rows of the next seconds, at most one, with all channels."""
    first = rig.sample * 10 + 1
    rig.advance(seconds)
    return rig.rows_at(1e-4, first, round(seconds * 1e4)).copy()


def column(values, name: str) -> np.ndarray:
    return values[:, list(CHANNELS).index(name)]


def only(seed=1, **parts) -> Rig:
    """Returns a rig whose instruments have only these parts."""
    return Rig(load_rig("hydmag", QUIET | {f"instruments.{name}": value for name, value in parts.items()}), seed)


def turned(rig, rpm: float = 1500.0) -> Rig:
    """Returns a rig with oil, in gear I, at a speed and under a load."""
    rig.set("oil", 4e6, True)
    rig.advance(0.3)
    rig.order_gear(1)
    rig.advance(1.0)
    rig.set("motor", rpm * RPM, True)
    rig.set("load", 5e6, True)
    rig.advance(3.5)
    return rig


def truth(rig) -> dict:
    return {
        "M_wej": rig.shown_truly("M_wej"),
        "n_wej": rig.true("w0.speed"),
        "M_wyj": rig.true("M_wyj"),
        "n_wyj": rig.true("wk.speed"),
        "p1": rig.line_pressure(0),
        "p2": rig.line_pressure(1),
        "p_po": rig.load["pressure"],
        "I_zr_p1": rig.valves[0]["current"],
        "p_p": rig.oil["pressure"],
        "T_oil": rig.device("oil_supply")["oil_temperature"],
    }


def test_without_transducers_every_channel_shows_the_truth():
    shown = [turned(Rig(load_rig("hydmag", {"effects.transducers": "off"}), seed)) for seed in (1, 2)]
    for name, value in truth(shown[0]).items():
        assert shown[0].measurement(name) == value
    assert np.array_equal(shown[0].row(), shown[1].row()), "no seed is left in them"
    with pytest.raises(RigError, match="shows true values"):
        shown[0].set_value("instruments.noise", True)


def test_each_part_is_left_out_by_its_zero():
    rig = turned(only())
    for name, value in truth(rig).items():
        assert rig.measurement(name) == value


def test_class_errors_stay_in_a_run_and_inside_the_largest_error_of_7_1():
    classes = {
        "torque_class": "0.2 %",
        "p1_class": "0.25 %",
        "p2_class": "0.25 %",
        "p_po_class": "0.5 %",
        "temperature_offset": "0.3 degC",
        "temperature_gain": "0.5 %",
    }
    zeros = []
    for seed in range(1, 21):
        standing = rows(only(seed, **classes), 0.01)
        assert np.ptp(standing, axis=0).max() < 1e-3  # Pa that the oil keeps, K by which it cools
        zeros.append(standing[0])
    for name, largest in LARGEST.items():
        errors = column(np.array(zeros), name) - (40.0 if name == "T_oil" else 0.0)
        # the zero error of torque meters and pressure transducers is half of the class; (7.2) has none at 40 degC
        most = largest if name == "T_oil" else 0.5 * largest
        assert 0.5 * most < np.abs(errors).max() <= most and errors.min() < 0.0 < errors.max()
    assert abs(np.corrcoef(column(np.array(zeros), "M_wej"), column(np.array(zeros), "M_wyj"))[0, 1]) < 0.6


def test_a_class_error_has_a_gain_as_well_as_an_offset():
    for seed in (1, 2, 3):
        rig = only(seed, p1_class="0.25 %")
        offset = rig.measurement("p1")
        turned(rig)
        grown = rig.measurement("p1") - rig.line_pressure(0) - offset
        assert 0.0 < abs(grown) <= 0.00125 * rig.line_pressure(0)


def test_hum_is_on_torques_and_pressures_with_the_amplitude_that_is_set():
    """A second of a standing rig has a sine of 50 Hz by Fourier, and its third and fifth harmonics of 0.3 and 0.15 of it."""
    seen = rows(only(torque_hum="0.1 Nm", p1_hum="8 kPa", p2_hum="5 kPa", p1_class="0.25 %", p2_class="0.25 %"), 1.0)
    t = 1e-4 * np.arange(len(seen))
    for name, amplitude in (("M_wej", 0.1), ("M_wyj", 0.1), ("p1", 8e3), ("p2", 5e3)):
        lines = [2.0 * abs(np.mean(column(seen, name) * np.exp(-2j * np.pi * f * t))) for f in (50, 100, 150, 250)]
        assert lines == pytest.approx(amplitude * np.array([1.0, 0.0, 0.3, 0.15]), rel=1e-6, abs=1e-6 * amplitude)
    assert np.all(column(seen, "n_wej") == 0.0) and np.all(column(seen, "I_zr_p1") == 0.0)


def pulses(rig) -> np.ndarray:
    """Returns the addition to p1 in 20 ms at half duty on ZR-P1."""
    for sample in range(100):
        rig.set_duty(sample, [0.5, 0.0, 0.0], [0.5, 0.0, 0.0], 1, True)
        rig.advance_samples(1)
    found = []
    for sample in range(100, 120):
        rig.set_duty(sample, [0.5, 0.0, 0.0], [0.5, 0.0, 0.0], 1, True)
        found.append(rows(rig, 1e-3))
    found = np.concatenate(found)
    assert np.abs(column(found, "p2")).max() < 1e-4, "the other coil is off"
    return column(found, "p1")


def test_the_coil_induces_its_pulses_in_its_own_pressure_though_the_plant_takes_their_mean():
    """At 1 kHz and duty 0.5 without oil: five rows up, five down, half of the height each way."""
    quiet = {"p1_pickup": "20 kPa", "p1_class": "0.25 %", "p2_pickup": "12.5 kPa"}
    config = load_rig(
        "hydmag", QUIET | {"alfa46.pwm_frequency": "1 kHz"} | {f"instruments.{name}": value for name, value in quiet.items()}
    )
    rig = Rig(config, controller="external")
    zero = rig.measurement("p1")
    induced = pulses(rig) - zero
    assert induced == pytest.approx(np.tile([1e4] * 5 + [-1e4] * 5, 20), abs=1e-3)
    assert set(np.round([valve["on"] for valve in rig.valves], 12)) == {0.5, 0.0}, "the plant's own coil has the mean"


def test_an_encoder_shows_whole_rpm_around_the_true_speed():
    rig = turned(only(speed_step="1 rpm"), 1000.0)
    shown = column(rows(rig, 0.5), "n_wyj") / RPM
    assert np.abs(shown - np.round(shown)).max() < 1e-6 and len(np.unique(np.round(shown))) == 2
    true = rig.true("wk.speed") / RPM
    assert np.abs(shown - true).max() < 1.05 and shown.mean() == pytest.approx(true, abs=0.05)


def test_the_converter_divides_the_range_and_shows_errors_below_zero():
    parts = {"p1_class": "0.25 %", "p1_noise": "5 kPa", "resolution_bits": "12 -"}
    seen = [rows(only(seed, **parts), 0.1) for seed in range(1, 9)]
    for values in seen:
        steps = column(values, "p1") / (40e6 / 4096)
        assert np.abs(steps - np.round(steps)).max() < 1e-9
    assert min(column(values, "p1").min() for values in seen) < 0.0


def test_noise_off_takes_hum_and_pickup_too_and_leaves_the_class_error():
    rig = Rig(load_rig("hydmag"))
    assert np.ptp(column(rows(rig, 0.1), "p1")) > 20e3
    rig.set_value("instruments.noise", False)
    rows(rig, 0.01)
    standing = column(rows(rig, 0.1), "p1")
    assert np.ptp(standing) == 0.0 and standing[0] != 0.0
    rig.set_value("instruments.noise", True)
    assert np.ptp(column(rows(rig, 0.1), "p1")) > 20e3


def test_transducers_change_nothing_of_the_plant_but_what_the_current_loop_reads():
    with_them, without = (
        turned(only(**parts))
        for parts in (
            {
                "p1_class": "0.25 %",
                "torque_class": "0.2 %",
                "torque_hum": "0.1 Nm",
                "speed_step": "1 rpm",
                "anti_alias": "1 kHz",
                "p1_pickup": "20 kPa",
            },
            {},
        )
    )
    assert np.array_equal(with_them.v, without.v) and with_them.clutches == without.clutches


def test_a_gate_that_is_no_whole_number_of_rows_is_refused():
    with pytest.raises(RigError, match=r"speed_gate of 2\.05 ms is no whole number of the plant's steps of 100 us"):
        only(speed_step="1 rpm", speed_gate="2.05 ms")


def test_each_encoder_counts_over_the_gate_of_its_own_entry(tmp_path):
    (tmp_path / "rig.yaml").write_text(
        "description: a slow encoder at the output\nbase: hydmag\ntransducers: {n_wyj: {like: n_out}}\n"
        "instruments: {n_out_range: [3600 rpm, x], n_out_step: [1 rpm, x], n_out_gate: [20 ms, x]}\n"
    )

    def speeds(name: str) -> np.ndarray:
        rig = Rig(load_rig(name))
        rig.set("oil", 4e6, True)
        rig.advance(0.3)
        rig.order_gear(1)
        rig.set("motor", 50.0, True)
        return rows(rig, 0.6)

    slow, quick = speeds(tmp_path), speeds("hydmag")
    assert np.array_equal(column(slow, "n_wej"), column(quick, "n_wej"))
    # the mean over 20 ms in place of those over 2 ms: ten of them
    mean = sum(column(quick, "n_wyj")[200 - 20 * k : 6000 - 20 * k] for k in range(10)) / 10.0
    assert np.ptp(mean) > 20.0
    assert np.abs(column(slow, "n_wyj")[200:6000] - mean).max() < 1.5 * RPM
    assert np.abs(column(quick, "n_wyj")[200:6000] - mean).max() > 5.0 * RPM
    with pytest.raises(RigError, match=r"instruments\.n_out_gate of 2\.05 ms is no whole number"):
        Rig(load_rig(tmp_path, {"instruments.n_out_gate": "2.05 ms"}))
