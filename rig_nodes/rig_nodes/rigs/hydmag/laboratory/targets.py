# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The laboratory's printed results, from targets.yaml: one frozen :class:`Target` for each number or trend.

Used by the modules that compare the rig with the laboratory; this one does not depend on how a procedure is run. The head
of targets.yaml describes each key and kind.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

from rig_nodes.base import SI, UNITS, RigError, brief, check_keys, load_yaml, quantity, where_of, with_article
from rig_nodes.studies import Span, Target

from .conditions import CONDITIONS

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Mapping

    from rig_nodes.base import Map

TARGETS_FILE = Path(__file__).parents[1] / "targets.yaml"

ROLES = ("calibrate", "predict", "implied", "consistency", "information")
INDEPENDENT = ("calibrate", "predict")  # roles of rows that are facts of their own
SIGNS = ("grows", "falls", "flat")
SHAPES = ("linear", "quadratic")
STATISTICS = ("mean", "lowest", "highest", "spread", "spread_share")
# kind -> (keys it must have, keys it may have)
KINDS = {
    "value": (("printed", "low", "high", "tolerance"), ()),
    "range": (("printed", "low", "high", "tolerance"), ()),
    "upper": (("high", "tolerance"), ("printed",)),
    "lower": (("low", "tolerance"), ("printed",)),
    "difference": (("of", "to", "tolerance"), ("printed", "low", "high", "absolute")),
    "ratio": (("of", "to", "tolerance"), ("printed", "low", "high")),
    "trend": (("sign", "over", "tolerance"), ()),
    "fit": (("shape", "over", "low", "tolerance"), ("printed",)),
    "curve": (("variable", "variable_unit", "unit", "pieces", "tolerance"), ()),
    "classification": (("classes", "expected"), ()),
}
REQUIRED = ("id", "text", "where", "kind", "quantity", "procedure", "role", "conditions", "why")
OPTIONAL = ("statistic", "across", "fixed", "inside", "conflicts", "note", "implied_by", "consistent_with")
PARTS = ("all", "most")  # of a row's single values that must be inside


def load_targets(path: str | Path | None = None) -> list[Target]:
    """Read the targets of a file.

    Parameters
    ----------
    path : str or Path or None
        The file; None for the one that ships with the package.

    Returns
    -------
    list of Target
        The targets in the file's order.

    Raises
    ------
    RigError
        With file and line, for everything that is not as the file's head describes.
    """
    path = TARGETS_FILE if path is None else Path(path)
    node = load_yaml(path)
    keys = ("procedures", "quantities", "targets")
    check_keys(path, node, keys, keys, "the targets")
    procedures = _procedures(path, node)
    quantities = _quantities(path, node)
    rows = node["targets"]
    if not (isinstance(rows, list) and rows):
        raise RigError(f"{where_of(path, node, 'targets')}: targets must be a list of rows, found {brief(rows)}")
    targets: dict[str, Target] = {}
    for row in rows:
        target = _Row(path, row, procedures, quantities).target()
        if target.id in targets:
            raise RigError(
                f"{path}:{target.line}: the id '{target.id}' is taken by line {targets[target.id].line}; each id may be used once"
            )
        targets[target.id] = target
    _mirror_conflicts(path, rows, targets)
    _check_sources(path, rows, targets)
    return list(targets.values())


def _procedures(path: str | Path, node: Map) -> tuple[str, ...]:
    procedures = node["procedures"]
    check_keys(path, procedures, procedures, (), "procedures")
    for name, meaning in procedures.items():
        if not (isinstance(meaning, str) and meaning.strip()):
            raise RigError(f"{where_of(path, procedures, name)}: procedures.{name} must be a description, found {brief(meaning)}")
    return tuple(procedures)


def _quantities(path: str | Path, node: Map) -> dict[str, str]:
    """Return the dimension of each quantity, by name."""
    quantities = node["quantities"]
    check_keys(path, quantities, quantities, (), "quantities")
    for name, entry in quantities.items():
        if not (isinstance(entry, list) and len(entry) == 2 and entry[0] in SI and isinstance(entry[1], str)):
            raise RigError(
                f"{where_of(path, quantities, name)}: quantities.{name} must be [dimension, "
                f'"meaning"] with one of {", ".join(sorted(SI))}, found {brief(entry)}'
            )
    return {name: str(entry[0]) for name, entry in quantities.items()}


def _mirror_conflicts(path: str | Path, rows: Iterable[Map], targets: dict[str, Target]) -> None:
    """Note at both rows a conflict that is written at one of them."""
    for row in rows:
        here = targets[str(row["id"])]
        for other, sentence in (row.get("conflicts") or {}).items():
            where = f"{where_of(path, row['conflicts'], other)}: {here.id}.conflicts"
            if other not in targets:
                raise RigError(f"{where} names '{other}', which is no row; expected the id of another row")
            if other == here.id:
                raise RigError(f"{where} names the row itself; expected the id of another row")
            if other in here.conflicts:
                raise RigError(f"{where} names '{other}', which already names this row; name a conflict at one of the two")
            here.conflicts[other] = targets[other].conflicts[here.id] = " ".join(sentence.split())


def _check_sources(path: str | Path, rows: Iterable[Map], targets: dict[str, Target]) -> None:
    """Refuse an implied row whose source is no independent row, so that nothing follows from itself or from nothing."""
    for row in rows:
        for other in row.get("implied_by") or ():
            if other not in targets or targets[other].role not in INDEPENDENT:
                found = f"has the role {targets[other].role}" if other in targets else "is no row"
                raise RigError(
                    f"{where_of(path, row['implied_by'], other)}: {row['id']}.implied_by names '{other}', which {found}; "
                    f"expected the id of a row with the role {' or '.join(INDEPENDENT)}"
                )


class _Row:
    """One row while it is read; every refusal names file, line and id."""

    def __init__(self, path: str | Path, node: Any, procedures: Collection[str], quantities: Mapping[str, str]) -> None:
        self.path, self.node = path, node
        every = {key for musts, mays in KINDS.values() for key in (*musts, *mays)}
        check_keys(path, node, [*REQUIRED, *OPTIONAL, *sorted(every)], REQUIRED, "a target")
        self.id = node["id"]
        for key in ("id", "text", "where", "why", *(k for k in ("note", "consistent_with") if k in node)):
            if not (isinstance(node[key], str) and node[key].strip()):
                self.refuse(key, f"is {brief(node[key])}, expected words (a bare number needs quotes)")
        self.one_of("kind", KINDS)
        self.one_of("role", ROLES)
        self.one_of("procedure", procedures)
        self.one_of("quantity", quantities)
        musts, mays = KINDS[node["kind"]]
        check_keys(path, node, [*REQUIRED, *OPTIONAL, *musts, *mays], musts, f"{self.id}, a {node['kind']},")
        self.dimension = quantities[node["quantity"]]

    def refuse(self, key: str, reason: str) -> NoReturn:
        """Raise RigError about a key of the row, with file and line."""
        raise RigError(f"{where_of(self.path, self.node, key)}: {self.id}.{key} {reason}")

    def one_of(self, key: str, known: Collection[str]) -> None:
        """Raise RigError when a key names none of what is known."""
        if self.node[key] not in tuple(known):
            self.refuse(key, f"is {brief(self.node[key])}, expected one of {', '.join(known)}")

    def target(self) -> Target:
        """Return the row as its file has it; RigError with file and line when it is not right."""
        node, kind = self.node, self.node["kind"]
        values: dict = {}
        for key, known in (("sign", SIGNS), ("shape", SHAPES), ("statistic", STATISTICS), ("over", CONDITIONS), ("inside", PARTS)):
            if key in node:
                self.one_of(key, known)
                values[key] = str(node[key])
        if node.get("absolute", True) is not True:
            self.refuse("absolute", f"is {brief(node['absolute'])}, expected true; leave the key out otherwise")
        values["absolute"] = "absolute" in node
        if ("statistic" in node) != ("across" in node):
            self.refuse(
                "statistic" if "statistic" in node else "across",
                "stands alone; a statistic is taken across a condition, both keys are needed",
            )
        if kind in ("ratio", "fit") or node.get("statistic") == "spread_share":
            self.dimension = "ratio"
        values["fixed"] = self.names("fixed")
        values["across"] = self.names("across")
        for key in ("conditions", "of", "to"):
            if key in node:
                values[key] = self.conditions(key)
        if kind == "classification":
            values.update(self.classes())
        else:
            if kind == "curve":
                values.update(self.curve())
            values.update(self.numbers())
        self.sentences("conflicts")
        values["implied_by"] = self.sentences("implied_by")
        for role, key in (("implied", "implied_by"), ("consistency", "consistent_with")):
            if (node["role"] == role) != (key in node):
                self.refuse("role", f"is {node['role']}; a row has the key '{key}' when it has the role {role}, and only then")
        return Target(
            id=str(self.id),
            kind=str(kind),
            quantity=str(node["quantity"]),
            dimension=self.dimension,
            procedure=str(node["procedure"]),
            role=str(node["role"]),
            line=node.line + 1,
            **{key: " ".join(node.get(key, "").split()) for key in ("text", "where", "why", "note", "consistent_with")},
            **values,
        )

    def names(self, key: str) -> tuple[str, ...]:
        """Return the names of conditions that stand under a key as a list."""
        names = self.node.get(key, [])
        if not isinstance(names, list) or any(name not in CONDITIONS for name in names):
            self.refuse(key, f"is {brief(names)}, expected a list out of {', '.join(CONDITIONS)}")
        return tuple(str(name) for name in names)

    def conditions(self, key: str) -> dict[str, tuple | Span]:
        """Return the conditions that a row requires under a key: values or spans [SI]."""
        node = self.node[key]
        check_keys(self.path, node, CONDITIONS, (), f"{self.id}.{key}")
        out = {}
        for name, entry in node.items():
            takes, where = CONDITIONS[name], f"{where_of(self.path, node, name)}: {self.id}.{key}.{name}"
            if isinstance(entry, dict):
                check_keys(self.path, entry, ("from", "to"), ("from", "to"), f"{self.id}.{key}.{name}")
                if not isinstance(takes, str):
                    raise RigError(f"{where} is a span, which only numbers with a unit can have; expected a value or a list")
                low, high = (quantity(entry[end], takes, where) for end in ("from", "to"))
                if low >= high:
                    raise RigError(f"{where} runs from {entry['from']} to {entry['to']}; expected the lower one first")
                out[name] = Span(low, high)
                continue
            entries = list(entry) if isinstance(entry, list) else [entry]
            if not entries:
                raise RigError(f"{where} is an empty list; expected at least one value")
            out[name] = tuple(_condition(takes, name, one, where) for one in entries)
        return out

    def classes(self) -> dict:
        """Return the names of a classification, and the one that is expected."""
        classes = self.node["classes"]
        names = isinstance(classes, list) and all(isinstance(name, str) for name in classes)
        if not names or len(set(classes)) < 2:
            self.refuse("classes", f"is {brief(classes)}, expected a list of two or more names")
        self.one_of("expected", classes)
        return {"classes": tuple(str(c) for c in classes), "expected": str(self.node["expected"])}

    def curve(self) -> dict:
        """Return the pieces of a printed curve, its variable and the unit of the variable."""
        node = self.node
        for key in ("unit", "variable_unit"):
            self.one_of(key, UNITS)
        if UNITS[node["unit"]][0] != self.dimension:
            self.refuse("unit", f"is {with_article(UNITS[node['unit']][0])}, expected {with_article(self.dimension)}")
        pieces, end = [], None
        for piece in node["pieces"] if isinstance(node["pieces"], list) else [None]:
            try:
                start, until, coefficients = piece
                numbers = float(start), float(until), tuple(float(c) for c in coefficients)
            except (TypeError, ValueError):
                self.refuse("pieces", f"has {brief(piece)}, expected [from, to, [coefficients]] in numbers")
            if not numbers[2] or not numbers[0] < numbers[1] or end not in (None, numbers[0]):
                self.refuse(
                    "pieces", f"has {brief(piece)}; each must run forward from where the one before ends and have coefficients"
                )
            end = numbers[1]
            pieces.append(numbers)
        if not pieces:
            self.refuse("pieces", "is empty; expected at least one [from, to, [coefficients]]")
        return {"pieces": tuple(pieces), "variable": str(node["variable"]), "variable_unit": str(node["variable_unit"])}

    def numbers(self) -> dict:
        """Return printed, low, high and tolerance in SI, after a check that they fit each other."""
        node, kind = self.node, self.node["kind"]
        text = node["tolerance"]
        share = kind == "trend" and isinstance(text, str) and text.rstrip().endswith("%")
        tolerance = self.number(text, "tolerance", "ratio" if share else self.dimension)
        if tolerance < 0.0:
            self.refuse("tolerance", f"is {text}, expected 0 or more")
        ends = {end: self.number(node[end], end, self.dimension) for end in ("low", "high") if end in node}
        if kind in ("difference", "ratio") and not ends:
            self.refuse("to", "has nothing to be judged by; expected low, high or both")
        if len(ends) == 2 and ends["low"] > ends["high"]:
            self.refuse("low", f"is {node['low']}, above high, which is {node['high']}")
        printed = self.printed()
        if printed:
            reach = [printed[0] - ends["low"]] if "low" in ends else []
            reach += [ends["high"] - printed[-1]] if "high" in ends else []
            size = max(abs(x) for x in (*printed, *ends.values(), tolerance))
            if min(reach) < -1e-9 * size:
                self.refuse("printed", f"is {node['printed']}, outside of what low and high accept")
            if not math.isclose(max(reach), tolerance, rel_tol=1e-6, abs_tol=1e-6 * size):
                self.refuse(
                    "tolerance",
                    f"is {text}, but low and high do not reach just that far beyond what is printed ({node['printed']})",
                )
        return {"printed": printed, "tolerance": tolerance, "tolerance_is_share": share, "unit": self.unit(), **ends}

    def number(self, text: object, key: str, dimension: str) -> float:
        """Return the number [SI] that is written under a key."""
        return quantity(text, dimension, f"{where_of(self.path, self.node, key)}: {self.id}.{key}")

    def printed(self) -> tuple[float, ...]:
        """Return the printed number [SI], or the lowest and the highest."""
        if "printed" not in self.node:
            return ()
        entry = self.node["printed"]
        pair = self.node["kind"] == "range"
        if pair and not (isinstance(entry, list) and len(entry) == 2):
            self.refuse("printed", f"is {brief(entry)}, expected [lowest, highest]")
        numbers = tuple(self.number(one, "printed", self.dimension) for one in (entry if pair else [entry]))
        if numbers[0] > numbers[-1]:
            self.refuse("printed", f"is {brief(entry)}, expected the lower one first")
        return numbers

    def unit(self) -> str:
        """Return the laboratory's unit, which is that of the first number of the row."""
        keys = ("unit", "printed", "low", "high", "tolerance")
        entry = next(self.node[key] for key in keys if key in self.node)
        text = str(entry[0] if isinstance(entry, list) else entry)
        return text if text in UNITS else (text.split(None, 1)[1:] or ["-"])[0]

    def sentences(self, key: str) -> dict[str, str]:
        """Return the sentences by ids of other rows under a key; RigError when there is anything else."""
        sentences = self.node.get(key, {})
        if not isinstance(sentences, dict) or (key in self.node and not sentences):
            self.refuse(key, f"is {brief(sentences)}, expected {{id of another row: one sentence}}")
        for other, sentence in sentences.items():
            if not (isinstance(sentence, str) and sentence.strip()):
                raise RigError(
                    f"{where_of(self.path, sentences, other)}: {self.id}.{key}.{other} is {brief(sentence)}, expected one sentence"
                )
        return {str(other): " ".join(sentence.split()) for other, sentence in sentences.items()}


def _condition(takes: str | type[int] | tuple[str, ...], name: str, entry: object, where: str) -> float | int | str:
    if isinstance(takes, str):
        return quantity(entry, takes, where)
    if isinstance(takes, type):
        if name == "series" and entry == "all":
            return "all"
        if not isinstance(entry, int) or isinstance(entry, bool) or entry < 1:
            more = " or all" if name == "series" else ""
            raise RigError(f"{where} is {brief(entry)}, expected a whole number from 1{more}")
        return int(entry)
    if entry not in takes:
        raise RigError(f"{where} is {brief(entry)}, expected one of {', '.join(takes)}")
    return str(entry)
