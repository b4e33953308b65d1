"""The signal catalogue: every topic and every signal of the rig, once.

Read by the nodes, the recorder, the view, the report and the docs; the data is config/signals.yaml.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache

from .config import load_yaml, package_file
from .errors import RigError


@dataclass(frozen=True)
class Topic:
    """One topic: who publishes it, its message type, its quality-of-service class and its rate [Hz]."""

    name: str
    node: str
    type: str
    qos: str
    rate: float

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
    """All topics and signals, by name, in the order of the file.

    topics: of every run; cut_topics: of runs in which their device stands outside the plant; controller_topics: of
    runs whose controller has signals of its own.
    """

    topics: dict[str, Topic]
    signals: dict[str, Signal]
    cut_topics: dict[str, Topic]
    controller_topics: dict[str, Topic]

    @property
    def all_topics(self) -> dict[str, Topic]:
        """Every topic that a run may have."""
        return {**self.topics, **self.cut_topics, **self.controller_topics}

    def logger_channels(self) -> list[Signal]:
        """The columns of the 10 kHz logger, in order."""
        columns = [s for s in self.signals.values() if s.logger is not None]
        return sorted(columns, key=lambda s: s.logger)

    def on_topic(self, topic: str) -> list[Signal]:
        """The signals that travel in one topic."""
        return [s for s in self.signals.values() if s.topic == topic]

    def signal(self, name: str) -> Signal:
        """One signal; RigError names the known ones when there is none."""
        if name not in self.signals:
            raise RigError(f"unknown signal '{name}'; the catalogue has {', '.join(self.signals)}")
        return self.signals[name]


@lru_cache(maxsize=1)
def catalogue() -> Catalogue:
    """The catalogue of the installed rig, read once per process."""
    data = load_yaml(package_file("signals.yaml"))
    topics, cut_topics, controller_topics = ({name: Topic(name=name, **entry) for name, entry in data[key].items()}
                          for key in ("topics", "cut_topics", "controller_topics"))
    displays = data["displays"]
    signals = {}
    for name, entry in data["signals"].items():
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
    return Catalogue(topics, signals, cut_topics, controller_topics)
