#!/usr/bin/env python3
# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Looks with axe-core, in Chromium, at every page of the site that `./rig docs` built and at the operator's page, light and dark.

    pip download --no-deps --dest /tmp/axe axe-playwright-python    # the wheel holds axe.min.js
    ./rig docs && tests/release/accessibility.py /tmp/axe/*.whl

It serves a copy of the site on loopback, and starts `rig panel` with faults. Exit code 1 when something serious or critical is
found, which is printed.
"""

import collections
import functools
import html
import http.server
import json
import re
import shutil
import subprocess
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
RUN = (
    '<script src="{up}axe.js"></script><script>axe.run(document,{{resultTypes:["violations"]}}).then(found=>{{'
    'const out=document.createElement("pre");out.id="found";out.textContent=JSON.stringify(found.violations.map('
    "one=>[one.impact,one.id,one.nodes.length,one.nodes[0].html.slice(0,120)]));document.body.append(out)}})</script></body>"
)
SCHEMES = {"light": "1", "dark": "0"}
ON_PAGE = (
    'axe.run(document,{resultTypes:["violations"]}).then(found=>found.violations.map('
    "one=>[one.impact,one.id,one.nodes.length,one.nodes[0].html.slice(0,120)]))"
)


class Quiet(http.server.SimpleHTTPRequestHandler):
    """Serves a folder and logs nothing."""

    def log_message(self, *_):
        """Say nothing."""


def looked_at(address: str, scheme: str) -> list[list]:
    """Return what axe-core finds on a page: impact, rule, number of places, the first of them."""
    options = ["--headless", "--no-sandbox", "--disable-gpu", "--virtual-time-budget=20000", "--window-size=1200,900", "--dump-dom"]
    command = ["chromium", *options, f"--blink-settings=preferredColorScheme={SCHEMES[scheme]}", address]
    dom = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True).stdout
    found = re.search(r'<pre id="found"[^>]*>(.*?)</pre>', dom, re.DOTALL)
    if found is None:
        raise SystemExit(f"{address}: axe-core gave no result")
    return json.loads(html.unescape(found[1]))


def found_on_panel(axe: str) -> Iterator[tuple[str, list]]:
    """Yield scheme and findings, as of :func:`looked_at`, of the operator's page with all of its parts open."""
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
                for one in browser.js(ON_PAGE):
                    yield scheme, one


def main(wheel: str) -> int:
    """Look at all pages; return the exit code."""
    counts: collections.Counter = collections.Counter()
    with tempfile.TemporaryDirectory() as folder:
        site = Path(folder) / "site"
        shutil.copytree(SITE, site)
        axe = zipfile.ZipFile(wheel).read(AXE)
        (site / "axe.js").write_bytes(axe)
        pages = sorted(site.rglob("*.html"))
        for page in pages:
            up = "../" * (len(page.relative_to(site).parts) - 1)
            page.write_text(page.read_text(encoding="utf-8").replace("</body>", RUN.format(up=up)), encoding="utf-8")
        server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Quiet, directory=site))
        threading.Thread(target=server.serve_forever, daemon=True).start()
        for page in pages:
            for scheme in SCHEMES:
                for impact, rule, places, first in looked_at(
                    f"http://127.0.0.1:{server.server_port}/{page.relative_to(site)}", scheme
                ):
                    counts[impact] += places
                    if impact in ("serious", "critical"):
                        print(f"{page.relative_to(site)}, {scheme}: {impact}, {rule}, {places} places, e.g. {first}")
        server.shutdown()
        for scheme, (impact, rule, places, first) in found_on_panel(axe.decode()):
            counts[impact] += places
            if impact in ("serious", "critical"):
                print(f"operator's page, {scheme}: {impact}, {rule}, {places} places, e.g. {first}")
    print(
        f"{len(pages)} pages and the operator's, light and dark: "
        + (", ".join(f"{n} {impact}" for impact, n in counts.items()) or "nothing")
    )
    return int(counts["serious"] + counts["critical"] > 0)


if __name__ == "__main__":
    raise SystemExit(main(*sys.argv[1:]))
