# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The rig that the operator's page has started: `rig run`, as a process of its own that the page can start anew.

The verb `panel` makes it.
"""

from __future__ import annotations

import ctypes
import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from ...base import RigError
from ...controllers import Domain, environment
from ...runs import run_folder

if TYPE_CHECKING:
    from collections.abc import Iterable

PR_SET_PDEATHSIG = 1
END = 40.0  # s that `rig run` has to end in order and to write its report


class OwnRig:
    """A rig in a domain, which is worked by hand until it is told to run something.

    Attributes
    ----------
    rig : str
        Its name or folder.
    settings : list of str
        Its changed values, as --set takes them.
    folder : Path
        Folder of the run.

    Parameters
    ----------
    rig : str
        Its name or folder.
    settings : list of str
        Its changed values, as --set takes them.
    options : list of str
        Further options of `rig run`.
    domain : Domain
        Its domain.
    """

    def __init__(self, rig: str, settings: list[str], options: list[str], domain: Domain) -> None:
        self.rig, self.settings, self._options, self._domain = rig, settings, options, domain
        self.start()

    def start(self, words: Iterable[str] = (), folder: Path | None = None) -> None:
        """Start it, by hand or with these further words of `rig run`; RigError while it runs."""
        if hasattr(self, "_process") and not self.ended:
            raise RigError("the rig runs already")
        self.folder = folder or Path(run_folder(None, "by-hand"))
        words = ["--rig", self.rig, "--out", str(self.folder), *(f"--set={text}" for text in self.settings), *self._options, *words]
        libc = ctypes.CDLL(None)
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-m", "rig_nodes", "run", *words],
            env=environment(self._domain),
            stdin=subprocess.DEVNULL,
            start_new_session=True,  # Ctrl-C is for the page, which ends the rig in order
            preexec_fn=lambda: libc.prctl(PR_SET_PDEATHSIG, signal.SIGTERM),
        )

    @property
    def ended(self) -> bool:
        """Whether it has ended."""
        return self._process.poll() is not None

    @property
    def how(self) -> str:
        """A sentence on how it has ended."""
        code = self._process.returncode
        return "the rig has ended" if code in (0, 3) else f"the rig has ended with exit code {code}; the terminal says why"

    def stop(self) -> None:
        """End it in order, so that its recording is whole."""
        if not self.ended:
            os.kill(self._process.pid, signal.SIGINT)
            try:
                self._process.wait(END)
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._process.wait()
