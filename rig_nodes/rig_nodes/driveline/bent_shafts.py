# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A part of a step of a driveline whose only laws are shafts with tables, in which no mode changes.

Used by driveline/quick.py, and by driveline/law_steps.py, which takes all other parts. The method is that of
driveline/collocation.py, with matrices for one straight line through each table. What a table has beyond this line is a force that
depends on the twist: it is put on the nodes as the cubic with the same moments, which are integrated piece by piece along the twist
of the last pass, until nothing changes. So a bend neither divides the part nor needs other matrices, and a part on one piece takes
a single pass.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

from rig_nodes.base import INLINED, INNER, njit
from rig_nodes.driveline.algebra import (
    BACKWARD,
    FORWARD,
    OPEN,
    RATE_OF,
    STUCK,
    TAU,
    has_capacity,
    noinline,
    places,
    rate_of,
    short_loops,
    sum_at,
)
from rig_nodes.driveline.collocation import (
    END,
    MEAN,
    NODES,
    WEIGHTS,
    are_made,
    elements_by_nodes,
    forces_by_nodes,
    put_sum,
    solve_nodes,
)
from rig_nodes.driveline.kernel import SAME, Span, answer_forces, change_forces, ends, first_event, longest_part, start_forces, take
from rig_nodes.driveline.laws import SHAFT
from rig_nodes.driveline.tables import line_here, piece, value
from rig_nodes.driveline.wide import WIDE, solve_band, sum_along

if TYPE_CHECKING:
    from rig_nodes.base import Floats
    from rig_nodes.driveline.algebra import Places
    from rig_nodes.driveline.laws import Laws, Moving
    from rig_nodes.driveline.state import Loads, State, Structure
    from rig_nodes.driveline.tables import Tables

SHORT, LINES = 10, 16  # a table with more points has matrices for slopes that are 1 / LINES of a power of 2 apart only
PASSES, LEAST = 12, 2.0**-8  # most passes; least share of its length to which a part is halved where they do not settle
TRIES = 60  # most tries at the time of a bend
CLOSE = 1e-12  # share of a torque by which the last pass may change it
NEAR = 1e-9  # share of a part: accuracy of the time at which a bend is passed, whose square is the error of the torque
LEFT = 2e-7  # share of its rate that a twist may gain or lose in a part because of what the cubics leave out
MANY, FINE = 3, 4e-6  # pieces in a part from which on the nodes alone may count; share of its rate that a twist then may miss
# rows of `bent`: four for the force beyond the line in the eigenvectors of the method, its mean, the impulse per rate that makes up
# for what the cubics leave out of it, the torque of the table at the start, the number of its piece there, the acceleration of the
# twist by a torque, and 1 where the twist keeps to the line of the matrices
BEYOND, MADE_UP, BEGUN, PIECE, MOBILITY, STRAIGHT = 4, 5, 6, 7, 8, 9

# Nodes as shares of a part; the change of the speeds at share x of it, by the powers 1 to 4 of x (rows), from the real and
# imaginary parts of both z; and cubics (from their constant to the highest power), the real and imaginary parts of those of both
# eigenvectors: the integral of the product of a cubic and a force is the share of that eigenvector in the force.
AT = (0.069431844202973712, 0.330009478207571868, 0.669990521792428132, 0.930568155797026288)
POWERS = (
    (2.82319209942994077, -3.51093544362493725, -1.82319209942994077, -0.983755748346893596),
    (-17.0105590609343589, 27.3893145197688798, 17.0105590609343589, 2.92295899188641582),
    (36.0163564283347805, -62.2793394779226104, -36.0163564283347805, 4.72296534033873996),
    (-19.6508624373212632, 48.3130056078291449, 19.6508624373212632, -8.4557442920331076),
)
CUBICS = (
    (5.51423420377799583, -23.9686944236471498, 35.1125364425277325, -16.936263224521327),
    (-1.38851354759870926, 10.6880253049327719, -20.605318117220827, 11.6517610701570626),
    (5.0571943676505756, -12.4598770049242788, 1.31603498604369605, 6.93626322452132704),
    (-4.85640155870008951, 38.143160822553397, -72.0971720143996331, 39.2688472755597415),
)


class Path(NamedTuple):
    """A twist over a part of a step.

    Parameters
    ----------
    d : float
        Length of the part [s].
    x, rate : float
        Twist [rad] and its rate [rad/s] at the start.
    one, two, three, four : float
        Change of the rate by the powers of the share of the part.
    """

    d: float
    x: float
    rate: float
    one: float
    two: float
    three: float
    four: float


@njit(**INLINED)
def twist_at(path: Path, share: float) -> float:
    """Return the twist at a share of a part."""
    turned = path.one / 2.0 + share * (path.two / 3.0 + share * (path.three / 4.0 + share * path.four / 5.0))
    return path.x + path.d * share * (path.rate + share * turned)


@njit(**INLINED)
def rate_at(path: Path, share: float) -> float:
    """Return the rate of the twist at a share of a part."""
    return path.rate + share * (path.one + share * (path.two + share * (path.three + share * path.four)))


@njit(**INLINED)
def path_of(a: int, d: float, sh: Floats, twist: Floats, work: Floats, at: Places) -> Path:
    """Return the path of shaft a by the present z."""
    n = sh.shape[1]
    y = (
        sum_at(work, at.z, sh, a),
        sum_at(work, at.z + n, sh, a),
        sum_at(work, at.z + 2 * n, sh, a),
        sum_at(work, at.z + 3 * n, sh, a),
    )
    one = POWERS[0][0] * y[0] + POWERS[0][1] * y[1] + POWERS[0][2] * y[2] + POWERS[0][3] * y[3]
    two = POWERS[1][0] * y[0] + POWERS[1][1] * y[1] + POWERS[1][2] * y[2] + POWERS[1][3] * y[3]
    three = POWERS[2][0] * y[0] + POWERS[2][1] * y[1] + POWERS[2][2] * y[2] + POWERS[2][3] * y[3]
    four = POWERS[3][0] * y[0] + POWERS[3][1] * y[1] + POWERS[3][2] * y[2] + POWERS[3][3] * y[3]
    return Path(d, twist[a], work[at.rate + a], one, two, three, four)


@njit(**INNER)
def turning(path: Path) -> float:
    """Return the share of a part at which the rate changes its sign, 1 where it does not."""
    noinline()
    if path.rate * rate_at(path, 1.0) >= 0.0:
        return 1.0
    low, high = 0.0, 1.0
    while high - low > NEAR:
        middle = 0.5 * (low + high)
        if path.rate * rate_at(path, middle) > 0.0:
            low = middle
        else:
            high = middle
    return high


@njit(**INNER)
def passing(path: Path, bend: float, low: float, high: float) -> float:
    """Return the share from low to high at which a twist that goes one way passes a bend, by Newton's method."""
    noinline()
    first, last = twist_at(path, low), twist_at(path, high)
    share = low + (high - low) * min(max((bend - first) / (last - first), 0.0), 1.0)
    for _ in range(TRIES):
        beyond = twist_at(path, share) - bend
        if (beyond > 0.0) == (last > first):
            high = share
        else:
            low = share
        better = share - beyond / (path.d * rate_at(path, share))
        if not low <= better <= high:
            better = 0.5 * (low + high)
        if abs(better - share) <= NEAR:
            return better
        share = better
    return share


@njit(**INLINED)
def shared(force: float, share: float, r0: float, i0: float, r1: float, i1: float) -> tuple[float, float, float, float]:
    """Return the shares of both eigenvectors with that of a force at a share of a part."""
    r0 += force * (CUBICS[0][0] + share * (CUBICS[0][1] + share * (CUBICS[0][2] + share * CUBICS[0][3])))
    i0 += force * (CUBICS[1][0] + share * (CUBICS[1][1] + share * (CUBICS[1][2] + share * CUBICS[1][3])))
    r1 += force * (CUBICS[2][0] + share * (CUBICS[2][1] + share * (CUBICS[2][2] + share * CUBICS[2][3])))
    i1 += force * (CUBICS[3][0] + share * (CUBICS[3][1] + share * (CUBICS[3][2] + share * CUBICS[3][3])))
    return r0, i0, r1, i1


@njit(**INLINED)
def made_up(
    missing: float, path: Path, r0: float, i0: float, r1: float, i1: float, mean: float
) -> tuple[float, float, float, float, float, float]:
    """Return the first six rows of `bent` with a torque along the rate that takes the mean power that is missing."""
    square = 0.0
    for i in range(NODES):
        square += WEIGHTS[i] * rate_at(path, AT[i]) ** 2
    drag = missing / square if square > 0.0 else 0.0
    for i in range(NODES):
        force = WEIGHTS[i] * drag * rate_at(path, AT[i])
        mean += force
        r0, i0, r1, i1 = shared(force, AT[i], r0, i0, r1, i1)
    return r0, i0, r1, i1, mean, path.d * drag


@njit(**INNER)
def at_nodes(
    tables: Tables, k: int, number: int, final: int, stiffness: float, path: Path
) -> tuple[float, float, float, float, float, float]:
    """Return what :func:`beyond_line` does for a path over many short pieces, from one to another, by the torques at the nodes."""
    noinline()
    short_loops()
    _, _, height, point, rise = line_here(tables, k, number)
    torque, last, first, now = height + rise * (path.x - point), twist_at(path, 1.0), tables.first[k], number
    r0 = i0 = r1 = i1 = mean = power = 0.0
    for i in range(NODES):
        x = twist_at(path, AT[i])
        while now < final and x > tables.x[first + now + 1]:
            now += 1
        while now > final and x < tables.x[first + now]:
            now -= 1
        _, _, height, point, rise = line_here(tables, k, now)
        force = WEIGHTS[i] * (height + rise * (x - point) - torque - stiffness * (x - path.x))
        mean += force
        power += force * rate_at(path, AT[i])
        r0, i0, r1, i1 = shared(force, AT[i], r0, i0, r1, i1)
    _, _, height, point, rise = line_here(tables, k, final)
    here, begun, to, end = path.x, torque, last, height + rise * (last - point)
    if final < number:
        here, begun, to, end = to, end, here, begun
    energy = 0.0
    for i in range(first + min(number, final) + 1, first + max(number, final) + 1):
        energy += 0.5 * (begun + tables.y[i]) * (tables.x[i] - here)
        here, begun = tables.x[i], tables.y[i]
    energy += 0.5 * (begun + end) * (to - here)
    turn = last - path.x
    energy = (energy if turn > 0.0 else -energy) - (torque + 0.5 * stiffness * turn) * turn
    return made_up(energy / path.d - power, path, r0, i0, r1, i1, mean)


@njit(**INNER)
def beyond_line(
    tables: Tables, k: int, number: int, stiffness: float, path: Path, light: float
) -> tuple[float, float, float, float, float, float]:
    """Return the first six rows of `bent` of a shaft.

    Parameters
    ----------
    tables, k, number : Tables, int and int
        The tables, and the numbers of that of the shaft and of its piece at the start.
    stiffness : float
        Slope of the line that the matrices have [Nm/rad].
    path : Path
        The twist over the part.
    light : float
        Change of the twist's rate over the part by a stiffness, per change of the twist [rad/Nm].
    """
    noinline()
    short_loops()
    begin, end, height, point, rise = line_here(tables, k, number)
    torque, until, last = height + rise * (path.x - point), turning(path), twist_at(path, 1.0)
    r0 = i0 = r1 = i1 = mean = rest = here = 0.0
    bent = False
    if until == 1.0 and begin <= last <= end:
        if rise == stiffness:
            return r0, i0, r1, i1, mean, rest
    elif until == 1.0:
        final = piece(tables, k, last)
        count = abs(final - number)
        if count >= MANY and light * abs(line_here(tables, k, final)[4] - rise) <= FINE * count * count:
            return at_nodes(tables, k, number, final, stiffness, path)
    while True:
        to, last = until, twist_at(path, until)
        step = 1 if last > end else -1 if last < begin else 0
        if step != 0:
            to = passing(path, end if step > 0 else begin, here, until)
        for i in range(NODES):
            share = here + (to - here) * AT[i]
            x = twist_at(path, share)
            force = (to - here) * WEIGHTS[i] * (height + rise * (x - point) - torque - stiffness * (x - path.x))
            mean += force
            r0, i0, r1, i1 = shared(force, share, r0, i0, r1, i1)
            rest += force * (1.0 + share * (-20.0 + share * (90.0 + share * (-140.0 + share * 70.0))))
        here = to
        if step != 0:
            bent = True
            number += step
            begin, end, height, point, rise = line_here(tables, k, number)
        elif until < 1.0:
            until = 1.0
        elif bent:
            return made_up(path.four * rest / 70.0, path, r0, i0, r1, i1, mean)
        else:
            return r0, i0, r1, i1, mean, 0.0


@njit(**INNER)
def push_nodes(a: int, d: float, change: tuple[float, ...], sh: Floats, work: Floats, at: Places) -> None:
    """Change both z by a torque of shaft a, given by its shares in the eigenvectors."""
    noinline()
    short_loops()
    n = sh.shape[1]
    for p in range(2):
        re, im, z, top = d * change[2 * p], d * change[2 * p + 1], at.z + 2 * p * n, at.nodes + p * 2 * n * n
        if n >= WIDE and work[at.band] == 0.0:
            for i in range(n):
                work[at.solve + i], work[at.solve + n + i] = sh[a, i] * re, sh[a, i] * im
            solve_band(work, top, at.band, at.solve, n)
            for i in range(2 * n):
                work[z + i] -= work[at.solve + i]
            continue
        for i in range(n):
            real = sum_along(work, top + i * n, sh, a, at.sh_ends)
            imaginary = sum_along(work, top + (n + i) * n, sh, a, at.sh_ends)
            work[z + i] -= real * re - imaginary * im
            work[z + n + i] -= real * im + imaginary * re


@njit(**INLINED)
def keep_straight(d: float, kc: Floats, laws: Laws, sh: Floats, twist: Floats, work: Floats, at: Places) -> bool:
    """Return whether all twists keep to the lines of the matrices, so that both z are found already."""
    all_straight = True
    for k in range(laws.kind.shape[0]):
        a = laws.slot[k]
        mine, path = at.bent + 10 * a, path_of(a, d, sh, twist, work, at)
        begin, end, _, _, rise = line_here(laws.tables, k, int(work[mine + PIECE]))
        one_way = path.rate * rate_at(path, 1.0) >= 0.0
        straight = one_way and rise == kc[0, a] and begin <= twist_at(path, 1.0) <= end
        work[mine + STRAIGHT] = 1.0 if straight else 0.0
        all_straight = all_straight and straight
        for row in range(BEGUN):
            work[mine + row] = 0.0
    return all_straight


@njit(**INLINED)
def settles(d: float, kc: Floats, laws: Laws, sh: Floats, twist: Floats, work: Floats, at: Places) -> bool:
    """Find both z with the tables of all shafts, and what is made of them; return False where the part is too long for that."""
    if keep_straight(d, kc, laws, sh, twist, work, at):
        return True
    before, n = 0.0, sh.shape[1]
    for k in range(laws.kind.shape[0]):
        a = laws.slot[k]
        mine, mobility = at.bent + 10 * a, 0.0
        for i in range(n):
            mobility += sh[a, i] * sum_at(work, at.p + i * n, sh, a)
        work[mine + MOBILITY], work[mine + STRAIGHT] = mobility, 0.0
    for _ in range(PASSES):
        worst = missed = 0.0
        for k in range(laws.kind.shape[0]):
            a = laws.slot[k]
            mine = at.bent + 10 * a
            path, light = path_of(a, d, sh, twist, work, at), d * d * work[mine + MOBILITY]
            found = beyond_line(laws.tables, k, int(work[mine + PIECE]), kc[0, a], path, light)
            change = (found[0] - work[mine], found[1] - work[mine + 1], found[2] - work[mine + 2], found[3] - work[mine + 3])
            size = max(max(abs(change[0]), abs(change[1])), max(abs(change[2]), abs(change[3])))
            if size > 0.0:
                push_nodes(a, d, change, sh, work, at)
                worst = max(worst, size / (1.0 + abs(work[mine + BEGUN])))
            missed = max(missed, abs(found[MADE_UP]) * work[mine + MOBILITY])
            for row in range(BEGUN):
                work[mine + row] = found[row]
        # each pass changes less than the last one by the same factor
        if worst <= CLOSE or worst * worst <= CLOSE * before:
            put_sum(END, 1.0, at.dv, work, at, n)
            put_sum(MEAN, 1.0, at.mean, work, at, n)
            return missed <= LEFT
        if 0.0 < before <= worst:
            return False
        before = worst
    return False


@njit(**INLINED)
def keeps_modes(structure: Structure, cap: Floats, state: State) -> float:
    """Return 1 plus the largest speed, or 0 where a mode changes at the start of a part."""
    scale = 1.0
    for j in range(state.v.shape[0]):
        scale = max(scale, 1.0 + abs(state.v[j]))
    for f in range(state.mode.shape[0]):
        mo = state.mode[f]
        slips = mo == FORWARD or mo == BACKWARD
        if has_capacity(cap, f):
            if not (mo == STUCK or (slips and mo * rate_of(structure.w, f, state.v) > 1e-12 * scale)):
                return 0.0
        elif mo != OPEN:
            return 0.0
    return scale


@njit(**INLINED)
def start_shafts(structure: Structure, laws: Laws, state: State, work: Floats, at: Places) -> None:
    """Set the lines of the matrices, and torques and pieces at the start; other matrices than the last ones count as not made."""
    kc = structure.kc
    for k in range(laws.kind.shape[0]):
        a = laws.slot[k]
        x, rate = state.twist[a], rate_of(structure.sh, a, state.v)
        number = piece(laws.tables, k, x)
        begin, _, height, point, rise = line_here(laws.tables, k, number)
        if x == begin and rate < 0.0:
            number -= 1
            _, _, height, point, rise = line_here(laws.tables, k, number)
        kc[0, a] = rise
        if laws.tables.first[k + 1] - laws.tables.first[k] > SHORT:
            mantissa, exponent = math.frexp(rise)
            kc[0, a] = math.ldexp(math.floor(LINES * mantissa + 0.5) / LINES, exponent)
        kc[1, a] = laws.damping[k] if laws.gap[k] == 0.0 or abs(x) > laws.gap[k] else 0.0
        work[at.bent + 10 * a + BEGUN], work[at.bent + 10 * a + PIECE] = height + rise * (x - point), number
    if not are_made(kc, work, at):
        work[1] = work[RATE_OF] = 0.0
        for a in range(kc.shape[1]):
            work[at.made + 2 * a], work[at.made + 2 * a + 1] = kc[0, a], kc[1, a]


@njit(**INLINED)
def ends_well(d: float, kc: Floats, laws: Laws, sh: Floats, twist: Floats, work: Floats, at: Places) -> bool:
    """Add the tables to the end forces and the mean ones; return False where a contact with damping begins, ends or lets go."""
    n = sh.shape[1]
    for k in range(laws.kind.shape[0]):
        a = laws.slot[k]
        mine, rate, gap = at.bent + 10 * a, work[at.rate + a], laws.gap[k]
        turn = d * (rate + sum_at(work, at.mean, sh, a))
        torque = work[mine + BEGUN]
        final = torque + kc[0, a] * turn
        if work[mine + STRAIGHT] == 0.0:
            onto = value(laws.tables, k, twist[a] + turn)
            for j in range(n):
                work[at.during + j] -= sh[a, j] * work[mine + BEYOND]
                work[at.dforce + j] -= sh[a, j] * (onto - final)
            final = onto
        if gap > 0.0 and laws.damping[k] > 0.0:
            path, last = path_of(a, d, sh, twist, work, at), rate + sum_at(work, at.dv, sh, a)
            middle, side = twist_at(path, turning(path)), 1.0 if twist[a] > 0.0 else -1.0
            nearest = min(side * middle, side * (twist[a] + turn))
            if kc[1, a] == 0.0:
                if max(abs(middle), abs(twist[a] + turn)) > gap:
                    return False
            elif nearest < gap or min(side * (torque + kc[1, a] * rate), side * (final + kc[1, a] * last)) < 0.0:
                return False
    return True


@njit(**INLINED)
def shaft_part(h: float, done: float, whole: bool, structure: Structure, laws: Laws, loads: Loads, moving: Moving) -> float:
    """Take the longest part of a step h that shafts allow, from a time in it on, and return the time up to which the step is done.

    Where a mode could change in it, or a contact with damping, the driveline is left as it is.

    Parameters
    ----------
    h, done : float
        Length of the step, and what of it is done [s].
    whole : bool
        Whether the part must be the rest of the step.
    structure, laws, loads, moving
        The driveline; kc of the structure is set for the shafts with tables.

    Returns
    -------
    float
        The time; `done` where nothing has changed.
    """
    loss, state, own = moving
    w, sh, kc, cap, v, work = structure.w, structure.sh, structure.kc, loads.cap, state.v, state.work
    n = v.shape[0]
    at = places(n, state.mode.shape[0], sh.shape[0], int(0))
    scale = keeps_modes(structure, cap, state)
    if scale == 0.0:
        return done
    start_shafts(structure, laws, state, work, at)
    start_forces(done / h, structure, loads, state, at)
    for k in range(laws.kind.shape[0]):
        a = laws.slot[k]
        more = work[at.bent + 10 * a + BEGUN] - kc[0, a] * state.twist[a]
        for j in range(n):
            work[at.force + j] -= sh[a, j] * more
    answer_forces(state.mode, n, work, at)
    longest = longest_part(h, structure, cap, work)
    d = longest if longest <= (h - done) * (1.0 + SAME) else h - done
    span = Span(h, done, scale, longest, False, at)
    if whole and not ends(d, span):
        return done
    shortest = d if whole else d * LEAST
    while True:
        change_forces(d, span, structure, loads, loss, state)
        solve_nodes(d, at.force, at.dforce, work, at, n)
        if settles(d, kc, laws, sh, state.twist, work, at):
            break
        # a piece that is much stiffer than the one at the start asks for a shorter part
        if d <= shortest:
            return done
        d *= 0.5
    forces_by_nodes(d, structure, cap, work, at)
    if not ends_well(d, kc, laws, sh, state.twist, work, at):
        return done
    elements_by_nodes(w, state.mode, work, at)
    if first_event(d, int(-1), int(0), span, structure, cap, loss, state)[1] >= 0:
        return done
    for j in range(n):
        work[at.lag + j] = 0.0
    take(d, span, structure, loads, loss, state)
    for k in range(laws.kind.shape[0]):
        a = laws.slot[k]
        last = rate_of(sh, a, v)
        own.at[k] = state.twist[a]
        own.way[k] = (last - work[at.rate + a]) / (2.0 * d)
        own.torque[k] = value(laws.tables, k, state.twist[a])
        state.shaft[TAU, a] = own.torque[k] + kc[1, a] * last
    return h if ends(d, span) else done + d


@njit(**INLINED)
def only_shafts(laws: Laws, loss: Floats) -> bool:
    """Return whether a driveline has no laws but shafts with tables, without springs that slide, and no losses by torque."""
    found = loss.shape[0] == 0
    for k in range(laws.kind.shape[0]):
        found = found and laws.kind[k] == SHAFT and laws.first_spring[k] == laws.first_spring[k + 1]
    return found
