# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The signal catalogue of a rig, made from its structure: topics of its devices, of the whole rig and of its controller.

All that publishes, records, plots or exports a signal uses it through catalogue.catalogue.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from ..base import RigError
from ..plant import part as parts
from .commands import setpoints_of
from .quantities import QUANTITIES
from .read_elements import GROUND
from .structure import Device, Structure, Transducer
from .transducer_types import TRANSDUCER_TYPES

if TYPE_CHECKING:
    from collections.abc import Callable

STATE_RATE, SCALAR_RATE, SAMPLE_RATE = 200, 100, 1000  # Hz
CONTROLLER_COMMAND, CONTROLLER_EVENTS = "/controller/command", "/controller/events"
SHIFT_ORDERED = "shift_ordered"  # event of the controller with the gear as value
CONTROLLER_FAILED, CONTROLLER_SILENT = "controller_failed", "controller_silent"  # events with what the controller's plug knows
GEAR_WAS = "gear_was"  # event of an imported run: the gear that was in before its first order
TORQUES = "torques"  # a group that the key signals of a rig may name
_CURRENT_LIMIT = 0.8  # A, of all outputs of the box


def described(structure: Structure) -> dict:
    """Return the entries of the catalogue's Topic and Signal by name.

    Parameters
    ----------
    structure : Structure
        What the rig is made of.

    Returns
    -------
    dict
        The maps topics, signals, cut_topics and controller_topics.

    Raises
    ------
    RigError
        When two signals have the same name.
    """
    topics: dict[str, dict] = {}
    signals: dict[str, dict] = {}
    setpoints, logged = setpoints_of(structure), 0

    def topic(name: str, node: str, message: str, qos: str = "measurement", rate: float = 0, **others: object) -> None:
        topics[name] = {"node": node, "type": message, "qos": qos, "rate": rate, **others}

    def signal(name: str, of: str, low: float, high: float, where: str, field: str, sign: str, text: str, **others: object) -> None:
        name, quantity = structure.names.get(name, name), QUANTITIES[of]
        if name in signals:
            raise RigError(f"the signal '{name}' is there twice; give one of them another name under the key names")
        signals[name] = {
            "quantity": quantity.name,
            "unit": quantity.unit,
            "display_unit": quantity.display,
            "scale": quantity.scale,
            "low": low,
            "high": high,
            "topic": where,
            "field": field,
            "sign": sign,
            "text": text,
            "gauge": quantity.gauge,
            **others,
        }

    for one in structure.transducers:
        where, of = f"/{one.at}/{one.topic}", TRANSDUCER_TYPES[one.type].quantity
        signal(one.name, of, one.low, one.high, where, "value", one.sign, one.text, logger=logged if one.logged else None)
        logged += one.logged
    for device in structure.devices:
        for one in (one for one in structure.transducers if one.at == device.name):
            topic(f"/{device.name}/{one.topic}", device.name, "Measurement", rate=SCALAR_RATE)
        part = parts.part(device.part)
        if part.message:
            topic(f"/{device.name}/state", device.name, part.message, rate=STATE_RATE)
        for one in setpoints.values():
            if one.device == device.name:
                topic(one.topic, "sequencer", "Setpoint", "setting", sets=one.command.text, like=one.like)
        words = _words(structure, device)
        for one in part.shows:
            signal(
                f"{device.key}_{one.what}",
                one.of,
                one.low,
                one.high,
                f"/{device.name}/state",
                one.field,
                one.sign.format(**words),
                one.text.format(**words),
                states=one.states,
            )
    _whole(structure, topic, signal)
    return {"topics": topics, "signals": signals, "cut_topics": _cuts(structure), "controller_topics": _own(structure)}


def _cuts(structure: Structure) -> dict[str, dict]:
    """The topics of devices that can stand outside the plant."""
    from ..plant import cuttable  # here, because it imports compiled code

    cut = {}
    for device in structure.devices:
        if cuttable(device):
            for end, node, message in (("port", device.name, "CutPort"), ("answer", f"{device.name}_device", "CutAnswer")):
                cut[f"/{device.name}/cut/{end}"] = {"node": node, "type": message, "qos": "measurement", "rate": SAMPLE_RATE}
    return cut


def _own(structure: Structure) -> dict[str, dict]:
    """The topics of a controller's own signals."""
    if not structure.shifts:
        return {}
    return {
        "/controller/signals": {"node": "alfa46", "type": "SampleBlock", "qos": "measurement", "rate": STATE_RATE},
        "/controller/channels": {"node": "alfa46", "type": "ChannelList", "qos": "latched", "rate": 0},
    }


def unnamed(structure: Structure) -> tuple[list[str], list[str]]:
    """Return the keys of a rig's ``names`` that are no signal's name, and the names of all signals without ``names``."""
    marked = replace(structure, names={name: f"names.{name}" for name in structure.names})
    made = [*described(marked)["signals"], *(one.node for one in setpoints_of(marked).values())]
    lacking = [name for name, mark in marked.names.items() if mark not in made]
    return lacking, [name.removeprefix("names.") for name in dict.fromkeys(made)]


def _words(structure: Structure, device: Device) -> dict[str, str]:
    """The words that the sentences on a device's signals may contain."""

    def spaced(body: str) -> str:
        return body.replace("_", " ")

    driving, driven = device.wires.get("joins", (device.wires.get("brakes", ""), "ground"))
    fed = structure.device(device.wires["feeds"]).called if "feeds" in device.wires else ""
    return {
        "called": device.called,
        "body": spaced(str(device.wires.get("body", ""))),
        "driving": spaced(driving),
        "driven": spaced(driven),
        "fed": f"clutch {fed}",
    }


def _whole(structure: Structure, topic: Callable[..., None], signal: Callable[..., None]) -> None:
    """Add topics and signals of the rig as a whole, of its gears, logger, controller and sequencer."""
    if structure.gears:
        _gearbox(structure, topic, signal)
    topic("/instruments/hmg4000", "instruments", "SampleBlock", rate=STATE_RATE)
    topic("/instruments/channels", "instruments", "ChannelList", "latched")
    if structure.shifts:
        topic("/instruments/controller", "instruments", "ControllerSample", rate=SAMPLE_RATE)
        topic("/instruments/controller_record", "instruments", "ControllerRecord", "latched")
        topic("/instruments/joint_states", "instruments", "sensor_msgs/JointState", rate=SCALAR_RATE)
        for one in absolute_pressures(structure):
            topic(f"/instruments/{one.name}_absolute", "instruments", "sensor_msgs/FluidPressure", rate=SCALAR_RATE)
    topic("/rig/state", "rig", "RigState", rate=STATE_RATE)
    if TORQUES in structure.signals:
        topic("/rig/torques", "rig", "SampleBlock", rate=STATE_RATE)
        topic("/rig/channels", "rig", "ChannelList", "latched")
        for k, one in enumerate(torque_signals(structure)):
            signal(one.name, "torque", -1e4, 1e4, "/rig/torques", f"data[{k}]", one.sign, one.text)
    topic("/rig/events", "rig", "Event")
    topic("/rig/run_info", "rig", "RunInfo", "latched")
    if structure.shifts:
        _controller(structure, topic, signal)
    topic("/sequencer/events", "sequencer", "Event")
    signal(
        "rig_state",
        "state",
        0.0,
        3.0,
        "/rig/state",
        "state",
        "none",
        "What the rig is doing.",
        states={0: "starting", 1: "ready", 2: "running", 3: "tripped"},
    )
    signal(
        "energy_residual",
        "energy",
        -1e6,
        1e6,
        "/rig/state",
        "energy_residual",
        "positive: work in that is found nowhere",
        "Motor work minus load work, heat and stored energy.",
    )


def _gearbox(structure: Structure, topic: Callable[..., None], signal: Callable[..., None]) -> None:
    """Add the topic of the gearbox, with the gear that its clutches make and its losses."""
    numbers = {0: "none"} | {k: gear.name for k, gear in enumerate(structure.gears, 1)}
    several = len(numbers)
    topic("/gearbox/state", "gearbox", "GearboxState", rate=STATE_RATE)
    both = "both" if several == 3 else "several"
    signal(
        "gear",
        "state",
        0.0,
        several,
        "/gearbox/state",
        "gear",
        "none",
        "Which clutches are locked.",
        states={**numbers, several: both},
    )
    ends = structure.input.body, structure.output.body
    for field, side, body in (("loss_in", "driving", ends[0]), ("loss_out", "driven", ends[1])):
        signal(
            field, "torque", 0.0, 100.0, "/gearbox/state", field, "positive brakes", f"Loss torque of the {side} side on {body}."
        )


def _controller(structure: Structure, topic: Callable[..., None], signal: Callable[..., None]) -> None:
    """Add the topics of the shift controller, with its setpoints and the gear that it was ordered."""
    topic(CONTROLLER_COMMAND, "alfa46", "ValveCommand", "command", SAMPLE_RATE)
    topic(CONTROLLER_EVENTS, "alfa46", "Event")
    for valve, output in ((valve, valve.wires["output"] - 1) for valve in structure.valves):
        signal(
            f"I_set_{valve.key}",
            "current",
            0.0,
            _CURRENT_LIMIT,
            CONTROLLER_COMMAND,
            f"setpoint[{output}]",
            "positive",
            f"Current the profile of {valve.called} asks for.",
        )
    signal(
        "gear_ordered",
        "state",
        0.0,
        len(structure.gears),
        CONTROLLER_COMMAND,
        "gear",
        "none",
        "Gear the shift controller was ordered last.",
        states={0: "neutral"} | {k: gear.name for k, gear in enumerate(structure.gears, 1)},
    )


@dataclass(frozen=True)
class TorqueSignal:
    """A torque in what joins bodies.

    Parameters
    ----------
    name : str
        Name of the signal.
    of : str
        What joins the bodies.
    body : str
        The body on which the torque acts, where several bodies are tied together; otherwise empty.
    text : str
        What the signal is.
    sign : str
        Meaning of its sign.
    """

    name: str
    of: str
    body: str
    text: str
    sign: str


def torque_signals(structure: Structure) -> list[TorqueSignal]:
    """Return the torques of all that joins bodies or acts on them, without the devices, which have torque signals of their own."""
    out = []
    for kind, one in (
        *(("shaft", one) for one in structure.shafts),
        *((one.kind, one) for one in structure.of_kind("clutch", "brake", "torque", "motion")),
    ):
        a, b = (*one.bodies, GROUND)[:2]
        pushes = kind in ("torque", "motion")
        out.append(
            TorqueSignal(
                f"{one.name}_torque",
                one.name,
                "",
                f"Torque {'' if kind == 'torque' else f'of the {kind} '}{one.name}.",
                f"positive drives {a}"
                if pushes
                else f"positive slows {a} and drives {b}"
                if b != GROUND
                else f"positive slows {a}",
            )
        )
    ties = [
        *((one.name, one.bodies) for one in structure.of_kind("varying_inertia", "slider_crank")),
        *((name, mesh.bodies) for name, mesh in zip(structure.mesh_names, structure.meshes)),
        *((one.name, (one.sun, one.ring, one.carrier)) for one in structure.planetary_sets),
        *((one.name, one.bodies) for one in structure.of_kind("relation", "variator")),
    ]
    return out + [
        TorqueSignal(
            f"{name.replace('-', '_')}_{body}_torque", name, body, f"Torque that {name} puts on {body}.", f"positive drives {body}"
        )
        for name, bodies in ties
        for body in bodies
        if body != GROUND
    ]


def absolute_pressures(structure: Structure) -> list[Transducer]:
    """Return the transducers of the clutches' pressures, which are also sent as absolute pressures, for other tools."""
    lines = {f"{structure.line_of(clutch.name)}.pressure" for clutch in structure.clutches}
    return [one for one in structure.transducers if one.shows in lines]
