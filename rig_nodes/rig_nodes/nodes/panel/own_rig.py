# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The rig that the operator's page has started: `rig run` without a sequence, as a process of its own that the page can start anew.

The verb `panel` makes it.
"""

from __future__ import annotations

import ctypes
import os
import signal
import subprocess
import sys
from pathlib import Path

from ...base import RigError
from ...controllers import Domain, environment
from ...runs import run_folder

PR_SET_PDEATHSIG = 1
END = 40.0  # s that `rig run` has to end in order and to write its report


class OwnRig:
    """A rig worked by hand in a domain.

    Attributes
    ----------
    rig : str
        Its name or folder.
    folder : Path
        Folder of the run.

    Parameters
    ----------
    rig : str
        Its name or folder.
    options : list of str
        Further options of `rig run`.
    domain : Domain
        Its domain.
    """

    def __init__(self, rig: str, options: list[str], domain: Domain) -> None:
        self.rig, self._options, self._domain = rig, options, domain
        self.start()

    def start(self) -> None:
        """Start it; RigError while it runs."""
        if hasattr(self, "_process") and not self.ended:
            raise RigError("the rig runs already")
        self.folder = Path(run_folder(None, "by-hand"))
        libc = ctypes.CDLL(None)
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-m", "rig_nodes", "run", "--rig", self.rig, "--out", str(self.folder), *self._options],
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
