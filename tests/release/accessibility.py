#!/usr/bin/env python3
# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Looks with axe-core, in Chromium, at every page of the site that `./rig docs` built and at the operator's page, light and dark.

    pip download --no-deps --dest /tmp/axe axe-playwright-python    # the wheel holds axe.min.js
    ./rig docs && tests/release/accessibility.py /tmp/axe/*.whl

It serves the site on loopback, and starts `rig panel` with faults. Exit code 1 when something serious or critical is
found, which is printed.
"""

import collections
import functools
import http.server
import itertools
import sys
import tempfile
import threading
import zipfile
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "panel"))

from browser import Browser
from started_panel import READY, Panel

SITE = Path(__file__).parents[2] / "docs" / "_build" / "html"
AXE = "axe_playwright_python/axe.min.js"
SCHEMES = "light", "dark"
LOOK = (
    'axe.run(document,{resultTypes:["violations"]}).then(found=>found.violations.map('
    "one=>[one.impact,one.id,one.nodes.length,one.nodes[0].html.slice(0,120)]))"
)


class Quiet(http.server.SimpleHTTPRequestHandler):
    """Serves a folder and logs nothing."""

    def log_message(self, *_):
        """Say nothing."""


def found_on_site(axe: str, site: Path) -> Iterator[tuple[str, list]]:
    """Yield place and findings (impact, rule, number of places, the first of them) of each page; say how far it is."""
    pages = sorted(page.relative_to(site) for page in site.rglob("*.html"))
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Quiet, directory=site))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    address = f"http://127.0.0.1:{server.server_port}"
    with closing(Browser("about:blank")) as browser:
        for number, page in enumerate(pages, 1):
            print(f"\r{number} of {len(pages)} pages", end="", file=sys.stderr, flush=True)
            browser.call("Page.navigate", url=f"{address}/{page}")
            browser.until(f"location.pathname === '/{page}' && document.readyState === 'complete'")
            browser.call("Runtime.evaluate", expression=axe)
            for scheme in SCHEMES:
                browser.call("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])
                for one in browser.js(LOOK):
                    yield f"{page}, {scheme}", one
    print(file=sys.stderr)
    server.shutdown()


def found_on_panel(axe: str) -> Iterator[tuple[str, list]]:
    """Yield place and findings of the operator's page with all of its parts open."""
    with tempfile.TemporaryDirectory() as folder:
        with closing(Panel(Path(folder), "hydmag", "--faults")) as panel, closing(Browser(panel.url)) as browser:
            browser.until(READY, 200)
            browser.click("[data-gear='1']")  # which is refused, as there is no oil yet
            browser.until("document.querySelectorAll('#event-list li').length")
            browser.js("document.querySelectorAll('details').forEach((one) => { one.open = true; })")
            browser.call("Runtime.evaluate", expression=axe)
            for _ in SCHEMES:
                browser.click("#theme")
                scheme = browser.js("document.documentElement.dataset.theme")
                for one in browser.js(LOOK):
                    yield f"operator's page, {scheme}", one


def main(wheel: str) -> int:
    """Look at all pages; return the exit code."""
    counts: collections.Counter = collections.Counter()
    axe = zipfile.ZipFile(wheel).read(AXE).decode()
    for place, (impact, rule, places, first) in itertools.chain(found_on_site(axe, SITE), found_on_panel(axe)):
        counts[impact] += places
        if impact in ("serious", "critical"):
            print(f"{place}: {impact}, {rule}, {places} places, e.g. {first}")
    print("site and operator's page, light and dark: " + (", ".join(f"{n} {impact}" for impact, n in counts.items()) or "nothing"))
    return int(counts["serious"] + counts["critical"] > 0)


if __name__ == "__main__":
    raise SystemExit(main(*sys.argv[1:]))
