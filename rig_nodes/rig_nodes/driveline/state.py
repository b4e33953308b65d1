# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the compiled steps of a driveline take: its structure, the loads on it, and its state, each as a tuple of arrays.

There are n speeds, m friction elements, s shafts and k losses. Every array is C-contiguous, of float64 unless said otherwise, in SI
units. Modes, kinds and names of rows are those of driveline.algebra.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from rig_nodes.base import ALLOCATES, INLINED, INNER, njit

if TYPE_CHECKING:
    from rig_nodes.base import Floats, Ints


class Structure(NamedTuple):
    """What a driveline is.

    Parameters
    ----------
    minv : (n, n) array
        Inverse of the mass matrix M of the speeds [1/(kg m2)].
    w : (m, n) array
        W, slips of the friction elements by the speeds.
    sh : (s, n) array
        S, rates of the shafts' twists by the speeds.
    kc : (2, s) array
        Stiffness [Nm/rad] and damping [Nm s/rad] of the shafts.
    """

    minv: Floats
    w: Floats
    sh: Floats
    kc: Floats


class Loads(NamedTuple):
    """Forces and capacities over a step.

    Rows 0 and 1 of q and the 0/1 pairs of cap hold the right limit at the step's start and the left limit at its end. They are
    linear in between, so jumps belong on step boundaries.

    Parameters
    ----------
    q : (2, n) array
        Forces on the speeds [Nm].
    cap : (7, m) array
        Rows KIN0, KIN1: kinetic torque >= 0; LO0, LO1 <= 0 and HI0, HI1 >= 0: stick limits [Nm] (a limit below the kinetic torque
        counts as the kinetic torque; infinite at both ends or at none); VISC: drag coefficient over the step [Nm s/rad]. An element
        with kin, lo, hi zero at both ends is OPEN.
    """

    q: Floats
    cap: Floats


class State(NamedTuple):
    """What a step changes in place.

    Parameters
    ----------
    v : (n,) array
        Speeds [rad/s].
    twist : (s,) or (s + n,) array
        Twists of the shafts and, where there is room, the integrals of the speeds [rad].
    mode : (m,) array of int64
        Modes. OPEN is set at the start of a step; a locked element must have zero slip when it is passed in.
    el : (4, m) array
        LAM: friction torque at the end (positive opposes positive slip, without drag) [Nm]; IMPULSE += int lam dt [Nm s];
        E_FRIC += int lam slip dt; E_VISC += int visc slip^2 dt [J].
    shaft : (2, s) array
        TAU: torque at the end [Nm]; E_SHAFT += int c (S v)^2 dt [J].
    e_in : (n,) array
        += int q v dt [J].
    events : (rows, 3) or (rows, 3 + 2 n) array
        Time [s], element, kind, and the speeds v and their integrals at each event, a ring that is filled from row 0. Where it has
        speeds, twist must have room for the integrals.
    count : (3,) array of int64
        N_EVENTS: events so far; N_CAPPED: steps in which the bound on events or pivots was reached; WORST: of the last of these the
        element with the largest residual, or m plus the number of the law.
    work : array
        At least work_size(n, m, s, k) numbers, zeros at first: room for results inside a step.
    """

    v: Floats
    twist: Floats
    mode: Ints
    el: Floats
    shaft: Floats
    e_in: Floats
    events: Floats
    count: Ints
    work: Floats


class Rows(NamedTuple):
    """State of a driveline at the end of each of k steps, (k, ...) arrays of what `State` has."""

    v: Floats
    twist: Floats
    mode: Ints
    el: Floats
    shaft: Floats
    e_in: Floats


@njit(**INLINED)
def put(to: Floats | Ints, what: Floats | Ints) -> None:
    """Copy the numbers of an array into another one, both C-contiguous."""
    # reshape would make numba count one more reference to the memory, which takes longer than the copy
    for i in range(to.size):
        to.flat[i] = what.flat[i]


@njit(**ALLOCATES)
def copied(state: State) -> State:
    """Return a state whose arrays are copies; events and work, which nothing reads back, are the same."""
    return State(
        state.v.copy(),
        state.twist.copy(),
        state.mode.copy(),
        state.el.copy(),
        state.shaft.copy(),
        state.e_in.copy(),
        state.events,
        state.count.copy(),
        state.work,
    )


@njit(**INNER)
def restore(state: State, kept: State) -> None:
    """Set a state to what :func:`copied` has returned."""
    put(state.v, kept.v)
    put(state.twist, kept.twist)
    put(state.mode, kept.mode)
    put(state.el, kept.el)
    put(state.shaft, kept.shaft)
    put(state.e_in, kept.e_in)
    put(state.count, kept.count)


@njit(**INLINED)
def put_row(rows: Rows, i: int, state: State) -> None:
    """Write a state to row i."""
    put(rows.v[i], state.v)
    put(rows.twist[i], state.twist)
    put(rows.mode[i], state.mode)
    put(rows.el[i], state.el)
    put(rows.shaft[i], state.shaft)
    put(rows.e_in[i], state.e_in)
