# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Finds which speeds of a driveline are free: eliminates its gears, planetary sets and other linear relations exactly.

Used by driveline/builder.py. Bodies that gears alone join turn as one, by factors that are products of the gear ratios. Every
other relation then removes one of these speeds, that of a body without inertia if there is one. Between shafts the balance of
torques at such a body is a relation too.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from rig_nodes.base import RigError

if TYPE_CHECKING:
    from rig_nodes.base import Floats

GROUND = "ground"
_SAME = 1e-9  # relative size up to which a difference counts as zero


def bodies_from_speeds(
    inertia: Mapping[str, float],
    gears: Sequence[tuple[str, str, float]],
    relations: Mapping[str, Mapping[str, float]],
    kept: Collection[str] = (),
) -> tuple[tuple[str, ...], np.ndarray]:
    """Return the bodies whose speeds are free, and the coefficients that give the speeds of all bodies from these.

    Parameters
    ----------
    inertia : mapping of str to float
        Inertia of each body, 0 for one without.
    gears : sequence of (str, str, float)
        Gears (a, b, ratio) with w_a = ratio w_b.
    relations : mapping of str to mapping
        By name, the coefficients of bodies; the sum of coefficients times speeds is 0.
    kept : collection of str
        Bodies whose speeds are free before all others, as they are prescribed.

    Returns
    -------
    tuple of str
        The n bodies whose speeds are free.
    (b, n) array of float
        Speeds of all bodies by the free ones.

    Raises
    ------
    RigError
        For loops that cannot turn, for relations that add nothing new and for bodies that could turn without moving any inertia.
    """
    free, t = _tied(inertia, gears, relations, kept)
    _moves_inertia(inertia, free, t)
    return tuple(free), t


def move_nothing(
    inertia: Mapping[str, float], gears: Sequence[tuple[str, str, float]], relations: Mapping[str, Mapping[str, float]]
) -> dict[str, np.ndarray]:
    """Return the bodies whose free speeds move no inertia, each with the speeds (b,) of all bodies where its own speed is 1.

    The arguments and errors are those of :func:`bodies_from_speeds`. The result is empty where each body
    without inertia can turn only together with bodies that have some.
    """
    free, t = _tied(inertia, gears, relations)
    heavy = t[[j > 0.0 for j in inertia.values()]]
    alone = np.flatnonzero(~heavy.any(axis=0))
    return {free[j]: t[:, j] for j in alone}


def _tied(
    inertia: Mapping[str, float],
    gears: Sequence[tuple[str, str, float]],
    relations: Mapping[str, Mapping[str, float]],
    kept: Collection[str] = (),
) -> tuple[list[str], np.ndarray]:
    """Do the elimination of :func:`bodies_from_speeds`, also where a speed moves no inertia."""
    bodies = tuple(inertia)
    root, factor = _gear_groups(inertia, gears)
    free = [name for name in bodies if root[name] == name]
    heavy = {root[name] for name, j in inertia.items() if j > 0.0}
    last = {root[name] for name in kept}
    t = np.zeros((len(bodies), len(free)))
    for i, name in enumerate(bodies):
        t[i, free.index(root[name])] = factor[name]
    for name, coefficients in relations.items():
        sizes = np.zeros(len(free))
        row = np.zeros(len(free))
        for body, c in coefficients.items():
            if body != GROUND:
                row += c * t[bodies.index(body)]
                sizes += np.abs(c * t[bodies.index(body)])
        row[np.abs(row) <= _SAME * max(sizes, default=0.0)] = 0.0
        if not row.any():
            raise RigError(f"driveline: {name} says no more than the gears and relations before it; leave it out")
        goes = max((j for j in range(len(free)) if row[j] != 0.0), key=lambda j: (free[j] not in last, free[j] not in heavy, j))
        was = np.abs(t).max(axis=1)
        t = np.delete(t - np.outer(t[:, goes], row / row[goes]), goes, axis=1)
        del free[goes]
        t[np.abs(t) <= 1e-3 * _SAME * was[:, None]] = 0.0
        for i, body in enumerate(bodies):
            if not t[i].any():
                raise RigError(
                    f"driveline: with {name}, body '{body}' could not turn any more; "
                    f"name the {GROUND} in its place, or mend what contradicts it"
                )
    return free, t


def start_speeds(given: Mapping[str, float], bodies: Sequence[str], t: np.ndarray) -> np.ndarray:
    """Return the free speeds at the start from the speeds of some bodies; speeds that these do not determine are 0.

    Parameters
    ----------
    given : mapping of str to float
        Initial speeds of some bodies [rad/s].
    bodies : sequence of str
        Names of all bodies.
    t : (b, n) array of float
        Speeds of all bodies by the free ones.

    Returns
    -------
    (n,) array of float
        The free speeds [rad/s].

    Raises
    ------
    RigError
        When the speeds contradict the gears and relations between the bodies.
    """
    v = np.zeros(t.shape[1])
    known: list[int] = []
    rows = {name: t[bodies.index(name)] for name in given}
    for name, row in rows.items():
        j = np.flatnonzero(row)
        if len(j) == 1 and j[0] not in known:
            v[j[0]] = given[name] / row[j[0]]
            known.append(j[0])
    others = [name for name, row in rows.items() if not set(np.flatnonzero(row)) <= set(known)]
    if others:
        a = np.array([rows[name] for name in others])
        chosen: list[int] = []
        for j in reversed([j for j in range(len(v)) if j not in known]):
            if np.linalg.matrix_rank(a[:, [*chosen, j]]) > len(chosen):
                chosen.append(j)
        v[chosen] = np.linalg.lstsq(a[:, chosen], np.array([given[name] for name in others]) - a @ v, rcond=None)[0]
    for name, row in rows.items():
        if abs(row @ v - given[name]) > _SAME * (np.abs(row).max() + abs(given[name])):
            raise RigError(
                f"driveline: initial speeds contradict the gears and relations between the bodies; by the others "
                f"'{name}' would have {row @ v:g} rad/s"
            )
    return v


def _gear_groups(inertia: Mapping[str, float], gears: Sequence[tuple[str, str, float]]) -> tuple[dict[str, str], dict[str, float]]:
    """Return the root body of each group that gears join, and every body's speed by that of its root.

    The root is a body with inertia if there is one.
    """
    meshes = {name: [] for name in inertia}
    for a, b, ratio in gears:
        meshes[b].append((a, ratio))
        meshes[a].append((b, 1.0 / ratio))
    root, factor = {}, {}
    for name in sorted(inertia, key=lambda name: inertia[name] == 0.0):
        if name in root:
            continue
        root[name], factor[name] = name, 1.0
        todo = [name]
        while todo:
            here = todo.pop()
            for other, ratio in meshes[here]:
                if other not in root:
                    root[other], factor[other] = name, factor[here] * ratio
                    todo.append(other)
    for a, b, ratio in gears:
        if abs(factor[a] - ratio * factor[b]) > _SAME * abs(factor[a]):
            raise RigError(
                f"driveline: gear {a}-{b} with ratio {ratio:g} closes a loop that needs "
                f"{factor[a] / factor[b]:g}; as it is the loop could not turn"
            )
    return root, factor


def _moves_inertia(inertia: Mapping[str, float], free: Sequence[str], t: Floats) -> None:
    """Raise a RigError when some body could turn while all bodies with inertia stand still."""
    heavy = t[[j > 0.0 for j in inertia.values()]]
    if np.linalg.matrix_rank(heavy) == len(free):
        return
    alone = np.linalg.svd(heavy)[2][-1]
    name = list(inertia)[int(np.argmax(np.abs(t @ alone)))]
    raise RigError(
        f"driveline: body '{name}' has no inertia, and no gears or relations tie it to bodies that have some; "
        "tie it to one or give it an inertia; a billionth of its neighbours' acts as none"
    )
