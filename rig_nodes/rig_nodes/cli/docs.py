# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""``rig docs``: the site of a checkout, built with Sphinx; with words, the places of its pages that have them."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    import argparse

HELP = "build the site in docs/_build/html, or find words in its pages"
DOCS = Path(__file__).parents[3] / "docs"
HITS = 10  # that are printed
# What a word counts, by the place where it stands: a page is found by what it is about rather than by how long it is.
TITLE, HEADING, TEXT = 12.0, 6.0, 1.0
ASKING = {"a", "an", "are", "can", "do", "does", "how", "i", "in", "is", "it", "of", "the", "to", "what", "where", "which", "why"}
MADE = 0.5  # share for pages made from the program, whose tables name everything


class Hit(NamedTuple):
    """A section of a page that has the words: its page, heading and line, the line of text, and how well it fits."""

    page: str
    heading: str
    line: int
    text: str
    score: float


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the verb."""
    parser.add_argument("words", nargs="*", metavar="WORD", help="words to find; alone: build the site")


def main(args: argparse.Namespace) -> int:
    """Build the site, or print the hits of a search; 1 when there are none, or when Sphinx warns."""
    from ..base import RigError

    if not (DOCS / "conf.py").is_file():
        raise RigError(f"there is no {DOCS / 'conf.py'}; the pages are part of a checkout, not of an installed package")
    if not args.words:
        return build()
    found = search(args.words)
    for hit in found[:HITS]:
        print(f"docs/{hit.page}:{hit.line}  {hit.heading}\n    {hit.text}")
    if not found:
        print(f"no page has {' '.join(args.words)!r}")
    return 0 if found else 1


def build() -> int:
    """Build the site into docs/_build/html and return Sphinx' exit code; every warning counts as an error.

    Raises
    ------
    Lacking
        When a package of the extra ``docs`` is missing.
    """
    from ..base import optional

    for package in ("myst_parser", "sphinx_copybutton", "furo"):
        optional(package, "docs")
    html, cache = DOCS / "_build" / "html", DOCS / "_build" / "doctrees"
    # -E reads every page anew, because Sphinx warns only about pages that it reads
    options = ["-q", "-E", "-W", "--keep-going", "-b", "html", "-d", str(cache)]
    code = optional("sphinx.cmd.build", "docs").main([*options, str(DOCS), str(html)])
    if code == 0:
        print(f"the site is {html / 'index.html'}")
    return code


class Section(NamedTuple):
    """A heading with its line and words, and below it each line with its number and words."""

    heading: str
    line: int
    words: set[str]
    text: list[tuple[int, str, set[str]]]

    def all_words(self) -> set[str]:
        """Return the words of the heading and of all lines."""
        return self.words.union(*(words for _, _, words in self.text))


def search(words: list[str]) -> list[Hit]:
    """Find the pages that have the words, best first.

    A word counts by its place, and the more the fewer pages have it.

    Parameters
    ----------
    words : list of str
        Words or a question; endings of words do not matter.

    Returns
    -------
    list of Hit
        The best section of each page that has at least half of the words, by what they count.
    """
    asked = " ".join(words).lower().split()
    wanted = _words(" ".join(word for word in asked if word not in ASKING) or " ".join(asked))
    pages = {path: _sections(path) for path in sorted(DOCS.glob("*.md")) + sorted(DOCS.glob("[!_]*/*.md"))}
    found = {path: set().union(*(one.all_words() for one in sections)) & wanted for path, sections in pages.items()}
    by_hand = [has for path, has in found.items() if path.parent.name != "made"]  # others are there only once the site was built
    counts = {word: math.log(1 + len(by_hand) / (1 + sum(word in has for has in by_hand))) for word in wanted}
    whole = sum(counts.values())
    hits = [
        max((_hit(path, pages[path][0], one, counts) for one in pages[path]), key=lambda hit: hit.score)
        for path, has in found.items()
        if has and 2 * sum(counts[word] for word in has) >= whole
    ]
    return sorted(hits, key=lambda hit: (-hit.score, hit.page))


def _hit(path: Path, first: Section, one: Section, counts: dict[str, float]) -> Hit:
    """Return how well a section of a page fits; ``first`` is the page's first one, which has its title."""

    def count(words: set[str]) -> float:
        return sum(counts[word] for word in words & counts.keys())

    def about(lead: str) -> float:
        words = _words(lead)
        return count(words) * len(words & counts.keys()) / max(1, len(words))

    title = first.words | _words(path.stem)
    lines = [(HEADING * about(_lead(text)) + count(words), -number, text) for number, text, words in one.text]
    best, number, text = max(lines, default=(0.0, -one.line, one.heading))
    place = (-number, text) if best else (one.line, one.heading)
    together = count(one.all_words() | title) / sum(counts.values())
    score = TITLE * count(title) + HEADING * count(one.words) + TEXT * (count(one.all_words()) + best)
    score *= together**2 * (MADE if path.parent.name == "made" else 1.0)
    return Hit(path.relative_to(DOCS).as_posix(), one.heading, *place, score)


def _lead(line: str) -> str:
    """Return what a line is about: the first cell of a row, or the words in bold with which it begins."""
    found = re.match(r"\| ([^|]+) \||(?:- )?\*\*(.+?)\*\*", line)
    return (found[1] or found[2]) if found else ""


def _words(text: str) -> set[str]:
    """Return the words of a text without the endings by which their forms differ."""
    return {re.sub(r"(?<=\w{3})(ies|ing|ed|es|s|e)$", "", word) for word in re.findall(r"[^\W_]+", text.lower())}


def _sections(path: Path) -> list[Section]:
    """Return the sections of a page, whose first line is its title."""
    found: list[Section] = []
    fenced = False
    for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
        fenced ^= line.startswith("```")
        if (heading := re.match(r"#+ (.+)", line)) and not fenced:
            found.append(Section(heading[1], number, _words(heading[1]), []))
        elif found:
            found[-1].text.append((number, line.strip(), _words(line)))
    return found
