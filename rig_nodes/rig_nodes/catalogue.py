# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The signal catalogue: every topic and every signal of every kind of rig, once.

Read by the nodes, the recorder, the view, the report and the docs; the data is config/signals.yaml.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache

from .clocks import COMMAND_TIMEOUT
from .config import load_yaml, package_file
from .errors import RigError


@dataclass(frozen=True)
class Offer:
    """How the topics of a quality-of-service class are offered: depth, deadline [ms] (0: without one)."""

    reliable: bool = True
    latched: bool = False
    deadline_ms: int = 0
    depth: int = 1000  # at 1 kHz one second; 10 lost 0.4 % of the messages without a word


# Nodes publish with these (nodes.qos) and bags say them (bags.metadata). A command's deadline is the age at which the
# rig trips. The last one is for topics of users' own nodes only.
QOS = {"measurement": Offer(), "command": Offer(deadline_ms=round(1e3 * COMMAND_TIMEOUT)), "setting": Offer(),
       "latched": Offer(latched=True), "best_effort": Offer(reliable=False)}


@dataclass(frozen=True)
class Topic:
    """One topic: who publishes it, its message type, its quality-of-service class and its rate [Hz].

    sets: of a Setpoint, what its value is; like: the signal whose unit and range the value has.
    """

    name: str
    node: str
    type: str
    qos: str
    rate: float
    sets: str = ""
    like: str = ""

    @property
    def ros_type(self) -> str:
        """Full type name as the bag and ROS write it, e.g. ``rig_msgs/msg/Measurement``."""
        package, _, short = self.type.rpartition("/")
        return f"{package or 'rig_msgs'}/msg/{short}"


@dataclass(frozen=True)
class Signal:
    """One signal: where it travels, in which unit, with which sign, and how people read it."""

    name: str
    quantity: str
    unit: str
    display_unit: str
    scale: float
    low: float
    high: float
    topic: str
    field: str
    sign: str
    text: str
    gauge: bool = False
    logger: int | None = None
    states: dict[int, str] = field(default_factory=dict)

    def shown(self, value):
        """The value in the unit people read."""
        return value * self.scale


@dataclass(frozen=True)
class Catalogue:
    """All topics and signals of a kind of rig, by name, in the order of the file.

    topics: of every run; cut_topics: of runs in which their device stands outside the plant; controller_topics: of
    runs whose controller has signals of its own; others: the catalogues of the other kinds, which the gearbox rig's
    knows, so that a bag or a sequence of any kind can be read with it.
    """

    topics: dict[str, Topic]
    signals: dict[str, Signal]
    cut_topics: dict[str, Topic]
    controller_topics: dict[str, Topic]
    others: dict[str, Catalogue] = field(default_factory=dict)

    @property
    def all_topics(self) -> dict[str, Topic]:
        """Every topic that a run of any kind may have."""
        out = {**self.topics, **self.cut_topics, **self.controller_topics}
        for other in self.others.values():
            out.update(other.topics)
        return out

    @property
    def all_signals(self) -> dict[str, Signal]:
        """Every signal of every kind."""
        out = dict(self.signals)
        for other in self.others.values():
            out.update(other.signals)
        return out

    def of_run(self, cut_out=(), own_signals: bool = False) -> dict[str, Topic]:
        """The topics of a run in which these devices stand outside, with a controller that may have its own signals."""
        cut = {name: topic for name, topic in self.cut_topics.items() if name.split("/")[1] in cut_out}
        return {**self.topics, **cut, **(self.controller_topics if own_signals else {})}

    def logger_channels(self) -> list[Signal]:
        """The columns of the 10 kHz logger, in order."""
        columns = [s for s in self.signals.values() if s.logger is not None]
        return sorted(columns, key=lambda s: s.logger)

    def setpoints(self) -> dict[Topic, Signal]:
        """The topics of setpoints, each with the signal whose unit and range its value has."""
        return {topic: self.signals[topic.like] for topic in self.topics.values() if topic.like}

    def measured(self) -> dict[str, str]:
        """Topic of each transducer's messages -> its signal."""
        return {signal.topic: name for name, signal in self.signals.items()
                if signal.topic in self.topics and self.topics[signal.topic].type == "Measurement"}

    def on_topic(self, topic: str) -> list[Signal]:
        """The signals that travel in one topic."""
        return [s for s in self.signals.values() if s.topic == topic]

    def signal(self, name: str) -> Signal:
        """One signal of any kind; RigError names the known ones of this kind when there is none."""
        if name in self.signals:
            return self.signals[name]
        for other in self.others.values():
            if name in other.signals:
                return other.signals[name]
        from .config.names import unknown  # here, as that module reads this one

        raise RigError(unknown("signal", name, self.signals))


GEARBOX = "gearbox"  # the kind of rig whose topics and signals stand at the top of the file


@lru_cache(maxsize=4)
def catalogue(kind: str = GEARBOX) -> Catalogue:
    """The catalogue of a kind of rig, read once per process; RigError for one that there is not."""
    if kind != GEARBOX:
        others = catalogue().others
        if kind not in others:
            raise RigError(f"there is no rig of kind '{kind}'; known are {', '.join([GEARBOX, *others])}")
        return others[kind]
    data = load_yaml(package_file("signals.yaml"))
    topics, cut_topics, controller_topics = ({name: Topic(name=name, **entry) for name, entry in data[key].items()}
                                             for key in ("topics", "cut_topics", "controller_topics"))
    signals = _signals(data["signals"], topics, data["displays"])
    _check_topics({**topics, **cut_topics, **controller_topics}, signals)
    others, taken = {}, {*topics, *cut_topics, *controller_topics, *signals}
    for other, part in data["benches"].items():
        own = {name: Topic(name=name, **entry) for name, entry in part["topics"].items()}
        shared = {name: topics[name] for name in part["shares"]}
        found = _signals(part["signals"], own, data["displays"])
        _check_topics(own, found)
        if both := sorted(taken & {*own, *found}):
            raise RigError(f"signals.yaml: '{both[0]}' of {other} is there twice")
        taken |= {*own, *found}
        found |= {name: signal for name, signal in signals.items() if signal.topic in shared}
        others[other] = Catalogue({**own, **shared}, found, {}, {})
    return Catalogue(topics, signals, cut_topics, controller_topics, others)


def kind_of_topics(topics) -> str:
    """The kind of rig of a run with these topics."""
    known = catalogue()
    for kind, other in known.others.items():
        if any(topic in other.topics and topic not in known.topics for topic in topics):
            return kind
    return GEARBOX


def _check_topics(topics: dict[str, Topic], signals: dict[str, Signal]) -> None:
    """RigError for a class of which nobody knows how it is offered, and for a setpoint without unit and range."""
    for topic in topics.values():
        if topic.qos not in QOS:
            raise RigError(f"signals.yaml: {topic.name} is of the class '{topic.qos}'; known are {', '.join(QOS)}")
        if (topic.type == "Setpoint") != (topic.like in signals):
            raise RigError(f"signals.yaml: {topic.name}: a Setpoint, and no other topic, is like a signal; found "
                           f"'{topic.like}'")


def _signals(entries: dict, topics: dict[str, Topic], displays: dict) -> dict[str, Signal]:
    """Checked signals, each on one of the topics."""
    signals = {}
    for name, entry in entries.items():
        entry = dict(entry)
        display = displays[entry.pop("display")]
        low, high = entry.pop("range")
        states = {int(k): v for k, v in entry.pop("states", {}).items()}
        signal = Signal(name=name, display_unit=display["unit"], scale=display["scale"], low=low, high=high,
                        states=states, **entry)
        if signal.topic not in topics:
            raise RigError(f"signals.yaml: signal '{name}' names the unknown topic '{signal.topic}'")
        signals[name] = signal
    columns = sorted(s.logger for s in signals.values() if s.logger is not None)
    if columns != list(range(len(columns))):
        raise RigError(f"signals.yaml: logger columns are {columns}, expected 0 to {len(columns) - 1} once each")
    return signals
