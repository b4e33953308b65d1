# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A command that the rig prints can be copied into a shell, whatever the names of the user's files and folders are."""

import re
import shlex
from pathlib import Path

import pytest

from rig_nodes.base.errors import quoted
from rig_nodes.cli.main import main

PACKAGE = Path(__file__).parents[2] / "rig_nodes" / "rig_nodes"
# what is put into a printed command that is no path of a user: names of verbs, devices, rigs' records and numbers
# and dir of templates, which is replaced by a quoted path
PLAIN = {
    "dir",
    "verb",
    "look",
    "what",
    "device",
    "controller",
    "seed",
    "healthy",
    "record.rig",
    "self.rig",
    "domain",
    "domain.number",
}
LOGGED = "Zeit;Drehmoment Antrieb\ns;Nm\n0,0;1,0\n0,1;1,0\n0,2;2,0\n"


def commands_in(text):
    """Returns the words of each command that a text names."""
    return [shlex.split(found[1].partition(" (")[0]) for found in re.finditer(r"(\./rig .*)", text)]


def test_every_path_in_a_printed_command_is_quoted():
    bare = []
    for file in PACKAGE.rglob("*.py"):
        for line in re.findall(r"\./rig [^`\n]*", file.read_text(encoding="utf-8")):
            bare += [
                (file.name, one) for one in re.findall(r"\{([^{}]+)\}", line) if not one.startswith("quoted(") and one not in PLAIN
            ]
    assert bare == []


@pytest.mark.parametrize("name", ["a b", "it's", "$HOME", "-x", "Prüf;stand", "a&b"])
def test_a_quoted_name_is_one_word_that_is_no_option(name):
    (word,) = shlex.split(quoted(name))
    assert Path(word) == Path(name) and not word.startswith("-")


def test_commands_that_are_printed_name_the_files_that_are_there(tmp_path, monkeypatch, capsys):
    folder = tmp_path / "mit Leer zeichen"
    folder.mkdir()
    monkeypatch.chdir(tmp_path)
    (folder / "x y.csv").write_text(LOGGED)
    assert main(["import", str(folder / "x y.csv")]) == 0
    assert main(["new", "rig", str(folder / "my rig")]) == 0
    assert main(["controller", "new", "python", str(folder / "my controller")]) == 0
    assert main(["controller", "new", "udp-c", str(folder / "in c")]) == 0
    assert main(["report", str(folder / "x y.csv")]) == 2
    said = capsys.readouterr()
    commands = commands_in(said.out + said.err)
    paths = [word for words in commands for word in words if "Leer" in word or word.endswith(".yaml")]
    assert len(paths) >= 8
    for path in paths:
        assert Path(path.removeprefix("python:").removesuffix(":MyController")).exists(), path
    compiled = next(line for line in said.out.splitlines() if line.strip().startswith("cc "))
    assert str(folder / "in c" / "main.c") in shlex.split(compiled)
