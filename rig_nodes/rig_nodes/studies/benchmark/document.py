# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The numbers of ``rig bench`` as tables on the terminal; the verb ``bench`` prints them."""

from __future__ import annotations

TITLES = {
    "kernel": "The kernel, one core",
    "rigs": "Every rig, one core",
    "demo": "What a user waits for",
    "graph": "The node graph in lockstep",
    "controllers": "A step of a controller",
    "scaling": "How the cost grows",
    "peers": "The bare problem, against other tools",
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
