# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The calculations of the paper on the chain saw's clutch, and the same quantities from a recording.

Numbers in brackets are the paper's equations. "Static" is the paper's view: the drum follows a prescribed speed of the engine, (6),
and the clutch slips in a cycle in which the torque for this motion, (13), is above the torque that the clutch can transmit.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import brentq
from scipy.stats import norm

from rig_nodes.base import RigError
from rig_nodes.plant import chain_inertia, chain_mass, clutch_torque, full_torque
from rig_nodes.rigs.chain_saw.cycles import (
    DELTA,
    MEAN,
    SCATTER,
    SPEED,
    Case,
    cycles_of,
    each,
    engagement_speed,
    irregularity,
    slipping,
)
from rig_nodes.runs import Table

if TYPE_CHECKING:
    from rig_nodes.plant import CentrifugalConfig
    from rig_nodes.rig import RigConfig
    from rig_nodes.runs import Recorded

INCH, RPM = 0.0254, np.pi / 30.0
WORN = 0.04107  # kg, p. 3: a shoe at the end of its life
HEAVY = 0.063  # kg, p. 7: the shoe that prevents slip by the paper
LIMIT = DELTA + 3.0 * SCATTER
# printed shares of cycles with slip, and printed losses by slip, p. 6 and 7
SHARES = {("new", 15): 0.038, ("worn", 15): 0.141, ("new", 13): 0.0236}
LOSSES = {("new", 15): 0.0132, ("worn", 15): 0.0515, ("new", 13): 0.0075, ("new", 20): 0.0414, ("worn", 20): 0.11}
# p. 1 and 2: displacement of this saw [cm3], and displacement [cm3] and torque [Nm] of the smallest and the largest engine of saws
DISPLACEMENT, SIZES = 56.5, ((30.0, 1.5), (120.0, 7.8))
SHELF, SHELF_LEFT = 3.5, (0.8, 1.0)  # mm, p. 3: shelf of a new shoe, and the remaining shelf at the end of its life
HIGHEST, CUTTING, FIG_4 = 15000.0, (8000.0, 10000.0), 8470.0  # rpm, p. 1, p. 5 and fig. 4
BARS = (13.0, 20.0)  # in, p. 7: shortest and longest bar of this saw
PITCH = 3.0 / 8.0  # in, p. 5: of the chain


def _shoes(config: RigConfig) -> dict[str, CentrifugalConfig]:
    """Return the clutch with new, worn and heavy shoes; the springs are the same, so that m_s w_0^2 is the same by (4)."""
    own = config.clutch
    return {name: replace(own, shoe_mass=mass) for name, mass in (("new", own.engagement_mass), ("worn", WORN), ("heavy", HEAVY))}


def _inertia(config: RigConfig, inches: float) -> float:
    """Return J_b + m_p r_k^2 for a bar of some inches (11) [kg m2]."""
    return config.drum.inertia + chain_inertia(replace(config.chain, bar=inches * INCH))


def clutch(config: RigConfig) -> Table:
    """Torque of the clutch by (5) with new, worn and heavy shoes, the engine's torque, and the limit of the inertia torque."""
    own, rows = config.clutch, []
    limit = _inertia(config, 15.0) * LIMIT * SPEED**2
    for name, one in _shoes(config).items():
        at_peak = clutch_torque(one, 838.0)
        torque = clutch_torque(one, SPEED)
        stays = clutch_torque(replace(one, engagement_mass=one.shoe_mass), SPEED)
        rows.append(
            (
                name,
                one.shoe_mass,
                one.shoe_mass / own.engagement_mass - 1.0,
                engagement_speed(one),
                torque,
                stays,
                at_peak / config.engine.torque_peak,
                limit,
                torque / limit,
            )
        )
    return Table(
        "torque of the clutch at 950 rad/s (5), its share of the engine's largest torque at 838 rad/s, and the limit of (11)",
        {
            "shoes": "",
            "mass": "g",
            "mass_change": "%",
            "engagement_speed": "rad/s",
            "torque": "Nm",
            "torque_at_347": "Nm",
            "over_engine": "-",
            "limit": "Nm",
            "over_limit": "-",
        },
        rows,
    )


def shoes_without_slip(config: RigConfig) -> Table:
    """Mass of a shoe with which the clutch transmits the limit of the inertia torque, by two interpretations of (4)."""
    rows, new = [], config.clutch.engagement_mass
    for bar in (13.0, 15.0, 20.0):
        limit = _inertia(config, bar) * LIMIT * SPEED**2
        for reading, of in (
            ("same springs", lambda mass: replace(config.clutch, shoe_mass=mass)),
            ("same 347 rad/s", lambda mass: replace(config.clutch, shoe_mass=mass, engagement_mass=mass)),
        ):
            mass = brentq(lambda m, of=of, limit=limit: clutch_torque(of(m), SPEED) - limit, 0.02, 0.2)
            rows.append((bar * INCH, reading, limit, mass, mass / new - 1.0))
    return Table(
        "mass of a shoe with which the clutch's torque (5) is the limit of (11) at 950 rad/s",
        {"bar": "in", "reading": "", "limit": "Nm", "mass": "g", "more": "%"},
        rows,
    )


def times(config: RigConfig) -> Table:
    """Time of a turn (14) at some speeds, and the speed at which a turn takes the printed time."""
    rows = []
    for rpm, printed in ((8000.0, 0.0075), (10000.0, 0.0061), (FIG_4, None)):
        w = rpm * RPM
        rows.append((w, w, 2.0 * np.pi / w, printed, 2.0 * np.pi / printed if printed else None))
    return Table(
        "time of a turn of the crank (14)",
        {"speed": "rpm", "angular_speed": "rad/s", "turn": "s", "printed": "s", "speed_of_printed": "rpm"},
        rows,
    )


def engine(config: RigConfig) -> Table:
    """Torque of the engine at open throttle over its speed: line 1 of fig. 2, as far as its numbers are printed."""
    own = config.engine
    return Table(
        "torque of the engine on its shaft at open throttle",
        {"speed": "rad/s", "torque": "Nm", "power": "kW"},
        [(w, t, w * t) for w in (500.0, 650.0, 838.0, 950.0, 1100.0, 1250.0) for t in (full_torque.py_func(w, own),)],
    )


def given(config: RigConfig) -> Table:
    """Values that the paper gives for the saw, with the values of the rig."""
    own, chain = config.clutch, config.chain
    return Table(
        "values that the paper gives, in the rig",
        {"what": "", "value": "-"},
        [
            ("m_s of new shoes [g]", own.engagement_mass * 1e3),
            ("m_s of worn shoes [g]", WORN * 1e3),
            ("r_s [mm]", own.shoe_radius * 1e3),
            ("r_spr [mm]", own.spring_radius * 1e3),
            ("r_b [mm]", own.drum_radius * 1e3),
            ("q_spr [kg/m]", own.spring_mass),
            ("pi over gamma", np.pi / own.spring_angle),
            ("k", own.shoes),
            ("mu", own.friction),
            ("w_0 of new shoes [rad/s]", own.engagement_speed),
            ("J_b [1e-6 kg m2]", config.drum.inertia * 1e6),
            ("m_p with 15 in [kg]", chain_mass(replace(chain, bar=15.0 * INCH))),
            ("r_k [mm]", chain.sprocket_radius * 1e3),
            ("bar of m_p [in]", chain.stated_bar / INCH),
            ("shortest bar [in]", BARS[0]),
            ("longest bar [in]", BARS[1]),
            ("8 pitches of the chain [in]", 8.0 * PITCH),
            ("shelf of new shoes [mm]", SHELF),
            ("shelf left, least [mm]", SHELF_LEFT[0]),
            ("shelf left, most [mm]", SHELF_LEFT[1]),
            ("displacement [cm3]", DISPLACEMENT),
            ("displacement of the smallest engine [cm3]", SIZES[0][0]),
            ("displacement of the largest engine [cm3]", SIZES[1][0]),
            ("torque of the smallest engine [Nm]", SIZES[0][1]),
            ("torque of the largest engine [Nm]", SIZES[1][1]),
            ("range of the speed meters [rpm]", config.instruments.speed_range / RPM),
            ("lowest speed of a cut [rpm]", CUTTING[0]),
            ("highest speed of a cut [rpm]", CUTTING[1]),
            ("speed of fig. 4 [rpm]", FIG_4),
        ],
    )


def speeds(config: RigConfig) -> Table:
    """Torque of the engine and of the clutch, and limit of the inertia torque (11), at the speeds that the paper names."""
    own, (new, worn, _) = config.engine, _shoes(config).values()
    named = (
        ("cutting, lowest", CUTTING[0] * RPM),
        ("fig. 4", FIG_4 * RPM),
        ("fig. 5", SPEED),
        ("cutting, highest", CUTTING[1] * RPM),
        ("this engine, highest", own.cut_speed),
        ("engines of saws, highest", HIGHEST * RPM),
    )
    return Table(
        "speeds that the text names: torque at open throttle, torque of the clutch by (5), limit of the inertia torque (11)",
        {"which": "", "speed": "rpm", "turn": "s", "engine": "Nm", "clutch_new": "Nm", "clutch_worn": "Nm", "limit": "Nm"},
        [
            (
                name,
                w,
                2.0 * np.pi / w,
                full_torque.py_func(w, own),
                clutch_torque(new, w),
                clutch_torque(worn, w),
                _inertia(config, 15.0) * LIMIT * w**2,
            )
            for name, w in named
        ],
    )


def shelf(config: RigConfig) -> Table:
    """Shelf of a shoe at the end of its life by the paper's masses and its r_s, which is 22 mm for new and worn shoes.

    A shelf that is thinner by d has lost the mass m at the drum's radius r_b, and the shoe moves outwards by d to touch the drum:
    m_worn r_s = m_new r_s - m (r_b - d / 2) + m_worn d. This holds for a shoe that is narrow along the drum. The mass that a
    wide shoe loses has its centre nearer to the axis, so that d is smaller and more of the shelf is left.
    """
    own = config.clutch
    new, radius, drum = own.engagement_mass, own.shoe_radius, own.drum_radius
    lost = new - WORN

    def left(before: float, after: float) -> float:
        """Return the remaining shelf [mm] by the radii of the centre of mass of a new and of a worn shoe [m]."""
        return SHELF - 1e3 * (WORN * after - new * before + lost * drum) / (WORN + 0.5 * lost)

    half = 0.0005
    least, most = left(radius - half, radius + half), left(radius + half, radius - half)
    gone = [SHELF - one for one in SHELF_LEFT]
    return Table(
        "shelf of a worn shoe from 48.15 and 41.07 g with r_s of 22 mm for both, and by r_s within its last digit; loss of mass in "
        "the range of the shelf",
        {"what": "", "value": "-"},
        [
            ("shelf left [mm]", left(radius, radius)),
            ("shelf left by rounding, least [mm]", least),
            ("shelf left by rounding, most [mm]", most),
            ("the printed shelf is within the rounding", float(least <= SHELF_LEFT[0] and SHELF_LEFT[1] <= most)),
            ("loss with 0.8 mm left over that with 1.0 mm", gone[0] / gone[1]),
            ("share of a new shoe in its shelf, least", lost / gone[0] * SHELF / new),
            ("share of a new shoe in its shelf, most", lost / gone[1] * SHELF / new),
        ],
    )


def sprocket(config: RigConfig) -> Table:
    """Radius of the sprocket by the pitch of the chain: each tooth moves two pitches, and the number of teeth is whole."""
    way = 2.0 * PITCH * INCH / (2.0 * np.pi)
    teeth = config.chain.sprocket_radius / way
    return Table(
        "teeth by r_k and the pitch of 3/8 in, and the radius of the nearest whole number of teeth",
        {"by_radius": "-", "teeth": "-", "radius": "mm"},
        [(teeth, float(round(teeth)), round(teeth) * way)],
    )


def size(config: RigConfig) -> Table:
    """Largest torque per displacement of this engine and of the smallest and the largest engine that the paper names."""
    (small, low), (large, high) = SIZES
    return Table(
        "largest torque of engines of saws over their displacement",
        {"engine": "", "displacement": "-", "torque": "Nm", "per_cm3": "Nm"},
        [
            ("smallest", small, low, low / small),
            ("this saw", DISPLACEMENT, config.engine.torque_peak, config.engine.torque_peak / DISPLACEMENT),
            ("largest", large, high, high / large),
        ],
    )


def slips(config: RigConfig) -> Table:
    """Share of cycles that slip, and the loss by each plausible definition beside the printed one, by bar and shoes."""
    rows = []
    for name, one in _shoes(config).items():
        for bar in (13, 15, 18, 20):
            case = Case(clutch_torque(one, SPEED), _inertia(config, bar))
            rows.append(
                (
                    name,
                    bar * INCH,
                    chain_mass(replace(config.chain, bar=bar * INCH)),
                    case.inertia,
                    case.per_delta * LIMIT,
                    case.capacity,
                    case.share(),
                    SHARES.get((name, bar)),
                    LOSSES.get((name, bar)),
                    case.over(case.excess) / MEAN,
                    case.over(lambda d, c=case: c.excess(d) / (c.per_delta * d) if d else 0.0),
                    case.over(case.excess_over_turn) / MEAN,
                    case.over(case.slip_time),
                    case.slip_work() / (2.0 * np.pi * MEAN),
                )
            )
    return Table(
        "the static view at 950 rad/s; losses: excess of the largest torque over M_s, as a share of M_o and of itself; mean excess "
        "over a turn as a share of M_o; share of the time; work of slip against a prescribed engine as a share of its work",
        {
            "shoes": "",
            "bar": "in",
            "chain": "kg",
            "inertia": "kg m2",
            "limit": "Nm",
            "clutch": "Nm",
            "share": "%",
            "printed_share": "%",
            "printed_loss": "%",
            "excess_of_mean": "%",
            "excess_of_peak": "%",
            "excess_over_turn": "%",
            "slip_time": "%",
            "slip_work": "%",
        },
        rows,
    )


def shares_by_rounding(config: RigConfig) -> Table:
    """Least and largest share of cycles that slip, for all values that round to the printed delta, deviation and 10 %."""
    rows = []
    d, s = np.meshgrid(np.linspace(0.0315, 0.0325, 201), np.linspace(0.0125, 0.0135, 201))
    limit = _inertia(config, 15) * SPEED**2 * (d + 3.0 * s)
    fits = (limit >= 13.305) & (limit < 13.32)  # printed as 13.31, rounded or cut off
    chain = chain_inertia(replace(config.chain, bar=15 * INCH))
    for ((name, bar), printed), half in zip(SHARES.items(), (0.0005, 0.0005, 0.00005)):
        capacity = clutch_torque(_shoes(config)[name], SPEED)
        inertias = [config.drum.inertia + chain * of for of in ((0.895, 0.9, 0.905) if bar == 13 else (1.0,))]
        shares = np.array([norm.sf((capacity / (one * SPEED**2) - d) / s)[fits] for one in inertias])
        low, high = float(shares.min()), float(shares.max())
        reached = low <= printed + half and high >= printed - half
        rows.append((name, bar * INCH, printed, Case(capacity, inertias[len(inertias) // 2]).share(), low, high, float(reached)))
    return Table(
        "share of cycles that slip, for every delta and deviation that print as 0.032 and 0.013 and give the printed 13.31 Nm",
        {"shoes": "", "bar": "in", "printed": "%", "computed": "%", "least": "%", "most": "%", "reached": "-"},
        rows,
    )


def losses(config: RigConfig) -> Table:
    """Printed losses and losses by each definition, as multiples of the loss of new shoes with 15 in by the same definition."""
    table = slips(config)
    names = list(table.columns)
    made = {(row[0], round(row[1] / INCH)): dict(zip(names, row)) for row in table.rows}
    kinds = ("excess_of_mean", "excess_of_peak", "excess_over_turn", "slip_time", "slip_work")
    first, rows = made["new", 15], []
    for (name, bar), printed in LOSSES.items():
        own = made[name, bar]
        times_first = [own[kind] / first[kind] for kind in kinds]
        ratio = printed / LOSSES["new", 15]
        rows.append((name, bar * INCH, printed, ratio, *times_first, min(times_first), max(times_first)))
    return Table(
        "losses by slip as multiples of that of new shoes with 15 in: no definition gives all of the printed ones",
        {"shoes": "", "bar": "in", "printed_loss": "%", "printed": "-", **dict.fromkeys((*kinds, "least", "most"), "-")},
        rows,
    )


def bars(config: RigConfig) -> Table:
    """Chain, inertia and limit of the load by the length of the bar, compared with the bar of 15 inches."""
    first, mass = _inertia(config, 15), chain_mass(replace(config.chain, bar=15 * INCH))
    rows = []
    for bar in (13, 15, 18, 20):
        own = _inertia(config, bar)
        weight = chain_mass(replace(config.chain, bar=bar * INCH))
        limit = own * LIMIT * SPEED**2
        rows.append((bar * INCH, weight, weight / mass - 1.0, own, limit, np.floor(100.0 * limit) / 100.0, own / first - 1.0))
    return Table(
        "chain, inertia on the drum and limit of the inertia torque (11) at 950 rad/s",
        {"bar": "in", "chain": "kg", "chain_change": "%", "inertia": "kg m2", "limit": "Nm", "cut_off": "Nm", "load_change": "%"},
        rows,
    )


def compared(config: RigConfig) -> Table:
    """Ratios that the paper states in words, and the speed at which a clutch carries the stated multiple of 3.40 Nm."""
    new, worn, _ = _shoes(config).values()
    peak, rows = config.engine.torque_peak, []
    for name, one, stated in (("new clutch over engine", new, 2.0), ("worn clutch over engine", worn, 1.5)):
        speed = brentq(lambda w, one=one, stated=stated: clutch_torque(one, w) - stated * peak, 400.0, 1500.0)
        rows.append((name, stated, clutch_torque(one, 838.0) / peak, speed))
    return Table(
        "ratios that the paper states in words, from its own numbers; the clutch's torque is that at 838 rad/s",
        {"what": "", "stated": "-", "value": "-", "speed_of_stated": "rad/s"},
        [
            *rows,
            ("loss with 13 in over 15 in", 0.5, LOSSES["new", 13] / LOSSES["new", 15], None),
            ("loss with 20 in over 15 in", 3.0, LOSSES["new", 20] / LOSSES["new", 15], None),
            ("mass that a shoe loses", 0.15, 1.0 - WORN / config.clutch.engagement_mass, None),
            ("longest bar over shortest", 2.0, BARS[1] / BARS[0], None),
            ("twice the shortest bar over the longest", 1.0, 2.0 * BARS[0] / BARS[1], None),
        ],
    )


# ---- the same quantities from a recording


def cut(config: RigConfig, recording: Recorded) -> Table:
    """Irregularity, load, turns that slip and loss by torque times slip in a recorded cut."""
    cycles = cycles_of(config, recording)
    w, drum, torque, chain = (recording[name] for name in ("n_engine", "n_drum", "M_clutch", "M_chain"))
    delta, (slipped, touched) = irregularity(w, cycles), slipping(config, recording, cycles)
    rows = np.concatenate([np.arange(b, e) for b, e in zip(cycles.begin, cycles.end)])
    # without this limit the noise of the meters would count as slip
    slip = np.where(np.abs(w - drum)[rows] > 1.0 + (4.0 * config.instruments.speed_noise), (w - drum)[rows], 0.0)
    means = each(chain, cycles, np.mean)
    mean = float(w[rows].mean())
    case = Case(clutch_torque(config.clutch, mean), config.drum.inertia + chain_inertia(config.chain))
    measured = norm.sf((case.capacity / (case.inertia * mean**2) - delta.mean()) / delta.std())
    return Table(
        "turns of the crank in the cut; slipping: a slip begins in them; touched: they have slip; "
        "slipping_static: the share that (13) gives for the measured irregularity",
        {
            "turns": "-",
            "speed": "rad/s",
            "irregularity": "-",
            "irregularity_scatter": "-",
            "load": "Nm",
            "load_scatter": "Nm",
            "largest_torque": "Nm",
            "clutch": "Nm",
            "slipping": "%",
            "touched": "%",
            "slipping_static": "%",
            "loss": "%",
        },
        [
            (
                float(len(delta)),
                mean,
                float(delta.mean()),
                float(delta.std()),
                float(means.mean()),
                float(means.std()),
                float(np.abs(torque[rows]).max()),
                case.capacity,
                float(slipped.mean()),
                float(touched.mean()),
                float(measured),
                float((torque[rows] * slip).sum() / (torque[rows] * w[rows]).sum()),
            )
        ],
    )


def static_and_dynamic(config: RigConfig, recording: Recorded) -> Table:
    """The result of (13) for each turn, with the turn's own irregularity, beside the recorded turn."""
    cycles = cycles_of(config, recording)
    w, torque = recording["n_engine"], recording["M_clutch"]
    delta, (slipped, _) = irregularity(w, cycles), slipping(config, recording, cycles)
    mean, largest = each(w, cycles, np.mean), each(torque, cycles, np.max)
    inertia = config.drum.inertia + chain_inertia(config.chain)
    asked = inertia * delta * mean**2
    carried = np.array([clutch_torque(config.clutch, one) for one in mean])
    says = asked > carried
    rows = []
    for static, name in ((False, "holds"), (True, "slips")):
        for dynamic, other in ((False, "holds"), (True, "slips")):
            these = (says == static) & (slipped == dynamic)
            some = bool(these.any())
            rows.append(
                (
                    name,
                    other,
                    float(these.sum()),
                    float(these.mean()),
                    float(delta[these].mean()) if some else None,
                    float(asked[these].mean()) if some else None,
                    float(carried[these].mean()) if some else None,
                    float(largest[these].mean()) if some else None,
                )
            )
    return Table(
        "turns by the result of (13) for their own irregularity and by the record; asked: J delta w^2; largest: of the clutch",
        {
            "static": "",
            "dynamic": "",
            "turns": "-",
            "share": "%",
            "irregularity": "-",
            "asked": "Nm",
            "clutch": "Nm",
            "largest_torque": "Nm",
        },
        rows,
    )


def harmonics(config: RigConfig, recording: Recorded) -> Table:
    """First harmonic over the crank's angle in turns without and with slip, beside the paper's assumption."""
    cycles = cycles_of(config, recording)
    _, slipped = slipping(config, recording, cycles)
    w = recording["n_engine"]
    delta, mean = irregularity(w, cycles), each(w, cycles, np.mean)
    inertia = config.drum.inertia + chain_inertia(config.chain)
    rows = []
    for name, these in (("holding", ~slipped), ("slipping", slipped)):
        if not these.any():
            continue
        unevenness = float((delta * mean)[these].mean())
        pulse = float((inertia * delta * mean**2)[these].mean())
        expected = {
            "n_engine": (unevenness, -90.0, "rad/s"),
            "n_drum": (unevenness, -90.0, "rad/s"),
            "M_chain": (MEAN, 180.0, "Nm"),
            "M_clutch": (pulse - MEAN, 0.0, "Nm"),
        }
        accelerates = 0.0  # the angle at which the crank's acceleration and the torque of inertia are largest
        for signal, (amplitude, phase, unit) in expected.items():
            found = []
            for b, e in zip(cycles.begin[these], cycles.end[these]):
                angle, value = cycles.angle[b:e], recording[signal][b:e]
                found.append(2.0 * np.mean((value - value.mean()) * np.exp(-1j * angle)))
            first = complex(np.mean(found))
            own = float(np.angle(first))
            if signal == "n_engine":
                accelerates = own + 0.5 * np.pi
            after = (own - accelerates) % (2.0 * np.pi)
            rows.append((name, signal, unit, abs(first), amplitude, own, float(np.radians(phase)), after))
    return Table(
        "first harmonic over the crank's angle, amplitude cos(angle + phase); the paper's is that of (6), (11), (12); "
        "beside_inertia: phase less that of the crank's acceleration",
        {
            "turns": "",
            "signal": "",
            "unit": "",
            "amplitude": "-",
            "paper": "-",
            "phase": "deg",
            "paper_phase": "deg",
            "beside_inertia": "deg",
        },
        rows,
    )


def engagement(config: RigConfig, recording: Recorded) -> Table:
    """Speed at which the shoes touch the drum, and the factor of (5), from the torque of a clutch that slips."""
    w, torque = recording["n_engine"], recording["M_clutch"]
    rows = (w - recording["n_drum"] > 15.0) & (torque > 0.5) & (torque < 8.0)
    if rows.sum() < 10:
        raise RigError("the clutch never slips between 0.5 and 8 Nm in this recording; take one of the sequence throttle_up")
    factor, constant = np.polyfit(w[rows] ** 2, torque[rows], 1)
    own, speed = config.clutch, float(np.sqrt(-constant / factor))
    engaged = engagement_speed(own)
    stated = clutch_torque(own, 1000.0) / (1000.0**2 - engaged**2)
    return Table(
        "straight line through torque over speed squared of the slipping clutch, and the values of (5)",
        {"rows": "-", "speed": "rad/s", "of_shoes": "rad/s", "torque_at_950": "Nm", "by_formula": "Nm", "factor_ratio": "-"},
        [(float(rows.sum()), speed, engaged, factor * SPEED**2 + constant, clutch_torque(own, SPEED), factor / stated)],
    )


CALCULATIONS = {
    "given": given,
    "size": size,
    "speeds": speeds,
    "shelf": shelf,
    "sprocket": sprocket,
    "clutch": clutch,
    "engine": engine,
    "shoes_without_slip": shoes_without_slip,
    "times": times,
    "bars": bars,
    "slips": slips,
    "shares_by_rounding": shares_by_rounding,
    "losses": losses,
    "compared": compared,
    "engagement": engagement,
    "cut": cut,
    "static_and_dynamic": static_and_dynamic,
    "harmonics": harmonics,
}
