"""Finds the rig's unknown parameters on the rows of targets.yaml whose role is to calibrate, all in one set.

Used by `rig calibrate`. Hydraulics first (pressures of chapter 9, response times, kiss points), then losses (coast-down,
torques of 7.3); friction stays as printed. calibration.yaml says what may change and how far.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

import numpy as np
from scipy.optimize import differential_evolution

from ..alfa46.settings import Alfa46Config, Alfa46Values
from ..config import load_marked
from ..config.schema import check_keys, where_of
from ..config.units import UNITS, quantity
from ..errors import RigError
from ..plant import kernel
from ..plant.clutch import Cylinder
from ..plant.load_pump import relief_setting_for
from ..testbench.campaign import Workers
from ..testbench.configuration import PARTS, RigConfig
from ..testbench.rig import Rig
from .targets import Target, load_targets

CALIBRATION_FILE = Path(__file__).resolve().with_name("calibration.yaml")
SUPPLY = 4e6  # Pa, 7.1.2
SETTLE = 300  # samples in which the supply comes up
MS = 1e-3
FIRST_RISE = 10e3  # Pa: about what the laboratory could see of a first rise
FALLEN = 2.2e6  # Pa: the fall has begun when it is passed (22 bar, Annex A)
CLUTCHES = (1, 2)
CURVES = {  # of a clutch: row of the rising and of the falling pressure in chapter 9
    1: ("ch9_pressure_down_p1", "ch9_pressure_up_p1"), 2: ("ch9_pressure_up_p2", "ch9_pressure_down_p2"),
}
# Start of a fall after the order: Annex D gives both pressures of a change one time, so the falling one starts with the
# rising one. For II to I that is before ZR-P2 is switched off: there only early counts.
FALL_STARTS = {1: (0.3306, 0.01), 2: (0.22, 0.05)}  # s, and what counts as one tolerance
DELAYS = {1: "valve_delay_zr_p1", 2: "valve_delay_zr_p2"}
KISSES = {1: "kiss_pressure_s1", 2: "kiss_pressure_s2"}


@dataclass(frozen=True)
class Parameter:
    """One unknown: the values of the rig that it is, each so many times, and its bounds (SI)."""

    name: str
    of: dict[str, float]
    low: float
    high: float
    why: str


def load_stages(path: Path = CALIBRATION_FILE) -> dict[str, dict[str, Parameter]]:
    """The parameters of calibration.yaml, stage -> name -> parameter; RigError with file and line when it is not right."""
    node = load_marked(path)
    check_keys(path, node, ("stages",), ("stages",), "the calibration")
    check_keys(path, node["stages"], ROWS, ROWS, "stages")
    return {stage: {name: _parameter(path, parts, name) for name in parts} for stage, parts in node["stages"].items()}


def _parameter(path: Path, node, name: str) -> Parameter:
    where, body = where_of(path, node, name), node[name]
    check_keys(path, body, ("of", "low", "high", "why"), ("of", "low", "high", "why"), name)
    times = isinstance(body["of"], dict)
    of = {str(place): float(body["of"][place]) if times else 1.0 for place in body["of"]}
    dimensions = {_field(place, where).metadata["dimension"] for place in of}
    low, high = (quantity(body[key], "ratio" if times else min(dimensions), f"{where}: {name}.{key}")
                 for key in ("low", "high"))
    if not low < high:
        raise RigError(f"{where}: {name}: low must be below high")
    return Parameter(str(name), of, low, high, str(body["why"]))


def _field(value: str, where: str):
    part, _, name = value.partition(".")
    owner = Alfa46Values if part == "alfa46" else PARTS.get(part)
    if owner is None or name not in owner.__dataclass_fields__:
        raise RigError(f"{where}: the rig has no value '{value}'")
    return owner.__dataclass_fields__[name]


def with_values(config: RigConfig, parameters: dict[str, Parameter], values: dict[str, float]) -> RigConfig:
    """The rig with these values (SI) of parameters."""
    for name, value in values.items():
        for place, times in parameters[name].of.items():
            part, _, key = place.partition(".")
            owner = config.alfa46.values if part == "alfa46" else getattr(config, part)
            owner = replace(owner, **{key: times * value})
            if part == "alfa46":
                config = replace(config, alfa46=Alfa46Config(owner, config.alfa46.profiles))
            else:
                config = replace(config, **{part: owner})
    return config


# ---- what the rig does, without its transducers


def pressures(config: RigConfig, clutch: int) -> tuple[np.ndarray, np.ndarray]:
    """Pressure [Pa] of clutch 1 or 2 each millisecond, engaged and then released, from each order on.

    At the settings of the rig's controller, shafts at rest, true values; the second time, because a piston that has
    never moved lies deeper than its seals let it return.
    """
    rig = Rig(replace(config, effects=replace(config.effects, transducers=False)))
    rig.set_oil(SUPPLY, True)
    rig.advance_samples(SETTLE)
    rig.take_rows(10 * SETTLE)
    column, found = (kernel.P_1, kernel.P_2)[clutch - 1], []
    for gear, samples in ((clutch, 1000), (0, 1300)) * 2:
        rig.order_gear(gear)
        rig.advance_samples(samples)
        found.append(rig.take_rows(10 * samples)[1][::10, column].copy())
    return found[2], found[3]


def kiss_pressure(cylinder: Cylinder) -> float:
    """Pressure [Pa] at which the rising piston meets the plates: springs and seals at the clearance."""
    resist = cylinder.spring_preload + cylinder.spring_rate * cylinder.clearance + cylinder.seal_friction
    slope, square = cylinder.piston_area, cylinder.force_per_pressure_squared
    share = 1.0 - cylinder.seal_friction_share
    return 2.0 * resist / share / (slope + np.sqrt(slope * slope + 4.0 * square * resist / share))


def first_true(values: np.ndarray, missing: float) -> float:
    """Time [s] of the first True of values each millisecond; ``missing`` where there is none."""
    return float(np.argmax(values)) * MS if values.any() else missing


def on_curve(target: Target, t: np.ndarray) -> np.ndarray:
    """A curve of chapter 9 [Pa] at times since its start [s], before which it stays as it begins."""
    out = np.full(t.shape, np.polyval(target.pieces[0][2], 0.0))
    for low, high, coefficients in target.pieces:
        inside = (t > low) & (t <= high)
        out[inside] = np.polyval(coefficients, t[inside])
    out[t > target.pieces[-1][1]] = np.polyval(target.pieces[-1][2], target.pieces[-1][1])
    return np.maximum(out, 0.0) * 1e6


def deviation(target: Target, p: np.ndarray, start: float) -> float:
    """Root mean square distance [Pa] of pressures each millisecond from a curve that begins at ``start`` [s]."""
    t = np.arange(len(p)) * MS - start
    span = (t >= 0.0) & (t <= target.pieces[-1][1])
    if not span.any():
        return 2.3e6
    return float(np.sqrt(np.mean((p[span] - on_curve(target, t[span])) ** 2)))


def fall_begins(target: Target, p: np.ndarray) -> float:
    """Start [s] of a fall: where the pressure passes 2.2 MPa, less what the curve needs to there."""
    t = np.arange(0.0, 0.1, 1e-4)
    return first_true(p < FALLEN, 1.0) - float(t[np.argmax(on_curve(target, t) < FALLEN)])


@dataclass(frozen=True)
class Miss:
    """How far a row is from what is printed, in tolerances, and its value [SI]."""

    row: str
    value: float
    tolerances: float


def hydraulic_misses(config: RigConfig, targets: dict[str, Target], clutch: int) -> list[Miss]:
    """The rows of valve response, kiss point and chapter 9's pressures of one clutch."""
    rise, fall = pressures(config, clutch)
    rising, falling = (targets[name] for name in CURVES[clutch])
    delay, kiss = targets[DELAYS[clutch]], targets[KISSES[clutch]]
    first, fallen = first_true(rise > FIRST_RISE, len(rise) * MS), fall_begins(falling, fall)
    meets = kiss_pressure(config.clutch_s1 if clutch == 1 else config.clutch_s2)
    delays = config.alfa46.values
    order_to_off = max(0.0, -(delays.t12 if clutch == 1 else delays.t21))
    due, tolerance = FALL_STARTS[clutch]
    out = [Miss(delay.id, first, (first - delay.printed[0]) / delay.tolerance),
           Miss(kiss.id, meets, (meets - kiss.printed[0]) / kiss.tolerance),
           Miss(f"{falling.id}: start", fallen + order_to_off, (fallen + order_to_off - due) / tolerance)]
    for row, p, start in ((rising, rise, first), (falling, fall, fallen)):
        miss = deviation(row, p, start)
        out.append(Miss(row.id, miss, miss / row.tolerance))
    return out


def steady_torque(config: RigConfig, gear: int, speed: float, load: float) -> float:
    """M_wej [Nm] that turns the rig in a gear (0: neutral) at an input speed [rad/s] under a load [Nm], true value."""
    rig = Rig(replace(config, effects=replace(config.effects, transducers=False)))
    rig.set_oil(SUPPLY, True)
    rig.advance_samples(SETTLE)
    if gear:
        rig.order_gear(gear)
        rig.advance_samples(1200)
    rig.set_motor(speed, True)
    rig.advance_samples(2000)
    rig.set_load(relief_setting_for(load, float(rig.v[1]), config.load_pump), load > 0.0)
    rig.advance_samples(3000)
    return float(rig.plant["m_wej"][0])


def loss_misses(config: RigConfig, targets: dict[str, Target]) -> list[Miss]:
    """The rows of coast-down and of the mean torques of 7.3.2, in steady state.

    The tangent at the start of the coast-down meets zero after J w / M, what the open driving side's torque makes of it.
    """
    rpm = np.pi / 30.0
    coasting = steady_torque(config, 0, 470 * rpm, 0.0)
    values = {"coast_down_torque": coasting,
              "coast_down_tangent_time": config.gearbox.inertia_in * 470 * rpm / coasting,
              "valve_mean_torque_s1": steady_torque(config, 1, 500 * rpm, 30.0),
              "valve_mean_torque_s2": steady_torque(config, 2, 500 * rpm, 30.0)}
    return [Miss(name, value, (value - targets[name].printed[0]) / targets[name].tolerance)
            for name, value in values.items()]


ROWS: dict[str, Callable] = {  # of each stage
    "losses": loss_misses, "clutch_s1": partial(hydraulic_misses, clutch=1),
    "clutch_s2": partial(hydraulic_misses, clutch=2),
}


# ---- the search


@dataclass
class Found:
    """What a calibration found: value of each parameter (SI), the rows' misses before and after, and how well each
    parameter is determined: ``spread`` is the change that moves the sum of squares by 1 with the others held.
    """

    values: dict[str, float]
    before: list[Miss]
    after: list[Miss]
    spread: dict[str, float] = field(default_factory=dict)
    sensitivities: dict[str, dict[str, float]] = field(default_factory=dict)


def _cost(x, config, parameters, misses) -> float:
    values = {p.name: p.low + (p.high - p.low) * u for p, u in zip(parameters.values(), np.clip(x, 0.0, 1.0))}
    targets = _targets()
    return float(sum(miss.tolerances**2 for miss in misses(with_values(config, parameters, values), targets)))


_TARGETS: dict[str, Target] = {}


def _targets() -> dict[str, Target]:
    """The rows by name, read once in each process."""
    if not _TARGETS:
        _TARGETS.update({target.id: target for target in load_targets()})
    return _TARGETS


def search(config: RigConfig, parameters: dict[str, Parameter], misses: Callable, generations: int, jobs: int,
           seed: int, progress: Callable[[int, float], None] | None = None) -> dict[str, float]:
    """Values that make the sum of squared misses small, by differential evolution; an interrupt is passed on.

    misses: of this module, e.g. hydraulic_misses. The same seed finds the same values for any number of jobs.
    """
    cost = partial(_cost, config=config, parameters=parameters, misses=misses)
    turn = [0]

    def tell(intermediate_result) -> None:
        turn[0] += 1
        if progress:
            progress(turn[0], float(intermediate_result.fun))

    start = _start(config, parameters)
    with Workers(jobs) as workers:
        found = differential_evolution(
            cost, [(0.0, 1.0)] * len(parameters), x0=start, popsize=4, maxiter=generations, tol=1e-4, seed=seed,
            mutation=(0.4, 0.9), recombination=0.8, polish=False, callback=tell, workers=workers.map, updating="deferred")
    return {p.name: float(p.low + (p.high - p.low) * u) for p, u in zip(parameters.values(), found.x)}


def _start(config: RigConfig, parameters: dict[str, Parameter]) -> np.ndarray:
    """The rig as it is, as shares of the bounds."""
    shares = []
    for p in parameters.values():
        place, times = next(iter(p.of.items()))
        part, _, key = place.partition(".")
        owner = config.alfa46.values if part == "alfa46" else getattr(config, part)
        now = getattr(owner, key) / times
        shares.append((now - p.low) / (p.high - p.low))
    return np.clip(shares, 0.0, 1.0)


def sensitivities(config: RigConfig, parameters: dict[str, Parameter], values: dict[str, float],
                  misses: Callable) -> tuple[dict[str, dict[str, float]], dict[str, float]]:
    """(change of each row's miss [tolerances] by a tenth of each parameter's bounds, spread of each parameter).

    Differences to both sides; the spread is what moves the sum of squared misses by 1 to second order, the others held,
    at most the width of the bounds: a parameter that the rows do not see has that.
    """
    targets, step = _targets(), 0.02
    rows: dict[str, dict[str, float]] = {}
    spread = {}
    for name, p in parameters.items():
        width = p.high - p.low
        sides = [{miss.row: miss.tolerances for miss in misses(
            with_values(config, parameters, {name: values[name] + way * step * width}), targets)} for way in (-1.0, 1.0)]
        slope = {row: (sides[1][row] - sides[0][row]) / (2.0 * step) for row in sides[0]}
        rows[name] = {row: 0.1 * value for row, value in slope.items()}
        curvature = sum(value**2 for value in slope.values())
        spread[name] = width * min(1.0, 1.0 / np.sqrt(curvature)) if curvature > 0.0 else width
    return rows, spread


def calibrate(config: RigConfig, generations: int, jobs: int, seed: int, stages: list[str] | None = None,
              progress: Callable[[str, int, float], None] | None = None) -> Found:
    """The stages, all or some, one after the other, each on its rows; RigError when calibration.yaml is not right."""
    targets, found = _targets(), Found({}, [], [])
    for stage, those in load_stages().items():
        if stages is not None and stage not in stages:
            continue
        misses = ROWS[stage]
        found.before += misses(config, targets)
        tell = partial(progress, stage) if progress else None
        values = search(config, those, misses, generations if len(those) > 4 else min(generations, 15), jobs, seed, tell)
        config = with_values(config, those, values)
        found.after += misses(config, targets)
        rows, spread = sensitivities(config, those, values, misses)
        found.values |= {f"{stage}.{name}": value for name, value in values.items()}
        found.sensitivities |= {f"{stage}.{name}": row for name, row in rows.items()}
        found.spread |= {f"{stage}.{name}": value for name, value in spread.items()}
    return found


def write_values(values: dict[str, float], rig_file: Path, controller_file: Path) -> None:
    """Put values ("stage.name" -> SI) into the YAML files of rig and controller, in the units that stand there.

    The rest of the files stays as it is. RigError when a value has no line of its own there.
    """
    stages = load_stages()
    texts = {rig_file: rig_file.read_text(), controller_file: controller_file.read_text()}
    for full, value in values.items():
        stage, _, name = full.partition(".")
        for place, times in stages[stage][name].of.items():
            part, _, key = place.partition(".")
            file = controller_file if part == "alfa46" else rig_file
            texts[file] = _replaced(texts[file], "" if part == "alfa46" else part, key, times * value, file)
    for file, text in texts.items():
        file.write_text(text)


def _replaced(text: str, part: str, key: str, value: float, file: Path) -> str:
    indent = "  " if part else ""
    begin = re.search(rf"^{part}:\s*$", text, re.M).end() if part else 0
    line = re.compile(rf"^{indent}{key}: \[([^,]*?), \"(.*)\"\]", re.M)
    match = line.search(text, begin)
    if match is None:
        raise RigError(f"{file}: no line '{key}: [value, \"source\"]' in {part or 'the controller'}")
    unit = match[1].split(" ", 1)[1]
    number = value / UNITS[unit][1]
    new = f'{indent}{key}: [{number:.4g} {unit}, "calibrated: rig calibrate"]'
    return text[:match.start()] + new + text[match.end():]
