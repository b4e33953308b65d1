# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A `rig panel` as its user starts it. Used by the tests of the page and by their conftest.py."""

import os
import re
import signal
import subprocess
import sys
from pathlib import Path

START = re.compile(r"page of the rig in ROS domain (\d+): (http://[\d.]+:(\d+)/\?token=\S+)")

READY = "document.getElementById('state').textContent === 'ready' && document.querySelector('[id=\"set motor.speed\"]').value"


class Panel:
    """A running `rig panel`."""

    def __init__(self, folder: Path, *words: str, **more: str):
        """Starts it, with some more of the environment, and waits for its address."""
        env = {name: value for name, value in os.environ.items() if name != "ROS_DOMAIN_ID"} | more
        self.process = subprocess.Popen(
            [sys.executable, "-P", "-m", "rig_nodes", "panel", *words, "--no-open", "--port", "0"],
            cwd=folder,
            env=env,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        said = ""
        while not (found := START.search(said)):
            line = self.process.stdout.readline()
            assert line, said
            said += line
        self.domain, self.url, self.port = int(found[1]), found[2], int(found[3])
        self.origin, self.token = self.url.split("/?")[0], self.url.rpartition("=")[2]

    def close(self) -> str:
        """Ends it in order and returns what it has printed."""
        self.process.send_signal(signal.SIGINT)
        try:
            return self.process.communicate(timeout=60)[0]
        finally:
            self.process.kill()  # one that has not ended would run beside the tests that follow


def choose(page, name, series=""):
    """Chooses a procedure and its series as a hand does, and starts it."""
    page.js(f"(() => {{ const s = document.getElementById('sequence'); s.value = 'procedure {name}'; s.onchange(); }})()")
    page.until("document.getElementById('sequence-text').textContent.includes('series of')")
    page.write("#series", series)
    page.click("#run")
