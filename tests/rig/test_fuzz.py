# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Descriptions that are nearly rigs: each is taken, or refused in one sentence, within seconds; a campaign tries 10 000 of them."""

import random
import re
import shutil
import time

import pytest

from rig_nodes.base import RigError, rig_folders
from rig_nodes.rig import load_rig

HANGS = 5.0  # s
VALUES = [
    "",
    "0",
    "-1",
    "1e30",
    ".nan",
    ".inf",
    "[]",
    "{}",
    "~",
    "on",
    "'",
    "1 rpm",
    "-5 degC",
    "3 MPa",
    "[1, 2]",
    "a b",
    "\u00e9",
    "*x",
]
NUMBER = re.compile(r"-?\d+(\.\d+)?(e-?\d+)?")
WORD = re.compile(r"[A-Za-z_]\w*")


def changed(text, draw):
    """Returns a description with one to three random changes."""
    lines = text.splitlines()
    for _ in range(draw.randint(1, 3)):
        k = draw.randrange(len(lines))
        how = draw.randrange(7)
        if how == 0:
            del lines[k]
        elif how == 1:
            lines.insert(draw.randrange(len(lines)), lines[k])
        elif how == 2:
            lines[k] = draw.choice(("  ", " ", "\t")) + lines[k]
        elif how == 3:
            head, sign, _ = lines[k].partition(":")
            lines[k] = f"{head}{sign} {draw.choice(VALUES)}"
        else:
            found = list((NUMBER if how == 4 else WORD).finditer(lines[k]))
            if found:
                one = draw.choice(found)
                other = draw.choice(VALUES) if how < 6 else draw.choice(WORD.findall(text))
                lines[k] = lines[k][: one.start()] + other + lines[k][one.end() :]
        lines = lines or [""]
    return "\n".join(lines) + "\n"


@pytest.mark.parametrize("count", [120, pytest.param(10_000, marks=pytest.mark.campaign)])
def test_a_description_that_is_nearly_a_rig_is_taken_or_refused_in_a_sentence(tmp_path, count):
    draw, refused, longest, wrong = random.Random(41), 0, 0.0, []
    folders = {}
    for name, folder in rig_folders().items():
        folders[name] = tmp_path / name
        shutil.copytree(folder, folders[name], ignore=shutil.ignore_patterns("*.py", "__pycache__", "validation.yaml"))
    texts = {name: (folder / "rig.yaml").read_text(encoding="utf-8") for name, folder in folders.items()}
    for number in range(count):
        name = draw.choice(sorted(folders))
        path = folders[name] / "rig.yaml"
        path.write_text(changed(texts[name], draw), encoding="utf-8")
        began = time.thread_time()
        try:
            assert load_rig(folders[name]).trips is not None
        except RigError as error:
            refused += 1
            if "\n" in str(error):
                wrong.append(f"{number}: more than a line: {error}")
        except Exception as error:
            kept = tmp_path.parent / f"rig_{number}.yaml"
            shutil.copy(path, kept)
            wrong.append(f"{kept} of {name}: {type(error).__name__}: {error}")
        path.write_text(texts[name], encoding="utf-8")
        longest = max(longest, time.thread_time() - began)
    print(f"{count} descriptions: {refused} refused, {count - refused - len(wrong)} taken; longest {longest:.2f} s")
    assert not wrong, "\n".join(wrong[:20])
    assert longest < HANGS
