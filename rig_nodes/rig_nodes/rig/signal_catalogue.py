# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The signal catalogue: every topic and every signal of a rig, made from its description.

The nodes, the recorder, the view, the report and the docs read it; rig.signals makes its entries.
"""

from __future__ import annotations

import hashlib
from collections.abc import Collection, Iterable, Mapping
from dataclasses import astuple, dataclass, field
from functools import cached_property, lru_cache
from itertools import starmap
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from ..base import COMMAND_TIMEOUT, RigError, kept, kept_folder, unknown
from .signals import described
from .structure import Structure, structure_of

if TYPE_CHECKING:
    from ..base import Floats
    from .configuration import RigConfig

    Numbers = TypeVar("Numbers", float, Floats)


@dataclass(frozen=True)
class Offer:
    """The quality of service with which the topics of a class are offered; a deadline of 0 ms means none."""

    reliable: bool = True
    latched: bool = False
    deadline_ms: int = 0
    depth: int = 1000  # one second at 1 kHz; with 10, 0.4 % of the messages were lost without an error


# Nodes publish with these (nodes.qos) and bags record them (bags.metadata). A command's deadline is the age at which the
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
    """One topic of a rig.

    Parameters
    ----------
    name : str
        Name of the topic.
    node : str
        Node that publishes it.
    type : str
        Type of its messages, without the package rig_msgs.
    qos : str
        Its quality-of-service class.
    rate : float
        Messages in a second [Hz].
    sets : str
        For a Setpoint, what its value is.
    like : str
        Signal whose unit and range the value has.
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
        """Full name of the type as bags and ROS write it, e.g. ``rig_msgs/msg/Measurement``."""
        package, _, short = self.type.rpartition("/")
        return f"{package or 'rig_msgs'}/msg/{short}"


@dataclass(frozen=True)
class Signal:
    """One signal: its topic and field, its units, its sign, and its text for people."""

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
        """Return a value, given in ``unit``, in the unit that people read."""
        return value * self.scale


@dataclass(frozen=True)
class Catalogue:
    """All topics and signals of a rig, by name.

    Parameters
    ----------
    topics : dict of str to Topic
        Topics of every run.
    signals : dict of str to Signal
        All signals.
    cut_topics : dict of str to Topic
        Topics of runs in which their device stands outside the plant.
    controller_topics : dict of str to Topic
        Topics of runs whose controller has signals of its own.
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
        """Return the topics of a run.

        Parameters
        ----------
        cut_out : collection of str
            Devices that stand outside the plant.
        own_signals : bool
            True when the controller has signals of its own.

        Returns
        -------
        dict of str to Topic
            The topics by name.
        """
        cut = {name: topic for name, topic in self.cut_topics.items() if name.split("/")[1] in cut_out}
        return {**self.topics, **cut, **(self.controller_topics if own_signals else {})}

    def logger_channels(self) -> list[Signal]:
        """Return the columns of the logger, in order."""
        columns = [s for s in self.signals.values() if s.logger is not None]
        return sorted(columns, key=lambda s: s.logger)

    def setpoints(self) -> dict[Topic, Signal]:
        """Return the topics of setpoints, each with the signal whose unit and range its value has."""
        return {topic: self.signals[topic.like] for topic in self.topics.values() if topic.like}

    def measured(self) -> dict[str, str]:
        """Return the signal of each transducer by the topic of its messages."""
        return {
            signal.topic: name
            for name, signal in self.signals.items()
            if signal.topic in self.topics and self.topics[signal.topic].type == "Measurement"
        }

    def on_topic(self, topic: str) -> list[Signal]:
        """Return the signals of a topic."""
        return [s for s in self.signals.values() if s.topic == topic]

    def signal(self, name: str) -> Signal:
        """Return a signal by its name; RigError, with the known names, when there is none."""
        if name not in self.signals:
            raise RigError(unknown("signal", name, self.signals))
        return self.signals[name]


def catalogue(config: RigConfig | Mapping) -> Catalogue:
    """Return the catalogue of a rig.

    Parameters
    ----------
    config : RigConfig or mapping
        A configuration, or its record in a bag or a report.

    Returns
    -------
    Catalogue
        The catalogue.

    Raises
    ------
    KeyError, TypeError, ValueError
        When a record is not that of a rig.
    """
    if isinstance(config, Mapping):
        return catalogue_of(structure_of(config["structure"]))
    return config.catalogue


@lru_cache(maxsize=1)
def installed_topics() -> dict[str, Topic]:
    """Return every topic of every installed rig, to find the meaning of a message of an unknown rig.

    They are kept on disk for later processes, because reading all rigs takes a third of a second.
    """
    found = kept(kept_folder("installed-topics") / "topics.json", _sources(), lambda: [astuple(one) for one in _read_topics()])
    return {topic.name: topic for topic in starmap(Topic, found)}


def _sources() -> bytes:
    """Everything on which the topics of the installed rigs depend."""
    digest = hashlib.sha256()
    for pattern in ("base/*.py", "rig/*.py", "plant/parts/*.py", "rigs/*/rig.yaml"):
        for path in sorted(Path(__file__).parents[1].glob(pattern)):
            digest.update(f"{path} ".encode() + path.read_bytes())
    return digest.digest()


def _read_topics() -> Iterable[Topic]:
    """Every topic of every installed rig, read from its description."""
    from ..base import installed
    from .configuration import load_rig

    out: dict[str, Topic] = {}
    for name in installed("rigs"):
        out = {**load_rig(name).catalogue.all_topics, **out}
    return out.values()


def catalogue_of(structure: Structure) -> Catalogue:
    """Return the catalogue of a rig from its structure; RigError when two signals have the same name."""
    found = described(structure)
    topics, cut_topics, controller_topics = (
        {name: Topic(name=name, **entry) for name, entry in found[key].items()}
        for key in ("topics", "cut_topics", "controller_topics")
    )
    return Catalogue(
        topics, {name: Signal(name=name, **entry) for name, entry in found["signals"].items()}, cut_topics, controller_topics
    )
