# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""One process of the graph, seen from its supervisor, which starts it, reads its messages and always ends it.

nodes.processes.supervisor uses it; the other end of the line is nodes.process. The processes are forked from a server that has
ROS and the rig's code loaded, because loading them costs a process 0.7 s of a core, four times in a run.
"""

from __future__ import annotations

import contextlib
import ctypes
import importlib
import json
import os
import resource
import select
import signal
import socket
import sys
from multiprocessing import connection, forkserver, get_context, resource_tracker
from pathlib import Path

from ...base import RigError, not_written

STOP_SIGNALS = (signal.SIGINT, signal.SIGTERM)
PRELOADED = "rig_nodes.nodes.preloaded"
PR_SET_NAME = 15
FILES = 64  # open files that this process needs for the lines to its processes; each of them needs fewer
REPORTED = 2.0  # s from the end of a process to the server's word on how it ended
UNREPORTED = 255  # exit code of a process whose server has ended too


def start_server() -> None:
    """Let the processes' server begin to load, in parallel with this process; further calls do nothing.

    It ends with this process, also when this process is killed.

    Raises
    ------
    RigError
        When the server cannot be started, or too few files may be open.
    """
    allowed, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
    if allowed < FILES:
        raise RigError(f"{allowed} open files are too few for the processes of a rig, which need {FILES} (ulimit -n)")
    get_context("forkserver").set_forkserver_preload([PRELOADED])
    resource_tracker.ensure_running()  # now, because its start would lift the mask
    # Stop signals wait until a process can handle them; the server passes the mask on to the process.
    before = signal.pthread_sigmask(signal.SIG_BLOCK, STOP_SIGNALS)
    try:
        forkserver.ensure_running()
    except OSError as error:
        why = f"{error}; their server's socket is in the temporary folder"
        raise RigError(f"the rig's processes cannot be started ({why})") from None
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


class Child:
    """A running process; ``line`` is the descriptor on which its status lines arrive.

    Parameters
    ----------
    name : str
        The process's name.
    module : str
        The module whose ``main()`` it runs.
    arguments : list of str
        Arguments of ``main()``.
    logs : Path
        Folder of the logs; the output goes to ``logs/<name>.log``.
    env : dict of str to str
        Its environment.
    links : dict of str to socket, or None
        Ends of links for it, by the name of the process at the other end.
    life : int
        1 at the first start, 2 at the second and so on; each life has a log of its own.

    Raises
    ------
    RigError
        When the process cannot be started.
    """

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
        """Start the process."""
        self.name, self.life = name, life
        self.log = f"{name}.log" if life == 1 else f"{name}-{life}.log"
        self._rest = b""
        self.silent = False  # True: the process has closed its line, which happens only when it ends
        start_server()
        try:
            (logs / self.log).touch()
        except OSError as error:
            raise not_written(logs / self.log, error) from None
        context = get_context("forkserver")
        try:
            self._status, status = context.Pipe(duplex=False)
            orders, self._orders = context.Pipe(duplex=False)
            os.set_blocking(self.line, False)
            arguments = [*arguments, "--logs", str(logs), "--life", str(life)]
            self._process = context.Process(
                target=_begin,
                args=(name, module, arguments, env, os.getcwd(), logs / self.log, (status, orders), links or {}),
                name=name,
            )
            self._process.start()
            try:
                # the kernel's word on whether it runs: the server, which is a process too, may be stopped or gone
                self._alive = os.pidfd_open(self.pid)
            except OSError:
                self._process.kill()
                raise
        except (EOFError, ConnectionError, ProcessLookupError):
            raise RigError(f"{name} cannot be started: the server of the rig's processes has ended") from None
        except OSError as error:  # too many files are open, for instance
            raise RigError(f"{name} cannot be started ({error.strerror or error})") from None
        status.close()
        orders.close()

    @property
    def line(self) -> int:
        """Descriptor of the status lines."""
        return self._status.fileno()

    @property
    def pid(self) -> int | None:
        """Number of the process; None when it was not started."""
        return self._process.pid

    @property
    def exit_code(self) -> int | None:
        """Exit code of an ended process, negative after a signal; None while it runs."""
        return self._process.exitcode if self.ended() else None

    def messages(self) -> list[dict]:
        """Return the status lines that have arrived."""
        try:
            while data := os.read(self.line, 65536):
                self._rest += data
            self.silent = True
        except BlockingIOError:
            pass
        *lines, self._rest = self._rest.split(b"\n")
        return [json.loads(line) for line in lines]

    def send(self, **order: object) -> None:
        """Send the process an order (nodes.process.Process.follow_orders); it has no effect when the process has ended."""
        with contextlib.suppress(BrokenPipeError):
            os.write(self._orders.fileno(), json.dumps(order).encode() + b"\n")

    def ended(self) -> bool:
        """Return whether the process has ended."""
        return self.ends_in(0.0)

    def ends_in(self, seconds: float | None) -> bool:
        """Wait so long (None: without a limit) for the end of the process; return whether it has ended."""
        line = select.poll()
        line.register(self._alive, select.POLLIN)
        if not line.poll(None if seconds is None else 1e3 * seconds):
            return False
        self._process.join(REPORTED)
        if self._process.exitcode is None:
            self._end_server()
        return True

    def _end_server(self) -> None:
        """Kill the server, which does not report the end of this process, as one that was stopped (SIGSTOP) does not."""
        with contextlib.suppress(OSError):  # it has reported it now
            server = _parent(self.pid)
            if _parent(server) == os.getpid():
                os.kill(server, signal.SIGKILL)
        self._process.join()

    def how(self) -> str:
        """Return how an ended process ended, for people."""
        code = self.exit_code
        if code < 0:
            # those of real time have no name
            return f"killed by signal {-code} ({next((one.name for one in signal.Signals if one == -code), 'of real time')})"
        if code == UNREPORTED:
            return "ended, as did the server of the rig's processes, which knew how"
        return f"ended with exit code {code}"

    def signal(self, number: int) -> None:
        """Send a signal unless the process has ended."""
        with contextlib.suppress(ProcessLookupError):
            signal.pidfd_send_signal(self._alive, number)

    def finish(self, seconds: float) -> bool:
        """Wait for the end of the process, and kill it after ``seconds``; return False when it was killed."""
        if self.ends_in(seconds):
            return True
        self.signal(signal.SIGKILL)
        self.ends_in(None)
        return False

    def close(self) -> None:
        """Close both lines; a process that still runs is killed."""
        self.finish(0.0)
        self._process.close()
        os.close(self._alive)
        self._status.close()
        self._orders.close()


def _parent(pid: int) -> int:
    """Return the number of a process's parent; OSError when the process is gone."""
    return int(Path(f"/proc/{pid}/status").read_text(encoding="utf-8").partition("PPid:")[2].split()[0])


def _begin(
    name: str,
    module: str,
    arguments: list[str],
    env: dict[str, str],
    folder: str,
    log: Path,
    lines: tuple[connection.Connection, connection.Connection],
    links: dict[str, socket.socket],
) -> None:
    """Run the process as ``python -m module arguments`` would, under a name of its own (`ps -o comm`, `top`).

    ``lines`` are its ends of the lines for what it reports and for its orders.
    """
    status, orders = lines
    ctypes.CDLL(None).prctl(PR_SET_NAME, name.encode())
    os.setsid()  # keeps a terminal's Ctrl-C away
    os.chdir(folder)
    os.environ.clear()
    os.environ.update(env)
    with open(log, "ab") as file:
        for descriptor in (1, 2):
            os.dup2(file.fileno(), descriptor)
    os.dup2(orders.fileno(), 0)
    ends = [part for other, end in links.items() for part in ("--link", f"{other}:{end.fileno()}")]
    sys.argv = [name, *arguments, "--status-fd", str(status.fileno()), *ends]
    sys.exit(importlib.import_module(module).main())
