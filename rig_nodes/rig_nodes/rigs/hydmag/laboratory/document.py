# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The result of a validation for people: the terminal's summary, and the page of the site with its table of rows.

Used by the verb ``validate`` and by docs/made_pages.py. Explanations of misses are written by hand in
explanations.yaml (id -> text).
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

from rig_nodes.base import RigError, brief, load_yaml, where_of
from rig_nodes.studies import INSIDE, NOT_COMPARED, OUTSIDE, Row, Target, accepted, counts, laboratory, listed, of_rig, verdict_line

from .score import HOLD, balanced_accuracy
from .targets import load_targets

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

EXPLANATIONS_FILE = Path(__file__).parents[1] / "explanations.yaml"
SECTIONS = {
    "7.1": "7.1: instruments, definitions, shape of the rising pressure",
    "7.2": "7.2: response of the valves",
    "7.3.1": "7.3.1: coast-down",
    "7.3.2": "7.3.2: valve profiles",
    "7.3.3": "7.3.3: delays",
    "7.4": "7.4: single records",
    "7.4.1": "7.4.1: I to II over load and speed",
    "7.4.2": "7.4.2: II to I over load and speed",
    "7.5": "7.5: conclusions of the gearbox tests",
    "8": "Chapter 8: plate clutches",
    "9": "Chapter 9: the thesis's own simulation",
    "10": "Chapter 10: conclusions",
}
HEAD = """# Validation

The numbers are those of one `./rig validate --json docs/reference/validation.json`; {download}`all rows as CSV <validation.csv>`.

## How

`./rig validate` repeats the measuring programme of thesis 7.1.3 on the rig: every series of every procedure, each as
often as the laboratory did it (twice, with other noise of the transducers), evaluates the logger's channels by the
definitions of 7.1.5 ([analysis.md](../background/analysis.md)), averages the repeats, and compares the result with each row of
[targets.yaml](../../rig_nodes/rig_nodes/rigs/hydmag/targets.yaml). What a row accepts was set from
the text before the first calibration, and once more before the next where the text leaves no other reading
(rig_nodes/CHANGELOG.rst names these rows); nothing is added to it, and every single value must lie inside (a trend:
every line, a curve: every shift), unless the row is about a mean, a spread or most values. Where several values are
judged, the worst one is shown with its place.

Only two bases are facts of their own: **calibrated** rows may be fitted, **predicted** ones must follow from the
model. **Implied** rows follow from such a row or repeat one, rows of **consistency** are met by construction,
because the rig was given their content; both are judged, and counted apart. Rows for **information** cannot be
judged; their value is shown where there is one. A row is *not compared* when something that it needs is missing. Not all predicted
rows are untouched. The form of the friction law, the omission of Annex D's losses by torque and some assumptions were decided with
them in view (that the plates stick in their splines when clamp force is taken off; that chapter 9's output speed is bounded; the
drive's tuning); see "Calibration" in [physics.md](../background/physics.md).

The rows of chapter 8 are measured on the clutch bench by its own procedure ([benches.md](../how_to/benches.md)). Its
packs follow the thesis's model with stated friction ([friction_models.md](../background/friction_models.md)): k_kor
against that model comes back as 1 within the instruments' errors, so those rows are consistency. The plant's springs
and cylinder are the printed polynomials themselves. Rows that compare chapter 9's simulation with a measurement take
the rig `chapter9` for the simulation and this rig for the measurement, because the measured figures are lost.

`./rig validate --pictures FOLDER` draws the figures of chapters 7 to 9 that the text lets one redraw.
"""


SIDE_BY_SIDE = """## Chapter 9, side by side

Thesis 9.2 compares four curves of its own simulation with the measurement. Both curves are lost. The rig `chapter9`
is that simulation rebuilt from Annex D and 9.1, and stands for it; of the measurement there remain the statements of
the text, which give an interval for each point (a highest distance from the simulation, a range of all measured
values), in two places one value or the other. A distance is the mean over the points of the distance from a
measurement anywhere in its interval; in brackets from the least to the most that it can be. A point is open when it
depends on where in its interval the measurement was. Points without a statement are left out.
"""


def load_explanations(path: str | Path | None = None) -> dict[str, str]:
    """Return the explanations of rows that the rig misses, by the id of the row.

    Parameters
    ----------
    path : str or Path or None
        The file; None for the one of the package.

    Returns
    -------
    dict of str to str
        Id of a row -> why the rig misses it.

    Raises
    ------
    RigError
        With file and line, for an unknown row or an explanation without words.
    """
    path = EXPLANATIONS_FILE if path is None else Path(path)
    node = load_yaml(path) or {}
    known = {target.id for target in load_targets()}
    if not isinstance(node, dict):
        raise RigError(f"{path}: explanations must be a map of row ids and texts, found {brief(node)}")
    for name, text in node.items():
        if name not in known:
            raise RigError(f"{where_of(path, node, name)}: '{name}' is no row of targets.yaml")
        if not (isinstance(text, str) and text.strip()):
            raise RigError(f"{where_of(path, node, name)}: {name} must be explained in words, found {brief(text)}")
    return {str(name): " ".join(text.split()) for name, text in node.items()}


def of_holds(rows: list[Row]) -> str:
    """Return how the predicted rows part into those on the hold phase and all others, and its balanced accuracy."""
    predicted = [row for row in rows if row.basis == "predicted"]
    held = [row for row in predicted if row.target.quantity == HOLD]
    accuracy = balanced_accuracy(rows)
    if accuracy is None:
        return ""
    right, inside = (sum(row.verdict == INSIDE for row in some) for some in (held, predicted))
    return (
        f" (hold phase {right} of {len(held)}, balanced accuracy {accuracy:.2f} where always hold has 0.50; "
        f"all else {inside - right} of {len(predicted) - len(held)})"
    )


def rows_of(stored: list[dict]) -> list[Row]:
    """Return the rows that ``rig validate --json`` has written.

    Parameters
    ----------
    stored : list of dict
        Its ``rows``.

    Returns
    -------
    list of Row
        The same rows, without their single values.

    Raises
    ------
    RigError
        When one of them is no row of targets.yaml any more.
    """
    targets = {target.id: target for target in load_targets()}
    if lost := [row["id"] for row in stored if row["id"] not in targets]:
        raise RigError(f"the stored validation has rows that targets.yaml does not have: {', '.join(lost)}; run it again")
    keys = ("verdict", "value", "low", "high", "judged_by", "reason", "count", "inside", "at")
    return [Row(targets[row["id"]], **{key: row[key] for key in keys}, place=_place(row["place"])) for row in stored]


def _place(stored: dict) -> dict:
    return {key: tuple(value) if isinstance(value, list) else value for key, value in stored.items()}


def section(target: Target) -> str:
    """Return the key of SECTIONS for a row, from the first place in the thesis that the row names."""
    chapter = re.search(r"chapter (\d+)|Annex (D)", target.where)
    found = re.search(r"(?<![\d.])(7(?:\.\d)+|[89](?:\.\d)*)", target.where)
    if found is None:
        number_of = "9" if chapter is not None and chapter[2] else chapter[1] if chapter is not None else ""
        return number_of if number_of in SECTIONS else "7.1"
    if found[1][0] != "7":
        return found[1][0]
    return next(key for key in (found[1][:5], found[1][:3]) if key in SECTIONS)


def document(rows: list[Row], found: dict, explanations: dict[str, str], rig: str) -> str:
    """Return the page on the validation as text.

    Parameters
    ----------
    rows : list of Row
        The judged rows.
    found : dict
        Their summary, from :func:`.programme.summary`.
    explanations : dict of str to str
        Explanations of misses, from :func:`load_explanations`.
    rig : str
        Name of the rig.

    Returns
    -------
    str
        The page in markdown.
    """
    parts = [
        HEAD,
        _summary(rows, found, rig),
        _hold(rows, found),
        _side_by_side(rows, found),
        _misses(rows, explanations),
        _apart(rows),
    ]
    for key, title in SECTIONS.items():
        of_section = [row for row in rows if section(row.target) == key]
        if of_section:
            parts.append(
                f"## {title}\n\n"
                + _table(
                    ("row", "what is claimed", "laboratory", "rig", "verdict"),
                    [
                        (
                            f"`{row.target.id}`",
                            f"{row.target.text} ({row.target.where})",
                            laboratory(row),
                            of_rig(row),
                            _verdict(row),
                        )
                        for row in of_section
                    ],
                )
            )
    return "\n".join(parts)


def _verdict(row: Row) -> str:
    if row.basis == "information":
        return "information"
    if row.verdict == NOT_COMPARED:
        return f"not compared: {row.reason}"
    word = f"**{OUTSIDE}**" if row.verdict == OUTSIDE else INSIDE
    return f"{word}, {row.basis}"


def _table(head: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    def line(cells: Iterable[object]) -> str:
        return "| " + " | ".join(str(cell).replace("|", "\\|") for cell in cells) + " |"

    return "\n".join([line(head), "|" + " --- |" * len(head), *map(line, rows), ""])


def _of(count: dict[str, int], who: str) -> str:
    return f"{count[who]} of {count['rows']}" if count["rows"] else "-"


def _summary(rows: list[Row], found: dict, rig: str) -> str:
    bases = [basis for basis, count in counts(rows).items() if basis != "information" and count["rows"]]
    table = _table(
        ("basis", "rows", "inside", "outside", "not compared"),
        [(basis, *(found[basis][key] for key in ("rows", INSIDE, OUTSIDE, NOT_COMPARED))) for basis in bases],
    )
    groups = [
        (
            "hold phase" if name == HOLD else name,
            group["predictor"],
            *(_of(group[basis], who) for basis in ("predicted", "calibrated") for who in ("rig", "trivial")),
        )
        for name, group in found["groups"].items()
    ]
    total = [
        f"{sum(group[basis][who] for group in found['groups'].values())} of {found[basis]['rows']}"
        for basis in ("predicted", "calibrated")
        for who in ("rig", "trivial")
    ]
    return (
        f"## Summary\n\nRig `{rig}`: {verdict_line(rows, of_holds(rows))}.\n\n{table}"
        "\nEach group is compared with a trivial predictor, which is judged in the same way. Its inputs are the printed "
        "numbers,\nso that it meets a row that alone prints a number; the rig does not have them.\n\n"
        + _table(
            ("group", "trivial predictor", "predicted: rig", "trivial", "calibrated: rig", "trivial"),
            [*groups, ("all", "", *total)],
        )
    )


def _hold(rows: list[Row], score: dict) -> str:
    """Return the confusion matrix of the hold phase, and the pairs of series that contradict each other."""
    held = {row.target.id: row for row in rows if row.target.quantity == "hold" and row.target.expected}
    if not held:
        return ""
    lines = []
    for valve in ("ZR-P1", "ZR-P2", "both"):
        of_valve = [row for row in held.values() if valve in ("both", *listed(row.target.conditions["valve"]))]
        for expected in ("hold", "no hold"):
            found = [row.value for row in of_valve if row.target.expected == expected]
            lines.append((valve, expected, *(found.count(value) for value in ("hold", "no hold", None))))
    pairs = []
    for name, row in held.items():
        for other, sentence in row.target.conflicts.items():
            if other in held and name < other:
                seen = "; ".join(f"{n}: {held[n].value or 'undecided'}, {held[n].verdict}" for n in (name, other))
                pairs.append((f"`{name}`, `{other}`", sentence, seen))
    return (
        "## The hold phase of the 47 profile series\n\n"
        + _accuracy(score)
        + _table(("valve", "laboratory", "rig: hold", "rig: no hold", "rig: undecided"), lines)
        + "\nPairs of series that contradict each other, or nearly: hardly any rig meets both.\n\n"
        + _table(("rows", "why", "rig"), pairs)
    )


def _accuracy(score: dict) -> str:
    if score["hold_balanced_accuracy"] is None:
        return ""
    return (
        f"Balanced accuracy (the mean of the shares of series with and without a hold phase that the rig gets right): "
        f"{score['hold_balanced_accuracy']:.3f}\nwith series 21 left aside, which contradicts its neighbours, and "
        f"{score['hold_balanced_accuracy_all_series']:.3f} with it. A predictor that always gives hold has "
        f"{score['hold_balanced_accuracy_always_hold']:.3f}.\n\n"
    )


def _side_by_side(rows: list[Row], found: dict) -> str:
    """Return the section in which the thesis's own simulation and the rig stand beside the measurement."""
    if not found["chapter9"]:
        return ""

    def distances(side: dict, unit: str) -> str:
        mean, least, most = (
            side[key] * factor for key in ("distance", "at_least", "at_most") for factor in (1e3 if unit == "s" else 1.0,)
        )
        return f"{mean:.1f} ({least:.1f} to {most:.1f}) {'ms' if unit == 's' else unit}"

    compared = []
    for one in found["chapter9"].values():
        at = [point["closer"] for point in one["points"]]
        points = f"{len(at)}: {at.count('rig')}, {at.count('thesis')}, {at.count('open')}"
        row_ids = ", ".join(f"`{row}`" for row in one["from"])
        compared.append(
            (
                one["title"],
                row_ids,
                distances(one["thesis"], one["unit"]),
                distances(one["rig"], one["unit"]),
                points,
                f"**{one['closer']}**",
            )
        )
    closer = sum(one["closer"] == "rig" for one in found["chapter9"].values())
    rebuilt = [row for row in rows if row.target.procedure == "chapter9" and row.basis == "consistency"]
    stated = [
        row
        for row in rows
        if row.target.procedure == "chapter9"
        and row.basis == "information"
        and row.target.quantity in ("setting", "step_s", "coast_down_torque_nm")
    ]
    return (
        f"{SIDE_BY_SIDE}\nThe rig is closer to the measurement in {closer} of {len(compared)} comparisons.\n\n"
        + _table(
            (
                "comparison",
                "measured, by",
                "distance of the thesis's simulation",
                "of this rig",
                "points: rig, thesis closer, open",
                "closer",
            ),
            compared,
        )
        + "\nThe thesis's simulation as rebuilt. Its program and values as printed:\n\n"
        + _table(
            ("row", "what is printed", "number"),
            [(f"`{row.target.id}`", f"{row.target.text} ({row.target.where})", accepted(row)) for row in stated],
        )
        + "\nand its results as stated in the text:\n\n"
        + _table(
            ("row", "what is claimed", "laboratory", "rig `chapter9`", "verdict"),
            [
                (f"`{row.target.id}`", f"{row.target.text} ({row.target.where})", laboratory(row), of_rig(row), row.verdict)
                for row in rebuilt
            ],
        )
    )


def _sources(target: Target) -> str:
    """Return the rows from which an implied row follows, and why, each reason once."""
    rows_of: dict[str, list[str]] = {}
    for other, why in target.implied_by.items():
        rows_of.setdefault(why, []).append(f"`{other}`")
    return " ".join(f"{', '.join(others)}: {why}" for why, others in rows_of.items())


def _apart(rows: list[Row]) -> str:
    """Return the rows that are no facts of their own, with what they follow from."""
    found = [row for row in rows if row.basis in ("implied", "consistency")]
    if not found:
        return ""
    return "## Rows that are no facts of their own\n\n" + _table(
        ("row", "basis", "because", "verdict"),
        [(f"`{row.target.id}`", row.basis, row.target.consistent_with or _sources(row.target), row.verdict) for row in found],
    )


def _misses(rows: list[Row], explanations: dict[str, str]) -> str:
    missed = [row for row in rows if row.verdict == OUTSIDE]
    if not missed:
        return "## Misses\n\nNone.\n"
    ids = {row.target.id for row in rows if row.verdict == INSIDE}
    cells = []
    for row in missed:
        text = explanations.get(row.target.id, "unexplained")
        pulls = [f"`{other}`: {why}" for other, why in row.target.conflicts.items() if other in ids]
        text += f" Pulls against what is inside: {' '.join(pulls)}" if pulls else ""
        cells.append((f"`{row.target.id}`", row.basis, accepted(row), of_rig(row), text))
    unexplained = sum(row.target.id not in explanations for row in missed)
    return f"## Misses\n\n{len(missed)} rows are outside, {unexplained} of them unexplained.\n\n" + _table(
        ("row", "basis", "laboratory", "rig", "explanation"), cells
    )
