# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Commands and links of README and docs: each verb and option exists, each value is valid, and each file is there."""

import re
import shlex
from pathlib import Path

import pytest

from rig_nodes.base.arguments import Parser
from rig_nodes.base.errors import RigError
from rig_nodes.cli.main import module_of

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", ROOT / "ros_ws" / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
LINE = re.compile(r"^(?:    |\$ )?\./rig (?P<words>[^#\n]*?)(?:\s{2,}#.*|\s#\s.*)?$")
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
    lost = [link for link in links if not re.match(r"[a-z]+:", link) and not (page.parent / link).exists()]
    assert lost == []
