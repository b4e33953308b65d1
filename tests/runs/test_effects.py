# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Each effect of the thesis's list is left out of one shift: the values that it affects change, and earlier values do not."""

import dataclasses
import math

import numpy as np
import pytest

from rig_nodes.base.errors import RigError
from rig_nodes.controllers import load_controller
from rig_nodes.rig.configuration import load_rig
from rig_nodes.runs.rig import Rig
from rig_nodes.runs.simulation import advance_with

RPM = math.pi / 30.0
SPEED = 1200 * RPM
CHANNELS = ("current", "setpoint", "line", "piston", "clamp", "held", "kinetic", "static", "drag", "temperature", "wear")
# effects of a measurable size, independent of the rig's own values; the oil is colder than the temperature of its given viscosity.
# Neither speed nor heat of the shafts acts back on the pistons
STRONG = {
    "loss_in.share": "5 %",
    "loss_out.drag": "1 Nm",
    "loss_out.share": "5 %",
    "loss_out.torque_side": "driven",
    "plate_pack.friction_per_kelvin": "-0.2 %/K",
    "plate_pack.friction_temperature": "20 degC",
    "plate_pack.wear_rate": "0.003 um/MJ",
    "plate_pack.friction_spline": "0.12 -",
    "plate_pack.rest_torque": "0 Nm",
    "oil_supply.viscosity_temperature": "40 degC",
    "oil_supply.second_viscosity": "9 mPa s",
    "oil_supply.second_temperature": "100 degC",
    "oil_supply.temperature": "30 degC",
    "oil_supply.tank_heat_capacity": "0 J/K",
    **{f"valve_zr_p{k}.hysteresis": "8 %" for k in (1, 2)},
    **{
        f"clutch_s{k}.{name}": value
        for k in (1, 2)
        for name, value in (
            ("seal_friction", "200 N"),
            ("seal_friction_share", "2 %"),
            ("friction_model", "thesis"),
            ("centrifugal_radius", "0 mm"),
        )
    },
}


class Shift:
    """A shift from I to II at 1200 rpm and 60 Nm, recorded once a millisecond from the order on.

    Arrays (samples, 2 clutches) are named as in CHANNELS; n_wej, m_wej and loss_out are (samples,). ``modes`` holds for each
    clutch the modes that it went through, ``ripple`` that of the coil current of ZR-P2 [A] over the last 20 logger rows, and
    ``energy`` the energies at the end.
    """

    def __init__(self, config):
        rig = Rig(config)
        rig.set("oil", 4e6, True)
        rig.advance(0.3)
        rig.order_gear(1)
        rig.advance(1.0)
        rig.set("motor", SPEED, True)
        rig.advance(3.0)
        rig.set("load", 3.6e6, True)
        rig.advance(2.0)
        assert rig.locked_gear() == 1
        rig.order_gear(2)
        rows, alone, self.modes = [], [], ([], [])
        for _ in range(1500):
            rig.advance_samples(1)
            clutches = [
                [rig.line_pressure(k) if name == "line" else float(rig.clutches[k][name]) for k in range(2)]
                for name in CHANNELS[2:]
            ]
            rows.append([[float(valve["current"]) for valve in rig.valves], rig.setpoint[[0, 1]], *clutches])
            alone.append(
                (rig.true("rotor.speed"), rig.true("w0.speed"), rig.shown_truly("M_wej"), rig.device("loss_out")["torque"])
            )
            for k in range(2):
                if self.modes[k][-1:] != [rig.clutch_mode(k)]:
                    self.modes[k].append(rig.clutch_mode(k))
        for name, values in zip(CHANNELS, np.moveaxis(np.array(rows), 1, 0), strict=True):
            setattr(self, name, values)
        self.rotor, self.n_wej, self.m_wej, self.loss_out = np.array(alone).T
        self.ripple = np.ptp(rig.rows_at(1e-4, 10 * rig.sample - 19, 20)[:, rig.channels.index("I_zr_p2")])
        self.energy = rig.energy()


@pytest.fixture(scope="module")
def strong(noiseless):
    return noiseless(load_rig("hydmag", STRONG))


@pytest.fixture(scope="module")
def whole(strong):
    """The shift with every effect on the plant except the resolved pulses, which do not belong to the rig's own settings."""
    effects = dataclasses.replace(
        strong.effects,
        pwm_frequency=0.0,
        **{f.name: f.name != "transducers" for f in dataclasses.fields(strong.effects) if f.type == "bool"},
    )
    return Shift(strong.replaced(effects=effects))


def without(config, name, value=False):
    return Shift(config.replaced(effects=dataclasses.replace(config.effects, **{name: value})))


def largest(difference):
    return float(np.abs(difference).max())


# ---- checks of what an effect changes: (with it, without it)


def current_follows_the_setpoint(on, off):
    """The current is the setpoint of the sample before, as every answer acts one sample later."""
    assert largest(off.current[1:] - off.setpoint[:-1]) == 0.0
    assert largest(on.current[1:] - on.setpoint[:-1]) > 10e-3


def test_without_the_current_loop_setpoints_act_alike_from_inside_and_outside_and_a_duty_is_refused(noiseless):
    config = noiseless(load_rig("hydmag", {"effects.current_loop": "off"}))
    inside, box = Rig(config), load_controller("alfa46@current", config)
    outside = Rig(config, controller="external", level=None)
    for rig in (inside, outside):
        rig.set("oil", 4e6, True)
    with pytest.raises(RigError, match="current_loop=off makes the coil current follow its setpoint.*--level current"):
        outside.set_duty(0, (0.5, 0.0, 0.0), (0.3, 0.0, 0.0), 1, True)
    with pytest.raises(RigError, match="current_loop=off"):
        Rig(config, controller="external", level="duty")
    inside.order_gear(1)
    box.order(1)
    for _ in range(400):
        inside.advance_samples(1)
        advance_with(outside, box)
    assert inside.valves[0]["current"] > 0.2 and inside.measurement("p1") > 1e6
    assert outside.valves[0]["current"] == inside.valves[0]["current"]
    assert outside.measurement("p1") == inside.measurement("p1")


def speed_stays(on, off):
    assert largest(off.rotor - SPEED) < 1e-3 * RPM
    assert largest(on.n_wej - SPEED) > 5 * RPM
    # The torque that holds the speed is not counted: the work is that of the same test with the drive, and the balance closes.
    assert off.energy["motor"] == pytest.approx(on.energy["motor"], rel=0.03)
    assert abs(off.energy["residual"]) < 1e-6 * off.energy["motor"]


def no_loss_by_torque(on, off):
    """Without a load, the loss on the driven side is 1 Nm on the z5 axis, and it stays."""
    assert off.loss_out == pytest.approx(41 / 40)
    assert on.loss_out[-1] > 41 / 40 + 2.0 and np.ptp(on.loss_out) > 0.1
    assert off.m_wej[-1] < on.m_wej[-1] - 3.0


def magnet_has_one_line(on, off):
    """A falling p1 comes later with hysteresis: its currents are lower at the same pressure."""
    p = 1e6
    with_it, without_it = (s.current[np.flatnonzero(s.line[:, 0] > p)[-1], 0] for s in (on, off))
    assert with_it < without_it - 10e-3


def piston_goes_where_its_springs_want_it(on, off):
    """The kiss point of the rising S2 comes at a higher pressure with the friction of its seals, 80 kPa at rest."""
    with_it, without_it = (s.line[np.flatnonzero(s.clamp[:, 1] > 0.0)[0], 1] for s in (on, off))
    assert with_it > without_it + 40e3


def force_follows_the_clamp(on, off):
    """During the release of S1 its plates stick on their splines, and so the force on them is larger than that of the piston."""
    falling = (off.clamp[:, 0] < 0.7 * off.clamp[0, 0]) & (off.clamp[:, 0] > 100.0)
    without_it, with_it = (s.held[falling, 0] / s.clamp[falling, 0] for s in (off, on))
    assert without_it == pytest.approx(1.0)
    assert with_it.max() > 1.5 and with_it.min() > 1.1
    assert (on.kinetic[falling, 0] > off.kinetic[falling, 0]).all(), "it acts on a slipping pack too"


def oil_is_as_thick_when_cold(on, off):
    """Before the shift S2 is open with the same gap in both: its plates are colder, and the oil is thicker by ASTM D341."""

    def doubled_logarithm(viscosity):
        return math.log10(math.log10(1e6 * viscosity / 870.0 + 0.7))

    cold, hot = doubled_logarithm(0.08), doubled_logarithm(0.009)
    kelvin = on.temperature[0, 1] + 273.15
    between = cold + (hot - cold) * math.log(kelvin / 313.15) / math.log(373.15 / 313.15)
    by_hand = 870e-6 * (10.0 ** (10.0**between) - 0.7) / 0.08
    assert on.drag[0, 1] / off.drag[0, 1] == pytest.approx(by_hand, rel=1e-4) and by_hand > 1.2
    late = [np.flatnonzero(s.line[:, 1] > 1e6)[0] for s in (on, off)]
    assert late[0] > late[1], "thicker oil fills S2 later"


def friction_is_that_of_cold_plates(on, off):
    warm = on.temperature[-1, 1] - 20.0  # friction_temperature
    assert warm > 0.5
    # the last of the oil is still being squeezed out, sooner where it is warmer
    assert on.kinetic[-1, 1] / off.kinetic[-1, 1] == pytest.approx(1.0 - 0.002 * warm, rel=1e-4)


def nothing_wears(on, off):
    assert largest(off.wear) == 0.0 and on.wear[-1].min() > 0.0


BEFORE_THE_MAGNET = ("setpoint", "current")
BEFORE_THE_PLATES = (*BEFORE_THE_MAGNET, "line", "piston", "clamp")
TABLE = [
    ("current_loop", current_follows_the_setpoint, ("setpoint",)),
    ("motor_speed", speed_stays, BEFORE_THE_PLATES),
    ("torque_losses", no_loss_by_torque, BEFORE_THE_PLATES),
    ("valve_hysteresis", magnet_has_one_line, BEFORE_THE_MAGNET),
    ("seal_friction", piston_goes_where_its_springs_want_it, BEFORE_THE_MAGNET),
    ("spline_hysteresis", force_follows_the_clamp, BEFORE_THE_PLATES),
    ("oil_temperature", oil_is_as_thick_when_cold, BEFORE_THE_MAGNET),
    ("plate_heat", friction_is_that_of_cold_plates, BEFORE_THE_PLATES),
    ("wear", nothing_wears, BEFORE_THE_PLATES),
]


@pytest.mark.parametrize("name, changes, unmoved", TABLE, ids=[row[0] for row in TABLE])
def test_an_effect_that_is_left_out(strong, whole, name, changes, unmoved):
    off = without(strong, name)
    changes(whole, off)
    for channel in unmoved:
        # of the shafts' effects only wear, a few nanometres, acts back on the pistons
        size = largest(getattr(whole, channel))
        assert largest(getattr(off, channel) - getattr(whole, channel)) < 1e-6 * size, channel
    for s1, s2 in (off.modes, whole.modes):
        # without a loss by torque, or with thin oil, S1 locks once more before it opens
        assert s1 in ([2, 1, 0], [2, 1, 2, 1, 0]) and s2 == [0, 1, 2], "S1 slips and opens, S2 grips and locks"


def test_every_effect_is_in_the_table(strong):
    # transducers act only on the channels, see test_gauges
    assert {row[0] for row in TABLE} | {"pwm_frequency", "transducers"} == {f.name for f in dataclasses.fields(strong.effects)}


def test_resolved_pulses_make_a_ripple_of_current(strong, whole):
    """The pulse is on for the share d of 1 ms, so the current swings by d (1 - d) U / L times that."""
    resolved, valve = without(strong, "pwm_frequency", 1000.0), strong.valve_zr_p2
    duty = resolved.setpoint[-1, 1] * valve.coil_resistance / valve.coil_voltage
    by_hand = duty * (1 - duty) * valve.coil_voltage / valve.coil_inductance * 1e-3
    # rows that do not meet the turning points show a little less
    assert resolved.ripple == pytest.approx(by_hand, rel=0.2) and whole.ripple < 0.01 * by_hand
    assert resolved.modes == whole.modes


def test_the_energy_of_a_shift_balances_to_rounding(whole):
    """Each heat is integrated from its own torque and slip, none is a difference of others."""
    heat = whole.energy["heat_s1"] + whole.energy["heat_s2"]
    assert heat > 100.0 and whole.energy["loss_in"] > 100.0 and whole.energy["loss_out"] > 100.0
    assert abs(whole.energy["residual"]) < 1e-11 * whole.energy["motor"]
