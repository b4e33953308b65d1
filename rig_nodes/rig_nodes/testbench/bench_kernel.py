"""How fast the compiled kernel is: real-time factors, cost by phase and by run length, and what the first start costs.

Called by ``rig bench kernel``. All numbers of one call are of one process on one machine, so their ratios hold. The
kernel runs in one thread; its time is that of the processor, so that others on the machine count as little as they can.
Starts are by the clock on the wall.
"""

from __future__ import annotations

import os
import platform
import subprocess
import sys
import tempfile
import time
from importlib.metadata import version

from ..plant.gearbox import RPM
from .configuration import load_rig
from .rig import SAMPLE_NS, Rig

# variant -> settings of the rig. Rows of all channels are written in each; the first is what ``simulate`` does
VARIANTS = {
    "10 kHz, transducers": {},
    "10 kHz, true values": {"effects.transducers": "off"},
    "10 kHz, resolved PWM": {"effects.pwm_frequency": "1 kHz"},
    "125 kHz, resolved PWM": {"kernel.step": "8 us", "effects.pwm_frequency": "1 kHz"},
}
LENGTHS = (1, 10, 100)  # simulated s, one after the other in one run
SAMPLES_PER_S = 1_000_000_000 // SAMPLE_NS
_START = """
import time
begin = time.perf_counter()
from rig_nodes.testbench.configuration import load_rig
from rig_nodes.testbench.rig import Rig
imported = time.perf_counter()
rig = Rig(load_rig("hydmag"))
rig.order_gear(1)
rig.advance_samples(1)
print(imported - begin, time.perf_counter() - imported)
"""


def machine() -> dict[str, str]:
    """Processor and versions."""
    cpu = platform.processor() or platform.machine()
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as info:
            cpu = next((line.split(":", 1)[1].strip() for line in info if line.startswith("model name")), cpu)
    except OSError:
        pass  # not Linux: what Python knows has to do
    return {"cpu": cpu, "python": platform.python_version(), "numba": version("numba"), "numpy": version("numpy"),
            "llvmlite": version("llvmlite")}


class _Clock:
    """Moves a rig and notes what it takes: phase -> (steps, s)."""

    def __init__(self, rig: Rig, steps_per_sample: int):
        self.rig, self.spent, self._steps = rig, {}, steps_per_sample

    def go(self, phase: str, seconds: float) -> None:
        samples = round(seconds * SAMPLES_PER_S)
        begin = time.thread_time()
        self.rig.advance_samples(samples)
        spent = time.thread_time() - begin
        steps, before = self.spent.get(phase, (0, 0.0))
        self.spent[phase] = steps + samples * self._steps, before + spent


def _drive(clock: _Clock) -> None:
    """12 s of a rig: oil, gear I, 1500 rpm, load, up and down again; phases standing, running, shifting."""
    rig = clock.rig
    rig.set_oil(4e6, True)
    clock.go("standing", 0.5)
    rig.order_gear(1)
    clock.go("standing", 1.5)
    rig.set_motor(1500.0 * RPM, True)
    clock.go("running", 2.5)
    rig.set_load(5e6, True)
    clock.go("running", 1.5)
    rig.order_gear(2)
    clock.go("shifting", 0.6)
    clock.go("running", 2.4)
    rig.order_gear(1)
    clock.go("shifting", 0.6)
    clock.go("running", 2.4)


def variant(settings: dict[str, str], repeats: int) -> dict:
    """Fastest of some drives: real-time factor of all of it, ns per step of each phase."""
    config = load_rig("hydmag", settings)
    steps = round(SAMPLE_NS * 1e-9 / config.kernel.step)
    _drive(_Clock(Rig(config), steps))  # compiles what is not compiled yet
    best: dict[str, tuple[int, float]] = {}
    for _ in range(repeats):
        clock = _Clock(Rig(config), steps)
        _drive(clock)
        best = {phase: min(spent, best.get(phase, spent), key=lambda pair: pair[1])
                for phase, spent in clock.spent.items()}
    total_steps, total = sum(s for s, _ in best.values()), sum(t for _, t in best.values())
    return {"step_s": config.kernel.step, "real_time_factor": total_steps * config.kernel.step / total,
            "ns_per_step": {phase: 1e9 * t / s for phase, (s, t) in best.items()} | {"all": 1e9 * total / total_steps}}


def by_length() -> list[dict]:
    """Cost per simulated second of ever longer parts of one run in gear, under load."""
    rig = Rig(load_rig("hydmag"))
    _drive(_Clock(rig, 10))
    out = []
    for length in LENGTHS:
        begin = time.thread_time()
        rig.advance(float(length))
        out.append({"simulated_s": length, "ms_per_simulated_s": 1e3 * (time.thread_time() - begin) / length})
    return out


def starts() -> list[dict]:
    """Import and first sample in a new process: with no compiled code kept, then with it."""
    out = []
    with tempfile.TemporaryDirectory() as folder:
        for kind in ("cold", "warm"):
            done = subprocess.run([sys.executable, "-c", _START], env={**os.environ, "NUMBA_CACHE_DIR": folder},
                                  capture_output=True, text=True, check=True)
            imported, first = map(float, done.stdout.split())
            out.append({"start": kind, "import_s": imported, "first_sample_s": first})
    return out


def bench_kernel(repeats: int = 5, start: bool = True) -> dict:
    """Everything that `rig bench kernel` prints; start False leaves out the half a minute of compiling."""
    out = {"machine": machine(), "variants": {name: variant(settings, repeats) for name, settings in VARIANTS.items()},
           "by_length": by_length()}
    if start:
        out["starts"] = starts()
    return out


def lines(result: dict) -> list[str]:
    """The result as text."""
    out = [", ".join(f"{name} {value}" if name != "cpu" else value for name, value in result["machine"].items()), ""]
    out += ["| kernel, one core | times real time | ns per step | standing | running | shifting |",
            "| --- | --- | --- | --- | --- | --- |"]
    for name, row in result["variants"].items():
        ns = row["ns_per_step"]
        out.append(f"| {name} | {row['real_time_factor']:.0f} | " + " | ".join(
            f"{ns[phase]:.0f}" for phase in ("all", "standing", "running", "shifting")) + " |")
    out += ["", "| simulated | cost per simulated second |", "| --- | --- |"]
    out += [f"| {row['simulated_s']} s | {row['ms_per_simulated_s']:.2f} ms |" for row in result["by_length"]]
    if "starts" in result:
        out += ["", "| start | import | first sample |", "| --- | --- | --- |"]
        out += [f"| {row['start']} | {row['import_s']:.2f} s | {row['first_sample_s']:.2f} s |"
                for row in result["starts"]]
    return out
