# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Calculations of the paper on the MP-5 Ural-2: its matrix and spectra, identification, folding of the full chain, coupling.

Keller, Lesnoj Zhurnal 1990 (received 6 February 1989), reference/002. The paper prints spectra but no inertias and stiffnesses;
spectra.py identifies these.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy import optimize

from rig_nodes.analysis import spectrum, system_of
from rig_nodes.base import RigError
from rig_nodes.driveline import modes
from rig_nodes.rigs.ural2.spectra import (
    BOX,
    C_2,
    C_2_SERIAL,
    HALF,
    HIGHEST,
    MIDDLE,
    NEW_FLYWHEEL,
    PRINTED,
    ROWS,
    SHARE,
    STARTS,
    TURN,
    WANTED,
    alike,
    chain,
    identified,
    intervals,
    misses,
    pushed,
    spectra_of,
)
from rig_nodes.runs import Table

if TYPE_CHECKING:
    from rig_nodes.rig import RigConfig
    from rig_nodes.runs import Recorded

NAMES = ("I_1", "I_2", "I_3", "I_d", "I_4", "I_5", "c_1", "c_2", "c_3", "c_4")
SETTINGS = (
    *(f"{body}.inertia" for body in ("flywheel", "crank", "shoes", "drum", "gearbox", "cutting")),
    *(f"shaft_{k}.stiffness" for k in (1, 2, 3, 4)),
)
RINGS = (2e-3, 1.4)  # s after the ignition is switched off, between which the ringing is evaluated


def _values(config: RigConfig) -> np.ndarray:
    """The rig's values in the order of NAMES [SI]."""
    return np.array([float(getattr(getattr(config, name.partition(".")[0]), name.partition(".")[2])) for name in SETTINGS])


# ---- tables


def matrix(config: RigConfig) -> Table:
    """Elements of the matrix A of the paper, c - I w^2 + j w h, of the locked five-mass chain."""
    p = _values(config)
    c, h = p[6:], [getattr(config, f"shaft_{k}").damping for k in (1, 2, 3, 4)]
    i = [p[0], p[1], p[2] + p[3], p[4], p[5]]
    rows = []
    for k in range(5):
        around = [k - 1, k]
        of = [q for q in around if 0 <= q < 4]
        rows.append((f"a{k + 1}{k + 1}", float(sum(c[q] for q in of)), i[k], float(sum(h[q] for q in of))))
        if k < 4:
            rows.append((f"a{k + 1}{k + 2}", -float(c[k]), 0.0, -float(h[k])))
    return Table(
        "elements of A, p. 2; its a33 is printed with h_2 where h_3 is meant",
        {"element": "", "stiffness": "Nm/rad", "inertia": "kg m2", "damping": "Nm s/rad"},
        rows,
    )


def spectra(config: RigConfig) -> Table:
    """Natural frequencies of the rig in the paper's variants, beside the printed ones."""
    variants = {
        "flywheel": config.with_values({"flywheel.inertia": NEW_FLYWHEEL}),
        "shaft": config.with_values({"shaft_2.stiffness": SHARE * config.shaft_2.stiffness}),
        "serial": config,
    }
    rows = []
    for name, one in variants.items():
        system = system_of(one)
        for regime, locked in (("idle", ()), ("work", ("clutch",))):
            # at idle the paper's chain does not include the drum's side, so that only modes that move the flywheel count
            found = modes(system, locked)
            at = found.bodies.index("flywheel")
            own = [f for f, shape in zip(found.frequencies, found.shapes) if f > 0.0 and abs(shape[at]) > 1e-9]
            for k, f in enumerate(own):
                printed = PRINTED.get((name, regime))
                rows.append((name, regime, k + 1.0, float(TURN * f), printed[k] if printed else None))
    return Table(
        "spectra, p. 1 and 3; shaft: c_2 at 0.36 of the serial one, as 3.6e3 is of 1e4",
        {"variant": "", "regime": "", "mode": "-", "frequency": "rad/s", "printed": "rad/s"},
        rows,
    )


def masses(config: RigConfig) -> Table:
    """Number of masses of the chain in the paper's regimes: one more than it has frequencies above 0."""
    of = [(row[0], row[1]) for row in spectra(config).rows]
    return Table(
        "masses of the serial saw's chain",
        {"regime": "", "masses": "-"},
        [(regime, of.count(("serial", regime)) + 1.0) for regime in ("idle", "work")],
    )


def identification(config: RigConfig) -> Table:
    """Inertias and stiffnesses from the printed spectra: the chosen values, and the range in which each could lie."""
    best = identified()
    low, high = intervals()
    spread = np.std(np.log([best, *alike(20)]), axis=0)
    inside = [bool(a > 1.01 * lo and b < 0.99 * hi) for a, b, lo, hi in zip(low, high, *np.exp(BOX))]
    rows = [
        (name, unit, float(v), float(r), float(a), float(b), float(s), "bounded" if ok else "not bounded by the print")
        for name, unit, v, r, a, b, s, ok in zip(
            NAMES, ["kg m2"] * 6 + ["Nm/rad"] * 4, best, _values(config), low, high, spread, inside
        )
    ]
    return Table(
        "from all frequencies of two digits, the serial 523 and 164..184 1/s; the scale is that of I_1 = 20e-4 kg m2",
        {"parameter": "", "unit": "", "value": "-", "rig": "-", "low": "-", "high": "-", "spread_of_ln": "-", "says": ""},
        rows,
    )


def directions(config: RigConfig) -> Table:
    """Combinations of the parameters and how well the spectra determine them: singular values of d ln f / d ln parameter."""
    x = np.log(_values(config))
    f, slopes = spectra_of(x)
    _, sizes, right = np.linalg.svd(slopes[ROWS] / f[ROWS, None])
    rows = []
    for k, size in enumerate(sizes):
        way = right[k] * np.sign(right[k][np.abs(right[k]).argmax()])
        most = sorted(range(10), key=lambda q: -abs(way[q]))[:4]
        words = " ".join(f"{way[q]:+.2f} ln {NAMES[q]}" for q in most)
        rows.append((k + 1.0, float(size), float(HALF / 600.0 / size), words))
    return Table(
        "combinations of parameters, best determined first; uncertainty: that which half a unit of the print causes at 600 1/s",
        {"combination": "-", "singular_value": "-", "uncertainty": "-", "mostly": ""},
        rows,
    )


def monotony(config: RigConfig) -> Table:
    """Contradiction of the spectra to the paper's matrix, by which no frequency at work is below that of the same rank at idle.

    With c_3 = h_3 = 0 the five-mass chain separates into the chain at idle and a pair of masses. With less stiffness no frequency
    of a rank rises (Courant-Fischer), so that idle 0, 0, w_1, w_2 and the frequency of the pair are lower bounds for 0 and the four
    frequencies at work.
    """
    rows = []
    for name in ("flywheel", "shaft"):
        idle, work = PRINTED[name, "idle"], PRINTED[name, "work"]
        # the frequency of the pair can only raise the rank of those at idle: the highest two are at least w_1 and w_2
        for k, f in ((4, idle[1]), (3, idle[0])):
            rows.append((name, float(k), f, work[k - 1], 0.5 * max(0.0, f - work[k - 1]), 0.5 * max(0.0, f - work[k - 1]) / HALF))
    return Table(
        "least frequency at work by the one of the same rank at idle, the printed one, and the least error of one of the two",
        {"variant": "", "mode": "-", "least": "rad/s", "printed": "rad/s", "wrong_by": "rad/s", "half_units": "-"},
        rows,
    )


def printed_stiffness(config: RigConfig) -> Table:
    """Least error of the spectra with c_2' = 1e4, c_2 = 3.6e3 Nm/rad and I_1 = 20e-4 kg m2, whatever the other parameters are."""
    given = {"shaft": C_2, "serial": C_2_SERIAL}
    random = np.random.default_rng(2)
    worst, best = np.inf, None
    for _ in range(12):
        start = optimize.least_squares(
            lambda x: misses(x, **given)[0][:12], random.uniform(*STARTS), lambda x: misses(x, **given)[1][:12], bounds=BOX
        ).x
        found = optimize.minimize(
            lambda y: (y[10], np.eye(11)[10]),
            [*start, np.abs(misses(start, **given)[0][:12]).max()],
            jac=True,
            method="SLSQP",
            bounds=[*np.transpose(BOX), (0.0, 1e4)],
            constraints=[
                {
                    "type": "ineq",
                    "fun": lambda y, s=s: y[10] - s * misses(y[:10], **given)[0][:12],
                    "jac": lambda y, s=s: np.hstack([-s * misses(y[:10], **given)[1][:12], np.ones((12, 1))]),
                }
                for s in (1.0, -1.0)
            ],
            options={"maxiter": 300, "ftol": 1e-8},
        )
        reached = float(np.abs(misses(found.x[:10], **given)[0][:12]).max())
        if reached < worst:
            worst, best = reached, found.x[:10]
    f = spectra_of(best, **given)[0][:12]
    keys = [(variant, regime, k + 1.0) for (variant, regime), those in PRINTED.items() for k in range(len(those))]
    rows = [(*key, float(one), float(wanted), float(abs(one - wanted) / HALF)) for key, one, wanted in zip(keys, f, WANTED)]
    rows.append(("all", "", 0.0, None, None, worst))
    return Table(
        "spectra nearest to the print with both stiffnesses as printed; off: in half units of the last printed digit",
        {"variant": "", "regime": "", "mode": "-", "frequency": "rad/s", "printed": "rad/s", "off": "-"},
        rows,
    )


def highest_middle(config: RigConfig) -> Table:
    """The highest frequency of the serial saw that the printed spectra of its variants allow, beside the printed 1746 1/s."""
    rows = []
    for regime, row in (("idle", 13), ("work", 17)):
        top = 0.0
        for start in (identified(), *alike(5)):
            found = pushed(lambda x, row=row: tuple(-1e-2 * one[row] for one in spectra_of(x)), np.log(start))
            if found is not None:
                top = max(top, float(spectra_of(found)[0][row]))
        rows.append((regime, top, MIDDLE[1], MIDDLE[1] / top - 1.0))
    return Table(
        "highest frequency of the serial saw over all parameters that agree with the spectra of p. 3; p. 1 prints 1746 1/s",
        {"regime": "", "highest": "rad/s", "printed": "rad/s", "beyond": "%"},
        rows,
    )


def bench(config: RigConfig) -> Table:
    """Least deviation of a saw with the paper's matrix from the printed spectra, which a bench confirmed to 12 %.

    The matrix has one I_3 for idle and work, so that I_d is zero. Of all such saws the calculation finds the one whose largest
    deviation from the print is least: first for the spectrum of the saw with the coupling, which was on the bench, then for all
    spectra of p. 3 and the stiffness c_2 together, with I_1 = 20e-4 kg m2 and c_2 at 0.36 of c_2'.
    """
    free = np.delete(np.arange(10), 3)
    random = np.random.default_rng(4)

    def deviations(y: np.ndarray, rows: np.ndarray, stiffness: bool) -> tuple[np.ndarray, np.ndarray]:
        x = np.insert(y[:9], 3, np.log(1e-15))
        f, slopes = spectra_of(x)
        off, by = f[rows] / WANTED[rows] - 1.0, slopes[np.ix_(rows, free)] / WANTED[rows, None]
        if stiffness:
            share = np.exp(y[6]) / C_2_SERIAL
            off, by = np.append(off, share - 1.0), np.vstack([by, share * np.eye(9)[6]])
        return off, np.hstack([by, np.zeros((len(by), 1))])

    rows = []
    for name, which, stiffness in (
        ("saw with the coupling", np.arange(6, 12), False),
        ("all spectra", np.arange(12), False),
        ("all spectra and c_2", np.arange(12), True),
    ):
        least = np.inf
        for _ in range(6):
            start = random.uniform(*STARTS)[free]
            start = optimize.least_squares(
                lambda y, w=which, c=stiffness: deviations(np.append(y, 0.0), w, c)[0],
                start,
                lambda y, w=which, c=stiffness: deviations(np.append(y, 0.0), w, c)[1][:, :9],
                bounds=(BOX[0][free], BOX[1][free]),
            ).x
            largest = np.abs(deviations(np.append(start, 0.0), which, stiffness)[0]).max()
            found = optimize.minimize(
                lambda y: (y[9], np.eye(10)[9]),
                np.append(start, largest),
                jac=True,
                method="SLSQP",
                bounds=[*np.transpose(BOX)[free], (0.0, 10.0)],
                constraints=[
                    {
                        "type": "ineq",
                        "fun": lambda y, s=s, w=which, c=stiffness: y[9] - s * deviations(y, w, c)[0],
                        "jac": lambda y, s=s, w=which, c=stiffness: np.eye(10)[9] - s * deviations(y, w, c)[1],
                    }
                    for s in (1.0, -1.0)
                ],
                options={"maxiter": 300, "ftol": 1e-9},
            )
            least = min(least, float(np.abs(deviations(found.x, which, stiffness)[0]).max()))
        rows.append((name, least))
    return Table(
        "least deviation from the print that a saw with the matrix of p. 2 can have; the bench had at most 12 %, p. 4",
        {"what": "", "deviation": "%"},
        rows,
    )


# ---- folding


def full_chain(folded: np.ndarray, oiler: float, wedge: float, inline: bool) -> tuple[np.ndarray, np.ndarray, dict[str, float]]:
    """Return masses and links of the full chain of seven masses for a folded one (10,), and its parameters.

    The figure is lost. By the printed formulas I_7 lies between masses 4 and 5, and I_6 is connected to 4 by c_7, beside the chain
    or in it. The shares ``oiler`` of I_6 and ``wedge`` of I_7 in I_4 are assumed. With c_7, I_4 and I_6 have the partial frequency
    2.24e4 1/s.
    """
    i1, i2, i3, drum, i4n, i5n, c1, c2, c3n, c4n = folded
    i7 = wedge * i4n
    c4 = c5 = 2.0 * c4n
    i4 = i4n - i7 * c4 / (c4 + c5)
    i6, i4 = oiler * i4, (1.0 - oiler) * i4
    i5 = i5n - i7 * c5 / (c4 + c5)
    c7 = HIGHEST[0] ** 2 * i4 * i6 / (i4 + i6)
    c3 = c3n
    if inline:  # c_3 and c_4 do not include the shares of 1 / c_7 that folding adds to either side
        c3 = 1.0 / (1.0 / c3n - oiler / c7)
        c4 = 1.0 / (1.0 / c4n - (1.0 - oiler) / c7) * 2.0
        c5 = c4
    given = {"I_4": i4, "I_5": i5, "I_6": i6, "I_7": i7, "c_3": c3, "c_4": c4, "c_5": c5, "c_7": c7}
    masses = np.array([i1, i2, i3 + drum, i4, i6, i7, i5])  # 1 2 3 4 6 7 5
    ends = [(0, 1, c1), (1, 2, c2), (2, 3, c3), (3, 4, c7), (4 if inline else 3, 5, c4), (5, 6, c5)]
    return masses, np.array(ends), given


def _frequencies(masses: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """Natural frequencies above 0 [1/s] of masses with links (from, to, stiffness)."""
    k = np.zeros((len(masses), len(masses)))
    for a, b, c in ends:
        row = np.zeros(len(masses))
        row[int(a)], row[int(b)] = 1.0, -1.0
        k += c * np.outer(row, row)
    root = 1.0 / np.sqrt(masses)
    return np.sqrt(np.maximum(np.linalg.eigvalsh(root[:, None] * k * root), 0.0))[1:]


def _simplified(folded: np.ndarray, given: dict[str, float], rule: str) -> np.ndarray:
    """Frequencies of the five masses by the derived or the printed rule."""
    g = given
    if rule == "printed":
        i4 = g["I_4"] + g["I_6"] + g["I_7"] * (g["c_4"] + g["c_5"]) / g["c_5"]
        i5 = g["I_5"] + g["I_7"] * (g["c_4"] + g["c_5"]) / g["c_4"]
        c7 = g["I_6"] * g["c_7"] / (g["I_4"] + g["I_6"])
        c3, c4 = g["c_3"] * c7 / (g["c_3"] + c7), g["c_4"] * g["c_5"] / (g["c_4"] + g["c_5"])
    else:
        i4, i5, c3, c4 = folded[4], folded[5], folded[8], folded[9]
    return chain([folded[0], folded[1], folded[2] + folded[3], i4, i5], [folded[6], folded[7], c3, c4])[0]


def folding(config: RigConfig) -> Table:
    """Factors of the folding, derived and printed: a mass between two links, and two masses with a link between them.

    At low frequencies the angle of a mass between two links is (c_4 x_4 + c_5 x_5) / (c_4 + c_5), and its momentum is divided
    between the two sides by the same shares, whose sum is 1. Of two masses on a link the outer one takes the share
    I_6 / (I_4 + I_6) of the torque, so that the link's compliance counts with this share: c_7' = c_7 (I_4 + I_6) / I_6.
    """
    _, _, g = full_chain(_values(config), 0.02, 0.02, False)
    both = g["c_4"] + g["c_5"]
    share = g["I_6"] / (g["I_4"] + g["I_6"])
    rows = [
        ("I_7 to I_4", g["c_4"] / both, both / g["c_5"]),
        ("I_7 to I_5", g["c_5"] / both, both / g["c_4"]),
        ("I_7 in all", 1.0, both / g["c_5"] + both / g["c_4"]),
        ("c_7' over c_7", 1.0 / share, share),
    ]
    return Table(
        "factors of the folding with c_4 = c_5 and I_6 at 2 % of I_4 + I_6; printed ones, p. 2, add I_7 four times or more",
        {"factor": "", "derived": "-", "printed": "-"},
        rows,
    )


def folding_error(config: RigConfig) -> Table:
    """Largest error of the simplified chain in 500..2000 1/s against the full one, by derived and by printed factors."""
    folded = _values(config)
    rows = []
    for place, inline in (("beside", False), ("in line", True)):
        for oiler in (0.01, 0.02, 0.05, 0.2):
            for wedge in (0.001, 0.02, 0.1):
                masses, ends, given = full_chain(folded, oiler, wedge, inline)
                full = _frequencies(masses, ends)
                errors = []
                for rule in ("derived", "printed"):
                    simple = _simplified(folded, given, rule)
                    inside = [(s, f) for s, f in zip(simple, full) if 500.0 <= f <= 2000.0]
                    errors.append(max(abs(s / f - 1.0) for s, f in inside))
                rows.append((place, oiler, wedge, float(full[-1]), *errors))
    return Table(
        "shares of I_6 and I_7 in I_4 are assumed, as is the place of I_6; the paper states at most 12 %",
        {"oiler": "", "oiler_share": "%", "wedge_share": "%", "highest": "rad/s", "derived": "%", "printed": "%"},
        rows,
    )


def ringing(config: RigConfig, recording: Recorded) -> Table:
    """Frequencies at which the shafts ring after the ignition ends at work, by the averaged spectrum of their torques."""
    off = next((t for t, _, text, _ in recording.events if text.endswith("off")), None)
    if off is None or recording.t[-1] < off + RINGS[1]:
        found = "nothing is switched off"
        if off is not None:
            found = f"the engine is switched off only {recording.t[-1] - off:.3g} s before the end"
        raise RigError(f"in this recording {found}; take a run of the sequence step, whose shafts ring for {RINGS[1]:g} s")
    inside = (recording.t >= off + RINGS[0]) & (recording.t < off + RINGS[1])
    peaks = {
        name: spectrum(recording[name][inside], float(recording.t[1] - recording.t[0]), highest=300.0).peaks
        for name in ("M_1", "M_4")
    }
    found = modes(system_of(config), ("clutch",)).frequencies
    rows = []
    for mode, name in ((1, "M_4"), (2, "M_4"), (3, "M_1"), (4, "M_1")):  # the shaft whose torque shows this mode best
        at = min((one for one, _ in peaks[name]), key=lambda one: abs(one - found[mode]), default=0.0)
        rows.append((float(mode), name, float(TURN * found[mode]), float(TURN * at), float(at / found[mode] - 1.0)))
    return Table(
        "natural frequencies at work, computed and in the spectrum of the run",
        {"mode": "-", "signal": "", "computed": "rad/s", "measured": "rad/s", "off": "%"},
        rows,
    )


def high_frequencies(config: RigConfig) -> Table:
    """Frequencies of the full chain with an oiler and a wedge that meet the printed high ones, 2.24e4 and 3.30e4 1/s."""
    folded = _values(config)

    def off(y: np.ndarray) -> np.ndarray:
        masses, ends, _ = full_chain(folded, 0.02, float(np.exp(y[0])), False)
        return np.array([_frequencies(masses, ends)[-1] / HIGHEST[1] - 1.0])

    wedge = float(np.exp(optimize.least_squares(off, [np.log(3e-4)]).x[0]))
    masses, ends, given = full_chain(folded, 0.02, wedge, False)
    full = _frequencies(masses, ends)
    rows = [(k + 1.0, float(f)) for k, f in enumerate(full)]
    return Table(
        f"full chain with I_6 {given['I_6']:.3g}, I_7 {given['I_7']:.3g} kg m2, c_7 {given['c_7']:.3g} Nm/rad, for the highest two",
        {"mode": "-", "frequency": "rad/s"},
        rows,
    )


# ---- coupling

DISC = {"d_n": 0.01, "D_1": 0.039, "D_2": 0.09, "D": 0.064, "h": 0.0385, "A_c": 0.4, "A_s": 12.0, "safety": 1.35}  # p. 4
RUBBER = (1e6, 2e7)  # Pa, from the softest to the hardest rubber: Young's modulus
RUBBER_STRENGTH = (5e6, 32e6)  # Pa, tensile strength from weak silicone rubbers to the strongest natural ones
JAM = 7300.0 * np.pi / 30.0  # rad/s, speed of the sequence work


def coupling(config: RigConfig) -> Table:
    """Stiffness of the coupling in series, modulus of its disc, and stress per torque, p. 3 and 4."""
    c_m = C_2 * C_2_SERIAL / (C_2_SERIAL - C_2)
    b = 0.5 * (DISC["D_2"] - DISC["D_1"])

    def modulus(stiffness: float) -> float:
        return 4.0 * DISC["A_c"] * stiffness / (3.0 * np.pi * DISC["h"] * DISC["D"] ** 2)

    e = modulus(c_m)
    stress = DISC["A_s"] / (4.0 * b * DISC["h"] * DISC["D"])
    rows = [
        ("c_m [Nm/rad]", c_m),
        ("b [m]", b),
        ("d_n / b", DISC["d_n"] / b),
        ("E of the disc, c_m in Nm/rad [MPa]", e * 1e-6),
        ("E of the disc, c_m in kN m/rad [MPa]", modulus(1e3 * c_m) * 1e-6),
        ("h with that E [m]", 4.0 * DISC["A_c"] * c_m / (3.0 * np.pi * e * DISC["D"] ** 2)),
        ("c_m unit over that of the hardest rubber", modulus(1e3 * c_m) / RUBBER[1]),
        ("stress per torque [Pa/Nm]", stress),
        ("strength per torque with the safety 1.35 [Pa/Nm]", DISC["safety"] * stress),
        ("c_m of the rig [Nm/rad]", SHARE / (1.0 - SHARE) * config.shaft_2.stiffness),
    ]
    return Table("coupling by the formulas of p. 3 and 4", {"what": "", "value": "-"}, [(n, float(v)) for n, v in rows])


def given(config: RigConfig) -> Table:
    """Values that the paper gives, as the calculations use them."""
    return Table(
        "values that the paper gives, p. 3 and 4",
        {"what": "", "value": "-"},
        [
            ("I_1 [1e-4 kg m2]", NEW_FLYWHEEL * 1e4),
            *((f"{name} [mm]", DISC[name] * 1e3) for name in ("d_n", "D_1", "D_2", "D", "h")),
            *((name, DISC[name]) for name in ("A_c", "A_s", "safety")),
        ],
    )


def disc_safety(config: RigConfig) -> Table:
    """Torque M_3 at which the disc has the printed safety, if its rubber is the weakest and if it is the strongest.

    Neither M_3 nor the strength is printed. But a jam of the chain loads the coupling at least with the torque of the engine, and
    at most with the torque that arises when the clutch stops at once while flywheel and crank turn: w sqrt(c_2 (I_1 + I_2)).
    """
    stress = DISC["A_s"] / (2.0 * (DISC["D_2"] - DISC["D_1"]) * DISC["h"] * DISC["D"])
    engine = config.engine.torque_peak
    jam = JAM * np.sqrt(SHARE * config.shaft_2.stiffness * (config.flywheel.inertia + config.crank.inertia))
    rows = []
    for name, strength in zip(("weakest", "strongest"), RUBBER_STRENGTH):
        torque = strength / (DISC["safety"] * stress)
        rows.append((name, strength, torque, torque / engine, float(torque / jam)))
    return Table(
        f"torque at which the safety is 1.35; engine: {engine:.3g} Nm; jam, a clutch that stops at once at 7300 rpm: {jam:.4g} Nm",
        {"rubber": "", "strength": "MPa", "torque": "Nm", "over_engine": "-", "over_jam": "-"},
        rows,
    )


def disc_holes(config: RigConfig) -> Table:
    """Rubber that is left between the holes of the pins and the edges of the disc."""
    d = DISC
    inner, outer = 0.5 * (d["D"] - d["d_n"] - d["D_1"]), 0.5 * (d["D_2"] - d["D"] - d["d_n"])
    return Table("rubber beside the holes", {"inside": "mm", "outside": "mm", "least": "mm"}, [(inner, outer, min(inner, outer))])


CALCULATIONS = {
    "given": given,
    "matrix": matrix,
    "spectra": spectra,
    "masses": masses,
    "identification": identification,
    "directions": directions,
    "monotony": monotony,
    "printed_stiffness": printed_stiffness,
    "highest_middle": highest_middle,
    "folding": folding,
    "folding_error": folding_error,
    "high_frequencies": high_frequencies,
    "ringing": ringing,
    "coupling": coupling,
    "disc_safety": disc_safety,
    "disc_holes": disc_holes,
    "bench": bench,
}
