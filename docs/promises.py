# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The page of the requirements, made from the tests: what the docstring of each file promises, and the tests that show it.

made_pages.py writes it. The files are parsed and not imported, so that the site needs none of what a test needs.
"""

from __future__ import annotations

import ast
import re
from itertools import groupby
from pathlib import Path

TESTS = Path(__file__).parents[1] / "tests"
HEAD = """# Requirements

What the rig promises, and below each promise the tests that show it, made from `tests`: {promises} promises, {tests} tests, of
which {campaigns} are campaigns, measurements that run on demand (`./rig test -m campaign FILE`).
"""
CAMPAIGN, PARTLY = " (campaign)", " (with more in a campaign)"
MEANT = re.compile(r"(?<!`)(`+)(?!`).*?(?<!`)\1(?!`)|[\\*_\[\]<>${}|#]")  # code, and signs that Markdown would not show


def page() -> str:
    """Return the page; ValueError for a file of tests without a docstring."""
    promises, every, parts = 0, [], []
    for folder, paths in groupby(sorted(TESTS.glob("*/test_*.py")), lambda path: path.parent.name):
        parts.append(f"## tests/{folder}\n")
        for path in paths:
            text, tests = promise_of(path.read_text(encoding="utf-8"), path.name)
            lines = [f"- {plain(name + mark)}" for name, mark in tests]
            parts.append("\n".join([f"**{plain(text)}** `tests/{folder}/{path.name}`\n", *lines, ""]))
            promises, every = promises + 1, every + tests
    campaigns = sum(mark == CAMPAIGN for _, mark in every)
    return "\n".join([HEAD.format(promises=promises, tests=len(every), campaigns=campaigns), *parts])


def promise_of(source: str, where: str) -> tuple[str, list[tuple[str, str]]]:
    """Return what a file of tests promises.

    Parameters
    ----------
    source : str
        Its text.
    where : str
        Beginning of the error.

    Returns
    -------
    (str, list of (str, str))
        The first paragraph of its docstring, and of each test the name in words with "", CAMPAIGN or PARTLY.

    Raises
    ------
    ValueError
        When it has no docstring.
    """
    tree = ast.parse(source)
    said = ast.get_docstring(tree)
    if not said:
        raise ValueError(f"{where} has no docstring, which says what its tests promise")
    named: set[str] = set()  # of the file's own values and functions that hold the mark
    for node in tree.body:
        if isinstance(node, ast.Assign) and _has_mark(node, named):
            named |= {target.id for target in node.targets if isinstance(target, ast.Name)}
        elif isinstance(node, ast.FunctionDef) and not _is_test(node) and _has_mark(node, named):
            named.add(node.name)
    tests = [
        (node.name.removeprefix("test_").replace("_", " "), _mark_of(node, named)) for node in ast.walk(tree) if _is_test(node)
    ]
    return " ".join(said.split("\n\n")[0].split()), tests


def plain(text: str) -> str:
    """Return a text so that Markdown shows it as it is, but for code in backticks."""
    return MEANT.sub(lambda found: found[0] if found[1] else f"\\{found[0]}", text)


def _is_test(node: ast.AST) -> bool:
    return isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) and node.name.startswith("test_")


def _has_mark(tree: ast.AST, named: set[str]) -> bool:
    """Return whether something of a file is the mark of campaigns, holds it, or uses a name that does."""
    return any(getattr(node, "attr", "") == "campaign" or getattr(node, "id", "") in named for node in ast.walk(tree))


def _mark_of(test: ast.FunctionDef, named: set[str]) -> str:
    """Return CAMPAIGN for a test that is one by itself or by its file, and PARTLY for one that is with some of its parameters."""
    marks = [one for one in test.decorator_list if _has_mark(one, named)]
    if "pytestmark" in named or any(isinstance(one, ast.Attribute | ast.Name) for one in marks):
        return CAMPAIGN
    return PARTLY if marks else ""
