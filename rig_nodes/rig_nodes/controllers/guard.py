# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The guard of a controller's own process: a program that hosted.py starts, and that imports nothing of the rig.

It forks a child that loads a host (c/host.py, python/host.py, fmi/process.py) and serves the rig with it. The guard ends in the
same way as the child and ends all processes that the child started; it also does so when the rig ends, or asks for it by END_ALL.
"""

from __future__ import annotations

import contextlib
import ctypes as ct
import importlib
import os
import resource
import shutil
import signal
import socket
import sys

END_ALL = signal.SIGUSR1  # to the guard: the controller's process and its children end at once
LINE_LOST = 243  # exit code of a controller's process whose line to the rig was closed or changed by the controller
PR_SET_PDEATHSIG, PR_SET_NAME, PR_SET_CHILD_SUBREAPER = 1, 15, 36
LINE_BUFFERED = 1  # _IOLBF: what was printed before a crash is shown
MOST_MEMORY = 0.5  # share of the machine's memory that a controller may take
FIRST_TO_GO = "1000"  # when the machine has no memory left, the controller is ended and not the rig


def prctl(option: int, value: int | bytes) -> None:
    """Call prctl(2) once; its errors do not matter here."""
    ct.CDLL(None).prctl(option, value, 0, 0, 0)


def children() -> list[int]:
    """Return the numbers of this process's children, adopted ones included."""
    found = []
    for name in os.listdir("/proc"):
        if name.isdigit():
            try:
                with open(f"/proc/{name}/stat", encoding="utf-8", errors="replace") as file:
                    parent = file.read().rpartition(")")[2].split()[1]
            except OSError:
                continue  # the process has ended meanwhile
            if int(parent) == os.getpid():
                found.append(int(name))
    return found


def end_children() -> None:
    """End every process below this one; a process that loses its parent by this is adopted by this one and is ended next."""
    try:
        while True:
            if os.waitpid(-1, os.WNOHANG) == (0, 0):
                for child in children():
                    os.kill(child, signal.SIGKILL)
                os.waitpid(-1, 0)
    except ChildProcessError:
        pass  # no children are left


def clear(folder: str) -> None:
    """Remove what the controller's process has put aside; an empty name is no folder."""
    if folder:
        shutil.rmtree(folder, ignore_errors=True)


def guard(child: int, folder: str) -> None:
    """Wait until the controller's process has ended, remove what it leaves behind, and end in the same way."""
    status = None
    while status is None:
        ended, how = os.waitpid(-1, 0)
        if ended == child:
            status = how
    end_children()
    clear(folder)
    if os.WIFSIGNALED(status):
        number = os.WTERMSIG(status)
        if number != signal.SIGKILL:
            with contextlib.suppress(OSError):  # the C library keeps some signals of real time to itself
                signal.signal(number, signal.SIG_DFL)
        os.kill(os.getpid(), number)
    os._exit(os.WEXITSTATUS(status))


def keep_to_itself() -> None:
    """Bound what the controller's process can take from others: memory, and signals to its own process group."""
    os.setpgid(0, 0)  # Ctrl-C in the rig's terminal does not come here, and a signal to "the whole group" stays here
    whole = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    _, hard = resource.getrlimit(resource.RLIMIT_DATA)
    most = int(MOST_MEMORY * whole)
    if hard == resource.RLIM_INFINITY or hard > most:
        resource.setrlimit(resource.RLIMIT_DATA, (most, hard))
    with contextlib.suppress(OSError), open("/proc/self/oom_score_adj", "w", encoding="ascii") as file:
        file.write(FIRST_TO_GO)
    libc = ct.CDLL(None)
    libc.setvbuf(ct.c_void_p.in_dll(libc, "stdout"), None, LINE_BUFFERED, 0)


def main() -> None:
    """Run the guard and its child.

    Arguments: the folder and the name of the host's module, the name of its process, the descriptor of the line to the rig, the
    rig's process, a folder to remove at the end or an empty text; what follows is for the host's ``serve``.
    """
    folder, module, name, descriptor, parent, put_aside, *rest = sys.argv[1:]
    signals = signal.SIGINT, signal.SIGTERM
    for number in signals:
        signal.signal(number, signal.SIG_IGN)  # they are for the rig, which ends this process in order
    signal.pthread_sigmask(signal.SIG_SETMASK, ())
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))  # a crash becomes a sentence and leaves no core file

    def end_all(_number: int, _frame: object) -> None:
        end_children()
        clear(put_aside)
        os._exit(128 + END_ALL)

    signal.signal(END_ALL, end_all)
    prctl(PR_SET_PDEATHSIG, END_ALL)
    prctl(PR_SET_CHILD_SUBREAPER, 1)
    if os.getppid() != int(parent):
        return
    line, this = socket.socket(fileno=int(descriptor)), os.getpid()
    child = os.fork()
    if child:
        line.close()
        guard(child, put_aside)
    signal.signal(END_ALL, signal.SIG_DFL)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
    prctl(PR_SET_NAME, name.encode())
    if os.getppid() != this:
        return
    keep_to_itself()
    line.set_inheritable(False)
    sys.path.insert(0, folder)
    try:
        importlib.import_module(module).serve(line, *rest)
    except (BrokenPipeError, ConnectionResetError):
        pass  # the rig has gone
    except OSError:
        os._exit(LINE_LOST)


if __name__ == "__main__":
    main()
