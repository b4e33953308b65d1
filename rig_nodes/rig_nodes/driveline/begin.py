# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a step of a driveline begins with: the modes of elements that open, close or slip the other way, and the last losses.

Used by driveline/kernel.py.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from rig_nodes.base import INLINED, njit
from rig_nodes.driveline.algebra import BACKWARD, CLOSE, CROSS, FIRST, FORWARD, FREE, OPEN, RATE_OF, STUCK, Places, has_capacity
from rig_nodes.driveline.joint import note
from rig_nodes.driveline.losses import BEFORE, LAST, OWN, put_last
from rig_nodes.driveline.wide import know_ends, rate_along

if TYPE_CHECKING:
    from rig_nodes.base import Floats
    from rig_nodes.driveline.state import State, Structure


@njit(**INLINED)
def start_modes(t: float, scale: float, w: Floats, cap: Floats, state: State, at: Places) -> tuple[int, bool]:
    """Set the modes of elements that open, close or slip the other way at the start of a step.

    Returns the number of events, and whether there are elements to be decided jointly.
    """
    mode, work, made, joint, tol = state.mode, state.work, 0, False, 1e-12 * scale
    for f in range(mode.shape[0]):
        mo = mode[f]
        work[at.side + f] = 0.0
        if not has_capacity(cap, f):
            if mo != OPEN:
                note(t, f, int(FREE), state)
                made += 1
                mode[f] = OPEN
        elif mo == OPEN or abs(mo) == 1:
            slip = rate_along(w, f, state.v, work, at.w_ends)
            if mo == OPEN:
                if abs(slip) <= tol:
                    work[at.candidate + f] = 1.0
                    joint = True
                else:
                    mode[f] = FORWARD if slip > 0.0 else BACKWARD
                    note(t, f, int(CLOSE), state)
                    made += 1
            elif mo * slip < -tol:
                if mo * slip < -1e-6 * scale:
                    # a capped step has left this mode, or the caller has set another speed
                    mode[f] = -mo
                    note(t, f, int(CROSS), state)
                    made += 1
                else:
                    work[at.candidate + f] = 1.0
                    joint = True
        elif mo != STUCK:
            joint = True
    return made, joint


@njit(**INLINED)
def start_losses(m: int, cap: Floats, loss: Floats, work: Floats, at: Places) -> None:
    """Mark the elements that losses own, and let the last losses act."""
    for f in range(m):
        work[at.lossy + f] = 0.0
    for k in range(loss.shape[0]):
        work[at.lossy + int(loss[k, OWN])] = 1.0
        loss[k, BEFORE] = loss[k, LAST]
    put_last(loss, cap)


@njit(**INLINED)
def mark(tol: float, w: Floats, state: State, at: Places) -> None:
    """Mark as candidates all elements that do not slip."""
    for f in range(state.mode.shape[0]):
        if abs(state.mode[f]) >= 2:
            state.work[at.candidate + f] = 1.0
        elif state.mode[f] != OPEN:
            if abs(rate_along(w, f, state.v, state.work, at.w_ends)) <= tol:
                state.work[at.candidate + f] = 1.0


@njit(**INLINED)
def begin_step(t: float, structure: Structure, cap: Floats, loss: Floats, state: State, at: Places) -> tuple[float, int, bool]:
    """Clear what a step adds up in the work buffer, let the last losses act and set the modes at the start.

    Returns
    -------
    scale : float
        1 plus the largest speed.
    made : int
        Number of events.
    joint : bool
        Whether there are elements to be decided jointly.
    """
    work, scale = state.work, 0.0
    work[FIRST] = 0.0
    if work[1] <= 0.0:
        work[RATE_OF] = 0.0  # drag or shafts are others than before
    for j in range(state.v.shape[0]):
        work[at.lag + j] = 0.0
        scale = max(scale, abs(state.v[j]))
    for a in range(structure.sh.shape[0]):
        work[at.swing + a] = 0.0
    scale += 1.0
    know_ends(structure.w, structure.sh, work, at)
    start_losses(cap.shape[1], cap, loss, work, at)
    made, joint = start_modes(t, scale, structure.w, cap, state, at)
    return scale, made, joint
