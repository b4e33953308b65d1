# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""One process of the graph, seen from its supervisor: started, listened to, stopped, never left behind.

Used by graph.supervisor; the other end of the line is nodes.process.
"""

from __future__ import annotations

import contextlib
import json
import os
import signal
import socket
import subprocess
import sys
from pathlib import Path

STOP_SIGNALS = (signal.SIGINT, signal.SIGTERM)


class Child:
    """A running process; ``line`` is the descriptor on which its status lines arrive."""

    def __init__(
        self,
        name: str,
        module: str,
        arguments: list[str],
        logs: Path,
        env: dict[str, str],
        links: dict[str, socket.socket] | None = None,
        life: int = 1,
    ) -> None:
        """Start ``python -m module``; its output goes to ``logs/<name>.log``.

        links: ends for it, by the other's name; life: 2 when it is started again, and so on, for a log of its own.
        """
        self.name, self.life = name, life
        self.log = f"{name}.log" if life == 1 else f"{name}-{life}.log"
        self.line, other_end = os.pipe()
        os.set_blocking(self.line, False)
        self._rest = b""
        self.silent = False  # has closed its line, which it does only by ending
        command = [
            sys.executable,
            "-P",
            "-m",
            module,
            *arguments,
            "--logs",
            str(logs),
            "--parent",
            str(os.getpid()),
            "--status-fd",
            str(other_end),
            "--life",
            str(life),
        ]
        ends = {other: end.fileno() for other, end in (links or {}).items()}
        for other, descriptor in ends.items():
            command += ["--link", f"{other}:{descriptor}"]
        # Stop signals wait until the child can handle them; its own session keeps a terminal's Ctrl-C away.
        before = signal.pthread_sigmask(signal.SIG_BLOCK, STOP_SIGNALS)
        try:
            with open(logs / self.log, "wb") as log:
                self.process = subprocess.Popen(
                    command,
                    stdin=subprocess.PIPE,
                    stdout=log,
                    stderr=log,
                    env=env,
                    pass_fds=(other_end, *ends.values()),
                    start_new_session=True,
                )
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
            os.close(other_end)

    @property
    def pid(self) -> int:
        """Number of the process."""
        return self.process.pid

    def messages(self) -> list[dict]:
        """Status lines that have arrived."""
        try:
            while data := os.read(self.line, 65536):
                self._rest += data
            self.silent = True
        except BlockingIOError:
            pass
        *lines, self._rest = self._rest.split(b"\n")
        return [json.loads(line) for line in lines]

    def tell(self, **order: object) -> None:
        """Give the process an order (nodes.process.Process.follow_orders); nothing happens when it has ended."""
        try:
            self.process.stdin.write(json.dumps(order).encode() + b"\n")
            self.process.stdin.flush()
        except BrokenPipeError:
            pass

    def ended(self) -> bool:
        """True when the process is gone."""
        return self.process.poll() is not None

    def how(self) -> str:
        """How an ended process ended, for people."""
        code = self.process.returncode
        if code < 0:
            return f"killed by signal {-code} ({signal.Signals(-code).name})"
        return f"ended with exit code {code}"

    def signal(self, number: int) -> None:
        """Send a signal unless the process is gone."""
        if not self.ended():
            self.process.send_signal(number)

    def finish(self, seconds: float) -> bool:
        """Wait for the end, by force after ``seconds``; False when force was needed."""
        try:
            self.process.wait(seconds)
            return True
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
            return False

    def close(self) -> None:
        """Close both lines."""
        os.close(self.line)
        with contextlib.suppress(BrokenPipeError):
            self.process.stdin.close()
