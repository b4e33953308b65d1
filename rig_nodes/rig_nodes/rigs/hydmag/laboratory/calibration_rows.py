# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The values that a rig gives for the calibrating rows of targets.yaml, and how far they are from the printed ones.

Used by studies.validation.calibrate, which searches, and rigs.hydmag.laboratory.trade_off. This module does not depend on what a
search may change.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np

from rig_nodes.analysis import shift_metrics
from rig_nodes.bags import Recording
from rig_nodes.base import RIG_FILE, ROW, SAMPLE, check_keys, load_yaml
from rig_nodes.plant import RPM, relief_setting_for
from rig_nodes.rig import NEUTRAL, Alfa46Config, Clutch, RigConfig, Transmission, load_rig, transmission_of
from rig_nodes.runs import Rig
from rig_nodes.studies import UNSHIFTED, Calibration, Miss, Target, load_stages

from .derived import NO_DIP
from .targets import load_targets

STAGES_FILE = Path(__file__).parents[1] / "calibration.yaml"
SUPPLY = 4e6  # Pa, 7.1.2
SETTLE = 300  # samples in which the supply comes up
PAUSE = 8000  # samples between two engagements, as in the sequences of chapter 7, until the line of S2 has run empty again
PULSES = 4e-3  # A: what the ripple of the coil's pulses and the noise in the loop add to a constant current
FIRST_RISE = 10e3  # Pa: about the smallest first rise that the laboratory could see
NO_LEVEL = 100e3  # Pa: what a pressure that was fitted by 0 may be, the largest error of its transducer
LINE_ERROR = 100e3  # Pa: within which a rise has to keep to the longest printed line; half of it is left to the transducers
RELEASED = 200  # samples after the end of a fall to zero, in which the current stays: the pressure that is left is averaged
FALLEN = 2.2e6  # Pa: the fall has begun when the pressure passes it (22 bar, Annex A)
CURVES = {  # clutch -> rows of its rising and of its falling pressure in chapter 9
    "S1": ("ch9_pressure_down_p1", "ch9_pressure_up_p1"),
    "S2": ("ch9_pressure_up_p2", "ch9_pressure_down_p2"),
}
# Start of a fall after the order. Annex D gives both pressures of a change one time, so the falling one starts with the
# rising one, as far as two curves that were fitted by hand show it. For II to I that is before ZR-P2 is switched off, so there only
# an early start counts.
FALL_STARTS = {"S1": (0.3306, 0.025), "S2": (0.22, 0.05)}  # s after the order, and s that count as one tolerance
DELAYS = {"S1": "valve_delay_zr_p1", "S2": "valve_delay_zr_p2"}
START_PARTS = 100
PEAK_TOLERANCE = 6.5  # Nm: largest error of a shift's peak by (7.1)
TIME_TOLERANCE = 0.01  # s: tolerance of a time from the laboratory's program (9.2.2)
KISSES = {"S1": "kiss_pressure_s1", "S2": "kiss_pressure_s2"}


# ---- what the rig does, without its transducers


def _go(rig: Rig, samples: int) -> None:
    """Advance the rig by some samples; raise Tripped when its plant cannot be moved, because then there are no rows to compare.

    The machine's own trips are not watched: a shift that is not made counts as far off, and not as none.
    """
    rig.advance_samples(samples)
    rig.check_runs()


def alone(box: Transmission, name: str) -> tuple[Clutch, int]:
    """Return a clutch by its name, and the number of the gear that engages it alone."""
    gear = next(gear for gear in box.gears if gear.clutches == (name,))
    return box.engaged(gear.number)[0], gear.number


def pressures(config: RigConfig, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Return the pressure of a clutch at each millisecond from each order on.

    The settings are those of the rig's controller, the shafts are at rest, and the values are true ones. The second engagement
    and release are taken, because a piston that has never moved lies deeper than its seals let it return.

    Parameters
    ----------
    config : RigConfig
        The rig.
    name : str
        Name of the clutch, e.g. S1.

    Returns
    -------
    rise : (1000,) array of float
        Pressure while the clutch is engaged [Pa].
    fall : (1300,) array of float
        Pressure while it is released [Pa].
    """
    rig = Rig(config.replaced(effects=replace(config.effects, transducers=False), trips_watched=False))
    rig.set("oil", SUPPLY, True)
    _go(rig, SETTLE)
    clutch, own = alone(transmission_of(config), name)
    column, found = rig.channels.index(clutch.pressure), []
    for gear, samples, pause in ((own, 1000, 0), (NEUTRAL, 1300, PAUSE)) * 2:
        order = rig.sample
        rig.order_gear(gear)
        _go(rig, samples)
        found.append(rig.rows_at(ROW, 10 * order, 10 * samples)[::10, column])
        _go(rig, pause)
    return found[2], found[3]


def with_cracking(config: RigConfig, clutch: Clutch, more: float) -> RigConfig:
    """Return the rig with the cracking current of a clutch's valve changed by some amperes."""
    valve = getattr(config, clutch.valve)
    return config.replaced(**{clutch.valve: replace(valve, cracking_current=valve.cracking_current + more)})


def first_true(values: np.ndarray, missing: float) -> float:
    """Return the time [s] of the first True of values at each millisecond; ``missing`` where there is none."""
    return float(np.argmax(values)) * SAMPLE if values.any() else missing


def on_curve(target: Target, t: np.ndarray) -> np.ndarray:
    """Return the pressure [Pa] of a curve of chapter 9 at times since its start [s]; before the start it keeps its first value."""
    out = np.full(t.shape, np.polyval(target.pieces[0][2], 0.0))
    for low, high, coefficients in target.pieces:
        inside = (t > low) & (t <= high)
        out[inside] = np.polyval(coefficients, t[inside])
    out[t > target.pieces[-1][1]] = np.polyval(target.pieces[-1][2], target.pieces[-1][1])
    return np.maximum(out, 0.0) * 1e6


def distances(target: Target, p: np.ndarray, start: float) -> np.ndarray:
    """Return the distances of pressures from a curve, at each millisecond of the curve.

    Parameters
    ----------
    target : Target
        The row with the curve.
    p : (n,) array of float
        Pressure at each millisecond since the order [Pa]; after its end the last value is used.
    start : float
        Time after the order at which the curve begins [s].

    Returns
    -------
    array of float
        Distances [Pa].
    """
    t = np.arange(0.0, target.pieces[-1][1], SAMPLE)
    return np.interp(start + t, SAMPLE * np.arange(len(p)), p) - on_curve(target, t)


def piece_shares(target: Target, length: int) -> np.ndarray:
    """Return the share of each millisecond of a curve in its miss: all printed pieces count alike, however long they last.

    Parameters
    ----------
    target : Target
        The row with the curve.
    length : int
        Number of milliseconds.

    Returns
    -------
    (length,) array of float
        Shares; their sum is 1.
    """
    piece = np.searchsorted([high for _, high, _ in target.pieces], SAMPLE * np.arange(length))
    return 1.0 / (np.bincount(piece)[piece] * len(np.unique(piece)))


def off_the_line(target: Target, apart: np.ndarray) -> float:
    """Return the largest distance [Pa] from the longest printed line of a curve, of its distances at each millisecond.

    For p1 it is the ramp that its current gives, for p2 the fill.
    """
    lines = (piece for piece in target.pieces if len(piece[2]) == 2)
    begins, ends, _ = max(lines, key=lambda piece: piece[1] - piece[0])
    return float(np.abs(apart[round(begins / SAMPLE) : round(ends / SAMPLE)]).max())


def fall_begins(target: Target, p: np.ndarray) -> float:
    """Return the start [s] of a fall.

    It is the time at which the pressure passes 2.2 MPa, less the time that the curve takes from its start to there.
    """
    t = np.arange(0.0, 0.1, 1e-4)
    return first_true(p < FALLEN, 1.0) - float(t[np.argmax(on_curve(target, t) < FALLEN)])


def hydraulic_misses(config: RigConfig, targets: dict[str, Target], name: str) -> list[Miss]:
    """Return the misses of valve response, kiss point and chapter 9's pressures of one clutch.

    Parameters
    ----------
    config : RigConfig
        The rig.
    targets : dict of str to Target
        The rows by name.
    name : str
        Name of the clutch, e.g. S1.

    Returns
    -------
    list of Miss
        One miss for each row.
    """
    box = transmission_of(config)
    clutch, gear = alone(box, name)
    rise, fall = pressures(config, name)
    early, _ = pressures(with_cracking(config, clutch, -PULSES), name)
    rising, falling = (targets[row] for row in CURVES[name])
    delay, kiss = targets[DELAYS[name]], targets[KISSES[name]]
    first, fallen = first_true(rise > rise[0] + FIRST_RISE, len(rise) * SAMPLE), fall_begins(falling, fall)
    sees = first_true(early > early[0] + FIRST_RISE, len(early) * SAMPLE)  # the release before may have left pressure
    meets = clutch.kiss_pressure
    delays = config.alfa46.values
    order_to_off = max(0.0, -(delays.t12 if gear == min(box.ratios) else delays.t21))
    due, tolerance = FALL_STARTS[name]
    late = (fallen + order_to_off - due) / tolerance
    out = [
        Miss(delay.id, sees, (sees - delay.printed[0]) / delay.tolerance),
        Miss(kiss.id, meets, (meets - kiss.printed[0]) / kiss.tolerance),
        # piece by piece, because this curve must be met: it decides whether S1 still holds when S2 begins to carry torque
        Miss(f"{falling.id}: start", fallen + order_to_off, late, (late / np.sqrt(START_PARTS),) * START_PARTS),
    ]
    length = falling.pieces[-1][1]
    if not on_curve(falling, np.array([length])).any():  # the last piece of p2's fall ends with its fit, at no level
        over = round((fallen + length) / SAMPLE)
        left = fall[over : over + RELEASED]
        level = float(np.sqrt(np.mean(left**2)))
        out.append(Miss(f"{falling.id}: end", level, level / NO_LEVEL, tuple(left / NO_LEVEL / np.sqrt(len(left)))))
    of_rise, of_fall = distances(rising, rise, first), distances(falling, fall, fallen)
    line = off_the_line(rising, of_rise)
    out.append(Miss(f"{rising.id}: line", line, max(0.0, line / LINE_ERROR - 0.5)))
    for row, apart in ((rising, of_rise), (falling, of_fall)):
        parts = apart * np.sqrt(piece_shares(row, len(apart)))
        miss = float(np.sqrt(np.sum(parts**2)))
        out.append(Miss(row.id, miss, miss / row.tolerance, tuple(parts / row.tolerance)))
    return out


def steady_torque(config: RigConfig, gear: int, speed: float, load: float) -> float:
    """Return the true M_wej [Nm] that turns the rig steadily.

    Parameters
    ----------
    config : RigConfig
        The rig.
    gear : int
        The gear; 0 is neutral.
    speed : float
        Speed of the input [rad/s].
    load : float
        Load [Nm].

    Returns
    -------
    float
        Torque of the input [Nm].
    """
    rig = Rig(config.replaced(effects=replace(config.effects, transducers=False), trips_watched=False))
    rig.set("oil", SUPPLY, True)
    _go(rig, SETTLE)
    if gear:
        rig.order_gear(gear)
        _go(rig, 1200)
    rig.set("motor", speed, True)
    _go(rig, 2000)
    rig.set("load", relief_setting_for(load, rig.speed_at("load_pump"), config.load_pump), load > 0.0)
    _go(rig, 3000)
    return rig.shown_truly("M_wej")


def loss_misses(config: RigConfig, targets: dict[str, Target]) -> list[Miss]:
    """Return the misses of coast-down and of the mean torques of 7.3.2, in steady state.

    The coast-down follows from the torques M that keep the open driving side at its speeds w: J dw/dt = -M. Its tangent
    at the start reaches zero after J w / M.

    Parameters
    ----------
    config : RigConfig
        The rig.
    targets : dict of str to Target
        The rows by name.

    Returns
    -------
    list of Miss
        One miss for each row.
    """
    speeds = RPM * np.array([5.0, 50.0, 120.0, 230.0, 350.0, 470.0])
    torques = np.array([steady_torque(config, 0, speed, 0.0) for speed in speeds])
    coasting, driving = float(torques[-1]), transmission_of(config).inertias.driving
    values = {
        "coast_down_torque": coasting,
        "coast_down_tangent_time": driving * 470 * RPM / coasting,
        "valve_mean_torque_s1": steady_torque(config, 1, 500 * RPM, 30.0),
        "valve_mean_torque_s2": steady_torque(config, 2, 500 * RPM, 30.0),
    }
    curve = targets["coast_down_curve"]
    start, end, parabola = curve.pieces[0]
    t, w = np.arange(start, end, 1e-2), np.linspace(speeds[0], np.polyval(parabola, start), 500)
    # the time from one speed to the next, by trapezoids of J / M
    gone = driving * np.cumsum(np.diff(w) / np.interp(0.5 * (w[1:] + w[:-1]), speeds, torques))
    apart = np.interp(t, gone[-1] - np.append(0.0, gone)[::-1], w[::-1]) - np.polyval(parabola, t)
    miss = float(np.sqrt(np.mean(apart**2)))
    return [
        *(Miss(name, value, (value - targets[name].printed[0]) / targets[name].tolerance) for name, value in values.items()),
        Miss(curve.id, miss, miss / curve.tolerance),
    ]


def shift(
    config: RigConfig, to: int, t12: float | None = None, speed: float = 500.0 * RPM, load: float = 60.0, set_in: int | None = None
) -> dict:
    """Return the metrics of a shift, from true values and from the rig's second shift that way.

    Parameters
    ----------
    config : RigConfig
        The rig.
    to : int
        Gear to shift to, 1 or 2.
    t12 : float or None
        Delay t12 [s]; None for the rig's own.
    speed : float
        Speed of the input [rad/s]; by default that of the delay series (7.1.3.4).
    load : float
        Load [Nm]; by default that of the delay series.
    set_in : int or None
        Gear in which the load is set; None for the one before the shift.

    Returns
    -------
    dict
        The metrics of analysis.metrics.
    """
    values = config.alfa46.values if t12 is None else replace(config.alfa46.values, t12=t12)
    config = config.replaced(
        effects=replace(config.effects, transducers=False), alfa46=Alfa46Config(values, config.alfa46.profiles)
    )
    rig = Rig(config.replaced(trips_watched=False))
    rig.set("oil", SUPPLY, True)
    _go(rig, SETTLE)
    box = transmission_of(config)
    of = next(gear for gear in box.ratios if gear != to)
    for gear in (to, of):  # a piston that has never moved lies deeper than its seals let it return
        rig.order_gear(gear)
        _go(rig, 1600)
    _go(rig, PAUSE)
    rig.set("motor", speed, True)
    _go(rig, max(1500, 1000 + round(1000.0 * speed / config.motor.ramp)))
    output = speed / box.ratios[set_in or of]
    rig.set("load", relief_setting_for(load, output, config.load_pump), True)
    _go(rig, 1500)
    order, before, after = rig.sample, 150, 1700
    rig.order_gear(to)
    _go(rig, after)
    rows = rig.rows_at(ROW, 10 * (order - before), 10 * (before + after) - 9)
    channels = {name: rows[:, k] for k, name in enumerate(rig.channels)}
    recording = Recording((order - before) * SAMPLE, ROW, channels, [], box)
    return shift_metrics(recording, (order * SAMPLE, of, to))


def hydraulics_misses(config: RigConfig, targets: dict[str, Target]) -> list[Miss]:
    """Return the misses of :func:`hydraulic_misses` for both clutches, whose valves are of one type.

    The highest peak torque of the 19 delay series is added. That peak is series 5's, where S2 catches an output that nothing else
    drives; only it shows how far p2 overshoots.
    """
    target, peak = targets["delay_up_peak_upper"], shift(config, 2, -0.1)["input_torque_max_nm"]
    return [
        *(miss for name in CURVES for miss in hydraulic_misses(config, targets, name)),
        Miss(target.id, peak, max(0.0, peak - target.high) / PEAK_TOLERANCE),
    ]


def release_misses(config: RigConfig, targets: dict[str, Target]) -> list[Miss]:
    """Return the misses of :func:`s1_releases` and :func:`s2_releases`.

    They show what released clutches hold, and how much of it is left while they slip.
    """
    return [*s1_releases(config, targets), *s2_releases(config, targets)]


def within(target: Target, value: float, tolerance: float, which: str = "") -> Miss:
    """Return the miss of a row that accepts every value between its ends.

    The miss is the distance to the range that lies half a tolerance inside these ends; that half is left to the transducers.

    Parameters
    ----------
    target : Target
        The row.
    value : float
        The rig's value [SI].
    tolerance : float
        One tolerance [SI].
    which : str
        Ending for the row's name, where it gives several misses.

    Returns
    -------
    Miss
        The miss; 0 tolerances inside that range.
    """
    low = -np.inf if target.low is None else target.low + 0.5 * tolerance
    high = np.inf if target.high is None else target.high - 0.5 * tolerance
    return Miss(target.id + which, value, (min(0.0, value - low) + max(0.0, value - high)) / tolerance)


def s2_releases(config: RigConfig, targets: dict[str, Target]) -> list[Miss]:
    """Return the misses that show how long S2 holds against S1, by a peak, and how long it drags afterwards, by t_o of II to I."""
    series_19 = shift(config, 1, set_in=1)["input_torque_max_nm"]  # the sequence delay sets the load in gear I for both ways
    lets_go = [shift(config, 1, None, speed * RPM, load)["t_o_s"] for speed, load in ((1500, 40.0), (1500, 240.0))]
    peak, settling = targets["delay_down_peak_19"], targets["down_t_o_lower"]
    if any(time is None for time in lets_go):
        return [Miss(target.id, 0.0, UNSHIFTED) for target in (peak, settling)]
    return [
        Miss(peak.id, series_19, (series_19 - peak.printed[0]) / peak.tolerance),
        within(settling, min(lets_go), TIME_TOLERANCE),
    ]


def s1_releases(config: RigConfig, targets: dict[str, Target]) -> list[Miss]:
    """Return the misses of the upshift: the t12 at which it begins to dip, whether the load makes it dip, and peaks of the grid.

    The lowest and the highest peak of the grid depend on whether what is left of S1 while it slips brakes S2's torque. The
    border of the dip is where k crosses 0.95 on the straight line between the delays of series 6 and 9, which lie around it.
    """
    target, (late, early) = targets["delay_up_dip_begins"], (-0.15, -0.19)
    flat, peaks, longest = (targets[name] for name in ("up_k_flat_load", "up_peak_torque_range", "up_t_c_upper"))
    k_late, k_early = (shift(config, 2, t12)["k"] for t12 in (late, early))
    slow, slow_loaded, fast_loaded = (
        shift(config, 2, None, speed * RPM, load) for speed, load in ((1000, 40.0), (1000, 120.0), (2000, 120.0))
    )
    fall = None if None in (slow["k"], slow_loaded["k"]) else slow["k"] - slow_loaded["k"]
    least, most, slowest = slow["input_torque_max_nm"], fast_loaded["input_torque_max_nm"], fast_loaded["t_c_s"]
    if None in (k_late, k_early, fall, least, most, slowest):
        names = (target.id, flat.id, f"{peaks.id}: least", f"{peaks.id}: most", longest.id)
        return [Miss(name, 0.0, UNSHIFTED) for name in names]
    steep = min(k_late - k_early, -0.02)  # flat where neither dips; the border is then far off, on the correct side
    border = early + (late - early) * (NO_DIP - k_early) / steep
    return [
        Miss(target.id, border, (border - target.printed[0]) / target.tolerance),
        Miss(flat.id, fall, max(0.0, fall / flat.tolerance - 0.5)),  # as within() leaves half a tolerance
        within(peaks, least, PEAK_TOLERANCE, ": least"),
        within(peaks, most, PEAK_TOLERANCE, ": most"),
        within(longest, slowest, TIME_TOLERANCE),
    ]


def clutch_misses(config: RigConfig, targets: dict[str, Target]) -> list[Miss]:
    """Return the misses of :func:`hydraulics_misses` and :func:`release_misses`.

    They are one stage: how long a released clutch holds follows from its pressure as much as from its plates.
    """
    return [*hydraulics_misses(config, targets), *release_misses(config, targets)]


@cache
def calibrating() -> dict[str, Target]:
    """Return the rows of targets.yaml by name, which are read once in each process."""
    return {target.id: target for target in load_targets()}


def _losses(config: RigConfig) -> list[Miss]:
    return loss_misses(config, calibrating())


def _clutches(config: RigConfig) -> list[Miss]:
    return clutch_misses(config, calibrating())


ROWS: dict[str, Callable[[RigConfig], list[Miss]]] = {"losses": _losses, "clutches": _clutches}  # stage -> what gives its misses


def calibration(path: Path = STAGES_FILE) -> Calibration:
    """Return the stages of the laboratory's calibration.yaml, whose parameters are those of its rig, and their rows.

    Raises
    ------
    RigError
        With file and line, when the file is not right.
    """
    stages = load_stages(path, load_rig(STAGES_FILE.parent / RIG_FILE))
    check_keys(path, load_yaml(path)["stages"], ROWS, ROWS, "stages")
    return Calibration(stages, ROWS)
