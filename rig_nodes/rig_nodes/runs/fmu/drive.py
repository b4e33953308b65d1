# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Drives the rig's FMU through a test sequence with FMPy: the example of an importer, and how the FMU is checked.

    .venv/bin/python -m rig_nodes.runs.fmu.drive hydmag.fmu demo --out runs/fmu-demo

Everything goes through FMI: inputs in, 5 ms of time, outputs out. The rig inside records its bag and report.
"""

from __future__ import annotations

import argparse
import json
import sys
import zipfile
from pathlib import Path

from ...base import RigError, printable, quoted
from ...controllers import Fmu
from ...rig import FAULTS_APART, RigConfig, load_rig
from ..sequence import Sequence, load_sequence
from ..sequence_runner import SequenceRunner
from .rig_variables import FAULT, enable_of

TICK = 5  # ms between two polls of a sequence
SCALAR = 10  # ms between two messages of a transducer; a sequence reads the newest one


class FmuBench:
    """The bench of a sequence (runs.sequence_runner.Bench) over the inputs and outputs of the FMU.

    Parameters
    ----------
    fmu : Fmu
        The rig's FMU.
    config : RigConfig
        Configuration of the rig in the FMU.
    """

    def __init__(self, fmu: Fmu, config: RigConfig) -> None:
        """Prepare the reading of all signals."""
        self.fmu, self.steps = fmu, config.settings.steps
        self.names = list(config.catalogue.signals)
        measured = config.catalogue.measured().values()
        self._states = [name not in measured for name in self.names]
        self._read = fmu.reader(self.names)
        self._readings: dict[str, float] = {}
        self._gear: int | None = None
        self._faults: list[str] = []  # orders that the next step takes

    def hear(self, ms: int) -> None:
        """Read the outputs as often as a listener on the rig's topics receives them: transducers at 100 Hz, states at 200 Hz."""
        for name, value, state in zip(self.names, self._read(), self._states, strict=True):
            if ms % SCALAR == 0 or state:
                self._readings[name] = float(value)

    def step(self, ms: int) -> None:
        """Step to the next poll."""
        first = self.take_orders(ms)
        self.fmu.step((ms + first) * 1e-3, (TICK - first) * 1e-3)

    def take_orders(self, ms: int) -> int:
        """Have one millisecond take the orders of faults, so that later ones may have the same text; return how many ms passed."""
        if not self._faults:
            return 0
        self.fmu.set(**{FAULT: FAULTS_APART.join(self._faults)})
        self.fmu.step(ms * 1e-3, 1e-3)
        self.fmu.set(**{FAULT: ""})
        self._faults = []
        return 1

    def ready(self) -> bool:
        """Return True, because the FMU is ready from the start."""
        return True

    def set(self, step: str, value: float, enable: bool) -> None:
        """Set a device's setpoint [SI] and its switch, as inputs of the FMU."""
        setpoint = self.steps[step].setpoint
        self.fmu.set(**{setpoint.name: value, enable_of(setpoint): enable})

    def order_gear(self, gear: int) -> None:
        """Request a gear by the input gear_request."""
        self.fmu.set(gear_request=gear)
        self._gear = gear

    def shift_done(self) -> bool:
        """Return whether no shift runs and the ordered gear is the one that was requested."""
        shifting, gear = self.fmu.get("shifting", "gear_ordered")
        return not shifting and self._gear in (None, gear)

    def controller_gear(self) -> tuple[int, bool]:
        """Return (gear, shifting) of the embedded controller."""
        shifting, gear = self.fmu.get("shifting", "gear_ordered")
        return int(gear), bool(shifting)

    def reading(self, signal: str) -> float:
        """Return the newest value [SI] that was read of a signal; nan before the first."""
        return self._readings.get(signal, float("nan"))

    def change(self, name: str, value: float) -> None:
        """Set a setting [SI] by the tunable parameter of its name; RigError when the FMU has no such parameter."""
        if name not in self.fmu.variables:
            raise RigError(f"the FMU has no parameter {name}")
        self.fmu.set(**{name: value})

    def fault(self, order: str) -> None:
        """Order a fault or its end with the next step; those of one time are one text."""
        self._faults.append(order)

    def changed(self) -> bool:
        """Return True, because a parameter has its value as soon as it is set."""
        return True

    def event(self, name: str, text: str, value: float = 0.0) -> None:
        """Print the sentence of a new step; other events are ignored here."""
        if name == "step":
            print(f"            {printable(text)}", flush=True)


def drive(fmu: Fmu, sequence: Sequence, config: RigConfig, **parameters: float | str) -> float:
    """Run a sequence on the FMU; the FMU is terminated at the end.

    Parameters
    ----------
    fmu : Fmu
        The rig's FMU.
    sequence : Sequence
        The sequence.
    config : RigConfig
        Configuration of the rig in the FMU.
    **parameters : float or str
        Parameters of the FMU, e.g. record="runs/fmu-demo", seed=1.

    Returns
    -------
    float
        Length of the run [s].

    Raises
    ------
    FmuFailed
        When the rig trips.
    SequenceFailed
        When a step of the sequence does not come to its end.
    """
    fmu.set(**parameters)
    fmu.initialize()
    bench = FmuBench(fmu, config)
    runner = SequenceRunner(sequence, bench, config)
    ms = 0
    try:
        while ms == 0 or not runner.poll(ms * 1e-3):
            bench.hear(ms)
            bench.step(ms)
            ms += TICK
        ms += bench.take_orders(ms)  # with which the sequence ends
    finally:
        fmu.terminate()
    return ms * 1e-3


def origin_of(fmu: str) -> tuple[str, dict[str, str]]:
    """Return rig and changed values, as load_rig takes them, of which an FMU was made; RigError when it is not one of a rig."""
    try:
        with zipfile.ZipFile(fmu) as archive:
            origin = json.loads(archive.read("resources/rig.json"))
            return origin["rig"], origin["set"]
    except (OSError, zipfile.BadZipFile, KeyError, ValueError):
        raise RigError(f"{fmu}: is not what ./rig export fmu wrote") from None


def main(arguments: list[str] | None = None) -> int:
    """Run the program and return its exit code."""
    parser = argparse.ArgumentParser(prog="rig_nodes.runs.fmu.drive", description=__doc__.splitlines()[0])
    parser.add_argument("fmu", help="what ./rig export fmu wrote")
    parser.add_argument("sequence", help="name of an installed sequence or a .yaml file")
    parser.add_argument("--out", help="folder for bag and report (default: none is recorded)")
    parser.add_argument("--rig", help="the rig in the FMU (default: by the name that it was exported by)")
    parser.add_argument("--seed", type=int, default=1)
    parsed = parser.parse_args(arguments)
    try:
        record = str(Path(parsed.out).resolve()) if parsed.out else ""
        with Fmu(parsed.fmu) as fmu:
            made_of, overrides = origin_of(parsed.fmu)
            rig = parsed.rig or made_of
            config = load_rig(rig, overrides)
            sequence = load_sequence(parsed.sequence, None, rig, config=config)
            seconds = drive(fmu, sequence, config, record=record, seed=parsed.seed)
        print(f"{seconds:g} s driven" + (f"; look at it with: ./rig report {quoted(parsed.out)}" if parsed.out else ""))
    except RigError as error:
        print(f"rig: {printable(error)}", file=sys.stderr)
        return error.exit_code
    return 0


if __name__ == "__main__":
    sys.exit(main())
