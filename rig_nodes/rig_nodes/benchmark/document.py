# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The numbers of ``rig bench`` as tables, on the terminal and in docs/reference/performance.md.

The text of docs/reference/performance.md is in this module; its numbers come from one run of ``rig bench --write-docs``.
"""

from __future__ import annotations

from pathlib import Path

from ..errors import RigError

TITLES = {
    "kernel": "The kernel, one core",
    "rigs": "Every rig, one core",
    "demo": "What a user waits for",
    "graph": "The node graph in lockstep",
    "controllers": "A step of a controller",
    "scaling": "How the cost grows",
    "peers": "The bare problem, against other tools",
}

_INTRO = """# Performance

Made by `./rig bench --write-docs`; a change by hand is lost. All numbers are of one run on one machine, so their
ratios hold:

{machine}

Times are of the processor, the fastest of several, unless "wall" is stated. `./rig bench PART` measures one part,
`--json` gives everything to programs. Aims: the kernel with 10 kHz logging at least 400 times real time; `simulate
demo` warm under 1.5 s and its first run under 20 s; the bare problem at least 5000 times real time at 1e-3 of the
lock-up time.
"""

_PROSE = {
    "kernel": """\
12 s of a gear change up and down at 1500 rpm under load. "Standing": motor off; "running": in gear; "shifting": the
600 ms from an order on. A row of the logger is computed in every step, because the transducers' low passes and
counters go on in any case; "logging" keeps all rows in memory, as `procedure`, `sweep` and `validate` do.""",
    "rigs": """\
Each installed rig with its demo, or the first sequence of its folder, recorded in memory with the rows of the 10 kHz logger and the
sequencer's own work.""",
    "demo": """\
Programs of their own, from the shell's call to their end, bag and report written: 13.3 s of simulated time, 72,000
messages. In the first run everything is compiled, by two processes.""",
    "graph": """\
`./rig run demo --speed max`: all nodes, every topic published on DDS and recorded; `speed_factor` of its report.""",
    "controllers": """\
One step of the reference controller through each plug ([controllers.md](../how_to/controllers.md)), by the clock on the wall.""",
    "scaling": """\
One run in gear, second by second: neither the cost nor the memory may grow with its length. What fades for ever (a
coil's current, a line's pressure) is zero below 1e-200, because denormal numbers slowed a run down by a fifth after
ten seconds. Into a bag, the index of the chunks stays in memory until the file is closed, 4 KB per simulated second.
Clutches: a row of bodies with a clutch between each two, all closing at once, at a step of 100 us. The sweep's
members are whole runs of `demo` with metrics, on processes that are warm, the table included; the best of three sweeps
with each number of processes in turn.""",
    "peers": """\
Two inertias (0.7 and 0.127 kg m2, 1500 rpm and 0), a clutch whose capacity rises to 264 Nm in 45 ms, 2 s; 60 Nm drive
the one, 40 Nm brake the other. Exact lock-up: {lock:.9f} s. Every tool is tried with many settings; shown is the
cheapest one whose lock-up time errs at most so much, so no tool is shown at less than the best that was found for it.
What is built once (models, diagrams, compiled code) does not count, setting the state back does. "Free": one call;
"stopped": 2000 calls of 1 ms, as a controller needs it. It is an input of every tool that the rise ends at 45 ms and
that the capacity is constant after it.

- This project: the general driveline, lock-up as a root inside the step, capacity in each step as the straight line
  through its two Gauss points. After the rise it is exact for any step, so the rest may be one; "stopped" has no such
  help.
- scipy: `solve_ivp` (RK23, RK45, DOP853, LSODA) with a terminal event, and the older `ode` (dopri5, dop853), whose
  loop is compiled, with a look at every step; that one is the faster by far. Slipping and locked are systems of their
  own.
- pathsim: one ODE block with a zero-crossing event, adaptive methods of three orders and RK4 with fixed steps.
- MuJoCo: dry friction of a fixed tendon over two hinges, as hard as the solver takes it; Euler, implicitfast and RK4;
  `rollout` (steps in C) as soon as the capacity is constant, with a longer step there; the mean capacity over each
  step.
- Drake: a system of one's own in Python with a witness function; and built-in systems in C++ for rise, slip and lock,
  stopped by a monitor on the steps, which is the faster by far.""",
}


def _table(head: list[str], rows: list[list[str]]) -> list[str]:
    return [
        "| " + " | ".join(head) + " |",
        "| " + " | ".join("---" for _ in head) + " |",
        *("| " + " | ".join(row) + " |" for row in rows),
    ]


def machine_line(machine: dict) -> str:
    """Return processor and versions in one line."""
    versions = ", ".join(f"{name} {machine[name]}" for name in ("python", "numpy", "numba", "llvmlite", "scipy"))
    return (
        f"{machine['cpu']}, {machine['cores']} cores, {machine['system']}, {versions}; load of the machine at the "
        f"beginning {machine['load']:.1f}"
    )


def _kernel(result: dict) -> list[str]:
    phases = ("all", "standing", "running", "shifting")
    return _table(
        ["variant", "times real time", *(f"ns per step, {p}" for p in phases)],
        [
            [name, f"{row['real_time_factor']:.0f}", *(f"{row['ns_per_step'][p]:.0f}" for p in phases)]
            for name, row in result.items()
        ],
    )


def _rigs(result: dict) -> list[str]:
    return _table(
        ["rig", "step us", "simulated s", "times real time"],
        [
            [name, f"{row['step_s'] * 1e6:g}", f"{row['simulated_s']:.1f}", f"{row['real_time_factor']:.0f}"]
            for name, row in result.items()
        ],
    )


def _demo(result: dict) -> list[str]:
    return _table(
        ["program", "wall s", "processor s"],
        [[name, f"{spent['wall']:.2f}", f"{spent['cpu']:.2f}"] for name, spent in result.items()],
    )


def _graph(result: dict | str) -> list[str]:
    if isinstance(result, str):
        return [f"Not measured: {result}."]
    factors = ", ".join(f"{factor:.1f}" for factor in result["real_time_factors"])
    return [f"{result['best']:.1f} times real time (of {factors})."]


def _controllers(result: list[dict]) -> list[str]:
    return _table(
        ["plug", "us per step", "99 % below"],
        [
            [row["plug"], *([row["missing"], ""] if row["missing"] else [f"{row['median_us']:.1f}", f"{row['p99_us']:.1f}"])]
            for row in result
        ],
    )


def _scaling(result: dict) -> list[str]:
    parts = [
        _table(
            ["kernel, simulated s", "ms per simulated s", "fastest second ms", "memory MB"],
            [
                [
                    f"{r['from_s']} to {r['to_s']}",
                    f"{r['ms_per_simulated_s']:.2f}",
                    f"{r['fastest_ms']:.2f}",
                    f"{r['memory_mb']:.1f}",
                ]
                for r in result["length"]
            ],
        ),
        _table(
            ["into a bag, simulated s", "ms per simulated s", "memory MB", "bag MB per simulated s"],
            [
                [
                    f"{r['from_s']} to {r['to_s']}",
                    f"{r['ms_per_simulated_s']:.1f}",
                    f"{r['memory_mb']:.1f}",
                    f"{r['bag_mb_per_simulated_s']:.2f}",
                ]
                for r in result["streaming"]
            ],
        ),
        _table(
            ["clutches", "ns per step", "times real time"],
            [[str(r["clutches"]), f"{r['ns_per_step']:.0f}", f"{r['real_time_factor']:.0f}"] for r in result["clutches"]],
        ),
        _table(
            ["sweep, processes", "members per s (wall)", "the parent's own share, processor s"],
            [[str(r["processes"]), f"{r['members_per_s']:.1f}", f"{r['parent_cpu_s']:.2f}"] for r in result["sweep"]],
        ),
    ]
    one, two = (r["members_per_s"] for r in result["sweep"])
    return [line for part in parts for line in [*part, ""]] + [
        f"Two processes do {two / one:.2f} times what one does. Most memory of the measuring process: "
        f"{result['most_memory_mb']:.0f} MB."
    ]


def _peers(result: dict) -> list[str]:
    out = []
    for way in ("free", "stopped"):
        tools = {name: tool for name, tool in result["tools"].items() if way in tool["best"]}
        head = [way, *(f"times real time at {error:g}, with" for error in result["errors"])]
        rows = [
            [
                f"{name} {tool['version']}".strip(),
                *(
                    f"{found['real_time_factor']:,.0f}, {found['setting']}" if found else "not reached"
                    for found in tool["best"][way]
                ),
            ]
            for name, tool in tools.items()
        ]
        out += [*_table(head, rows), ""]
    best = result["tools"]["this project"]["best"]["free"]
    others = {name: tool["best"]["free"] for name, tool in result["tools"].items() if name != "this project"}
    for error, ours, *theirs in zip(result["errors"], best, *others.values()):
        ratios = [
            f"{ours['real_time_factor'] / found['real_time_factor']:.1f} x {name}"
            for name, found in zip(others, theirs)
            if ours and found
        ]
        if ratios:
            out.append(f"- at {error:g}: {', '.join(ratios)}")
    out += [f"- not installed, so not compared: {name}" for name in result["missing"]]
    return out


_FORMATS = {
    "kernel": _kernel,
    "rigs": _rigs,
    "demo": _demo,
    "graph": _graph,
    "controllers": _controllers,
    "scaling": _scaling,
    "peers": _peers,
}


def lines(part: str, result: dict | list[dict] | str) -> list[str]:
    """Return the lines of one part as Markdown, which is readable as plain text too."""
    return _FORMATS[part](result)


def document(results: dict) -> str:
    """Return docs/reference/performance.md for the results of one run of all parts."""
    parts = [_INTRO.format(machine=machine_line(results["machine"]))]
    for part, title in TITLES.items():
        prose = _PROSE[part]
        if part == "peers":
            prose = prose.format(lock=results[part]["exact_lock_s"])
        parts.append("\n".join([f"## {title}", "", prose, "", *lines(part, results[part])]).rstrip() + "\n")
    return "\n".join(parts)


def write_document(results: dict) -> Path:
    """Write docs/reference/performance.md of the checkout and return its path; RigError when there is no checkout."""
    docs = Path(__file__).resolve().parents[3] / "docs"
    if not (docs / "background" / "physics.md").is_file():
        raise RigError(f"there is no docs/ of a checkout at {docs}; --json writes the numbers from anywhere")
    path = docs / "reference" / "performance.md"
    path.write_text(document(results), encoding="utf-8")
    return path
