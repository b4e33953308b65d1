#!/usr/bin/env python3
# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Looks with axe-core, in Chromium, at every page of the site that `./rig docs` built, light and dark.

    pip download --no-deps --dest /tmp/axe axe-playwright-python    # the wheel holds axe.min.js
    ./rig docs && tests/release/accessibility.py /tmp/axe/*.whl

It serves a copy of the site on loopback. Exit code 1 when something serious or critical is found, which is printed.
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
from pathlib import Path

SITE = Path(__file__).parents[2] / "docs" / "_build" / "html"
AXE = "axe_playwright_python/axe.min.js"
RUN = (
    '<script src="{up}axe.js"></script><script>axe.run(document,{{resultTypes:["violations"]}}).then(found=>{{'
    'const out=document.createElement("pre");out.id="found";out.textContent=JSON.stringify(found.violations.map('
    "one=>[one.impact,one.id,one.nodes.length,one.nodes[0].html.slice(0,120)]));document.body.append(out)}})</script></body>"
)
SCHEMES = {"light": "1", "dark": "0"}


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


def main(wheel: str) -> int:
    """Look at all pages; return the exit code."""
    counts: collections.Counter = collections.Counter()
    with tempfile.TemporaryDirectory() as folder:
        site = Path(folder) / "site"
        shutil.copytree(SITE, site)
        (site / "axe.js").write_bytes(zipfile.ZipFile(wheel).read(AXE))
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
    print(f"{len(pages)} pages, light and dark: " + (", ".join(f"{n} {impact}" for impact, n in counts.items()) or "nothing"))
    return int(counts["serious"] + counts["critical"] > 0)


if __name__ == "__main__":
    raise SystemExit(main(*sys.argv[1:]))
