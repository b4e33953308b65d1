# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The chain of the MP-5 Ural-2, its spectra, and the parameters that agree with the printed ones; calculations.py uses it.

The paper prints spectra but no inertias and stiffnesses; these are identified here, and rig.yaml has the results.
"""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from scipy import optimize

if TYPE_CHECKING:
    from collections.abc import Callable

TURN = 2.0 * np.pi
NEW_FLYWHEEL = 20e-4  # kg m2, p. 3
C_2, C_2_SERIAL = 3.6e3, 1e4  # Nm/rad, p. 3; the paper prints kN m/rad, see `coupling`
SHARE = C_2 / C_2_SERIAL
# printed spectra [1/s] by variant and regime, p. 3; two digits, so half a unit of the last one is 5 1/s
PRINTED = {
    ("flywheel", "idle"): (620.0, 1310.0),
    ("flywheel", "work"): (170.0, 520.0, 560.0, 1190.0),
    ("shaft", "idle"): (650.0, 1050.0),
    ("shaft", "work"): (180.0, 520.0, 550.0, 1030.0),
}
HALF = 5.0
LOWEST, MIDDLE, HIGHEST = (164.0, 184.0), (523.0, 1746.0), (2.24e4, 3.30e4)  # of the serial saw, p. 1
BOX = (np.log([1e-5] * 6 + [1.0] * 4), np.log([1.0] * 6 + [1e6] * 4))  # kg m2, Nm/rad: bounds of the search
STARTS = (np.log([3e-4] * 6 + [20.0, 500.0, 20.0, 20.0]), np.log([5e-3] * 6 + [2e3, 1e4, 1e3, 1e3]))
EVEN = 0.1  # weight of the evenness of the inertias in the choice among sets that agree with the print
WITHIN = 0.9  # largest error of the chosen values, in half units


# ---- the chain


def chain(inertias: np.ndarray, stiffnesses: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return natural frequencies above 0 (n - 1,) [1/s] of a free chain, and d ln f / d ln of (n inertias, n - 1 stiffnesses)."""
    inertias, stiffnesses = np.asarray(inertias, float), np.asarray(stiffnesses, float)
    n = len(inertias)
    d = np.diff(np.eye(n), axis=0)  # from angles to twists
    root = 1.0 / np.sqrt(inertias)
    squares, vectors = np.linalg.eigh(root[:, None] * (d.T * stiffnesses @ d) * root)
    shapes = (root[:, None] * vectors)[:, 1:]
    slopes = np.hstack([-0.5 * inertias * shapes.T**2, 0.5 * stiffnesses * (d @ shapes).T ** 2 / squares[1:, None]])
    return np.sqrt(np.maximum(squares[1:], 0.0)), slopes


def spectra_of(x: np.ndarray, shaft: float | None = None, serial: float | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Return the 12 printed frequencies and the 6 of the serial saw [1/s], with slopes for the logarithms x (10,) of parameters.

    The order is idle and work with the new flywheel, with the new shaft and of the serial saw. The driven half of the clutch, I_d,
    turns with the driving one at work only. ``shaft`` and ``serial`` are c_2 and c_2' [Nm/rad]; without them c_2' is x[7] and
    c_2 its printed share.
    """
    p = np.exp(x)
    made = p[7] if serial is None else serial
    soft = SHARE * made if shaft is None else shaft
    found, slopes = [], []
    for first, second in ((NEW_FLYWHEEL, made), (p[0], soft), (p[0], made)):
        own = float(first == p[0])
        for work in (False, True):
            i = [first, p[1], p[2] + p[3] * work, *(p[4:6] if work else ())]
            f, s = chain(i, [p[6], second, *(p[8:10] if work else ())])
            n, jac = len(i), np.zeros((len(f), 10))
            jac[:, 0], jac[:, 1] = own * s[:, 0], s[:, 1]
            jac[:, 2], jac[:, 3] = s[:, 2] * p[2] / i[2], s[:, 2] * p[3] * work / i[2]
            jac[:, 6], jac[:, 7] = s[:, n], s[:, n + 1] * (serial is None)
            if work:
                jac[:, 4:6], jac[:, 8:10] = s[:, 3:5], s[:, n + 2 :]
            found.append(f)
            slopes.append(f[:, None] * jac)
    return np.concatenate(found), np.vstack(slopes)


WANTED = np.array([f for those in PRINTED.values() for f in those])
# rows of spectra_of with a printed value, and the middle and half width of the range that the print allows: the two-digit numbers,
# the lowest frequency of the serial saw at work and its next one, which is the lowest of the middle ones
ROWS = np.array([*range(12), 14, 15])
MEAN = np.array([*WANTED, 0.5 * sum(LOWEST), MIDDLE[0]])
WIDTH = np.array([HALF] * 12 + [0.5 * (LOWEST[1] - LOWEST[0]), 0.5])


def misses(x: np.ndarray, **given: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the errors of the 14 printed frequencies, 1 at the edge of the accepted range, with slopes (14, 10)."""
    f, slopes = spectra_of(x, **given)
    return (f[ROWS] - MEAN) / WIDTH, slopes[ROWS] / WIDTH[:, None]


def _lacks(x: np.ndarray, even: float, within: float) -> np.ndarray:
    miss, _ = misses(x)
    over = np.sign(miss) * np.maximum(np.abs(miss) - within, 0.0)
    return np.concatenate([over / (1.0 - within) * 3.0, even * (x[:6] - x[:6].mean())])


def _lacks_by(x: np.ndarray, even: float, within: float) -> np.ndarray:
    miss, slopes = misses(x)
    over = np.where(np.abs(miss) > within, 3.0 / (1.0 - within), 0.0)
    evened = np.zeros((6, 10))
    evened[:, :6] = even * (np.eye(6) - 1.0 / 6.0)
    return np.vstack([over[:, None] * slopes, evened])


@lru_cache(maxsize=1)
def identified() -> np.ndarray:
    """Return the chosen parameters (10,), the best result from 24 random starts.

    Of all parameters within 0.9 of the half unit of every printed digit, those are chosen whose inertias are most alike.
    """
    random, found = np.random.default_rng(1), []
    for _ in range(24):
        start = random.uniform(*STARTS)
        one = optimize.least_squares(_lacks, start, _lacks_by, bounds=BOX, args=(EVEN, WITHIN), max_nfev=400)
        found.append((one.cost, tuple(one.x)))
    return np.exp(min(found)[1])


@lru_cache
def alike(count: int) -> tuple[np.ndarray, ...]:
    """Return ``count`` other sets of parameters (10,) that also agree with the print, from random starts."""
    random, out = np.random.default_rng(3), []
    while len(out) < count:
        start = random.uniform(*STARTS)
        one = optimize.least_squares(_lacks, start, _lacks_by, bounds=BOX, args=(0.0, 0.99), max_nfev=400)
        if np.abs(misses(one.x)[0]).max() <= 1.0:
            out.append(np.exp(one.x))
    return tuple(out)


@lru_cache(maxsize=1)
def intervals() -> tuple[np.ndarray, np.ndarray]:
    """Lowest and highest value of each parameter for which some values of the others agree with the print (10,)."""
    best = identified()
    starts = [np.log(one) for one in (best, *alike(3))]
    ends = np.log(best) * np.ones((2, 1))
    for k in range(10):
        for side, sign in ((0, 1.0), (1, -1.0)):
            for start in starts:
                end = pushed(lambda x, k=k, sign=sign: (sign * x[k], sign * np.eye(10)[k]), start)
                if end is not None:
                    ends[side, k] = (min if side == 0 else max)(ends[side, k], end[k])
    return np.exp(ends[0]), np.exp(ends[1])


def pushed(aim: Callable[[np.ndarray], tuple], start: np.ndarray) -> np.ndarray | None:
    """Parameters that agree with the print and minimise ``aim``, which returns value and slopes; None where none was found."""
    found = optimize.minimize(
        aim,
        start,
        jac=True,
        method="SLSQP",
        bounds=np.transpose(BOX),
        constraints=[
            {"type": "ineq", "fun": lambda x: 1.0 - misses(x)[0], "jac": lambda x: -misses(x)[1]},
            {"type": "ineq", "fun": lambda x: 1.0 + misses(x)[0], "jac": lambda x: misses(x)[1]},
        ],
        options={"maxiter": 200, "ftol": 1e-7},
    )
    return found.x if np.abs(misses(found.x)[0]).max() <= 1.0 + 1e-6 else None
