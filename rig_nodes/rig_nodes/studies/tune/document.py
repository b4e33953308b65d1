# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The tables of docs/how_to/tune.md: what a tuning found, and its results on other rigs and operating points.

Used by the verb ``tune``; the rest of the page is written by hand.
"""

from __future__ import annotations

from pathlib import Path

from ...base import RigError, atomic_write
from .run import CHOICES

BEGIN, END = "<!-- made by ./rig tune --write-docs; a change by hand is lost -->", "<!-- up to here -->"


def tuning_page() -> Path:
    """Return the path of docs/how_to/tune.md in the checkout.

    Raises
    ------
    RigError
        When the page is missing or has no place for the tables.
    """
    path = Path(__file__).resolve().parents[4] / "docs" / "how_to" / "tune.md"
    if not path.is_file():
        raise RigError(f"there is no {path}; --write-docs works in a checkout only")
    text = path.read_text(encoding="utf-8")
    if not 0 <= text.find(BEGIN) < text.find(END):
        raise RigError(f"{path}: the lines '{BEGIN}' and '{END}' are not there, between which the tables stand")
    return path


def write_tuning(path: Path, summary: dict, seed: int) -> None:
    """Write the tables into the page, in place of the earlier ones.

    Parameters
    ----------
    path : Path
        The page.
    summary : dict
        Summary of a tuning, as studies.tune.run.tune returns it.
    seed : int
        Seed of the tuning.
    """
    text = path.read_text(encoding="utf-8")
    before, after = text[: text.index(BEGIN)], text[text.index(END) :]
    atomic_write(path, f"{before}{BEGIN}\n\n{tables(summary, seed)}\n\n{after}")


def tables(summary: dict, seed: int) -> str:
    """Return a tuning's summary with its seed as tables in markdown."""
    blocks = [_search(summary, seed), _settings(summary), _verdicts(summary)]
    if "largest_load" in summary:
        blocks.append(_largest_load(summary["largest_load"]))
    return "\n\n".join(blocks)


def _search(summary: dict, seed: int) -> str:
    lines = [
        f"`./rig tune --write-docs --seed {seed}`; the search took {summary['search_cpu_seconds']:.0f} s of CPU time.",
        "",
        "| search | settings | shifts tried | on | front | of the front better in every shift elsewhere |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    for name, one in summary["searches"].items():
        judged = summary["front"].get(name)
        elsewhere = "" if judged is None else f"{judged['dominating']} of {judged['settings']} judged"
        front = "" if one["front"] is None else one["front"]
        lines.append(f"| {name} | {one['settings']} | {one['shifts']} | {one['shifts_like']} | {front} | {elsewhere} |")
    return "\n".join(lines)


def _settings(summary: dict) -> str:
    lines = [
        "What the box is set to (ms and mA, P1 to P3 of the engaging valve, P4 to P6 of the releasing one):",
        "",
        "| controller | shift | P1 | P2 | P3 at | P4 | P5 | P6 at | delay |",
        "| --- " * 9 + "|",
    ]
    for name in CHOICES:
        for way, of in summary["chosen"].items():
            if name in of:
                row = of[name]
                t2, t5 = row["P1.time"] + row["P2.gap"], row["P4.time"] + row["P5.gap"]
                lines.append(
                    f"| `{name}` | {way} | {row['P1.time']}, {row['P1.current']} | {t2}, {row['P2.current']} | "
                    f"{t2 + row['P3.gap']} | {row['P4.time']}, {row['P4.current']} | {t5}, {row['P5.current']} | "
                    f"{t5 + row['P6.gap']} | {row['delay']} |"
                )
    return "\n".join(lines)


def _verdicts(summary: dict) -> str:
    lines = [
        "Fresh rigs and operating points, several draws; mean (worst) of the shares of what the compared settings give:",
        "",
        "| controller | shift | draw | peak | its rise | t_c | t_dt | highest peak, compared | better in | better on | dominates |",
        "| --- " * 11 + "|",
    ]
    for name in CHOICES:
        for way in summary["chosen"]:
            for number, verdict in enumerate(summary["verdicts"], 1):
                one = verdict[name][way]
                shares = " | ".join(_share(one["shares"], key) for key in ("peak", "rise", "t_c", "t_dt"))
                lines.append(
                    f"| `{name}` | {way} | {number} | {shares} | {one['highest_peak_nm']:.0f} Nm, "
                    f"{one['compared_highest_peak_nm']:.0f} Nm | {one['better']} of {one['pairs']} shifts | "
                    f"{one['better_rigs']} of {one['rigs']} rigs | {'yes' if one['dominates'] else 'no'} |"
                )
    out = sum(verdict[CHOICES[0]][way]["left_out"] for verdict in summary["verdicts"] for way in summary["chosen"])
    lines += [
        "",
        f"Left out: {out} shift{'s' if out != 1 else ''}, which the compared settings do not make on the sampled rig or which it "
        "does not hold.",
    ]
    return "\n".join(lines)


def _share(shares: dict, name: str) -> str:
    return f"{shares[name]['mean']:.3f} ({shares[name]['worst']:.3f})" if name in shares else "-"


def _largest_load(found: dict) -> str:
    lines = [
        f"The largest load of {found['way']}, on the rig itself ({found['tried']} settings sought for the least peak "
        "alone); the last three columns are the loads up to which the engine's torque is kept:",
        "",
        "| speed | load | torque before the shift | least peak found | compared | engine | gear alone | least peak | compared |",
        "| --- " * 9 + "|",
    ]
    for one in found["speeds"]:
        within = one["load_within_engine_nm"]
        lines.append(
            f"| {one['input_speed_rpm']:.0f} rpm | {one['load_nm']:.0f} Nm | {one['input_torque_before_nm']:.0f} Nm | "
            f"{one['least_peak_nm']:.0f} Nm | {one['compared_peak_nm']:.0f} Nm | {one['engine_nm']:.0f} Nm | "
            f"{within['before_the_shift']:.0f} Nm | {within['least_peak']:.0f} Nm | {within['compared']:.0f} Nm |"
        )
    return "\n".join(lines)
