# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The fields of the messages of the rig's topics, how often these are sent, and what a listener received last.

runs.outputs encodes the fields; runs.recorded only reads them.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..bags import Form, installed
from ..base import SAMPLE, TICK_SAMPLES
from ..controllers import LEVELS, record_of
from ..plant import part as parts
from ..rig import CONTROLLER_COMMAND, TORQUES, Catalogue, absolute_pressures
from .joint_torques import JointTorques
from .moments import Moments, Present
from .rig import Rig

if TYPE_CHECKING:
    from collections.abc import Callable

    from ..base import Floats

SCALAR_SAMPLES = 10  # controller samples between scalars (100 Hz)
ATMOSPHERE = 101_325.0  # Pa, for the mirrors in absolute pressure


class Readings:
    """The newest fields of each topic that was sent, and the readings that a listener takes from them."""

    def __init__(self, catalogue: Catalogue) -> None:
        self.fields: dict[str, tuple] = {}  # by topic
        self._catalogue = catalogue
        self._places: dict[str, tuple] = {}  # of signals: topic, number of the field, index in it

    def topic(self, name: str) -> str:
        """Return the topic of a signal."""
        return self._catalogue.signal(name).topic

    def reading(self, name: str) -> float:
        """Return the newest value of a signal that was sent [SI], as a listener has it; NaN before the first."""
        topic, place, index = self._place(name)
        fields = self.fields.get(topic)
        if fields is None:
            return float("nan")
        return float(fields[place] if index is None else fields[place][index])

    def _place(self, name: str) -> tuple:
        if name not in self._places:
            signal = self._catalogue.signal(name)
            field, _, index = signal.field.partition("[")
            ros_type = self._catalogue.all_topics[signal.topic].ros_type
            names = [name for name, _ in installed(ros_type).tree.fields[2:]]
            self._places[name] = signal.topic, names.index(field), int(index[:-1]) if index else None
        return self._places[name]


def measured_columns(rig: Rig) -> dict[str, int]:
    """Return the topic of each transducer's messages with its column in a row of the rig, in the order of the topics."""
    return {topic: rig.channels.index(name) for topic, name in rig.config.catalogue.measured().items()}


def state_fields(rig: Present | Moments, overruns: Callable[[], int] = lambda: 0) -> dict[str, Callable[[], tuple]]:
    """Return for each state topic the function that makes its fields, of the present moment or of several.

    Parameters
    ----------
    rig : Present or Moments
        The rig's state, or its states at several ticks.
    overruns : callable, optional
        Returns how many ticks were late.

    Returns
    -------
    dict of str to callable
        The functions by topic, in the order in which the topics are sent.
    """

    def whole() -> tuple:
        return (
            int(rig.status),
            rig.reason,
            rig.stopped_by_person,
            rig.sample // TICK_SAMPLES,
            overruns(),
            rig.energies["residual"],
        )

    def of(name: str) -> Callable[[], tuple]:
        if name == "gearbox":
            return _gearbox(rig)
        if name == "rig":
            return whole
        shown_values = parts.part(rig.config.structure.device(name).part).shown_values
        return lambda: shown_values(rig, name)

    topics = rig.config.catalogue.topics.values()
    return {topic.name: of(topic.node) for topic in topics if topic.name == f"/{topic.node}/state"} | {"/rig/state": whole}


def _gearbox(rig: Present | Moments) -> Callable[[], tuple]:
    """The function that returns the fields of the gearbox's state."""
    structure, facts = rig.config.structure, rig.facts
    into, out = _ends(rig)
    shows = {one.name: one.shows for one in structure.transducers}
    ends = [facts.world.number(what) for what in (f"{into.body}.speed", f"{out.body}.speed", shows[into.torque], shows[out.torque])]
    # 0: at the input's side, 1: at all others
    lost_at = {name: int(rig.wire(name, "body") != into.body) for name in facts.losses}
    between = [name for name in facts.accounts if name not in facts.loads]

    def fields() -> tuple:
        torques, lost = [0.0, 0.0], 0.0
        for name, side in lost_at.items():
            torques[side] = torques[side] + rig.device(name)["torque"]
            lost = lost + rig.energies[name]
        for name in between:
            lost = lost + rig.energies[name]
        return (rig.locked_gear(), *(rig.number(place) for place in ends), *torques, lost)

    return fields


def _ends(rig: Rig | Present | Moments) -> list:
    """The input and the output of the rig's driveline, as far as it has them."""
    return [end for end in (rig.config.structure.input, rig.config.structure.output) if end]


class States:
    """The fields of the state topics, from the rig's state at the last :meth:`refresh`, which is called at each tick."""

    def __init__(self, rig: Rig) -> None:
        self.rig, self.overruns = rig, 0  # overruns: the caller that keeps real time sets it
        self.measured = measured_columns(rig)
        self._columns = {name: column for column, name in enumerate(rig.channels)}
        self._ends = _ends(rig)
        self._speeds = np.array([self._columns[end.speed] for end in self._ends], int)
        self.angles = [0.0] * len(self._ends)  # of input and output since time 0 [rad]
        self._present = Present(rig)
        self.topics = state_fields(self._present, lambda: self.overruns)
        self._torques = None
        if TORQUES in rig.config.structure.signals:
            self._torques = JointTorques(rig)
            self.topics["/rig/torques"] = self._joint_torques

    def period(self, topic: str) -> int:
        """Return the number of controller samples between two messages of a topic with signals."""
        return SCALAR_SAMPLES if topic in self.measured else 1 if topic == CONTROLLER_COMMAND else TICK_SAMPLES

    def refresh(self) -> None:
        """Read the rig as it is now."""
        self._present.read()

    def turn(self, rows: Floats) -> Floats:
        """Add ticks to the angles of the shafts, as a counter of the encoders would without wrapping.

        The rows are added one after the other, so that the sum is the same on every machine.

        Parameters
        ----------
        rows : (ticks, rows, channels) array of float
            The logger's rows of each tick [SI].

        Returns
        -------
        (ticks, shafts) array of float
            The angles after each tick [rad].
        """
        ticks, count, _ = rows.shape
        # along its slow axis numpy adds one after the other; without the further column that axis could be its fast one
        speeds = np.zeros((count, len(self._speeds), ticks + 1))
        for k, column in enumerate(self._speeds):
            speeds[:, k, :ticks] = rows[:, :, column].T
        turned = (self.rig.row_period * speeds.sum(axis=0)[:, :ticks]).T
        turned[0] += self.angles
        turned = turned.cumsum(axis=0)
        self.angles = turned[-1].tolist()
        return turned

    def each_sample(self) -> list[tuple]:
        """Return each topic that is sent with every sample, with its fields: what a controller measures, if the rig has one."""
        rig = self.rig
        if not rig.shifts:
            return []
        return [("/instruments/controller", (rig.sample, *rig.seen()))]

    def mirrors(self) -> list[tuple]:
        """Return the standard messages for other tools, of a rig with gears.

        FluidPressure means absolute pressure, so the ambient pressure is added; its variance is that of the transducer's present
        noise.

        Returns
        -------
        list of (str, Form, callable)
            Topic, form of the message, and the function that makes its values from a logger row (channels,), the angles at it
            (shafts,) [rad], and the function that returns a transducer's noise, as Gauges.effective does. For n messages the
            row, the angles and the values are arrays (n,).
        """
        structure = self.rig.config.structure
        if not self.rig.shifts:
            return []

        def absolute(clutch: str, name: str) -> tuple:
            column = self._columns[name]
            form = Form(
                "sensor_msgs/msg/FluidPressure",
                lambda value, variance: {"header": {"stamp": 0, "frame_id": clutch}, "fluid_pressure": value, "variance": variance},
                2,
            )
            return form, lambda row, _angles, noise: (row[column] + ATMOSPHERE, noise(name) ** 2)

        names, count = [end.body for end in self._ends], len(self._ends)
        joints = Form(
            "sensor_msgs/msg/JointState",
            lambda *values: {
                "header": {"stamp": 0, "frame_id": ""},
                "name": names,
                "position": list(values[:count]),
                "velocity": list(values[count : 2 * count]),
                "effort": list(values[2 * count :]),
            },
            3 * count,
        )
        columns = [self._columns[name] for name in (*(end.speed for end in self._ends), *(end.torque for end in self._ends))]
        return [
            ("/instruments/joint_states", joints, lambda row, angles, _noise: (*angles, *[row[column] for column in columns])),
            *((f"/instruments/{one.name}_absolute", *absolute(one.at, one.name)) for one in absolute_pressures(structure)),
        ]

    def command(self) -> tuple:
        """Return the fields of the newest valve command, which is sent with every sample."""
        rig = self.rig
        return (
            rig.newest_command,
            rig.gear,
            rig.shifting,
            LEVELS.index(rig.level),
            rig.flags,
            rig.duty.tolist(),
            rig.setpoint.tolist(),
        )

    def once(self) -> list[tuple]:
        """Return each topic that is sent once, when time begins, with its fields: what the controller's numbers mean."""
        channels = (
            [("/rig/channels", (self._torques.names, ["N.m"] * len(self._torques.names), TICK_SAMPLES * SAMPLE))]
            if self._torques
            else []
        )
        if not self.rig.shifts:
            return channels
        record = record_of(self.rig.config)
        return [
            *channels,
            (
                "/instruments/controller_record",
                (
                    record.id,
                    [output.name for output in record.outputs],
                    [output.valve for output in record.outputs],
                    list(record.names),
                    [signal.unit for signal in record.transducers],
                    list(record.gear_names),
                    list(record.gear_names.values()),
                ),
            ),
        ]

    def _joint_torques(self) -> tuple:
        values = self._torques.values()
        return self.rig.sample // TICK_SAMPLES, TICK_SAMPLES * SAMPLE, 1, len(values), values
