# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The numbers of ``rig bench`` as tables, on the terminal and in docs/reference/performance.md.

The text of docs/reference/performance.md is in this module; its numbers come from one run of ``rig bench --write-docs``.
"""

from __future__ import annotations

from pathlib import Path

from ...base import RigError

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

Made by `./rig bench --write-docs`, which overwrites changes by hand. All numbers are from one run on one machine, so that
they can be compared with each other:

{machine}

Times are processor times, the shortest of several, unless "wall" is stated. `./rig bench PART` measures one part;
`--json` prints the results for programs. Aims: the kernel with 10 kHz logging runs at least 400 times as fast as real
time; `simulate demo` takes under 1.5 s with everything compiled and under 20 s in its first run; the bare problem is
solved at least 5000 times as fast as real time, with an error of at most 1e-3 of the lock-up time.
"""

_PROSE = {
    "kernel": """\
A run of 12 s with an upshift and a downshift at 1500 rpm under load. "Standing": motor off; "running": in gear;
"shifting": the 600 ms after an order. A row of the logger is computed in every step in all variants, because the
transducers' low passes and counters depend on the step before; "logging" keeps all rows in memory, as `procedure`,
`sweep` and `validate` do.""",
    "rigs": """\
Each installed rig runs its demo, or else the first sequence of its folder. The run is recorded in memory with the rows of
the 10 kHz logger, and its time includes the sequencer.""",
    "demo": """\
Each program is timed from the call in the shell to its end, with bag and report written: 13.3 s of simulated time,
72,000 messages. In the first run everything is compiled, by two processes.""",
    "graph": """\
`./rig run demo --speed max`: all nodes, every topic published on DDS and recorded; `speed_factor` of its report.""",
    "controllers": """\
Wall time of one step of the reference controller through each plug ([controllers.md](../how_to/controllers.md)).""",
    "scaling": """\
The first table has one run in gear in parts of equal length: neither the cost nor the memory may grow with the length of a
run. A value that decays exponentially (a coil's current, a line's pressure) is set to zero below 1e-200, because denormal
numbers slowed a run down by a fifth after ten seconds. With a bag, the index of the chunks stays in memory until the file
is closed, 4 KB per simulated second. Clutches: a row of bodies with a clutch between each two neighbours, which all close
at the same time, at a step of 100 us. The members of the sweep are whole runs of `demo` with metrics, on processes in
which everything is compiled; the time includes the table and is the best of three sweeps for each number of processes.""",
    "peers": """\
Two inertias (0.7 kg m2 at 1500 rpm, 0.127 kg m2 at rest) and a clutch whose capacity rises to 264 Nm in 45 ms run for
2 s; 60 Nm drive the first, 40 Nm brake the second. Exact lock-up: {lock:.9f} s. Every tool is measured with many settings;
the tables show the cheapest setting whose error of the lock-up time is at most that in the head of the column, so that
each tool is shown at its best. Time to build models, diagrams and compiled code is not counted; time to reset the state
is. "Free": the run is one call; "stopped": it is 2000 calls of 1 ms, as a controller needs it. Every tool is given that
the rise ends at 45 ms and that the capacity is constant after it.

- This project: the general driveline finds the lock-up as a root inside the step, and takes the capacity in each step as
  the straight line through its values at two Gauss points. After the rise the result is exact for any step, so that
  "free" takes the remaining time in one step; "stopped" cannot.
- scipy: `solve_ivp` (RK23, RK45, DOP853, LSODA) with a terminal event, and the older `ode` (dopri5, dop853), whose
  loop is compiled, with a check after every step; `ode` is by far the faster. The slipping and the locked clutch are
  separate systems.
- pathsim: one ODE block with a zero-crossing event, adaptive methods of three orders and RK4 with fixed steps.
- MuJoCo: dry friction of a fixed tendon over two hinges, as stiff as the solver allows; Euler, implicitfast and RK4;
  `rollout` (steps in C), with a longer step, as soon as the capacity is constant. The capacity of a step is its mean
  over the step.
- Drake: a system written in Python with a witness function; and built-in systems in C++ for rise, slip and lock, which
  a monitor of the steps stops. The second is by far the faster.""",
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
    docs = Path(__file__).resolve().parents[4] / "docs"
    if not (docs / "background" / "physics.md").is_file():
        raise RigError(f"there is no docs/ of a checkout at {docs}; --json writes the numbers from anywhere")
    path = docs / "reference" / "performance.md"
    path.write_text(document(results), encoding="utf-8")
    return path
