# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""``rig modes RIG``: natural frequencies, mode shapes, critical speeds, steady response, recorded spectra and detuning of a rig."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from .output_files import OutputFile
from .shared_arguments import add_dark, add_json, add_set, check_dark

if TYPE_CHECKING:
    import argparse
    from collections.abc import Iterator, Sequence

    from ..analysis import Critical, Detuned, Detuning, Found, Response, Spectrum
    from ..rig import RigConfig

HELP = "natural frequencies, critical speeds and responses of a rig's driveline; detuning"
RPM = math.pi / 30.0
ORDERS = [1.0, 2.0]
SPEEDS = ["500 rpm", "10000 rpm"]
MOST_PEAKS = 12


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the verb."""
    parser.add_argument("rig", metavar="RIG", help="folder of a rig, its file, or the name of an installed one")
    add_set(parser, 'change one value of the rig, e.g. shaft.stiffness="2000 Nm/rad"')
    parser.add_argument(
        "--gear", metavar="NAME", help="the gear whose modes are printed in full (default: the first); neutral: all open"
    )
    parser.add_argument(
        "--locked",
        nargs="*",
        metavar="NAME",
        help="in its place the clutches, brakes and free-wheels that are locked; none: all open",
    )
    parser.add_argument("--body", metavar="NAME", help="the body by whose speed orders count and on which a harmonic torque acts")
    parser.add_argument(
        "--orders", nargs="+", type=float, metavar="N", help="periods of the exciting torque in a turn (default: 1 2)"
    )
    parser.add_argument("--speeds", nargs=2, metavar="SPEED", help='range of speeds (default: "500 rpm" "10000 rpm")')
    parser.add_argument(
        "--response", action="store_true", help="also the steady response of shafts and bodies to a harmonic torque on the body"
    )
    parser.add_argument("--band", nargs=2, metavar="FREQUENCY", help='range of the response, e.g. "10 Hz" "500 Hz"')
    parser.add_argument(
        "--run", metavar="RUN", help="a recorded run: peaks of the averaged spectrum of --signal beside the frequencies"
    )
    parser.add_argument("--signal", metavar="NAME", help="the signal of --run, e.g. the torque of a shaft")
    parser.add_argument("--window", nargs=2, metavar="TIME", help='times of the run between which it is taken, e.g. "1 s" "5 s"')
    parser.add_argument(
        "--detune",
        nargs="?",
        const="own",
        metavar="FILE.yaml",
        help="find settings that keep the frequencies away from orders and bands; without a file, those of the rig's detuning.yaml",
    )
    add_json(parser, "write all of it as JSON to a file, or to the terminal for -")
    parser.add_argument(
        "--picture", type=OutputFile("picture"), metavar="FILE", help="draw shapes, critical speeds, response and spectrum"
    )
    add_dark(parser)


def main(args: argparse.Namespace) -> int:
    """Compute and print; return 0."""
    from ..analysis import modes as analysis
    from ..base import RigError
    from ..rig import load_rig
    from ..runs import parse_settings
    from .json_output import write_json

    if (args.run is None) != (args.signal is None):
        raise RigError("--run and --signal go together: a recorded run and the name of one of its signals")
    if args.window and args.run is None:
        raise RigError("--window is for the run of --run; give both")
    if args.band and not args.response:
        raise RigError("--band is for --response; give both")
    check_dark(args)
    config = load_rig(args.rig, parse_settings(args.settings))
    state = analysis.chosen_state(config, args.gear, args.locked)
    body = analysis.exciting_body(config, args.body)
    orders, speeds = _orders(args.orders), _speeds(args.speeds)
    system = analysis.system_of(config)
    chosen = analysis.found_in(system, state)
    others = [analysis.found_in(system, one) for one in analysis.states_of(config) if one.locked != state.locked]
    critical = analysis.critical_speeds(chosen.modes, body, orders, speeds)
    answer = analysis.response_of(system, state, body, _band(args.band)) if args.response else None
    spectrum = _spectrum(args, chosen) if args.run else None
    detuned = _detuned(args, config) if args.detune else None
    content = {
        "rig": config.name,
        "state": state.name,
        "locked": list(state.locked),
        "frequencies_hz": chosen.modes.frequencies,
        **_json_of(chosen),
        "body": body,
        "orders": orders,
        "speeds_rpm": [one / RPM for one in speeds],
        "critical_speeds": [
            {"mode": one.mode + 1, "order": one.order, "speed_rpm": one.speed / RPM, "share_of_body": one.share} for one in critical
        ],
        "states": [{"state": one.state.name, "locked": list(one.state.locked), **_json_of(one)} for one in (chosen, *others)],
    }
    if answer:
        content["response"] = _json_of_response(answer, body)
    if spectrum:
        content["spectrum"] = _json_of_spectrum(args, *spectrum, chosen)
    if detuned:
        content["detuning"] = _json_of_detuning(*detuned, config)
    if args.json:
        write_json(args.json, content)
    if args.json != "-":
        lines = [*_text(config, chosen, others), *_text_of_speeds(critical, body, orders, speeds)]
        lines += _text_of_response(answer, body, chosen) if answer else []
        lines += _text_of_spectrum(args.signal, *spectrum, chosen) if spectrum else []
        lines += _text_of_detuning(*detuned, config) if detuned else []
        print("\n".join(lines))
    if args.picture:
        _draw(args, config, chosen, (body, orders, speeds, critical), answer, spectrum)
    return 0


# ---- arguments


def _orders(given: list[float] | None) -> list[float]:
    from ..base import RigError

    orders = given or ORDERS
    for order in orders:
        if not (math.isfinite(order) and order > 0.0):
            raise RigError(f"--orders {order:g}: an order is a number above 0")
    return orders


def _rising(option: str, given: Sequence[str], dimension: str) -> tuple[float, float]:
    """Two rising values with their units, of an option [SI]; the first may be 0 only for a time."""
    from ..base import RigError, quantity

    low, high = (quantity(one, dimension, option) for one in given)
    if not (low < high and (low > 0.0 or (dimension == "time" and low >= 0.0))):
        least = "rising values from 0 s on" if dimension == "time" else "rising values above 0"
        raise RigError(f"{option} {given[0]} {given[1]}: expected two {least}")
    return low, high


def _speeds(given: list[str] | None) -> tuple[float, float]:
    return _rising("--speeds", given or SPEEDS, "angular velocity")


def _band(given: list[str] | None) -> tuple[float, float] | None:
    return _rising("--band", given, "frequency") if given else None


def _spectrum(args: argparse.Namespace, chosen: Found) -> tuple[Spectrum, str]:
    """The spectrum of the run's signal, and the signal's unit."""
    from ..analysis import recorded, spectrum
    from ..bags import Bag

    bag = Bag(args.run)
    window = _rising("--window", args.window, "time") if args.window else None
    values, period = recorded(bag, args.signal, window)
    return spectrum(values, period), bag.catalogue.signals[args.signal].unit


def _detuned(args: argparse.Namespace, config: RigConfig) -> tuple[Detuning, Detuned]:
    from ..analysis import detune, detuning_file, read_detuning

    task = read_detuning(detuning_file(args.rig) if args.detune == "own" else args.detune, config)
    return task, detune(config, task)


# ---- text


def _text(config: RigConfig, chosen: Found, others: Sequence[Found]) -> Iterator[str]:
    yield f"{config.name}: {config.description}"
    for found in (chosen, *others):
        yield ""
        yield from _table(found)
        if found is chosen:
            yield from _sensitivities(found)


def _table(found: Found) -> Iterator[str]:
    """Frequencies, damping and shapes of a state."""
    import numpy as np

    modes = found.modes
    yield f"{found.state.name}" + (f" ({', '.join(found.state.locked)} locked)" if _hides_locks(found) else "")
    if not len(modes.frequencies):
        yield "  nothing can turn"
        return
    width = max(8, *map(len, modes.bodies))
    yield f"  {'mode':>4} {'Hz':>10} {'1/s':>10} {'damping':>8}  " + " ".join(f"{body:>{width}}" for body in modes.bodies)
    for k, (f, damping, shape) in enumerate(zip(modes.frequencies, modes.damping, modes.shapes), 1):
        sizes = np.abs(shape) * np.where(np.real(shape) < 0.0, -1.0, 1.0)
        amplitudes = " ".join(f"{size:>{width}.3f}" for size in sizes + 0.0)
        yield f"  {k:>4} {f:>10.3f} {2.0 * math.pi * f:>10.2f} {damping:>8.4f}  {amplitudes}"
    if not np.any(modes.frequencies > 0.0):
        yield "  no shaft can twist in this state, so its bodies only turn as one"


def _hides_locks(found: Found) -> bool:
    """Whether the name of a state does not show what is locked."""
    return bool(found.state.locked) and "locked" not in found.state.name


def _sensitivities(found: Found) -> Iterator[str]:
    import numpy as np

    those = found.sensitivities
    names = [f"{body}.inertia" for body in those.bodies] + [f"{shaft}.stiffness" for shaft in those.shafts]
    values = np.hstack([those.inertia, those.stiffness])
    rows = [k for k, f in enumerate(found.modes.frequencies) if f > 0.0]
    if not rows:
        return
    yield "  change of each frequency in % with 1 % more of"
    width = max(map(len, names))
    yield f"  {'':<{width}} " + " ".join(f"mode {k + 1:>3}" for k in rows)
    for name, column in zip(names, values.T):
        yield f"  {name:<{width}} " + " ".join(f"{column[k] + 0.0:>8.3f}" for k in rows)


def _text_of_speeds(critical: Sequence[Critical], body: str, orders: Sequence[float], speeds: tuple[float, float]) -> Iterator[str]:
    numbers = ", ".join(f"{order:g}" for order in orders)
    yield ""
    yield f"critical speeds of {body} by orders {numbers}, {speeds[0] / RPM:.0f} to {speeds[1] / RPM:.0f} rpm"
    if not critical:
        yield "  none"
        return
    yield f"  {'rpm':>9} {'order':>6} {'mode':>5} {'shape at ' + body:>{10 + len(body)}}"
    for one in critical:
        yield f"  {one.speed / RPM:>9.1f} {one.order:>6g} {one.mode + 1:>5} {one.share:>{10 + len(body)}.3f}"


def _peaks(answer: Response) -> list[tuple[str, str, float, float]]:
    """Of each shaft's torque [Nm per Nm] and each body's speed [rad/s per Nm] the highest amplitude and its frequency."""
    import numpy as np

    out = []
    for what, names, values in (("torque", answer.shafts, answer.torques), ("speed", answer.bodies, answer.speeds)):
        for k, name in enumerate(names):
            at = int(np.abs(values[:, k]).argmax())
            out.append((what, name, float(answer.frequencies[at]), float(abs(values[at, k]))))
    return out


def _text_of_response(answer: Response, body: str, chosen: Found) -> Iterator[str]:
    ends = answer.frequencies[0], answer.frequencies[-1]
    yield ""
    yield f"steady response to a harmonic torque on {body}, {ends[0]:.4g} to {ends[1]:.4g} Hz: highest amplitudes"
    for what, name, at, size in _peaks(answer):
        yield f"  {what:<6} {name:<20} {size:>10.4g} {'Nm/Nm' if what == 'torque' else 'rad/s/Nm':<8} at {at:>9.3f} Hz"
    if not chosen.modes.damping[chosen.modes.frequencies > 0.0].all():
        yield "  a mode without damping has no steady amplitude at its own frequency; what stands here for it is rounding"


def _text_of_spectrum(name: str, found: Spectrum, unit: str, chosen: Found) -> Iterator[str]:
    from ..analysis import beside

    yield ""
    yield f"averaged spectrum of {name}, resolution {found.resolution:.3g} Hz: highest peaks"
    yield f"  {'Hz':>10} {unit or '-':>12} {'computed Hz':>12} {'off by':>9}"
    for at, size, near, off in beside(found.peaks[:MOST_PEAKS], chosen.modes.frequencies.tolist()):
        yield f"  {at:>10.3f} {size:>12.4g} " + ("" if near is None or off is None else f"{near:>12.3f} {100.0 * off:>8.2f}%")


def _text_of_detuning(task: Detuning, found: Detuned, config: RigConfig) -> Iterator[str]:
    yield ""
    bands = ", ".join(f"{name} ({low:.4g} to {high:.4g} Hz)" for name, low, high in task.bands)
    yield f"detuning: {100.0 * task.away:g} % away from {bands}"
    for name, old in found.old.items():
        setting = config.settings.find(name)
        yield f"  {name}: {setting.written(old)} -> {setting.written(found.new[name])}"
    for title, margins in (("before", found.before), ("after", found.after)):
        yield f"  {title}: smallest margin {100.0 * min(one.margin for one in margins):.2f} %"
        for one in margins:
            yield f"    {one.state:<24} {one.frequency:>9.3f} Hz  {100.0 * one.margin:>7.2f} % from {one.band}"
    yield f"  {_set_line(found, config)}"


def _set_line(found: Detuned, config: RigConfig) -> str:
    return " ".join(f'--set {name}="{config.settings.find(name).written(value)}"' for name, value in found.new.items())


# ---- JSON


def _json_of(found: Found) -> dict[str, Any]:
    import numpy as np

    from ..analysis import modes as analysis

    modes, those = found.modes, found.sensitivities
    return {
        "frequencies_hz": modes.frequencies,
        "frequencies_per_s": 2.0 * math.pi * modes.frequencies,
        "damping": modes.damping,
        "bodies": modes.bodies,
        "shapes": analysis.sizes(modes),
        "phases_deg": np.degrees(np.angle(modes.shapes)),
        "sensitivities": {
            **{f"{body}.inertia": those.inertia[:, k] for k, body in enumerate(those.bodies)},
            **{f"{shaft}.stiffness": those.stiffness[:, k] for k, shaft in enumerate(those.shafts)},
        },
    }


def _json_of_response(answer: Response, body: str) -> dict[str, Any]:
    import numpy as np

    return {
        "body": body,
        "frequencies_hz": answer.frequencies,
        "torques_nm_per_nm": {name: np.abs(answer.torques[:, k]) for k, name in enumerate(answer.shafts)},
        "speeds_rad_s_per_nm": {name: np.abs(answer.speeds[:, k]) for k, name in enumerate(answer.bodies)},
    }


def _json_of_spectrum(args: argparse.Namespace, found: Spectrum, unit: str, chosen: Found) -> dict[str, Any]:
    from ..analysis import beside

    rows = beside(found.peaks[:MOST_PEAKS], chosen.modes.frequencies.tolist())
    return {
        "run": args.run,
        "signal": args.signal,
        "unit": unit,
        "resolution_hz": found.resolution,
        "peaks": [{"frequency_hz": at, "amplitude": size, "computed_hz": near, "off": off} for at, size, near, off in rows],
    }


def _json_of_detuning(task: Detuning, found: Detuned, config: RigConfig) -> dict[str, Any]:
    def listed(margins: list) -> list[dict]:
        return [{"state": one.state, "frequency_hz": one.frequency, "band": one.band, "margin": one.margin} for one in margins]

    return {
        "away": task.away,
        "bands_hz": {name: [low, high] for name, low, high in task.bands},
        "old": {name: config.settings.find(name).written(value) for name, value in found.old.items()},
        "new": {name: config.settings.find(name).written(value) for name, value in found.new.items()},
        "before": listed(found.before),
        "after": listed(found.after),
        "smallest_margin": [min(one.margin for one in those) for those in (found.before, found.after)],
        "set": _set_line(found, config),
    }


def _draw(
    args: argparse.Namespace,
    config: RigConfig,
    chosen: Found,
    speeds: tuple[str, Sequence[float], tuple[float, float], Sequence[Critical]],
    answer: Response | None,
    spectrum: tuple[Spectrum, str] | None,
) -> None:
    from ..base import RigError, optional

    optional("matplotlib")
    from ..view import draw_figure, figure_of_modes, write_figure

    recorded = (args.signal, spectrum[1], spectrum[0]) if spectrum else None
    figure = figure_of_modes(config, chosen, speeds, answer, recorded)
    if not figure.panels:
        raise RigError(f"--picture: no shaft of the rig '{config.name}' can twist in this state, so there is no shape to draw")
    write_figure(draw_figure(figure, args.dark), args.picture)
    if args.json != "-":
        print(f"wrote {args.picture}")
