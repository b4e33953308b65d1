# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""README and docs: each command is understood, each file linked to is there, and the words written by hand keep to a budget."""

import json
import re
import runpy
import shlex
import subprocess
from pathlib import Path

import pytest

from rig_nodes.base.arguments import Parser
from rig_nodes.base.errors import RigError
from rig_nodes.cli.main import module_of

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
BY_HAND = [*sorted(DOCS.glob("*.md")), *(path for path in sorted(DOCS.glob("[!_]*/*.md")) if path.parent.name != "made")]
PAGES = [ROOT / "README.md", ROOT / "ros_ws" / "README.md", *BY_HAND]
MADE = {path.removesuffix(".md") for path in re.findall(r'^        "(\w+\.md)": ', (DOCS / "made_pages.py").read_text(), re.M)} | {
    "validation"
}
BUDGET = 30_000  # words of all pages by hand, README and CONTRIBUTING
LINE = re.compile(r"^(?:    |\$ )?\./rig (?P<words>[^#\n]*?)(?:\s{2,}#.*|\s#\s.*)?$")
SOURCES, PAGE = {".py", ".yaml", ".msg", ".action", ".srv", ".h", ".c", ".js"}, re.compile(r"\bdocs/(?!made/)[\w/]+\.md")
STANDS_FOR = {"N": "7", "PORT": "9002", "...": "x"}  # words of a command that stand for values


def commands() -> list[tuple[str, str]]:
    """Returns (place, words behind ./rig) of each command in a code block."""
    found = []
    for page in PAGES:
        fenced = False
        for number, line in enumerate(page.read_text(encoding="utf-8").splitlines(), 1):
            fenced ^= line.startswith("```")
            command = LINE.match(line)
            if command and (fenced or line.startswith("    ")):
                found.append((f"{page.relative_to(ROOT)}:{number}", command["words"].strip()))
    return found


def understood(words: list[str]) -> None:
    """Parses the arguments by the verb's own parser; RigError when they are not valid. Nothing is run."""
    verb, *arguments = words
    module = module_of(verb)
    if getattr(module, "PASSES_ON", False):
        return
    parser = Parser(prog=f"rig {verb}", allow_abbrev=False)
    module.add_arguments(parser)
    (parser.parse_intermixed_args if getattr(module, "INTERMIXED", False) else parser.parse_args)(arguments)


@pytest.mark.parametrize(("place", "command"), commands())
def test_it_is_understood(place, command):
    words = [STANDS_FOR.get(word, word) for word in shlex.split(command)]
    try:
        understood(words)
    except RigError as refusal:
        raise AssertionError(f"{place}: ./rig {command}: {refusal}") from None


def test_there_are_many_and_a_wrong_one_is_found():
    assert len(commands()) > 100
    for wrong in ("simulat demo", "simulate demo --sed 5", "run demo --speed fast"):
        with pytest.raises((RigError, SystemExit)):
            understood(wrong.split())


@pytest.mark.parametrize("page", [*PAGES, ROOT / "CONTRIBUTING.md"], ids=lambda page: page.relative_to(ROOT).as_posix())
def test_links_to_files_lead_to_some(page):
    links = re.findall(r"\]\(([^)\s#]+)(?:#[^)]*)?\)", page.read_text(encoding="utf-8"))
    made = {DOCS / "made" / f"{name}.md" for name in MADE}
    files = [link for link in links if not re.match(r"[a-z]+:", link)]
    assert [link for link in files if not (page.parent / link).exists() and (page.parent / link).resolve() not in made] == []


def test_pages_that_code_and_messages_name_are_there():
    sources = [path for folder in ("msgs", "rig_nodes/rig_nodes") for path in (ROOT / folder).rglob("*") if path.suffix in SOURCES]
    named = {(path.name, page) for path in sources for page in PAGE.findall(path.read_text(encoding="utf-8"))}
    assert len(named) > 5 and [one for one in sorted(named) if not (ROOT / one[1]).is_file()] == []


def test_the_words_by_hand_keep_to_their_budget():
    counts = {
        path: len(path.read_text(encoding="utf-8").split()) for path in (*BY_HAND, ROOT / "README.md", ROOT / "CONTRIBUTING.md")
    }
    total = sum(counts.values())
    longest = sorted(counts, key=counts.get, reverse=True)[:5]
    print(f"{total} words by hand; longest: {', '.join(f'{path.relative_to(ROOT)} {counts[path]}' for path in longest)}")
    assert total <= BUDGET, f"{total} words by hand, {total - BUDGET} over the budget"


def test_the_index_has_one_line_for_each_page():
    lines = (DOCS / "index.md").read_text(encoding="utf-8").splitlines()
    named = [link for line in lines if line.startswith(("- ", "  [")) for link in re.findall(r"\]\(([^)]+)\)", line)]
    pages = {path.relative_to(DOCS).as_posix() for path in BY_HAND} | {f"made/{name}.md" for name in MADE}
    of_rigs = {name for name in pages if name.startswith("rigs/")} - {"rigs/index.md"}  # have their lines in rigs/index.md
    assert sorted(named) == sorted(pages - of_rigs - {"index.md"})


PROMISES = """
'''A [bus] keeps
its `time_s`.

More words.'''

FEW, MANY = 3, 9
MORE = [pytest.param(MANY, marks=pytest.mark.campaign)]


def test_one_is_one(): ...


@pytest.mark.campaign
def test_it_lasts(): ...


@pytest.mark.parametrize("count", [FEW, *MORE])
def test_all_come(count): ...
"""


def test_the_page_of_requirements_has_each_file_of_tests_with_its_promise_and_its_tests():
    made = runpy.run_path(str(DOCS / "promises.py"))
    page, promise_of, plain = made["page"](), made["promise_of"], made["plain"]
    promise, tests = promise_of(PROMISES, "test_bus.py")
    assert (plain(promise), tests) == (
        r"A \[bus\] keeps its `time_s`.",
        [("one is one", ""), ("it lasts", " (campaign)"), ("all come", " (with more in a campaign)")],
    )
    assert [mark for _, mark in promise_of(PROMISES + "pytestmark = [pytest.mark.campaign]", "")[1]] == [" (campaign)"] * 3
    with pytest.raises(ValueError, match="test_bus.py has no docstring"):
        promise_of("def test_one(): ...", "test_bus.py")
    files = [path.relative_to(ROOT).as_posix() for path in (ROOT / "tests").glob("*/test_*.py")]
    assert [name for name in files if f"** `{name}`" not in page] == []
    assert "**README and docs: each command is understood" in page and "\n- no made page is kept\n" in page


def test_no_made_page_is_kept():
    kept = subprocess.run(["git", "ls-files", "docs/made", "docs/_build"], cwd=ROOT, capture_output=True, text=True, check=True)
    assert kept.stdout == ""


def test_the_readme_counts_the_rows_that_validation_stores():
    summary = json.loads((ROOT / "docs" / "reference" / "validation.json").read_text(encoding="utf-8"))["summary"]
    rows, inside = (sum(summary[kind][what] for kind in ("predicted", "calibrated")) for what in ("rows", "inside"))
    assert f"Of {rows} independent results" in (text := (ROOT / "README.md").read_text(encoding="utf-8"))
    assert f"the model meets {inside} within" in text
