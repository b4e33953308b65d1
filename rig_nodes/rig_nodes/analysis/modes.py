# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Natural frequencies of a rig in each state of its clutches, critical speeds, steady response, and peaks of a recorded spectrum.

Used by the verb ``modes`` and by analysis.detuning.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..base import RigError, unknown
from ..driveline import Modes, Response, Sensitivities, modes, response, sensitivities
from ..plant import part as parts
from ..rig import build_driveline, inertias_of

if TYPE_CHECKING:
    from ..bags import Bag
    from ..base import Floats
    from ..driveline import System
    from ..rig import RigConfig

OPEN = "all open"
TURN = 2.0 * math.pi
LEAST_PEAK = 0.02  # of the highest one: least amplitude of a peak that is reported
SEGMENTS = 7  # about as many half-overlapping parts of a record are averaged
PADDED = 8  # a part's length with zeros behind it, over its own
POINTS = 600  # frequencies of a response


@dataclass(frozen=True)
class State:
    """A state of a rig's clutches: its name for people, and which clutches, brakes and free-wheels are locked."""

    name: str
    locked: tuple[str, ...]


@dataclass(frozen=True)
class Found:
    """The modes of a rig in a state of its clutches, and how they depend on its inertias and stiffnesses."""

    state: State
    modes: Modes
    sensitivities: Sensitivities


@dataclass(frozen=True)
class Critical:
    """A speed [rad/s] at which an order of the speed of a body meets a natural frequency.

    ``share`` is the amplitude of that body in the mode's shape, whose largest is 1: an order excites a mode in proportion to it.
    """

    mode: int
    order: float
    speed: float
    share: float


def system_of(config: RigConfig) -> System:
    """Return the driveline of a rig.

    Parameters
    ----------
    config : RigConfig
        The rig.

    Returns
    -------
    System
        The driveline.
    """
    return build_driveline(config.structure, inertias_of(config.structure, config.sections), config.sections)


def lockable(config: RigConfig) -> dict[str, bool]:
    """Return what can be locked: by name, whether it joins two bodies (True) or holds one to the ground (False)."""
    structure = config.structure
    out = {one.name: "joins" in one.wires and "ground" not in one.wires["joins"] for one in structure.of_role(parts.CLUTCH)}
    out |= {one.name: "ground" not in one.wires["joins"] for one in structure.freewheels}
    return out | {one.name: one.kind == "clutch" for one in structure.of_kind("clutch", "brake")}


def states_of(config: RigConfig) -> list[State]:
    """Return the states whose modes are of use, the default first.

    Parameters
    ----------
    config : RigConfig
        The rig.

    Returns
    -------
    list of State
        Of a rig with gears each gear, and all open. Of another one all clutches between bodies locked, then all open, then each
        clutch and brake alone, as far as these differ.
    """
    if config.structure.gears:
        return [State(f"gear {gear.name}", gear.held) for gear in config.structure.gears] + [State(OPEN, ())]
    can = lockable(config)
    between = tuple(name for name, joins in can.items() if joins)
    out = [State(f"{', '.join(between)} locked", between)] if between else []
    out.append(State(OPEN, ()))
    out += [State(f"{name} locked", (name,)) for name in can if (name,) != between]
    return out


def chosen_state(config: RigConfig, gear: str | None, locked: Sequence[str] | None) -> State:
    """Return the state that a gear or a list of locked clutches names, else the default.

    Parameters
    ----------
    config : RigConfig
        The rig.
    gear : str or None
        Name of a gear; "neutral" for all open.
    locked : sequence of str or None
        Names of clutches, brakes and free-wheels; an empty list for all open.

    Returns
    -------
    State
        The state.

    Raises
    ------
    RigError
        When both are given, or there is no gear or clutch of a name.
    """
    if gear is not None and locked is not None:
        raise RigError("--gear and --locked are both given; give one of them")
    if gear is not None:
        if not config.structure.gears:
            raise RigError(f"--gear {gear}: the rig '{config.name}' has no gears; name what is locked with --locked")
        by_name = {one.name: one for one in config.structure.gears}
        if gear.lower() in ("neutral", "n", "0"):
            return State(OPEN, ())
        number = config.transmission.number(gear)
        if number is None:
            raise RigError(f"--gear {gear}: {unknown('gear', gear, by_name)}")
        held = config.structure.gears[number - 1]
        return State(f"gear {held.name}", held.held)
    if locked is not None:
        can = lockable(config)
        for name in locked:
            if name not in can:
                raise RigError(
                    f"--locked {name}: {unknown('clutch, brake or free-wheel', name, can)}"
                    if can
                    else f"--locked {name}: the rig '{config.name}' has no clutch, brake or free-wheel"
                )
        if len(set(locked)) < len(locked):
            raise RigError(f"--locked: {next(name for name in locked if locked.count(name) > 1)} is named twice")
        return State(f"{', '.join(locked)} locked" if locked else OPEN, tuple(locked))
    return states_of(config)[0]


def found_in(system: System, state: State) -> Found:
    """Return the modes of a driveline in a state of its clutches, with their sensitivities."""
    return Found(state, modes(system, state.locked), sensitivities(system, state.locked))


def sizes(found: Modes) -> np.ndarray:
    """Return the amplitudes (k, b) of the shapes, negative where a body turns against the others; phases are left out."""
    return np.abs(found.shapes) * np.where(np.real(found.shapes) < 0.0, -1.0, 1.0)


def exciting_body(config: RigConfig, name: str | None) -> str:
    """Return the body by whose speed orders count.

    Parameters
    ----------
    config : RigConfig
        The rig.
    name : str or None
        A body; without one that of the rig's first source of torque, its input, or its first body.

    Returns
    -------
    str
        The body.

    Raises
    ------
    RigError
        When there is no such body.
    """
    structure = config.structure
    if name is not None:
        if name not in structure.bodies:
            raise RigError(f"--body {name}: {unknown('body', name, structure.bodies)}")
        return name
    for device in structure.of_role(parts.SOURCE):
        if "body" in device.wires:
            return str(device.wires["body"])
    return structure.input.body if structure.input else structure.bodies[0]


def critical_speeds(found: Modes, body: str, orders: Sequence[float], speeds: tuple[float, float]) -> list[Critical]:
    """Return the speeds within a range at which orders of a body's speed meet natural frequencies.

    Parameters
    ----------
    found : Modes
        The modes.
    body : str
        The body whose speed counts.
    orders : sequence of float
        Periods of the exciting torque in a turn of this body.
    speeds : (float, float)
        Lowest and highest speed [rad/s].

    Returns
    -------
    list of Critical
        The critical speeds, slowest first; modes at 0 Hz and motions that only decay have none.
    """
    at = found.bodies.index(body)
    out = [
        Critical(k, order, TURN * f / order, float(abs(found.shapes[k, at])))
        for k, f in enumerate(found.frequencies)
        for order in orders
        if f > 0.0 and abs(found.damping[k]) < 1.0 and speeds[0] <= TURN * f / order <= speeds[1]
    ]
    return sorted(out, key=lambda one: one.speed)


def response_of(system: System, state: State, body: str, frequencies: tuple[float, float] | None = None) -> Response:
    """Return the steady response to a harmonic torque on a body over a range of frequencies.

    Parameters
    ----------
    system : System
        The driveline.
    state : State
        The state of its clutches.
    body : str
        The body on which the torque acts.
    frequencies : (float, float), optional
        The range [Hz]; by default from a third of the lowest natural frequency above 0 to three times the highest.

    Returns
    -------
    Response
        The response at frequencies in equal ratios, and at the natural ones.
    """
    natural = modes(system, state.locked).frequencies
    natural = natural[natural > 0.0]
    if frequencies is None:
        frequencies = (natural.min() / 3.0, natural.max() * 3.0) if len(natural) else (1.0, 1000.0)
    grid = np.geomspace(*frequencies, POINTS)
    inside = natural[(natural > frequencies[0]) & (natural < frequencies[1])]
    return response(system, body, np.unique(np.concatenate([grid, inside])), state.locked)


@dataclass(frozen=True)
class Spectrum:
    """Averaged spectrum of a signal.

    Parameters
    ----------
    frequencies : (n,) array of float
        Frequencies [Hz].
    amplitudes : (n,) array of float
        Amplitude of a harmonic [SI unit of the signal].
    peaks : list of (float, float)
        Frequency [Hz] and amplitude of each peak, highest first.
    resolution : float
        Resolution of frequencies [Hz].
    """

    frequencies: np.ndarray
    amplitudes: np.ndarray
    peaks: list[tuple[float, float]]
    resolution: float


def spectrum(values: Floats, period: float, parts_averaged: int = SEGMENTS, highest: float = math.inf) -> Spectrum:
    """Return the averaged spectrum of a signal, by Welch's method with Hann windows that overlap by half.

    A peak lies at the top of the parabola through the logarithms of three values.

    Parameters
    ----------
    values : (n,) array of float
        The signal.
    period : float
        Time between its values [s].
    parts_averaged : int
        Number of half-overlapping parts whose spectra are averaged.
    highest : float
        Highest frequency that is reported [Hz].

    Returns
    -------
    Spectrum
        The spectrum, up to half the rate of the values.

    Raises
    ------
    RigError
        When there are too few values, or some are not finite.
    """
    size = int(2 * len(values) // (parts_averaged + 1))
    if size < 16:
        raise RigError(f"the signal has {len(values)} values in this time, too few for a spectrum")
    if not np.isfinite(values).all():
        raise RigError("the signal has values that are not finite; a spectrum needs all of them")
    from scipy import signal as filters  # imported here: it takes 0.5 s, for which who loads a rig would wait

    at, power = filters.welch(values, 1.0 / period, "hann", size, size // 2, PADDED * size, detrend="linear", scaling="spectrum")
    amplitudes = np.sqrt(2.0 * power)
    resolution = 1.0 / (size * period)
    keep = at <= highest
    at, amplitudes = at[keep], amplitudes[keep]
    low = at < 2.0 * resolution  # what is left of the mean and the trend
    top = float(amplitudes[~low].max(initial=0.0))
    places, _ = filters.find_peaks(np.where(low, 0.0, amplitudes), prominence=max(LEAST_PEAK * top, 1e-300), distance=PADDED)
    peaks = []
    for k in places:
        if 0 < k < len(at) - 1 and not low[k]:
            left, middle, right = np.log(np.maximum(amplitudes[k - 1 : k + 2], 1e-300))
            bend = left - 2.0 * middle + right
            shift = 0.5 * (left - right) / bend if bend < 0.0 else 0.0
            peaks.append((float(at[k] + shift * at[1]), float(amplitudes[k])))
    return Spectrum(at, amplitudes, sorted(peaks, key=lambda one: -one[1]), resolution)


def recorded(bag: Bag, name: str, window: tuple[float, float] | None = None) -> tuple[Floats, float]:
    """Return a signal of a recorded run and the time between its values.

    Parameters
    ----------
    bag : Bag
        The run.
    name : str
        Name of the signal; one of the logger's has its 10 kHz, others the rate of their topic.
    window : (float, float), optional
        Times between which it is taken [s]; by default all.

    Returns
    -------
    values : (n,) array of float
        The signal [SI].
    period : float
        Time between values [s].

    Raises
    ------
    RigError
        When the run does not have the signal, or nothing of it in this time.
    """
    shown = bag.catalogue.signals
    if name not in shown:
        raise RigError(f"--signal {name}: {unknown('signal', name, shown)}")
    if shown[name].logger is not None:
        logged = bag.logger()
        times, values = logged.time(), logged.channels[name]
    else:
        times, values = bag.series(name)
    if window:
        inside = (times >= window[0]) & (times <= window[1])
        times, values = times[inside], values[inside]
    if len(times) < 2:
        raise RigError(f"--signal {name}: the run has no values of it in this time")
    return values, float(times[-1] - times[0]) / (len(times) - 1)


def beside(
    peaks: Sequence[tuple[float, float]], frequencies: Sequence[float]
) -> list[tuple[float, float, float | None, float | None]]:
    """Return each peak with the natural frequency nearest to it.

    Parameters
    ----------
    peaks : sequence of (float, float)
        Frequencies [Hz] and amplitudes of the peaks.
    frequencies : sequence of float
        The natural frequencies [Hz].

    Returns
    -------
    list of tuple
        Of each peak its frequency, its amplitude, the nearest natural frequency and the peak's distance from it as a share; None
        where there is no natural frequency above 0.
    """
    natural = [f for f in frequencies if f > 0.0]
    out = []
    for at, amplitude in peaks:
        near = min(natural, key=lambda f: abs(f - at), default=None)
        out.append((at, amplitude, near, None if near is None else at / near - 1.0))
    return out
