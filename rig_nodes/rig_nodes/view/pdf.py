# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A page printed as PDF by a Chromium or Chrome of this machine, without a window; `rig report --pdf` uses it."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import tempfile
from pathlib import Path

from ..base import MAKER, RigError

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome", "microsoft-edge")
LONGEST = 120.0  # s; time limit of the whole print
QUIET = ("--headless", "--disable-gpu", "--disable-background-networking", "--disable-component-update", "--disable-sync")
QUIET += ("--no-first-run", "--no-default-browser-check", "--disable-extensions", "--hide-scrollbars")


def browser() -> str:
    """Return the path of a browser that prints; RigError when there is none on the PATH."""
    for name in BROWSERS:
        if path := shutil.which(name):
            return path
    raise RigError(
        "--pdf: there is no Chromium or Chrome on the PATH to print with; install one (Debian: apt install chromium), or write "
        "--html and print that page from any browser"
    )


def pdf_of(page: str) -> bytes:
    """Return a page of HTML as PDF.

    Parameters
    ----------
    page : str
        The whole page, which contains all that it shows.

    Returns
    -------
    bytes
        The PDF.

    Raises
    ------
    RigError
        When there is no browser, or when it prints nothing within the time limit.
    """
    program = browser()
    with tempfile.TemporaryDirectory(prefix="rig-pdf-", ignore_cleanup_errors=True) as name:
        folder = Path(name)
        source, target = folder / "page.html", folder / "page.pdf"
        source.write_text(page, encoding="utf-8")
        run_browser(program, folder, f"--print-to-pdf={target}", "--no-pdf-header-footer", source.as_uri())
        if not target.exists() or not target.stat().st_size:
            raise RigError(f"--pdf: {program} printed nothing; write --html and print that page yourself")
        return target.read_bytes() + f"%{MAKER}\n".encode()  # behind its end, where a PDF may have comments


def run_browser(program: str, folder: Path, *arguments: str) -> None:
    """Run a browser without a window and with a profile of its own until it ends.

    Parameters
    ----------
    program : str
        Path of the browser.
    folder : Path
        Folder for its profile.
    arguments : str
        Arguments of the browser.

    Raises
    ------
    RigError
        When it does not end within the time limit.
    """
    alone = ["--no-sandbox"] if os.geteuid() == 0 else []  # Chromium's sandbox does not work for root
    process = subprocess.Popen(
        [program, *QUIET, *alone, f"--user-data-dir={folder / 'profile'}", *arguments],
        env={**os.environ, "HOME": str(folder), "XDG_CONFIG_HOME": str(folder), "XDG_CACHE_HOME": str(folder)},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    try:
        process.wait(LONGEST)
    except subprocess.TimeoutExpired:
        raise RigError(f"--pdf: {program} did not finish within {LONGEST:g} s; write --html and print that page yourself") from None
    finally:
        try:
            os.killpg(process.pid, signal.SIGKILL)  # child processes of the browser that are left when it was killed
        except ProcessLookupError:
            pass
        process.wait()
