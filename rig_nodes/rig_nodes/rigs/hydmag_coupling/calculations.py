# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The design of the metal coupling of high torsional compliance (Kowal and Filipowicz), for the coupling of this rig.

Numbers of sections, equations, figures and tables are those of their paper; the torque per force of the threads is that of
plant.parts.twisting_coupling. M_o is in Nm in (1); in (2), where d is in mm and k_so in N/mm2, it must be in N mm. Disc springs are
computed by Almen and Laszlo as in DIN 2092 and DIN EN 16984; their sizes are those of DIN 2093.
"""

from __future__ import annotations

from math import atan, cos, degrees, log, pi, radians, sin, sqrt, tan
from typing import TYPE_CHECKING

import numpy as np

from rig_nodes.plant import geometry, levers
from rig_nodes.runs import Table

if TYPE_CHECKING:
    from rig_nodes.plant import CouplingConfig
    from rig_nodes.rig import RigConfig
    from rig_nodes.runs import Recorded

MPA = 1e6
RPM = pi / 30.0
# table 1: material, and range of its tensile strength [MPa]
STRENGTH = (
    ("St3", 370.0, 460.0),
    ("St5", 490.0, 610.0),
    ("St7", 700.0, 840.0),
    ("40H", 1000.0, 1200.0),
    ("40HM", 1000.0, 1300.0),
    ("0H18N9", 550.0, 750.0),
    ("H18N10MT", 550.0, 750.0),
)
# table 1: material -> shares of its elements [%], and shares of carbon, chromium and nickel by the numbers in its Polish name [%]
STEELS = {
    "St3": ({"C": 0.2, "Mn": 0.6, "Si": 0.35}, {}),
    "St5": ({"C": 0.4, "Mn": 0.8, "Si": 0.3}, {}),
    "St7": ({"C": 0.6, "Mn": 0.8, "Si": 0.4}, {}),
    "40H": ({"C": 0.4, "Mn": 0.8, "Si": 0.4, "Cr": 1.1, "Ni": 0.3}, {"C": 0.40}),
    "40HM": ({"C": 0.45, "Mn": 0.7, "Si": 0.4, "Cr": 1.2, "Ni": 0.3}, {"C": 0.40}),
    "0H18N9": ({"C": 0.1, "Mn": 2.0, "Si": 0.8, "Cr": 18.0, "Ni": 9.0}, {"Cr": 18.0, "Ni": 9.0}),
    "H18N10MT": ({"C": 0.1, "Mn": 2.0, "Si": 0.8, "Cr": 18.0, "Ni": 10.0}, {"Cr": 18.0, "Ni": 10.0}),
}
# table 2: kind of load, and range of its factor of safety
SAFETY = (("static", 1.6, 1.8), ("quasi-static", 1.8, 1.9), ("varying", 1.8, 2.0), ("shock", 1.9, 2.2))
# table 3: pair of materials with its use, ranges of the coefficient of friction, dry and with oil, and of allowed pressure [MPa]
FRICTION = (
    ("steel, alternating, poor oil", 0.15, 0.22, 0.12, 0.17, 30.0, 100.0),
    ("steel, one way, good oil", None, None, 0.08, 0.12, 100.0, 200.0),
    ("steel and cast iron", 0.15, 0.20, 0.03, 0.06, 80.0, 140.0),
)
OVERLOAD = (1.2, 1.3)  # range of K_p, stated with (1)
ANGLES = (25.0, 75.0)  # deg, section 4
BEST = 45.0  # deg, section 4
METAL_FRICTION_ANGLE = 25.0  # deg, section 4: no friction angle of metals exceeds it
RETURN_ANGLES, RETURN_FRICTION, RETURN_RATIO = (25.0, 60.0), (0.08, 0.25), (0.1, 0.4)  # with (10)
SPRING_ANGLES = (65.0, 75.0)  # deg, section 6: helix angles of couplings with a helical spring
FLAT = 0.8  # section 6: share of h_1 up to which a disc may be pressed
# DIN 2093: disc -> outer and inner diameter, thickness, height of the cone h_1 [m], force at 0.75 h_1 [N]
DISCS = {
    "A 50": (50e-3, 25.4e-3, 3e-3, 1.1e-3, 11976.0),
    "A 80": (80e-3, 41e-3, 5e-3, 1.7e-3, 33559.0),
    "A 100": (100e-3, 51e-3, 6e-3, 2.2e-3, 48022.0),
    "B 100": (100e-3, 51e-3, 3.5e-3, 2.8e-3, 13070.0),
}
DISC, COUNT = "A 100", 72  # type and number of the discs in this rig's coupling, stacked singly
E_STEEL, POISSON = 206e9, 0.3  # DIN 2092


def threads(values: CouplingConfig) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return mean diameter [m] and helix angle [rad] of the inner and of the outer thread."""
    return (values.inner_diameter, values.inner_angle), (values.outer_diameter, values.outer_angle)


def motor(config: RigConfig) -> tuple[float, float]:
    """Return power [W] and speed [rad/s] of the laboratory's motor: its largest power without the overload, at 1500 rpm."""
    return 70e3, 1500.0 * RPM


def torque(power: float, speed: float, overload: float) -> float:
    """Return M_o [Nm] by (1) from power [W], speed [rad/s] and K_p; 9550 is 30000 / pi, rounded."""
    return overload * 9550.0 * (power / 1e3) / (speed / RPM)


def core(moment: float, strength: float, safety: float) -> float:
    """Return the diameter [m] of the screw's core by (2) and (3) from M_o [Nm], R_e [Pa] and x_e."""
    return 1e-3 * (5.0 * moment * 1e3 / (strength / MPA / safety)) ** (1.0 / 3.0)


def around_thread(moment: float, diameter: float) -> float:
    """Return the force F_o around a thread [N] by (4) from the torque [Nm] and the mean diameter [m]."""
    return 2.0 * moment / diameter


def disc_force(disc: str, travel: float) -> float:
    """Return the force [N] of one disc at a travel [m], by DIN 2092 without friction."""
    outer, inner, t, h, _ = DISCS[disc]
    k1 = _k1(outer / inner)
    shape = (h / t - travel / t) * (h / t - 0.5 * travel / t) + 1.0
    return 4.0 * E_STEEL / (1.0 - POISSON**2) * t**4 / (k1 * outer**2) * travel / t * shape


def disc_energy(disc: str, travel: float) -> float:
    """Return the energy [J] in one disc at a travel [m], the integral of :func:`disc_force`."""
    outer, inner, t, h, _ = DISCS[disc]
    k1, s, g = _k1(outer / inner), travel / t, h / t
    return (
        4.0 * E_STEEL / (1.0 - POISSON**2) * t**5 / (k1 * outer**2) * (0.5 * (g * g + 1.0) * s**2 - 0.5 * g * s**3 + 0.125 * s**4)
    )


def disc_stress(disc: str, travel: float) -> float:
    """Return the stress [Pa] at the upper inner edge (I of DIN 2092) of one disc at a travel [m]; compression is negative."""
    outer, inner, t, h, _ = DISCS[disc]
    d = outer / inner
    k2 = 6.0 / (pi * log(d)) * ((d - 1.0) / log(d) - 1.0)
    k3 = 3.0 / (pi * log(d)) * (d - 1.0)
    scale = 4.0 * E_STEEL / (1.0 - POISSON**2) * t**2 / (_k1(d) * outer**2)
    return -scale * travel / t * (k2 * (h / t - 0.5 * travel / t) + k3)


def _k1(d: float) -> float:
    return ((d - 1.0) / d) ** 2 / (pi * ((d + 1.0) / (d - 1.0) - 2.0 / log(d)))


def overload(config: RigConfig) -> Table:
    """Torque by (1) for each factor of overload."""
    power, speed = motor(config)
    rows = [(factor, torque(power, speed, factor)) for factor in (1.0, OVERLOAD[0], 0.5 * sum(OVERLOAD), OVERLOAD[1])]
    return Table("Torque M_o of the laboratory's motor by (1), 70 kW at 1500 rpm.", {"overload": "-", "torque": "Nm"}, rows)


def given(config: RigConfig) -> Table:
    """Values that the text gives without a formula."""
    rows = [("K_p, least", OVERLOAD[0]), ("K_p, largest", OVERLOAD[1])]
    return Table("Values that the text gives for (1).", {"what": "", "value": "-"}, rows)


def steels(config: RigConfig) -> Table:
    """Table 1: composition of the shaft's materials, and the shares that the numbers in their names give."""
    rows = [
        (name, element, 0.01 * share, 0.01 * named[element] if element in named else None)
        for name, (shares, named) in STEELS.items()
        for element, share in shares.items()
    ]
    return Table(
        "Table 1: shares of elements, and the share by the number in the material's name.",
        {"steel": "", "element": "", "printed": "%", "by_name": "%"},
        rows,
    )


def units(config: RigConfig) -> Table:
    """Number 9550 of (1), and the core by (2) with M_o in Nm and in N mm."""
    power, speed = motor(config)
    values, moment = config.coupling, torque(power, speed, 1.25)
    exact = power / speed / ((power / 1e3) / (speed / RPM))
    allowed = 1000.0 / 2.0  # N/mm2
    bending = 16.0 / pi  # d^3 = 16 M / (pi tau) of a round bar; (2) rounds 16 / pi to 5
    twice = core(2.0 * moment, 1000.0 * MPA, 2.0) / core(moment, 1000.0 * MPA, 2.0)
    rows = [
        ("9550 of (1), Nm rpm / kW", exact),
        ("9550 over the exact constant", 9550.0 / exact),
        ("root of (2)", log(2.0) / log(twice)),
        ("2 of (4)", around_thread(moment, values.inner_diameter) * values.inner_diameter / moment),
        ("5 of (2): 16 / pi of a round bar", bending),
        ("d of (2) in mm, M_o in N mm", (5.0 * moment * 1e3 / allowed) ** (1.0 / 3.0)),
        ("d of (2) in mm, M_o in Nm as in (1)", (5.0 * moment / allowed) ** (1.0 / 3.0)),
        ("strength of a core of the latter, N/mm2", 5.0 * moment * 1e3 / ((5.0 * moment / allowed) ** (1.0 / 3.0)) ** 3),
    ]
    return Table("Constants and units of (1) and (2).", {"what": "", "value": "-"}, rows)


def strengths(config: RigConfig) -> Table:
    """Table 1: strength of the shaft's materials, and the core of the screw of each material under shock."""
    power, speed = motor(config)
    moment = torque(power, speed, 0.5 * sum(OVERLOAD))
    rows = [
        (name, low * MPA, high * MPA, core(moment, low * MPA, SAFETY[3][2]), core(moment, high * MPA, SAFETY[3][1]))
        for name, low, high in STRENGTH
    ]
    return Table(
        "Table 1: strength of materials, and the core of the screw by (2) and (3) for shocks, at least and at most.",
        {"material": "", "from": "MPa", "to": "MPa", "thickest": "mm", "thinnest": "mm"},
        rows,
    )


def safety(config: RigConfig) -> Table:
    """Table 2: factors of safety, and the stress and core of 40HM with them."""
    power, speed = motor(config)
    moment = torque(power, speed, 0.5 * sum(OVERLOAD))
    weakest = next(low for name, low, _ in STRENGTH if name == "40HM") * MPA
    rows = [
        (name, low, high, weakest / high, weakest / low, core(moment, weakest, low), core(moment, weakest, high))
        for name, low, high in SAFETY
    ]
    return Table(
        "Table 2: factors of safety x_e; k_so by (3) and core by (2) for 40HM of 1000 MPa.",
        {"load": "", "from": "-", "to": "-", "least_stress": "MPa", "most_stress": "MPa", "thinnest": "mm", "thickest": "mm"},
        rows,
    )


def frictions(config: RigConfig) -> Table:
    """Table 3: friction of pairs of materials, its angle, and the smallest helix angle that is not self-locking."""
    rows = [
        (name, dry, wet, dry_to, wet_to, low * MPA, high * MPA, atan(max(wet_to, dry_to or 0.0)))
        for name, dry, dry_to, wet, wet_to, low, high in FRICTION
    ]
    columns = {
        "pair": "",
        "dry": "-",
        "oil": "-",
        "dry_to": "-",
        "oil_to": "-",
        "pressure": "MPa",
        "pressure_to": "MPa",
        "friction_angle": "deg",
    }
    return Table("Table 3: coefficients of friction and pressures, and the largest friction angle of each pair.", columns, rows)


def angles(config: RigConfig) -> Table:
    """Helix angles of section 4: forces by (4) to (7), efficiency of winding and unwinding, and self-locking."""
    values = config.coupling
    power, speed = motor(config)
    moment = torque(power, speed, 0.5 * sum(OVERLOAD))
    mu = values.thread_friction
    rho = atan(mu)
    around = around_thread(moment, values.inner_diameter)
    best = degrees(0.25 * pi - 0.5 * rho)
    rows = []
    for angle in sorted({*ANGLES, 35.0, BEST, best, 55.0, 60.0, SPRING_ANGLES[0]}):
        g = radians(angle)
        lead = pi * values.inner_diameter * tan(g)
        rows.append(
            (
                g,
                lead,
                around,
                around / tan(g),
                around / sin(g),
                mu * around / sin(g),
                tan(g) / tan(g + rho),
                tan(g - rho) / tan(g),
                around / tan(g + rho),
            )
        )
    return Table(
        "Forces of (4) to (7) at the inner thread for K_p of 1.25; efficiency of winding tan g / tan(g + rho), of unwinding "
        "tan(g - rho) / tan g, and the axial force that is left with friction.",
        {
            "angle": "deg",
            "lead": "mm",
            "around": "N",
            "axial": "N",
            "normal": "N",
            "friction": "N",
            "winding": "%",
            "unwinding": "%",
            "axial_with_friction": "N",
        },
        rows,
    )


def limits(config: RigConfig) -> Table:
    """Limits that the text prints, each beside the result of its formulas and tables."""
    mus = [mu for _, dry, dry_to, wet, wet_to, *_ in FRICTION for mu in (dry, dry_to, wet, wet_to) if mu is not None]
    grid = [(g, mu) for g in np.linspace(*RETURN_ANGLES, 351) for mu in np.linspace(*RETURN_FRICTION, 171)]
    ratio = [mu / cos(radians(g)) for g, mu in grid]
    inside = sum(RETURN_RATIO[0] <= one <= RETURN_RATIO[1] for one in ratio) / len(ratio)
    # winding and unwinding as one cycle: share of the work that is recovered; the angle with the largest share depends on mu
    rho = atan(config.coupling.thread_friction)
    fine = np.radians(np.linspace(26.0, 74.0, 4801))
    way = fine[np.argmax(np.tan(fine) / np.tan(fine + rho))]
    cycle = fine[np.argmax(np.tan(fine - rho) / np.tan(fine + rho))]
    most = max(mus)
    h = DISCS[DISC][3]
    one, two = (pi * d * tan(g) for d, g in threads(config.coupling))
    rows = [
        ("largest friction angle of table 3, deg", degrees(atan(most))),
        ("friction of the angle 25 deg", tan(radians(METAL_FRICTION_ANGLE))),
        ("best angle of winding, deg", degrees(way)),
        ("best angle of a whole cycle, deg", degrees(cycle)),
        ("least angle of section 4, deg", ANGLES[0]),
        ("largest angle of section 4, deg", ANGLES[1]),
        ("least angle of (10), deg", RETURN_ANGLES[0]),
        ("largest angle of (10), deg", RETURN_ANGLES[1]),
        ("least friction of (10)", RETURN_FRICTION[0]),
        ("largest friction of (10)", RETURN_FRICTION[1]),
        ("least mu / cos g of (10)", min(ratio)),
        ("largest mu / cos g of (10)", max(ratio)),
        ("mu / cos g at 60 deg, largest of table 3", most / cos(radians(RETURN_ANGLES[1]))),
        ("share of the ranges of (10) within 0.1 to 0.4", inside),
        ("largest angle with 0.4 at mu 0.25, deg", degrees(np.arccos(RETURN_FRICTION[1] / RETURN_RATIO[1]))),
        ("largest mu with 0.4 at 60 deg", RETURN_RATIO[1] * cos(radians(RETURN_ANGLES[1]))),
        ("least angle of a helical spring, deg", SPRING_ANGLES[0]),
        ("largest angle of a helical spring, deg", SPRING_ANGLES[1]),
        ("share of h_1 that may be used", FLAT),
        ("least friction of steel on steel in table 3", min(wet for name, _, _, wet, *_ in FRICTION if "iron" not in name)),
        ("largest friction in table 3", most),
        ("leads in one turn by (11)", abs(one - two) / one),
        ("stress at 0.8 h_1 over that at 0.75 h_1", disc_stress(DISC, FLAT * h) / disc_stress(DISC, 0.75 * h)),
        ("axial force at 75 deg over that at 45 deg", tan(radians(BEST)) / tan(radians(SPRING_ANGLES[1]))),
    ]
    return Table("Limits that the text states, from its formulas and tables.", {"what": "", "value": "-"}, rows)


def return_condition(config: RigConfig) -> Table:
    """Condition (10) and the exact one, mu < tan g, over angle and friction: the share of the axial force that friction takes."""
    rows = []
    for g in (25.0, 35.0, 45.0, 51.3, 60.0, 75.0):
        for mu in (0.08, 0.12, 0.17, 0.22, 0.25):
            taken = mu / cos(radians(g))
            rows.append((radians(g), mu, taken, mu / tan(radians(g)), "yes" if taken <= 1.0 else "no"))
    return Table(
        "Condition (10): mu / cos g, which compares the friction along the thread with the axial force; mu / tan g compares it "
        "with that force's part along the thread, and at 1 the thread locks itself.",
        {"angle": "deg", "friction": "-", "ratio": "-", "along": "-", "returns": ""},
        rows,
    )


def travel(config: RigConfig) -> Table:
    """Travel of the nut per turn by three statements of the text and by the joint motion of both threads."""
    values = config.coupling
    free, _, _ = geometry(values)
    one, two = (pi * d * tan(g) for d, g in threads(values))
    power, speed = motor(config)
    moment = torque(power, speed, 0.5 * sum(OVERLOAD))
    axial = around_thread(moment, values.inner_diameter) / tan(values.inner_angle)
    rows = []
    for name, way, force in (
        ("(11): s_1 - s_2", abs(one - two), axial),
        ("section 6: one turn, one lead s_1", one, axial),
        ("both threads, opposite hands", 2.0 * pi * free, moment / free),
        ("both threads, same hand", one * two / abs(one - two), 2.0 * pi * moment / (one * two / abs(one - two))),
    ):
        rows.append((name, way, force, force * way / (2.0 * pi * moment)))
    return Table(
        "Travel of the nut in one turn of twist, the axial force on the springs at M_o (for the text's statements by (5)), and the "
        "work on the springs over that of the torque, which is 1 without friction where both belong together.",
        {"statement": "", "travel": "mm", "force": "N", "work": "-"},
        rows,
    )


def disc_springs(config: RigConfig) -> Table:
    """Discs of DIN 2093 by DIN 2092: force, stress and rate at 0.75 h_1, against the force of the standard."""
    rows = []
    for name, (outer, inner, t, h, listed) in DISCS.items():
        s = 0.75 * h
        rows.append(
            (
                name,
                outer,
                inner,
                t,
                h,
                s,
                disc_force(name, s),
                listed,
                disc_force(name, FLAT * h),
                disc_stress(name, s),
                disc_force(name, s) / s / COUNT,
                disc_energy(name, s) / (0.5 * s * disc_force(name, s)),
            )
        )
    return Table(
        f"Disc springs by DIN 2092; rate of {COUNT} of them one by one, as a secant up to 0.75 h_1, and energy over that of the "
        "secant.",
        {
            "disc": "",
            "outer": "mm",
            "inner": "mm",
            "thickness": "mm",
            "cone": "mm",
            "travel": "mm",
            "force": "N",
            "listed": "N",
            "force_at_0.8": "N",
            "stress": "MPa",
            "rate": "N/mm",
            "energy": "-",
        },
        rows,
    )


def disc_count(config: RigConfig) -> Table:
    """Number of discs by (11) for each twist, and the number by the nut's true travel."""
    values = config.coupling
    free, _, _ = geometry(values)
    one, two = (pi * d * tan(g) for d, g in threads(values))
    _, _, t, h, _ = DISCS[DISC]
    rows = [
        (
            turns,
            turns * abs(one - two) / (FLAT * h),
            turns * one / (FLAT * h),
            turns * 2.0 * pi * free / (FLAT * h),
            turns * 2.0 * pi * free / (FLAT * h) * (t + h),
        )
        for turns in (0.25, 0.5, 1.0, 1.5, 2.0, 4.0)
    ]
    return Table(
        f"Number of single discs {DISC} by (11), by one lead in a turn, and by the motion of both threads, and the length of the "
        "set by the last.",
        {"turns": "-", "by_11": "-", "by_one_lead": "-", "both_threads": "-", "length": "mm"},
        rows,
    )


def design(config: RigConfig) -> Table:
    """The coupling of this rig: its torque, its threads, its springs and its twist."""
    values = config.coupling
    free, lever, share = geometry(values)
    power, speed = motor(config)
    moment = torque(power, speed, 0.5 * sum(OVERLOAD))
    force = values.spring_preload + values.spring_rate * values.stop_travel
    _, wound, back = levers(
        values.inner_diameter, values.inner_angle, values.outer_diameter, values.outer_angle, values.thread_friction
    )
    rows = [
        ("torque M_o for K_p 1.25, Nm", moment),
        ("core of the screw, 40HM, x_e 2, mm", 1e3 * core(moment, 1000.0 * MPA, 2.0)),
        ("lead of the inner thread, mm", 1e3 * pi * values.inner_diameter * tan(values.inner_angle)),
        ("lead of the outer thread, mm", 1e3 * pi * values.outer_diameter * tan(values.outer_angle)),
        ("travel in one turn, mm", 2e3 * pi * free),
        ("torque per force winding, mm", 1e3 * wound * (1.0 + values.spring_friction)),
        ("torque per force unwinding, mm", 1e3 * back * (1.0 - values.spring_friction)),
        ("share of friction", share),
        ("torque at which it begins to wind, Nm", lever * (1.0 + share) * values.spring_preload),
        ("torque at the last stop, winding, Nm", lever * (1.0 + share) * force),
        ("torque at the last stop, unwinding, Nm", lever * (1.0 - share) * force),
        ("twist at the last stop, turns", values.stop_travel / free / (2.0 * pi)),
        ("stiffness of the springs, Nm/rad", lever * free * values.spring_rate),
        ("force of the springs at the last stop, kN", 1e-3 * force),
        ("loss of a full cycle, J", 2.0 * share * lever * 0.5 * (values.spring_preload + force) * values.stop_travel / free),
        ("share of a full cycle that is lost", 1.0 - (1.0 - share) / (1.0 + share)),
    ]
    return Table("The coupling of this rig, by its present values.", {"what": "", "value": "-"}, rows)


def characteristic(config: RigConfig) -> Table:
    """Torque over twist, winding and unwinding, by the rig's linear springs and by the discs of DIN 2092 with friction."""
    values = config.coupling
    free, lever, share = geometry(values)
    h = DISCS[DISC][3]
    rows = []
    before = _travel_of(values.spring_preload)
    for part in np.linspace(0.0, 1.0, 13):
        x = part * values.stop_travel
        soft = min(x, values.knee_travel)
        force = values.spring_preload + values.spring_rate * soft + values.knee_rate * (x - soft)
        disc = disc_force(DISC, min(h, before + x / COUNT))
        rows.append(
            (
                float(x / free / (2.0 * pi)),
                float(x),
                float(force),
                float(lever * (1.0 + share) * force),
                float(lever * (1.0 - share) * force),
                float(disc),
                float(lever * (1.0 + share) * disc),
                float(lever * (1.0 - share) * disc),
            )
        )
    return Table(
        f"Characteristic with hysteresis: of the rig's linear springs and of {COUNT} discs {DISC} by DIN 2092.",
        {
            "turns": "-",
            "travel": "mm",
            "force": "N",
            "winding": "Nm",
            "unwinding": "Nm",
            "discs": "N",
            "discs_winding": "Nm",
            "discs_unwinding": "Nm",
        },
        rows,
    )


def _travel_of(force: float) -> float:
    """Travel [m] of one disc under a force [N], by bisection; the force of discs of these sizes rises with the travel."""
    low, high = 0.0, DISCS[DISC][3]
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if disc_force(DISC, middle) < force else (low, middle)
    return 0.5 * (low + high)


def natural_frequency(config: RigConfig) -> Table:
    """Natural frequencies on the coupling's springs and on its stop, in neutral and in each gear, motor free and held."""
    values, box = config.coupling, config.transmission
    free, lever, _ = geometry(values)
    rotor, own = config.rotor.inertia, config.w0.inertia
    rows = []
    for gear in box.gears:
        driven = own + (box.inertias.on_output / box.ratios[gear.number] ** 2 if gear.number else 0.0)
        for name, stiffness in (("springs", lever * free * values.spring_rate), ("stop", values.stop_stiffness)):
            both = sqrt(stiffness * (1.0 / rotor + 1.0 / driven)) / (2.0 * pi)
            rows.append((gear.name, name, driven, stiffness, both, sqrt(stiffness / driven) / (2.0 * pi)))
    return Table(
        "Natural frequencies of motor and gearbox on the coupling without its friction; held: with a motor that keeps its speed.",
        {"gear": "", "on": "", "driven": "kg m2", "stiffness": "Nm/rad", "both": "Hz", "held": "Hz"},
        rows,
    )


def peaks(config: RigConfig, recording: Recorded) -> Table:
    """Largest and smallest M_wej after each order of a gear, twist, oscillation of the speed and loss in the coupling."""
    free, _, _ = geometry(config.coupling)
    t, torque_in, speed = recording.t, recording["M_wej"], recording["n_wej"]
    moved, heat = recording["coupling_travel"], recording["coupling_heat"]
    ordered = np.flatnonzero(np.diff(recording["gear_ordered"])) + 1
    rows = []
    for number, at in enumerate(ordered):
        end = ordered[number + 1] if number + 1 < len(ordered) else len(t)
        end = min(end, at + int(round(3.0 / (t[1] - t[0]))))
        late = slice(at + (end - at) // 2, end)
        gear = f"{recording['gear_ordered'][at - 1]:.0f}-{recording['gear_ordered'][at]:.0f}"
        rows.append(
            (
                gear,
                float(torque_in[at:end].max()),
                float(torque_in[at:end].min()),
                float(speed[at:end].min()),
                float(speed[at:end].max()),
                float(np.ptp(torque_in[late])),
                float(moved[at:end].max() / free / (2.0 * pi)),
                float(heat[end - 1] - heat[at]),
            )
        )
    return Table(
        "Within 3 s of each order: largest and smallest torque behind the coupling, speeds of the input, span of the torque in the "
        "second half of that time, largest twist and heat of the coupling.",
        {
            "shift": "",
            "highest": "Nm",
            "lowest": "Nm",
            "slowest": "rpm",
            "fastest": "rpm",
            "late_span": "Nm",
            "turns": "-",
            "heat": "J",
        },
        rows,
    )


CALCULATIONS = {
    "given": given,
    "overload": overload,
    "steels": steels,
    "units": units,
    "strengths": strengths,
    "safety": safety,
    "frictions": frictions,
    "angles": angles,
    "limits": limits,
    "return_condition": return_condition,
    "travel": travel,
    "disc_springs": disc_springs,
    "disc_count": disc_count,
    "design": design,
    "characteristic": characteristic,
    "natural_frequency": natural_frequency,
    "peaks": peaks,
}
