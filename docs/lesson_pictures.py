# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The pictures of the lessons, drawn by the lessons' own commands when the site is built: none of them can be out of date.

conf.py names it as an extension of Sphinx. A reader on the site sees below each block of commands what the block draws.
"""

from __future__ import annotations

import contextlib
import io
import logging
import os
import re
import shlex
import shutil
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

import matplotlib as mpl
from docutils import nodes
from sphinx.errors import ExtensionError
from sphinx.transforms import SphinxTransform

from rig_nodes.cli.main import main

if TYPE_CHECKING:
    from sphinx.application import Sphinx

DOCS = Path(__file__).parent
PAGE = "learn/lessons"
FOLDER = "made/lessons"
COMMAND = re.compile(r"^ *\./rig (.+)$", re.M)
DRAWS = re.compile(r"--picture (\S+\.png)")


def setup(app: Sphinx) -> dict[str, bool]:
    """Have the pictures drawn before Sphinx reads pages, and shown on the page of the lessons."""
    app.connect("builder-inited", lambda _: draw())
    app.add_transform(Shown)
    return {"parallel_read_safe": True}


def draw() -> None:
    """Run the commands of each lesson, and keep what they draw; ExtensionError when one of them fails."""
    folder = DOCS / FOLDER
    folder.mkdir(parents=True, exist_ok=True)
    lessons = re.split(r"^## ", (DOCS / PAGE).with_suffix(".md").read_text(encoding="utf-8"), flags=re.M)[1:]
    mpl.use("Agg")
    logging.getLogger("numexpr").setLevel(logging.WARNING)  # Sphinx shows what it says of its threads
    with tempfile.TemporaryDirectory() as place, contextlib.chdir(place):
        os.symlink(DOCS, "docs")
        for lesson in lessons:
            said = io.StringIO()
            for command in COMMAND.findall(lesson):
                with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
                    code = main(shlex.split(command))
                if code:
                    raise ExtensionError(f"docs/{PAGE}.md: './rig {command}' has exit code {code}: {said.getvalue()}")
            for name in DRAWS.findall(lesson):
                shutil.move(name, folder / name)  # the temporary folder may be on another file system


class Shown(SphinxTransform):
    """Puts each lesson's picture below the block of commands that draws it."""

    default_priority = 200  # before Sphinx collects the images

    def apply(self, **_: object) -> None:
        """Add the images."""
        if self.env.docname != PAGE:
            return
        for block in list(self.document.findall(nodes.literal_block)):
            for name in reversed(DRAWS.findall(block.astext())):
                image = nodes.image(uri=f"/{FOLDER}/{name}", alt=f"Picture of lesson {block.parent[0].astext()}")
                block.parent.insert(block.parent.index(block) + 1, image)
