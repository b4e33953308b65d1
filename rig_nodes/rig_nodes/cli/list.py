# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""``rig list WHAT``: installed items, topics, signals, parts; without WHAT, what it can list.

docs/made_pages.py makes pages of the same rows.
"""

from __future__ import annotations

import json
import os
from typing import TYPE_CHECKING

from ..base import DEFAULT_RIG, RIG_FILE, RigError, find_config, installed, number_text, rig_folders, with_bases
from ..plant import VALUES
from .output_files import STDOUT

if TYPE_CHECKING:
    import argparse
    from collections.abc import Callable, Mapping
    from pathlib import Path
    from typing import Any

    from ..rig import Catalogue, RigConfig, Signal, Topic

HELP = "list sequences, rigs, settings, signals and what else there is"
# what can be listed -> its line of help and the command that accepts such a name
WHAT = {
    "sequences": ("tests that a rig walks through", "./rig simulate NAME"),
    "procedures": ("measuring procedures of the laboratory (their series: --labels)", "./rig procedure NAME"),
    "rigs": ("rigs with all their values", "./rig simulate demo --rig NAME"),
    "controllers": ("settings of the Alfa46, which a rig's file names", "controller: NAME in a rig's rig.yaml"),
    "templates": ("starts for a controller of your own", "./rig controller new NAME DIR"),
    "devices": ("devices of a rig, and which can be a node of your own", "./rig device NAME"),
    "settings": (
        "values of a rig with unit, range and whether they change while it runs",
        "--set NAME=VALUE, ./rig set NAME VALUE",
    ),
    "trips": ("limits at which a rig goes into its safe state, with delay, reaction and source", "--set trips.NAME.limit=VALUE"),
    "faults": ("what can fail of a rig, with size, unit and what one sees of it", "./rig simulate demo --fault NAME"),
    "parts": ("types of devices with unit and range of each value", "part: NAME in a rig's rig.yaml"),
    "topics": ("ROS topics of a rig with type, node and rate", "./rig replay RUN --topics NAME"),
    "metrics": ("results of a shift with unit, meaning and where they are shown", "./rig report RUN --limit 'NAME=.. VALUE'"),
    "signals": ("signals of a rig with unit, range, sign and topic", "a sequence's wait: {until: {signal: NAME, above: ...}}"),
}


PICTURE = "picture.svg"  # of a rig's driveline, in its folder


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the verb."""
    parser.add_argument("what", nargs="?", choices=WHAT, help="what to list; alone: what there is to list")
    parser.add_argument(
        "--rig",
        metavar="NAME",
        help="rig, its folder or .yaml file: only its sequences and procedures (default: "
        f"all); whose devices, settings, trips, faults, topics and signals (default: {DEFAULT_RIG})",
    )
    parser.add_argument("--json", nargs="?", const=STDOUT, choices=(STDOUT,), metavar=STDOUT, help="for programs, to stdout")


def main(args: argparse.Namespace) -> int:
    """Print the list as a table, as JSON ."""
    if args.rig is not None and args.what not in OF_A_RIG:
        raise RigError(f"--rig goes with {', '.join(OF_A_RIG)} only")
    rows = (
        (OF_A_RIG[args.what](args.rig) if args.what in OF_A_RIG else ROWS[args.what]())
        if args.what
        else [{"list": f"./rig list {what}", "what": text, "goes into": use} for what, (text, use) in WHAT.items()]
    )
    if args.json:
        print(json.dumps(rows, indent=2, ensure_ascii=False))
    elif not rows:
        print(f"rig '{args.rig}' has no {args.what} of its own")
    else:
        lines = [list(rows[0]), *([str(value) for value in row.values()] for row in rows)]
        widths = [max(map(len, column)) for column in zip(*lines)]
        for line in lines:
            print("  ".join(cell.ljust(width) for cell, width in zip(line, widths)).rstrip())
    return 0


def _described(path: Path) -> str:
    from ..base import load_yaml

    return (load_yaml(path) or {}).get("description", "")


def _rigs() -> list[dict[str, str]]:
    return [
        {"name": name, "description": _described(path), "picture": _shortest(path.parent / PICTURE)}
        for name, path in ((name, folder / RIG_FILE) for name, folder in rig_folders().items())
    ]


def _shortest(path: Path) -> str:
    """Return a path from here if that is shorter; an empty text when there is no such file."""
    return min(str(path), os.path.relpath(path), key=len) if path.is_file() else ""


def _controllers() -> list[dict[str, str]]:
    return [{"name": name, "description": _described(find_config("controllers", name))} for name in installed("controllers")]


def _of_rigs(kind: str) -> Callable[[str | None], list[dict[str, str]]]:
    """Return a function that lists the content of the folders of the installed rigs, or of one rig and those it is based on."""

    def rows(rig: str | None) -> list[dict[str, str]]:
        folders = rig_folders().items() if rig is None else [(path.parent.name, path.parent) for path, _ in with_bases(rig)]
        return [
            {"name": path.stem, "rig": name, "description": _described(path)}
            for name, folder in folders
            for path in sorted((folder / kind).glob("*.yaml"))
        ]

    return rows


def _templates() -> list[dict[str, str]]:
    from ..controllers import TEMPLATES

    return [{"name": name, "then": kind.commands[0].format(dir="DIR")} for name, kind in TEMPLATES.items()]


def _known(rig: str | None) -> RigConfig:
    from ..rig import load_rig

    return load_rig(rig or DEFAULT_RIG)


def _devices(rig: str | None) -> list[dict[str, str]]:
    from ..plant import NOT_DEVICES, why_not

    structure, rows = _known(rig).structure, []
    for name in (
        *(device.name for device in structure.devices if device.role != VALUES),
        *(NOT_DEVICES if structure.gears else ()),
    ):
        why = why_not(structure, name) or ""
        rows.append({"name": name, "own node": "no" if why else "yes", "why not": why.partition(": ")[2]})
    return rows


def _settings(rig: str | None) -> list[dict[str, str]]:
    config = _known(rig)
    return [
        {
            "setting": one.name,
            "value": one.written(config.value(one.name)) if one.kept else "",
            "range": one.span(),
            "while it runs": "yes" if one.live else "no",
            "what it is": one.text,
        }
        for one in config.settings.values()
        if one.key and not one.lacking
    ]


def _trips(rig: str | None) -> list[dict[str, str]]:
    from ..runs import trips_without_limits

    config = _known(rig)
    return trips_without_limits(config) + [trip.row() for trip in config.trips]


def _topics(rig: str | None) -> list[dict[str, str]]:
    return _rows_of(_known(rig).catalogue.all_topics)


def _setpoint_rows(known: Catalogue) -> list[dict[str, str]]:
    return [
        {
            "topic": topic.name,
            "value": topic.sets,
            "unit": signal.unit,
            "range": f"{_number(signal.low)} to {_number(signal.high)}",
            "shown": _range(signal),
        }
        for topic, signal in known.setpoints().items()
    ]


def _range(signal: Signal) -> str:
    return f"{_number(signal.shown(signal.low))} to {_number(signal.shown(signal.high))} {signal.display_unit}"


def _rows_of(topics: Mapping[str, Topic]) -> list[dict[str, str]]:
    return [
        {"topic": t.name, "type": t.ros_type, "node": t.node, "qos": t.qos, "rate": f"{t.rate:g} Hz" if t.rate else "on change"}
        for t in topics.values()
    ]


def _number(value: float) -> str:
    return number_text(value, 6)


def _signals(rig: str | None) -> list[dict[str, str]]:
    known = _known(rig)
    return _signal_rows(known, known.catalogue.all_topics)


def _signal_rows(known: RigConfig, topics: Mapping[str, Topic]) -> list[dict[str, str]]:
    in_block = f", {known.instruments.logger_rate * 1e-3:g} kHz in the block"
    return [
        {
            "signal": s.name,
            "unit": s.unit,
            "shown": s.display_unit,
            "range": f"{_number(s.shown(s.low))} to {_number(s.shown(s.high))}",
            "device": topics[s.topic].node,
            "topic": s.topic,
            "field": s.field,
            "rate": f"{topics[s.topic].rate:g} Hz" + (in_block if s.logger is not None else ""),
            "sign": s.sign,
            "meaning": s.text,
        }
        for s in known.catalogue.signals.values()
    ]


def _metrics() -> list[dict[str, str]]:
    from ..analysis import every_metric

    return [
        {
            "metric": one.key,
            "unit": one.unit,
            "what it is": one.text,
            "shown": ", ".join(one.places) if one.name else "",
            "of package": one.package,
        }
        for one in every_metric()
    ]


def _faults(rig: str | None) -> list[dict[str, Any]]:
    from ..rig import faults_of, shown_unit

    rows = []
    for one in faults_of(_known(rig)).values():
        fault, size = one.fault, one.fault.size
        unit, factor = shown_unit(size.quantity) if size else ("", 1.0)
        rows.append(
            {
                "name": one.name,
                "part": fault.part,
                "of it": fault.sub,
                "what": fault.text,
                "size": size.text if size else "",
                "unit": unit,
                "range": f"{_number(size.low / factor)} to {_number(size.high / factor)}" if size else "",
                "usual": _number(size.usual / factor) if size else "",
                "onset": fault.onset,
                "one sees": fault.sign,
                "spn": one.spn,
                "fmi": fault.fmi,
                "refused": one.lacking,
            }
        )
    return rows


def _parts() -> list[dict[str, str]]:
    from ..rig import rows_of_parts

    return rows_of_parts()


ROWS = {"rigs": _rigs, "controllers": _controllers, "templates": _templates, "parts": _parts, "metrics": _metrics}
OF_A_RIG = {
    "sequences": _of_rigs("sequences"),
    "procedures": _of_rigs("procedures"),
    "devices": _devices,
    "settings": _settings,
    "trips": _trips,
    "topics": _topics,
    "signals": _signals,
    "faults": _faults,
}


def markdown() -> str:
    """Return the content of docs/made/signals.md: every topic and every signal of the installed rigs."""
    from ..base import COMMAND_TIMEOUT

    kept: dict[str, tuple] = {}  # rig -> its configuration and the other rigs with the same catalogue
    for name in (DEFAULT_RIG, *(name for name in installed("rigs") if name != DEFAULT_RIG)):
        known = _known(name)
        same = next((other for other, (have, _) in kept.items() if have.catalogue == known.catalogue), None)
        if same is None:
            kept[name] = known, []
        else:
            kept[same][1].append(name)
    parts = [line for known, others in kept.values() for line in _page_of(known, others)]
    return "\n".join(
        [
            "# Signals and topics",
            "",
            "Of the installed rigs; those of a folder of yours: `./rig list signals --rig FOLDER`.",
            "",
            'Units travel in SI, temperatures in degC; "shown" is what plots and reports use, and the range is given '
            "in it. Pressures are "
            "gauge. Every message of `rig_msgs` here starts with `header` (its stamp is simulated time, its frame_id empty) and "
            "`seq` (counted per topic from 0).",
            "",
            "Actions of rigs with gears: `/controller/shift` (`rig_msgs/action/Shift`); of all: `/sequencer/run` "
            "(`rig_msgs/action/RunSequence`). Services: `/rig/e_stop`, `/rig/reset` and `/rig/end` "
            "(`std_srvs/srv/Trigger`), and of rigs "
            "with gears `/alfa46/set_profile` (`rig_msgs/srv/SetProfile`).",
            "",
            "Quality of service: all are reliable with depth 1000. command offers a deadline of "
            f"{COMMAND_TIMEOUT * 1e3:.0f} ms, and the rig "
            "asks for none; setting is sent on change; latched is transient local and sent once.",
            "",
            "Setpoints (`rig_msgs/msg/Setpoint`) carry their value in this unit and must keep to this range; every message "
            "needs `enable: true` as well, for one without it switches the device off ([ros2.md](../how_to/ros2.md)).",
            "",
            *parts,
        ]
    )


def _page_of(config: RigConfig, others: list[str]) -> list[str]:
    """Return the lines on one rig, which also hold for the rigs with the same topics and signals."""

    def table(rows: list[dict[str, str]]) -> list[str]:
        head = list(rows[0])
        lines = ["| " + " | ".join(head) + " |", "|" + " --- |" * len(head)]
        return [*lines, *("| " + " | ".join(str(v) for v in row.values()) + " |" for row in rows), ""]

    known = config.catalogue
    also = f"; so have {', '.join(f'`{name}`' for name in others)}" if others else ""
    out = [f"## Rig `{config.name}`", "", f"{config.description}{also}.", "", "Topics:", "", *table(_rows_of(known.topics))]
    for text, topics in (
        (
            "Only in a run with `source: topic` for the device ([cuts.md](../how_to/cuts.md)), once a tick of the cut:",
            known.cut_topics,
        ),
        (
            "Only in a run whose controller names signals of its own ([controllers.md](../how_to/controllers.md)):",
            known.controller_topics,
        ),
    ):
        out += [text, "", *table(_rows_of(topics))] if topics else []
    return [*out, "Setpoints:", "", *table(_setpoint_rows(known)), "Signals:", "", *table(_signal_rows(config, known.topics))]
