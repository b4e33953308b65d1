# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Settings of the site that ``./rig docs`` builds with Sphinx from the pages beside this file."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sphinx.application import Sphinx

sys.path.insert(0, str(Path(__file__).parent))

project = "Virtual powertrain test rig"
extensions = ["myst_parser", "sphinx_copybutton", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "made_pages", "lesson_pictures"]
root_doc = "index"
exclude_patterns = ["_build", "pictures", "examples", "notebooks"]
html_theme = "furo"
html_title = project
html_static_path = ["_static"]
html_css_files = ["tables.css"]
html_js_files = ["sort_tables.js"]
html_copy_source = False

myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 4  # headings are link targets by the same names as on GitHub
copybutton_prompt_text = "$ "
napoleon_google_docstring = False
napoleon_use_rtype = False
autodoc_typehints = "none"  # the docstrings give types with shapes and units
autodoc_member_order = "bysource"


def setup(app: Sphinx) -> None:
    """Put what the theme and Sphinx leave to a keyboard and a screen reader on each page, behind the theme's own handler."""
    app.connect("html-page-context", _accessible, priority=900)


def _accessible(_app: Sphinx, _page: str, _template: str, context: dict, _doctree: object) -> None:
    tree = context.get("furo_navigation_tree") or ""
    context["furo_navigation_tree"] = tree.replace('role="heading"', 'role="heading" aria-level="2"')
    body = context.get("body", "").replace("<pre>", '<pre tabindex="0">')  # wide blocks and tables are scrolled by keys
    context["body"] = body.replace('<div class="table-wrapper', '<div tabindex="0" class="table-wrapper')
