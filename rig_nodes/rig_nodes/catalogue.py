# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The signal catalogue: every topic and every signal of a rig, once, made of its description.

Read by the nodes, the recorder, the view, the report and the docs; what it is made of stands in description.signals.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, TypeVar

from .clocks import COMMAND_TIMEOUT
from .config.names import unknown
from .description.signals import described
from .description.structure import Structure, structure_of
from .errors import RigError

if TYPE_CHECKING:
    from .arrays import Floats
    from .testbench.configuration import RigConfig

    Numbers = TypeVar("Numbers", float, Floats)


@dataclass(frozen=True)
class Offer:
    """How the topics of a quality-of-service class are offered: depth, deadline [ms] (0: without one)."""

    reliable: bool = True
    latched: bool = False
    deadline_ms: int = 0
    depth: int = 1000  # at 1 kHz one second; 10 lost 0.4 % of the messages without a word


# Nodes publish with these (nodes.qos) and bags say them (bags.metadata). A command's deadline is the age at which the
# rig trips. The last one is for topics of users' own nodes only.
QOS = {
    "measurement": Offer(),
    "command": Offer(deadline_ms=round(1e3 * COMMAND_TIMEOUT)),
    "setting": Offer(),
    "latched": Offer(latched=True),
    "best_effort": Offer(reliable=False),
}


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

    def shown(self, value: Numbers) -> Numbers:
        """The value in the unit people read."""
        return value * self.scale


@dataclass(frozen=True)
class Catalogue:
    """All topics and signals of a rig, by name.

    topics: of every run; cut_topics: of runs in which their device stands outside the plant; controller_topics: of
    runs whose controller has signals of its own.
    """

    topics: dict[str, Topic]
    signals: dict[str, Signal]
    cut_topics: dict[str, Topic]
    controller_topics: dict[str, Topic]

    @cached_property
    def all_topics(self) -> dict[str, Topic]:
        """Every topic that a run of this rig may have."""
        return {**self.topics, **self.cut_topics, **self.controller_topics}

    def of_run(self, cut_out: Collection[str] = (), own_signals: bool = False) -> dict[str, Topic]:
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
        return {
            signal.topic: name
            for name, signal in self.signals.items()
            if signal.topic in self.topics and self.topics[signal.topic].type == "Measurement"
        }

    def on_topic(self, topic: str) -> list[Signal]:
        """The signals that travel in one topic."""
        return [s for s in self.signals.values() if s.topic == topic]

    def signal(self, name: str) -> Signal:
        """One signal; RigError names the known ones when there is none."""
        if name not in self.signals:
            raise RigError(unknown("signal", name, self.signals))
        return self.signals[name]


def catalogue(config: RigConfig | Mapping | None = None) -> Catalogue:
    """The catalogue of a rig.

    config: a RigConfig, or its record as a bag and a report hold it; by default the installed rig that is taken where none is
    named. Raises KeyError, TypeError or ValueError for a record that is none.
    """
    if config is None:
        return _default()
    if isinstance(config, Mapping):
        return catalogue_of(structure_of(config["structure"]))
    return config.catalogue


@lru_cache(maxsize=1)
def _default() -> Catalogue:
    from .testbench.configuration import load_rig  # here, as all that reads a rig stands above this module

    return load_rig().catalogue


@lru_cache(maxsize=1)
def installed_topics() -> dict[str, Topic]:
    """Every topic of every installed rig: what a message is where nobody says of which rig it is."""
    from .config.names import installed
    from .testbench.configuration import load_rig

    out: dict[str, Topic] = {}
    for name in installed("rigs"):
        out = {**load_rig(name).catalogue.all_topics, **out}
    return out


def catalogue_of(structure: Structure) -> Catalogue:
    """The catalogue of a rig by its structure; RigError for two signals of one name."""
    found = described(structure)
    topics, cut_topics, controller_topics = (
        {name: Topic(name=name, **entry) for name, entry in found[key].items()}
        for key in ("topics", "cut_topics", "controller_topics")
    )
    return Catalogue(
        topics, {name: Signal(name=name, **entry) for name, entry in found["signals"].items()}, cut_topics, controller_topics
    )
