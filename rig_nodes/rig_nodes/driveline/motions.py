# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Finds elements that could hold prescribed speeds; driveline/builder.py raises an error for them before a driveline runs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import numpy.typing as npt

    from rig_nodes.base import Floats

_HOLDS = 1e-4  # least torque with which meshes hold a speed, as a share of the greatest; less is within the solver's tolerance


def rank(matrix: Floats) -> int:
    """Return the rank of a matrix; of an empty one it is 0, for which numpy 1 raises an error."""
    return int(np.linalg.matrix_rank(matrix)) if matrix.size else 0


def locks_itself(joints: Sequence[tuple[Floats, Floats, float, float]], others: Floats, held: npt.NDArray[np.bool_]) -> bool:
    """Return whether meshes can hold prescribed speeds with torques of any size, as a worm gear holds its wheel.

    They can when torques exist that balance on all other speeds while each loss is no larger than its mesh's torque allows. This
    pair of torque and loss is then a sum of the pairs for the two directions of power, with factors of the same sign. The sign is
    an integer unknown, so this is a mixed-integer linear program.

    Parameters
    ----------
    joints : sequence of (array, array, float, float)
        For each mesh or set the coefficients (n,) of the speeds in the slips of its teeth and of its loss, and the shares of power
        that it loses in the two directions.
    others : (r, n) array of float
        Slips of all else that holds without a limit.
    held : (n,) array of bool
        The prescribed speeds.

    Returns
    -------
    bool
        Whether some prescribed speed can be held.
    """
    from scipy.optimize import Bounds, LinearConstraint, milp  # loaded only where a motion meets a mesh

    k, r = len(joints), len(others)
    # unknowns: the factors of the power there (k) and back (k), their signs (k) and the other torques (r)
    there = [gear + ahead * loss for gear, loss, ahead, _ in joints]
    back = [((1.0 - behind) * gear - behind * loss) / max(1.0, behind) for gear, loss, _, behind in joints]
    balance = np.concatenate([there, back, np.zeros((k, len(held))), others]).T
    one_sign = np.concatenate([np.eye(2 * k), -np.tile(np.eye(k), (2, 1)), np.zeros((2 * k, r))], axis=1)
    limits = Bounds(np.repeat([-1.0, 0.0, -1.0], [2 * k, k, r]), np.ones(3 * k + r))
    for speed in np.flatnonzero(held):
        found = milp(
            -balance[speed],
            integrality=np.repeat([0, 1, 0], [2 * k, k, r]),
            bounds=limits,
            constraints=[LinearConstraint(balance[~held], 0.0, 0.0), LinearConstraint(one_sign, -1.0, 0.0)],
        )
        if found.x is not None and -found.fun > _HOLDS * np.abs(balance[speed]).max():
            return True
    return False
