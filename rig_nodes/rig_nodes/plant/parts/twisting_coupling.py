# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Metal coupling of high torsional compliance: a screw, a nut with two threads and a housing, whose twist compresses springs.

Source: A. Kowal, K. Filipowicz, "Metalowe sprzeglo o duzej podatnosci skretnej w zastosowaniu do maszyn gorniczych", Silesian
University of Technology; numbers of equations, figures and tables are those of this paper. It is a part of the engine: a compliant
shaft of the driveline, which carries the mean of winding and unwinding, beside a friction element, which is their half difference.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import atan, pi, radians, tan
from typing import TYPE_CHECKING

from ...base import INLINED, njit, param
from ...driveline import E_FRIC, E_SHAFT, E_VISC, HI0, HI1, KIN0, KIN1, LAM, LO0, LO1, TAU
from .part import COUPLING, Part, Shown, Wire, not_in_order

if TYPE_CHECKING:
    from types import SimpleNamespace

    from ...base import Record
    from .shown_rig import ShownRig

LEAST, MOST = radians(25.0), radians(75.0)  # rad: section 4, helix angles between which the threads are chosen
HARDLY = 1e-7  # rad: a shorter twist across a bend is taken with the slope behind the bend
# pieces of the characteristic, in the order of the twist
BACK, PLAY, SEAT, SPRINGS, RINGS, END = range(6)


@dataclass(frozen=True)
class CouplingConfig:
    """Geometry of the two threads, their friction, the springs and the stops."""

    inner_diameter: float = param("length", 1e-3, 1.0, "Mean diameter of the thread between screw and nut")
    inner_angle: float = param("angle", LEAST, MOST, "Helix angle of the thread between screw and nut")
    outer_diameter: float = param("length", 1e-3, 1.0, "Mean diameter of the thread between nut and housing, of the other hand")
    outer_angle: float = param("angle", LEAST, MOST, "Helix angle of the thread between nut and housing")
    thread_friction: float = param("ratio", 0.0, 0.5, "Coefficient of friction in both threads")
    spring_preload: float = param("force", 0.0, 1e6, "Force of the springs with the nut at its first stop")
    spring_rate: float = param("stiffness", 1.0, 1e11, "Stiffness of the whole set of springs")
    knee_travel: float = param(
        "length", 0.0, 1.0, "Travel of the nut at which the softer springs lie on their rings; from stop_travel on they never do"
    )
    knee_rate: float = param("stiffness", 1.0, 1e11, "Stiffness of the springs that are left beyond the knee")
    spring_friction: float = param(
        "ratio", 0.0, 0.5, "Friction of the springs' edges and layers as a share of their force, against the motion"
    )
    stop_travel: float = param("length", 1e-6, 1.0, "Travel of the nut from its first stop to its last one")
    stop_stiffness: float = param("torque per angle", 1.0, 1e7, "Stiffness of the coupling with the nut on one of its stops")
    play: float = param("angle", 0.0, 10.0, "Angle by which the coupling turns freely where its torque changes sign")
    seal_friction: float = param("torque", 0.0, 100.0, "Friction of the seals and bearings, whatever the torque")
    stop_damping: float = param("torque per speed", 0.0, 1e3, "Viscous damping of the twist with the nut on one of its stops")
    damping: float = param("torque per speed", 0.0, 1e3, "Viscous damping of the twist between the stops, except in the play")


@njit(cache=True, error_model="numpy")
def levers(
    inner_diameter: float, inner_angle: float, outer_diameter: float, outer_angle: float, friction: float
) -> tuple[float, float, float]:
    """Return travel of the nut per twist [m/rad] and torque per force of the springs [m] while it winds and while it unwinds.

    Both threads carry the whole torque M, and the springs both axial forces: by (4) and (5) with friction these are
    2 M / (d tan(g + rho)), tan rho = mu, while the nut is pushed against the springs, and 2 M / (d tan(g - rho)) while the springs
    push it back. Without friction all three results are equal, by the balance of work.

    Parameters
    ----------
    inner_diameter, outer_diameter : float
        Mean diameters d of the threads [m].
    inner_angle, outer_angle : float
        Helix angles g [rad].
    friction : float
        Coefficient of friction mu in both threads.

    Returns
    -------
    tuple of float
        Travel per twist [m/rad], torque per force while winding and while unwinding [m]; 0 or less for a thread that locks itself.
    """
    rho = atan(friction)
    a, b = 0.5 * inner_diameter, 0.5 * outer_diameter
    free = _series(a * tan(inner_angle), b * tan(outer_angle))
    wound = _series(a * tan(inner_angle + rho), b * tan(outer_angle + rho))
    back = _series(a * tan(inner_angle - rho), b * tan(outer_angle - rho))
    return free, wound, back


@njit(cache=True, error_model="numpy", forceinline=True)
def _series(a: float, b: float) -> float:
    """Return 1 / (1 / a + 1 / b), 0 where one of them is not above 0."""
    return a * b / (a + b) if a > 0.0 and b > 0.0 else 0.0


@njit(cache=True, error_model="numpy", forceinline=True)
def mean_and_share(wound: float, back: float, spring_friction: float) -> tuple[float, float]:
    """Return the mean torque per force [m] of winding and unwinding, and their half difference as a share of it.

    Parameters
    ----------
    wound, back : float
        Torque per force [m] of :func:`levers`.
    spring_friction : float
        Friction of the springs as a share of their force.

    Returns
    -------
    tuple of float
        Mean torque per force [m] and share of friction.
    """
    up, down = wound * (1.0 + spring_friction), back * (1.0 - spring_friction)
    return 0.5 * (up + down), (up - down) / (up + down)


def geometry(values: CouplingConfig | SimpleNamespace) -> tuple[float, float, float]:
    """Return travel per twist [m/rad], mean torque per force [m] and share of friction of a coupling with these values."""
    free, wound, back = levers(
        values.inner_diameter, values.inner_angle, values.outer_diameter, values.outer_angle, values.thread_friction
    )
    return free, *mean_and_share(wound, back, values.spring_friction)


@njit(cache=True, error_model="numpy", forceinline=True)
def piece_at(twist: float, my: Record) -> int:
    """Return the piece of the characteristic at a twist [rad]."""
    if twist >= my.seat:
        if twist >= my.last:
            return END
        return SPRINGS if twist < my.knee else RINGS
    if twist >= 0.0:
        return SEAT
    return PLAY if twist > -my.play else BACK


@njit(cache=True, error_model="numpy", forceinline=True)
def on_piece(piece: int, twist: float, my: Record) -> tuple[float, float, float]:
    """Return (torque [Nm], slope [Nm/rad], energy [J]) without friction at a twist [rad] on a piece.

    Twist 0 is where the torque begins to rise from 0 with the nut on its first stop. With the nut on the first stop (SEAT) the
    coupling is stiff up to the torque of the springs' preload; beyond it the springs yield (SPRINGS, RINGS) up to the last stop
    (END). In the other direction there is the play and then the other flank, with the nut on the first stop (BACK).
    """
    if piece == SPRINGS:
        begun, torque, slope, energy = my.seat, my.torque_seat, my.slope_springs, my.energy_seat
    elif piece == SEAT:
        begun, torque, slope, energy = 0.0, 0.0, my.stop_stiffness, 0.0
    elif piece == RINGS:
        begun, torque, slope, energy = my.knee, my.torque_knee, my.slope_rings, my.energy_knee
    elif piece == END:
        begun, torque, slope, energy = my.last, my.torque_last, my.stop_stiffness, my.energy_last
    elif piece == BACK:
        begun, torque, slope, energy = -my.play, 0.0, my.stop_stiffness, 0.0
    else:
        return 0.0, 0.0, 0.0
    way = twist - begun
    return torque + slope * way, slope, energy + way * (torque + 0.5 * slope * way)


@njit(**INLINED)
def fill(world: Record, k: int, h: float) -> None:
    """Compute the bends of the characteristic from the values of the part."""
    my = world.values.twisting_coupling[k]
    free, wound, back = levers(my.inner_diameter, my.inner_angle, my.outer_diameter, my.outer_angle, my.thread_friction)
    my.lever, my.share = mean_and_share(wound, back, my.spring_friction)
    my.travel_per_twist = free
    my.torque_seat = my.lever * my.spring_preload
    my.seat = my.torque_seat / my.stop_stiffness
    my.energy_seat = 0.5 * my.torque_seat * my.seat
    my.slope_springs = my.lever * my.spring_rate * free
    my.slope_rings = my.lever * my.knee_rate * free
    soft = min(my.knee_travel, my.stop_travel) / free
    my.knee = my.seat + soft
    my.torque_knee = my.torque_seat + my.slope_springs * soft
    my.energy_knee = my.energy_seat + 0.5 * (my.torque_seat + my.torque_knee) * soft
    stiff = my.stop_travel / free - soft
    my.last = my.knee + stiff
    my.torque_last = my.torque_knee + my.slope_rings * stiff
    my.energy_last = my.energy_knee + 0.5 * (my.torque_knee + my.torque_last) * stiff


@njit(**INLINED)
def before(world: Record, k: int, h: float, t: float) -> None:
    """Set the shaft's stiffness to the piece of the characteristic at the expected twist, and the friction element's torques.

    Within a piece the kernel's step is that of a linear shaft. A step that is expected to pass a bend has a straight line that ends
    at the right torque and whose mean torque is the difference of the energies over the expected change of twist, so that the
    springs return the energy that they store.
    """
    me, my, line = world.parts.twisting_coupling[k], world.values.twisting_coupling[k], world.driveline
    a, f, cap = my.shaft, my.element, line.cap
    rate = 0.0
    for j in range(line.v.shape[0]):
        rate += line.sh[a, j] * (line.v[j] + 0.5 * line.gain[j])
    way = h * rate
    piece, there = piece_at(me.twist, my), piece_at(me.twist + way, my)
    torque, slope, energy = on_piece(piece, me.twist, my)
    end, behind, reached = on_piece(there, me.twist + way, my)
    offset = 0.0
    if piece != there and abs(way) > HARDLY:
        mean = (reached - energy) / way
        slope = max(0.0, 2.0 * (end - mean) / way)
        if slope > 0.0:
            offset = mean / slope - 0.5 * way
    else:
        if piece != there:
            slope = behind
        if slope > 0.0:
            offset = torque / slope
    damping = 0.0 if there == PLAY else my.damping if there == SPRINGS or there == RINGS else my.stop_damping
    if slope != line.kc[0, a] or damping != line.kc[1, a]:
        line.kc[0, a], line.kc[1, a] = slope, damping
        line.work[1] = 0.0  # the kernel's matrices for the former stiffness are not valid for any set of stuck elements
    line.twist[a] = me.begun = offset
    first, last = my.seal_friction + my.share * abs(torque), my.seal_friction + my.share * abs(end)
    cap[KIN0, f], cap[HI0, f], cap[LO0, f] = first, first, -first
    cap[KIN1, f], cap[HI1, f], cap[LO1, f] = last, last, -last


@njit(**INLINED)
def after(world: Record, k: int, h: float) -> None:
    """Take over the twist that the kernel has reached, with its torque, energies and heat."""
    me, my, line = world.parts.twisting_coupling[k], world.values.twisting_coupling[k], world.driveline
    a, f = my.shaft, my.element
    me.twist += line.twist[a] - me.begun
    me.stored = on_piece(piece_at(me.twist, my), me.twist, my)[2]
    me.friction = line.el[LAM, f]
    me.torque = line.shaft[TAU, a] + me.friction
    me.heat = line.el[E_FRIC, f] + line.el[E_VISC, f] + line.shaft[E_SHAFT, a]
    me.travel = my.travel_per_twist * (min(max(me.twist, my.seat), my.last) - my.seat)
    soft = min(me.travel, my.knee_travel)
    me.force = my.spring_preload + my.spring_rate * soft + my.knee_rate * (me.travel - soft)


def shaft(values: CouplingConfig | SimpleNamespace) -> tuple[float, float]:
    """Return stiffness [Nm/rad] and damping [Nm s/rad] where the springs begin to yield, for linear results such as modes."""
    free, lever, _ = geometry(values)
    return values.spring_rate * free * lever, values.damping


def check(values: CouplingConfig) -> tuple[str, str] | None:
    """Return a value and the rest of an error's sentence for a coupling that cannot be.

    That is one with a nut inside its screw, one that locks itself, and one with stops softer than its springs.
    """
    if wrong := not_in_order(values, "inner_diameter", "outer_diameter"):
        return wrong
    rho = atan(values.thread_friction)
    for name, angle in (("inner_angle", values.inner_angle), ("outer_angle", values.outer_angle)):
        if not rho < angle < 0.5 * pi - rho:
            return (
                "thread_friction",
                f"is {values.thread_friction:g}, with which a thread of {name} {angle * 180.0 / pi:.4g} deg locks itself; expected "
                f"less than {min(tan(angle), 1.0 / tan(angle)):.4g}",
            )
    springs = max(values.spring_rate, values.knee_rate if values.knee_travel < values.stop_travel else 0.0)
    free, lever, _ = geometry(values)
    if springs * free * lever > values.stop_stiffness:
        return (
            "stop_stiffness",
            f"is {values.stop_stiffness:g} Nm/rad, expected at least the {springs * free * lever:.4g} Nm/rad of the springs, which "
            "the stop ends",
        )
    return None


def shown_values(rig: ShownRig, name: str) -> tuple[float, ...]:
    """Return the fields of its ClutchState: without a separate drag and without oil; the clamp force is that of the springs."""
    me = rig.device(name)
    may = rig.capacity(name)
    free = (-getattr(rig.config, name).play < me["twist"]) & (me["twist"] < 0.0)
    return (
        (1 - free) * (1 + rig.holds(name)),
        me["torque"],
        me["friction"],
        may,
        may,
        rig.slip(name),
        me["force"],
        0.0,
        me["travel"],
        me["heat"],
    )


# twist: 0 where the torque rises from 0; begun: twist of the kernel's shaft at the step's start; stored: energy in springs and
# stops; travel: of the nut from its first stop; force: of the springs; friction: part of the torque
PART = Part(
    "twisting_coupling",
    25,
    (CouplingConfig,),
    state=("twist", "begun", "stored", "torque", "friction", "heat", "travel", "force"),
    derived=(
        "lever",
        "share",
        "travel_per_twist",
        "seat",
        "knee",
        "last",
        "torque_seat",
        "torque_knee",
        "torque_last",
        "slope_springs",
        "slope_rings",
        "energy_seat",
        "energy_knee",
        "energy_last",
    ),
    wires=("element", "shaft"),
    stages={"fill": fill, "before": before, "after": after},
    role=COUPLING,
    joined={"joins": Wire("bodies")},
    message="ClutchState",
    shown_values=shown_values,
    shows=(
        Shown(
            "mode",
            "mode",
            "state",
            0.0,
            2.0,
            "Coupling {called}: in its play, winding or unwinding, or held by friction.",
            "none",
            {0: "in its play", 1: "winds", 2: "holds"},
        ),
        Shown("torque", "torque", "torque", -700.0, 700.0, "Torque that coupling {called} transmits.", "positive drives {driven}"),
        Shown(
            "friction",
            "drag_torque",
            "torque",
            -350.0,
            350.0,
            "Part of the torque of coupling {called} that is friction.",
            "positive while it winds",
        ),
        Shown("winding", "slip", "speed", -320.0, 320.0, "Rate at which {called} winds.", "{driving} minus {driven}"),
        Shown("force", "clamp_force", "force", 0.0, 1e5, "Force of the springs of {called}.", "positive presses"),
        Shown(
            "travel", "piston_position", "length", 0.0, 0.1, "Travel of the nut of {called} from its first stop.", "positive winds"
        ),
        Shown("heat", "heat", "energy", 0.0, 1e9, "Heat of friction and damping in {called} since time 0.", "positive"),
    ),
    shaft=shaft,
    check=check,
)
