# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""``rig list WHAT``: what is installed, topics and signals; ``--markdown`` writes docs/signals.md. Alone: what it lists."""

from __future__ import annotations

import json

HELP = "list sequences, procedures, rigs, topics or signals"
# what can be listed, its line and the command that takes such a name
WHAT = {
    "sequences": ("tests that the rig walks through", "./rig simulate NAME"),
    "procedures": ("measuring procedures of the laboratory (their series: --labels)", "./rig procedure NAME"),
    "rigs": ("rigs with all their values", "./rig simulate demo --rig NAME"),
    "controllers": ("settings of the Alfa46, which a rig's file names", "controller: NAME.yaml in a rig's .yaml"),
    "templates": ("starts for a controller of your own", "./rig controller new NAME DIR"),
    "devices": ("devices of the rig, and which can be a node of your own", "./rig device NAME"),
    "topics": ("ROS topics with type, node and rate", "./rig replay RUN --topics NAME"),
    "signals": ("signals with unit, range, sign and topic", "a sequence's wait: {until: {signal: NAME, above: ...}}"),
}


def add_arguments(parser) -> None:
    parser.add_argument("what", nargs="?", choices=WHAT, help="what to list; alone: what there is to list")
    form = parser.add_mutually_exclusive_group()
    form.add_argument("--json", action="store_true", help="for programs")
    form.add_argument("--markdown", action="store_true", help="topics and signals as docs/signals.md has them")


def main(args) -> int:
    rows = _ROWS[args.what]() if args.what else [
        {"list": f"./rig list {what}", "what": text, "goes into": use} for what, (text, use) in WHAT.items()]
    if args.markdown:
        print(markdown(), end="")
    elif args.json:
        print(json.dumps(rows, indent=2, ensure_ascii=False))
    else:
        lines = [list(rows[0]), *([str(value) for value in row.values()] for row in rows)]
        widths = [max(map(len, column)) for column in zip(*lines)]
        for line in lines:
            print("  ".join(cell.ljust(width) for cell, width in zip(line, widths)).rstrip())
    return 0


def _files(kind: str):
    def rows():
        from ..config import CONFIG_DIR, load_yaml

        return [{"name": path.stem, "description": (load_yaml(path) or {}).get("description", "")}
                for path in sorted((CONFIG_DIR / kind).glob("*.yaml"))]
    return rows


def _templates():
    from ..controllers.templates import KINDS

    return [{"name": name, "then": kind.commands[0].format(dir="DIR")} for name, kind in KINDS.items()]


def _devices():
    from ..engine.outside import CUTTABLE, NOT_CUT

    return [{"name": name, "own node": "yes", "why not": ""} for name in CUTTABLE] + [
        {"name": name, "own node": "no", "why not": why} for name, why in NOT_CUT.items()]


def _topics():
    from ..catalogue import catalogue

    return _rows_of(catalogue().all_topics)


def _setpoint_rows(known):
    return [{"topic": topic.name, "value": topic.sets, "unit": signal.unit,
             "range": f"{_number(signal.low)} to {_number(signal.high)}", "shown": _range(signal)}
            for topic, signal in known.setpoints().items()]


def _range(signal) -> str:
    return f"{_number(signal.shown(signal.low))} to {_number(signal.shown(signal.high))} {signal.display_unit}"


def _rows_of(topics):
    return [{"topic": t.name, "type": t.ros_type, "node": t.node, "qos": t.qos,
             "rate": f"{t.rate:g} Hz" if t.rate else "on change"} for t in topics.values()]


def _number(value: float) -> str:
    return f"{value:.6g}"


def _signals():
    from ..catalogue import catalogue

    known = catalogue()
    return _signal_rows(known.all_signals.values(), known.all_topics)


def _signal_rows(signals, topics):
    return [{"signal": s.name, "unit": s.unit, "shown": s.display_unit,
             "range": f"{_number(s.shown(s.low))} to {_number(s.shown(s.high))}",
             "device": topics[s.topic].node, "topic": s.topic, "field": s.field,
             "rate": f"{topics[s.topic].rate:g} Hz" + (", 10 kHz in the block" if s.logger is not None else ""),
             "sign": s.sign, "meaning": s.text} for s in signals]


_ROWS = {**{kind: _files(kind) for kind in ("sequences", "procedures", "rigs", "controllers")},
         "templates": _templates, "devices": _devices, "topics": _topics, "signals": _signals}


def markdown() -> str:
    """docs/signals.md: every topic and every signal of the catalogue."""
    from ..catalogue import catalogue
    from ..clocks import COMMAND_TIMEOUT

    def table(rows):
        head = list(rows[0])
        lines = ["| " + " | ".join(head) + " |", "|" + " --- |" * len(head)]
        return lines + ["| " + " | ".join(str(v) for v in row.values()) + " |" for row in rows]

    known = catalogue()
    benches = []
    for kind, other in known.others.items():
        own = {name: topic for name, topic in other.topics.items() if name not in known.topics}
        shared = [f"`{name}`" for name in other.topics if name not in own]
        signals = [signal for name, signal in other.signals.items() if name not in known.signals]
        benches += [f"## Kind {kind}: topics and signals", "",
                    f"Rigs of chapter 8 ([benches.md](benches.md)). Beside these they have {', '.join(shared)}, and "
                    "none of those above.", "", *table(_rows_of(own)), "", *table(_setpoint_rows(other)), "",
                    *table(_signal_rows(signals, own)), ""]
    return "\n".join([
        "# Signals and topics", "",
        "Made from the catalogue (`rig_nodes/rig_nodes/config/signals.yaml`) by `./rig list signals --markdown`; "
        "a test keeps it in step.", "",
        "Units travel in SI, temperatures in degC; \"shown\" is what plots and reports use, and the range is given in it. Pressures are "
        "gauge. Every message of `rig_msgs` here starts with `header` (its stamp is simulated time, its frame_id empty) and "
        "`seq` (counted per topic from 0).", "",
        "## Topics", "", *table(_rows_of(catalogue().topics)), "",
        "Only in a run with `source: topic` for the device ([cuts.md](cuts.md)), once a tick of the cut:", "",
        *table(_rows_of(catalogue().cut_topics)), "",
        "Only in a run whose controller names signals of its own ([controllers.md](controllers.md)):", "",
        *table(_rows_of(catalogue().controller_topics)), "",
        "Actions: `/alfa46/shift` (`rig_msgs/action/Shift`), `/sequencer/run` (`rig_msgs/action/RunSequence`). "
        "Services: `/rig/e_stop`, `/rig/reset` and `/rig/end` (`std_srvs/srv/Trigger`), `/alfa46/set_profile` "
        "(`rig_msgs/srv/SetProfile`).", "",
        "Quality of service: all are reliable with depth 1000. command offers a deadline of "
        f"{COMMAND_TIMEOUT * 1e3:.0f} ms, and the rig "
        "asks for none; setting is sent on change; latched is transient local and sent once.", "",
        "Setpoints (`rig_msgs/msg/Setpoint`) carry their value in this unit and must keep to this range; every message "
        "needs `enable: true` as well, for one without it switches the device off ([ros2.md](ros2.md)):", "",
        *table(_setpoint_rows(known)), "",
        "## Signals", "", *table(_signal_rows(known.signals.values(), known.topics)), "", *benches])
