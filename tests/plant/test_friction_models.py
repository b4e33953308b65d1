# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The clutch models of chapter 6, compared with hand computations from the source and with their limits; chapter 8's bench."""

import math
import runpy
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rig_nodes.base.errors import RigError
from rig_nodes.plant.friction import bench, closed, drag
from rig_nodes.plant.friction.geometry import PackGeometry
from rig_nodes.plant.parts import plates
from rig_nodes.rig.configuration import load_rig
from rig_nodes.rigs.hydmag.laboratory import comparison
from rig_nodes.rigs.hydmag.laboratory.packs import PACKS

PICTURES = Path(__file__).parents[2] / "docs" / "pictures" / "friction_models.py"
GEARBOX = PackGeometry(12.0, 25e-3, 38e-3, 42e-3, 80e-3, 30.0)  # tab. 3.3
ONE = replace(GEARBOX, surfaces=1.0)
R_M = 2 * (38**3 - 25**3) / (3 * (38**2 - 25**2)) * 1e-3  # 31.9471 mm, (6.5)
COS30 = math.sqrt(3) / 2


def torque_by_balance(surfaces, radius, arms, friction, spline):
    """Returns the torque per force [Nm/N] from every plate's axial balance as one linear system.

    Plate p is between surfaces p - 1 and p, and its spline takes the force spline * (torque of both) / arm; ``arms`` and
    ``spline`` are those of the first plate and of the second.
    """
    balance, clamp = np.zeros((surfaces, surfaces)), np.zeros(surfaces)
    for p in range(surfaces):
        loss = spline[p % 2] * friction * radius / arms[p % 2]
        balance[p, p] = 1 + loss
        if p:
            balance[p, p - 1] = -(1 - loss)
    clamp[0] = 1.0
    return friction * radius * np.linalg.solve(balance, clamp).sum()


# ---- closed


def test_traditional_is_pressure_times_the_ring_integral():
    pressure = 5000.0 / (math.pi * (0.038**2 - 0.025**2))  # (6.29)
    by_pressure = 12 * 2 / 3 * math.pi * pressure * 0.17 * (0.038**3 - 0.025**3)  # (6.13), (6.27)
    assert closed.traditional(GEARBOX, 5000.0, 0.17) == pytest.approx(by_pressure, rel=1e-12)


def test_osinski_follows_its_table():
    table = {2: 1.0, 3: 0.97, 4: 0.94, 5: 0.91, 6: 0.88, 7: 0.85, 8: 0.82, 9: 0.79, 10: 0.76}  # tab. 6.1
    assert closed.osinski_factor(list(table)) == pytest.approx(list(table.values()), abs=1e-12)
    for n in (2, 7, 10):
        pack = replace(GEARBOX, surfaces=n)
        by_hand = table[n] * n * 0.3 * R_M * 1000.0
        assert closed.osinski(pack, 1000.0, 0.3) == pytest.approx(by_hand, rel=1e-12)


def test_osinski_carried_on_peaks_at_18_and_ends_after_35():
    n = np.arange(2, 37)
    product = n * closed.osinski_factor(n)
    assert n[product.argmax()] == 18
    assert list(n[product < 0]) == [36]
    with pytest.raises(ValueError, match="table has 2 to 10 surfaces, not 12"):
        closed.osinski(GEARBOX, 1000.0, 0.3)
    with pytest.raises(ValueError, match="no meaning"):
        closed.osinski(replace(GEARBOX, surfaces=36), 1000.0, 0.3, beyond_table=True)


@pytest.mark.parametrize("friction, torque", [(0.17, 0.0478), (0.30, 0.0682)])
def test_thesis_on_the_gearbox_pack(friction, torque):
    assert closed.thesis(GEARBOX, 1.0, friction, 0.12) == pytest.approx(torque, abs=5e-5)


def test_first_surfaces_by_hand():
    # mu 0.30, splines 0.12: C = 9.58413 mm, C mu_sp = 1.150096 mm, a = 34.6410 mm, b = 18.1865 mm
    first = 9.58413e-3 / (1 + 1.150096 / 34.6410)  # (6.37) divided by d_po/2 cos(alpha)
    second = first * (18.1865 - 1.150096) / (18.1865 + 1.150096)  # (6.44)
    third = second * (34.6410 - 1.150096) / (34.6410 + 1.150096)  # (6.52)
    for n, total in ((1, first), (2, first + second), (3, first + second + third)):
        assert closed.thesis(replace(GEARBOX, surfaces=n), 1.0, 0.3, 0.12) == pytest.approx(total, rel=1e-5)


@pytest.mark.parametrize("surfaces", [1, 2, 3, 10, 11, 18])
def test_models_with_spline_friction_meet_the_balance_of_every_plate(surfaces):
    pack, arms = replace(GEARBOX, surfaces=surfaces), (0.040 * COS30, 0.021 * COS30)
    balance = torque_by_balance(surfaces, R_M, arms, 0.3, (0.12, 0.12))
    assert closed.thesis(pack, 1.0, 0.3, 0.12) == pytest.approx(balance, rel=1e-12)
    balance = torque_by_balance(surfaces, R_M, arms, 0.3, (0.08, 0.15))
    assert closed.thesis(pack, 1.0, 0.3, 0.08, 0.15) == pytest.approx(balance, rel=1e-12)
    balance = torque_by_balance(surfaces, R_M, arms, 0.3, (-0.12, -0.12))
    assert closed.thesis(pack, 1.0, 0.3, 0.12, releasing=True) == pytest.approx(balance, rel=1e-12)
    # Newcomb: first plate on the shaft, straight splines, friction at the mean of their radii
    balance = torque_by_balance(surfaces, 30.5e-3, (0.021, 0.040), 0.3, (0.12, 0.12))
    assert closed.newcomb(pack, 1.0, 0.3, 0.12) == pytest.approx(balance, rel=1e-12)


def test_chen_by_the_pressures_of_neighbouring_surfaces():
    """(6.20) from plate to plate; (6.21) is summed over the plates with inner splines, which together have every surface once."""
    area, factor = math.pi * (0.038**2 - 0.025**2), 2 / 3 * math.pi * 0.3 * (0.038**3 - 0.025**3)
    pressures, lost = [2000.0 / area], 0.0
    for plate in range(12):
        before = pressures[-1]
        if plate % 2:  # the inner spline takes no force
            pressures.append(before)
            continue
        below = before
        for _ in range(200):  # iterated, because F_ch depends on the pressure that it leaves
            torque = factor * ((before if plate else 0.0) + below)
            lost = 0.12 * torque / (0.040 * COS30)
            below = before - lost / area
        pressures.append(below)
    surfaces = pressures[1:]
    inner_plates = sum(factor * (surfaces[i] + surfaces[i + 1]) for i in range(0, 12, 2))
    assert closed.chen(GEARBOX, 2000.0, 0.3, 0.12) == pytest.approx(inner_plates, rel=1e-9)


@pytest.mark.parametrize("surfaces", [1, 2, 12])
def test_without_spline_friction_all_agree(surfaces):
    pack = replace(GEARBOX, surfaces=surfaces)
    plain = closed.traditional(pack, 3000.0, 0.17)
    assert closed.thesis(pack, 3000.0, 0.17, 0.0) == pytest.approx(plain, rel=1e-12)
    assert closed.chen(pack, 3000.0, 0.17, 0.0) == pytest.approx(plain, rel=1e-12)
    assert closed.newcomb(pack, 3000.0, 0.17, 0.0) == pytest.approx(plain * 30.5e-3 / R_M, rel=1e-12)
    assert closed.newcomb(pack, 3000.0, 0.17, 1e-13) == pytest.approx(plain * 30.5e-3 / R_M, rel=1e-9)


@pytest.mark.parametrize("surfaces, ratio", [(16, 0.88), (18, 0.91)])
def test_thesis_over_osinski_on_the_gearbox_plates(surfaces, ratio):
    pack = replace(GEARBOX, surfaces=surfaces)
    found = closed.thesis(pack, 1.0, 0.3, 0.12) / closed.osinski(pack, 1.0, 0.3, beyond_table=True)
    assert found == pytest.approx(ratio, abs=5e-3)


def test_order_of_the_models_and_direction_of_every_influence():
    mu, packs = np.linspace(0.05, 0.4, 15), [replace(GEARBOX, surfaces=n) for n in range(1, 31)]
    thesis, chen = closed.thesis(GEARBOX, 1.0, mu, 0.12), closed.chen(GEARBOX, 1.0, mu, 0.12)
    released = closed.thesis(GEARBOX, 1.0, mu, 0.12, releasing=True)
    plain = closed.traditional(GEARBOX, 1.0, mu)
    assert np.all((thesis < chen) & (chen < plain) & (plain < released))
    assert np.all(np.diff(thesis) > 0)
    assert np.all(np.diff(closed.thesis(GEARBOX, 1.0, 0.3, np.linspace(0.0, 0.5, 11))) < 0)
    assert np.all(np.diff([closed.thesis(pack, 1.0, 0.3, 0.12) for pack in packs]) > 0)
    assert np.all(np.diff([closed.newcomb(pack, 1.0, 0.3, 0.12) for pack in packs]) > 0)


def test_arrays_broadcast():
    force, mu = np.array([[0.0], [1000.0], [5000.0]]), [0.17, 0.30]
    for torque in (
        closed.thesis(GEARBOX, force, mu, 0.12),
        closed.newcomb(GEARBOX, force, mu, 0.12),
        closed.chen(GEARBOX, force, mu, 0.12),
        closed.traditional(GEARBOX, force, np.array(mu)),
    ):
        assert torque.shape == (3, 2)
        assert np.all(torque[0] == 0.0) and np.allclose(torque[2], 5 * torque[1])
    assert isinstance(closed.newcomb(GEARBOX, 1, 0.17, 0.12), float)


def test_corrected_is_the_measured_line():
    assert closed.corrected([0.0, 100.0], 0.95, 20.0) == pytest.approx([20.0, 115.0])  # (6.56)
    with pytest.raises(ValueError, match="factor"):
        closed.corrected(100.0, 0.0, 20.0)
    with pytest.raises(ValueError, match="rest_torque"):
        closed.corrected(100.0, 1.0, -1.0)


@pytest.mark.parametrize(
    "change, message",
    [
        ({"surfaces": 0}, "surfaces is 0"),
        ({"surfaces": 12.5}, "surfaces is 12.5"),
        ({"outer_radius": 0.024}, "outer_radius is 0.024 m, expected more than the 0.025 m of inner_radius"),
        ({"outer_spline_diameter": 0.07}, "outer_spline_diameter is 0.07 m, expected at least the 0.076 m"),
        ({"inner_spline_diameter": 0.06}, "inner_spline_diameter is 0.06 m, expected at most the 0.05 m"),
        ({"pressure_angle_deg": 90.0}, "pressure_angle_deg"),
    ],
)
def test_impossible_packs_are_refused(change, message):
    pack = replace(GEARBOX, **change)
    for call in (
        lambda: closed.thesis(pack, 1.0, 0.3, 0.12),
        lambda: closed.traditional(pack, 1.0, 0.3),
        lambda: closed.newcomb(pack, 1.0, 0.3, 0.12),
        lambda: drag.kitabayashi(pack, 1.0, 0.08, 1e-4),
        lambda: drag.davis_viscous(pack, 1.0, 0.08, 1e-4),
    ):
        with pytest.raises(ValueError, match=message):
            call()


def test_impossible_values_are_refused():
    for force, mu, spline in ((-1.0, 0.3, 0.12), (1.0, -0.3, 0.12), (1.0, 0.3, -0.12), (np.nan, 0.3, 0.12)):
        with pytest.raises(ValueError, match="at least 0"):
            closed.thesis(GEARBOX, force, mu, spline)
    for call in (closed.thesis, closed.newcomb):  # mu mu_sp r_m beyond the arm of the shaft's spline
        with pytest.raises(ValueError, match="clamp force at one plate"):
            call(GEARBOX, 1.0, 0.9, 0.9)


def test_the_rig_uses_these_models_and_refuses_in_one_sentence():
    pack = load_rig("hydmag").plate_pack
    assert plates.torque_per_force(pack, 0.3) == closed.thesis(GEARBOX, 1.0, 0.3, pack.friction_spline)
    drag_at_10 = plates.drag_factor(pack) * 0.08 * 10.0 / 1e-4
    assert drag_at_10 == pytest.approx(drag.kitabayashi(GEARBOX, 10.0, 0.08, 1e-4))
    with pytest.raises(RigError, match="plate_pack: surfaces is 12.5"):
        plates.torque_per_force(replace(pack, surfaces=12.5), 0.3)


# ---- drag: one surface at 100 rad/s with the parameters of fig. 6.5, computed in mm and mPa s

SCALE = 80e-3 * 100 / 0.1e-3  # mu w / h [Pa]


def test_drag_models_by_hand():
    # pi r_m^2 (38^2 - 25^2) = pi * 1020.6166 * 819 mm4; pi/2 (38^4 - 25^4) = pi/2 * 1694511 mm4
    laminar, davis = SCALE * math.pi * 1020.6166 * 819e-12, SCALE * math.pi / 2 * 1694511e-12
    assert drag.kitabayashi(ONE, 100.0, 0.08, 1e-4) == pytest.approx(laminar, rel=1e-6)
    assert drag.davis_viscous(ONE, 100.0, 0.08, 1e-4) == pytest.approx(davis, rel=1e-12)
    # film to 32 mm: 32^2 - 25^2 = 399, 32^4 - 25^4 = 657951, 38^4 - 32^4 = 1036560
    pahlovy = SCALE / 1.1 * math.pi * 1020.6166 * 399e-12
    assert drag.pahlovy(ONE, 100.0, 0.08, 1.1e-4, 0.032) == pytest.approx(pahlovy, rel=1e-6)
    film = SCALE * math.pi / 2 * 657951e-12
    assert drag.peng_yuan(ONE, 100.0, 0.08, 1e-4, 0.032) == pytest.approx(film, rel=1e-12)
    beyond = math.pi / 2 * 1036560e-12 * (0.5 * SCALE + 0.5 * SCALE * 6.53e-4 / 0.08)
    assert drag.iqbal(ONE, 100.0, 0.08, 1e-4, 0.032, 0.5, 6.53e-4) == pytest.approx(film + beyond, rel=1e-12)


def test_davis_and_kitabayashi_differ_by_the_mean_of_the_square():
    """The thesis calls them equal in fig. 6.5; mean of r^2 over r_m^2 is 1034.5 / 1020.6 on the gearbox's ring."""
    ratio = drag.davis_viscous(ONE, 50.0, 0.08, 1e-4) / drag.kitabayashi(ONE, 50.0, 0.08, 1e-4)
    assert ratio == pytest.approx((38**2 + 25**2) / 2 / (R_M * 1e3) ** 2, rel=1e-9)
    assert ratio == pytest.approx(1.0, abs=0.015)


def test_davis_integrals_against_closed_forms():
    # gap k r: integral of mu r^2 w/(k r) 2 pi r dr = 2/3 pi mu w/k (ro^3 - ri^3)
    wedge = drag.davis_viscous(ONE, 100.0, 0.08, lambda r: 4e-3 * r)
    assert wedge == pytest.approx(2 / 3 * math.pi * 0.08 * 100 / 4e-3 * (0.038**3 - 0.025**3), rel=1e-12)
    # pressure p r_0 / r (even wear): integral of mu p r_0/r r 2 pi r dr = pi mu p r_0 (ro^2 - ri^2)
    worn = drag.davis_boundary(ONE, 0.17, lambda r: 1e6 * 0.025 / r)
    assert worn == pytest.approx(math.pi * 0.17 * 1e6 * 0.025 * (0.038**2 - 0.025**2), rel=1e-12)
    even = drag.davis_boundary(ONE, 0.17, 1e6)
    assert even == pytest.approx(closed.traditional(ONE, 1e6 * ONE.area, 0.17), rel=1e-12)
    # film and contact share the ring; flow factors scale only the film
    slip = np.array([-100.0, 100.0])
    both = drag.davis(ONE, slip, 0.08, 1e-4, 0.17, 1e6, 0.25, flow_factor=0.9, flow_shear=0.2)
    expected = 0.75 * 0.7 * drag.davis_viscous(ONE, 100.0, 0.08, 1e-4) + 0.25 * even
    assert both == pytest.approx([-expected, expected], rel=1e-12)


def test_iqbal_with_a_share_that_falls_outwards():
    # phi = (r_z - r) / (r_z - r_0): liquid is the integral of phi r^3
    def share(r):
        return (0.038 - r) / 0.006

    liquid = (0.038 * (0.038**4 - 0.032**4) / 4 - (0.038**5 - 0.032**5) / 5) / 0.006
    film = drag.peng_yuan(ONE, 100.0, 0.08, 1e-4, 0.032)
    torque = drag.iqbal(ONE, 100.0, 0.08, 1e-4, 0.032, share, 0.0)
    assert torque == pytest.approx(film + 2 * math.pi * SCALE * liquid, rel=1e-12)
    half_land = drag.iqbal(ONE, 100.0, 0.08, 1e-4, 0.032, share, 0.0, land_area=ONE.area / 2)
    assert half_land == pytest.approx(torque / 2)


def test_drag_limits():
    whole = drag.davis_viscous(ONE, 100.0, 0.08, 1e-4)
    assert drag.peng_yuan(ONE, 100.0, 0.08, 1e-4, 0.038) == pytest.approx(whole)
    assert drag.iqbal(ONE, 100.0, 0.08, 1e-4, 0.030, 1.0, 6.53e-4) == pytest.approx(whole)
    laminar = drag.kitabayashi(ONE, 100.0, 0.08, 1e-4)
    assert drag.pahlovy(ONE, 100.0, 0.08, 1e-4, 0.038) == pytest.approx(laminar)
    radii = np.linspace(0.025, 0.038, 9)
    for rising in (
        drag.pahlovy(ONE, 100.0, 0.08, 1e-4, radii),
        drag.peng_yuan(ONE, 100.0, 0.08, 1e-4, radii),
        drag.iqbal(ONE, 100.0, 0.08, 1e-4, radii, 0.5, 6.53e-4),
    ):
        assert rising.shape == (9,) and np.all(np.diff(rising) > 0)
    pack_of_12 = drag.iqbal(GEARBOX, 100.0, 0.08, 1e-4, 0.032, 0.5, 6.53e-4)
    assert pack_of_12 == pytest.approx(12 * drag.iqbal(ONE, 100.0, 0.08, 1e-4, 0.032, 0.5, 6.53e-4))


def test_effective_gap_and_liquid_share():
    assert drag.effective_gap(ONE, 1e-4, 0.0, ONE.area) == pytest.approx(1e-4)
    assert drag.effective_gap(ONE, 1e-4, 0.1e-3, 0.9 * ONE.area) == pytest.approx(1.1e-4)  # as in fig. 6.5
    assert drag.liquid_share(0.4, [0.0, 0.1, 0.4]) == pytest.approx([1.0, 0.75, 0.0])
    with pytest.raises(ValueError, match="land_area"):
        drag.effective_gap(ONE, 1e-4, 1e-4, 1.1 * ONE.area)
    with pytest.raises(ValueError, match="gas_angle"):
        drag.liquid_share(0.4, 0.5)


@pytest.mark.parametrize(
    "call, message",
    [
        (lambda: drag.kitabayashi(ONE, 1.0, 0.08, 0.0), "gap"),
        (lambda: drag.kitabayashi(ONE, 1.0, -0.08, 1e-4), "viscosity"),
        (lambda: drag.peng_yuan(ONE, 1.0, 0.08, 1e-4, 0.039), "film_radius"),
        (lambda: drag.pahlovy(ONE, 1.0, 0.08, 1e-4, 0.024), "film_radius"),
        (lambda: drag.iqbal(ONE, 1.0, 0.08, 1e-4, 0.032, 1.2, 6.53e-4), "share"),
        (lambda: drag.davis_viscous(ONE, 1.0, 0.08, lambda r: r - 0.03), "gap"),
        (lambda: drag.davis_boundary(ONE, 0.17, 1e6, 1.5), "contact_share"),
    ],
)
def test_impossible_films_are_refused(call, message):
    with pytest.raises(ValueError, match=message):
        call()


# ---- bench of chapter 8


def test_clamp_force_of_the_bench():
    assert bench.spring_force(0.0) == pytest.approx(9.8468)
    assert bench.spring_force(2e-3) == pytest.approx(  # (8.1) with - 38.063
        2.9035 * 64 - 38.063 * 32 + 197.57 * 16 - 515.09 * 8 + 658.13 * 4 - 38.596 * 2 + 9.8468
    )
    assert bench.spring_force(4e-3) == pytest.approx(914, abs=1)
    # above its first 0.03 mm the line only rises, as springs do; with the printed sign it would reach 79 kN
    assert np.all(np.diff(bench.spring_force(np.linspace(0.05e-3, 4e-3, 80))) > 0)
    assert bench.cylinder_force(2e6) == pytest.approx(63.034 * 4 + 1251.7 * 2 - 123.7)
    assert bench.cylinder_force(np.array([0.0, 0.09e6])).tolist() == [0.0, 0.0]  # positive from about 0.1 MPa
    assert bench.clamp_force(2e6, 4e-3) == pytest.approx(bench.cylinder_force(2e6) - bench.spring_force(4e-3))
    assert bench.clamp_force(0.3e6, 4e-3) == 0.0
    with pytest.raises(ValueError, match="0 to 0.004 m"):
        bench.spring_force(4.1e-3)


def test_packs_of_the_bench():
    ratio = {name: pack.inner_diameter / pack.outer_diameter for name, pack in PACKS.items()}
    printed = {"80x115": 0.7, "80x101.9": 0.8, "65x115": 0.57, "46x88.9": 0.52, "50x76": 0.66}  # r_st, 8.3
    assert ratio == pytest.approx(printed, abs=0.02)
    assert PACKS["50x76"].geometry(12) == GEARBOX
    with pytest.raises(ValueError, match="46x88.9 was tested with 18, 16 surfaces, not 14"):
        PACKS["46x88.9"].geometry(14)


def test_slip_torques_of_every_pack():
    force = bench.clamp_force(np.array([1e6, 2e6, 3e6]), 1e-3)
    for pack in PACKS.values():
        for n in pack.surfaces:
            torques = bench.slip_torques(pack.geometry(n), force, 0.12, 0.058)
            assert all(t.shape == (3,) and np.all(np.diff(t) > 0) for t in torques.values())
            # the splines take force on both sides, on one, on none; Osinski's model is below all of these here
            assert np.all(torques["osinski"] < torques["thesis"])
            assert np.all((torques["thesis"] < torques["chen"]) & (torques["chen"] < torques["traditional"]))


def test_what_chapter_8_says_bounds_the_product_of_frictions():
    statements = [s for s in comparison.STATEMENTS if not s.read_into]
    low, high = comparison.common_product(statements)
    assert (low, high) == pytest.approx((0.00688, 0.00755), abs=1e-5)
    for product in (low * 1.001, high * 0.999):
        pack = PACKS["46x88.9"].geometry(18)
        ratio = closed.thesis(pack, 1.0, 0.1, product / 0.1) / closed.osinski(pack, 1.0, 0.1, beyond_table=True)
        assert 1.505 / 0.955 <= ratio <= 1.515 / 0.945
        assert comparison.contradicted(0.12, product / 0.12, statements) == []
        assert comparison.contradicted(0.30, product / 0.30, statements) == []  # only the product counts


def test_chapter_9s_friction_contradicts_chapter_8():
    against = comparison.contradicted(0.30, 0.12)
    assert {s.pack for s in against} == {"46x88.9", "50x76", "65x115", "80x115"}
    assert comparison.model_ratio("50x76", 16, "osinski", 0.036) == pytest.approx(0.88, abs=5e-3)


def test_one_product_cannot_serve_steel_and_lined_plates():
    steel = comparison.common_product([s for s in comparison.STATEMENTS if s.pack != "50x76"])
    lined = comparison.common_product([s for s in comparison.STATEMENTS if s.pack == "50x76"])
    assert comparison.common_product(comparison.STATEMENTS) is None
    assert steel == pytest.approx((0.00688, 0.00755), abs=1e-5)
    assert lined == pytest.approx((0.01369, 0.01914), abs=1e-5)


def test_model_ratio_falls_with_the_product():
    for against in ("osinski", "traditional"):
        ratio = comparison.model_ratio("65x115", 14, against, np.linspace(0.0, 0.05, 26))
        assert np.all(np.diff(ratio) < 0)
    with pytest.raises(ValueError, match="no ratio for pack '60x90'"):
        comparison.model_ratio("60x90", 14, "osinski", 0.01)


# ---- pictures


def test_curves_of_the_pictures():
    script = runpy.run_path(str(PICTURES))
    end = {name: torque[-1] for name, torque in script["drag_curves"]().items()}
    assert end["Kitabayashi"] > end["Iqbal, film to 36 mm"] > end["Peng, Yuan, film to 36 mm"]
    assert end["Iqbal, film to 36 mm"] > end["Iqbal, film to 32 mm"] > end["Peng, Yuan, film to 32 mm"]
    osinski = script["surface_curves"]()["Osinski, k_os n"]
    assert script["SURFACES"][osinski.argmax()] == 18
