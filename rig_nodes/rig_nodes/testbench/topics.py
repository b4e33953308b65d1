# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the rig's topics say and how often, as fields of their messages, and what a listener has heard last.

Used by testbench.outputs, which encodes the fields, and by testbench.record, which only reads them.
"""

from __future__ import annotations

import math

from ..bags.cdr import Form
from ..bags.definitions import installed
from ..catalogue import catalogue
from ..clocks import ROW, TICK_SAMPLES
from ..controllers.record import record_of
from ..controllers.seam import LEVELS
from .rig import Rig

SCALAR_SAMPLES = 10  # controller samples between scalars (100 Hz)
COMMAND = "/controller/command"
SPEEDS = ("n_wej", "n_wyj")  # of w0 and wk
ATMOSPHERE = 101_325.0  # Pa, for the mirrors in absolute pressure


class Heard:
    """The newest fields of each topic that went out, and the readings that a listener takes from them."""

    def __init__(self):
        self.fields: dict[str, tuple] = {}  # by topic
        self._places: dict[str, tuple] = {}  # of signals: topic, number of the field, index in it

    @staticmethod
    def topic(name: str) -> str:
        """The topic of a signal."""
        return catalogue().signal(name).topic

    def reading(self, name: str) -> float:
        """The newest value of a signal that went out, SI, as a listener has it; NaN before the first."""
        topic, place, index = self._place(name)
        fields = self.fields.get(topic)
        if fields is None:
            return float("nan")
        return float(fields[place] if index is None else fields[place][index])

    def _place(self, name: str) -> tuple:
        if name not in self._places:
            signal = catalogue().signal(name)
            field, _, index = signal.field.partition("[")
            ros_type = catalogue().all_topics[signal.topic].ros_type
            names = [name for name, _ in installed(ros_type).tree.fields[2:]]
            self._places[name] = signal.topic, names.index(field), int(index[:-1]) if index else None
        return self._places[name]


def measured_columns(rig) -> dict[str, int]:
    """Topic of each transducer's messages -> its column in a row of the rig, in the order of the topics."""
    return {topic: rig.channels.index(name) for topic, name in catalogue(rig.config.kind).measured().items()}


class States:
    """Fields of the state topics, from the rig as it is; :meth:`refresh` before each tick's.

    The clutch bench's are testbench.clutch_bench_topics.
    """

    def __init__(self, rig: Rig):
        self.rig, self.overruns = rig, 0  # overruns: set by whoever keeps time
        self.measured = measured_columns(rig)
        self._columns = {name: column for column, name in enumerate(rig.channels)}
        self._energy: dict[str, float] = {}  # of this tick
        self._angles = [0.0, 0.0]  # of w0 and wk since time 0 [rad]
        self.topics = {
            "/motor/state": self._motor, "/gearbox/state": self._gearbox, "/load_pump/state": self._load,
            "/oil_supply/state": self._oil, "/rig/state": self._rig_state,
            "/clutch_s1/state": lambda: self._clutch(0), "/clutch_s2/state": lambda: self._clutch(1),
            "/valve_zr_p1/state": lambda: self._valve(0), "/valve_zr_p2/state": lambda: self._valve(1),
        }

    def refresh(self) -> None:
        """Take the energies of this tick."""
        self._energy = self.rig.energy()

    def turn(self, rows) -> None:
        """Go on with the shafts' angles by a tick's rows of the logger (rows, channels), one every 0.1 ms.

        As a counter of the encoders would, without wrapping; fsum, so that no order of summing shows in the bag.
        """
        for shaft, name in enumerate(SPEEDS):
            self._angles[shaft] += ROW * math.fsum(rows[:, self._columns[name]].tolist())

    def each_sample(self) -> list[tuple]:
        """(topic, its fields) of what goes out with every sample: what the controller sees."""
        rig = self.rig
        return [("/instruments/controller", (rig.sample, rig.coil_currents().tolist(), rig.wired()))]

    def mirrors(self) -> list[tuple]:
        """(topic, form, its values from a logger row) of the standard messages for other tools.

        FluidPressure means absolute pressure, so ambient is added; its variance is that of the transducer's noise now.
        """
        def absolute(clutch: str, name: str) -> tuple:
            column = self._columns[name]
            form = Form("sensor_msgs/msg/FluidPressure", lambda value, variance: {
                "header": {"stamp": 0, "frame_id": clutch}, "fluid_pressure": value, "variance": variance}, 2)
            return form, lambda row: (float(row[column]) + ATMOSPHERE, self.rig.gauges.effective(name)**2)

        joints = Form("sensor_msgs/msg/JointState", lambda *values: {
            "header": {"stamp": 0, "frame_id": ""}, "name": ["w0", "wk"], "position": list(values[:2]),
            "velocity": list(values[2:4]), "effort": list(values[4:])}, 6)
        columns = [self._columns[name] for name in (*SPEEDS, "M_wej", "M_wyj")]
        return [("/instruments/joint_states", joints, lambda row: [*self._angles, *row[columns].tolist()]),
                ("/instruments/p1_absolute", *absolute("clutch_s1", "p1")),
                ("/instruments/p2_absolute", *absolute("clutch_s2", "p2"))]

    def command(self) -> tuple:
        """Fields of the newest valve command, whose topic comes with every sample."""
        rig = self.rig
        return (rig.newest_command, rig.gear, rig.shifting, LEVELS.index(rig.level), rig.flags, rig.duty.tolist(),
                rig.setpoint.tolist())

    def once(self) -> list[tuple]:
        """(topic, its fields) of what goes out once, when time begins: what the controller's numbers are."""
        record = record_of(self.rig.config)
        return [("/instruments/controller_record", (
            record.id, [output.name for output in record.outputs], [output.valve for output in record.outputs],
            list(record.names), [signal.unit for signal in record.transducers], list(record.gear_names),
            list(record.gear_names.values())))]

    def _motor(self):
        rig, motor = self.rig, self.rig.motor
        return (float(rig.v[0]), float(motor["setpoint"]), float(motor["torque"]), self._energy["motor"],
                bool(motor["enabled"] > 0.0))

    def _gearbox(self):
        rig, energy = self.rig, self._energy
        return (rig.locked_gear(), float(rig.v[0]), float(rig.v[1]), rig.true("M_wej"), rig.true("M_wyj"),
                *(float(loss["torque"]) for loss in rig.losses), energy["loss_in"] + energy["loss_out"])

    def _clutch(self, k: int):
        rig, cylinder = self.rig, self.rig.clutches[k]
        slip = rig.slip(k)
        return (rig.clutch_mode(k), rig.clutch_torque(k), float(cylinder["drag"]) * slip, float(cylinder["kinetic"]),
                float(cylinder["static"]), slip, float(cylinder["clamp"]), float(cylinder["chamber"]),
                float(cylinder["piston"]), self._energy[f"heat_s{k + 1}"])

    def _valve(self, k: int):
        rig, valve = self.rig, self.rig.valves[k]
        return (float(valve["duty"]), float(valve["current"]), float(valve["spool"]), float(valve["flow"]),
                rig.line_pressure(k), rig.command_age, rig.safe)

    def _load(self):
        rig = self.rig
        return (rig.load_torque(), rig.load_capacity(), float(rig.load["pressure"]), float(rig.load["setting"]),
                self._energy["load"])

    def _oil(self):
        rig = self.rig
        return (float(rig.oil["pressure"]), float(rig.oil["setting"]),
                max(0.0, sum(float(valve["flow"]) for valve in rig.valves)), rig.config.oil_supply.temperature,
                bool(rig.oil["enabled"] > 0.0))

    def _rig_state(self):
        rig = self.rig
        return (int(rig.status), rig.reason, rig.stopped_by_person, rig.sample // TICK_SAMPLES, self.overruns,
                self._energy["residual"])
