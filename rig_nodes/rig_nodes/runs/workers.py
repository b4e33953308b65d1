# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Processes that work through lists of items; they are forked from a server that has the compiled plant in memory.

runs.campaign and all that runs campaigns use it. It imports nothing heavy, so that a command can start the server first.
"""

from __future__ import annotations

import json
import os
import signal
import sys
import threading
import traceback
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import closing, contextmanager, suppress
from multiprocessing import connection, forkserver, get_context
from types import ModuleType
from typing import Any

from ..base import RigError, Uninterrupted

TRIES = 2  # of an item in Workers.stream whose process was killed
PRELOADED = "rig_nodes.runs.preloaded"
RIGS_PRELOADED = "RIG_PRELOADED"  # variable of the environment, with the names or files of rigs as a JSON list
NO_PROCESSES = "the processes of the campaign cannot be started; one job needs none (--jobs 1, in Python jobs=1)"


class Lost(RigError):
    """An item that no process finished: they were killed, or memory was short. Another attempt may succeed."""


def start_server(*modules: str, rigs: Iterable[str] = ()) -> None:
    """Start the processes' server, which loads while this process goes on; further calls do nothing.

    The server ends with this process, whatever ends it.

    Parameters
    ----------
    *modules : str
        Modules that the work will need in addition to the plants.
    rigs : iterable of str
        Names or files of the rigs whose plants it will need.

    Raises
    ------
    RigError
        When the server cannot be started.
    """
    get_context("forkserver").set_forkserver_preload([PRELOADED, *modules])
    os.environ[RIGS_PRELOADED] = json.dumps(list(rigs))
    with _interrupts_ignored():  # the server and its processes inherit this
        try:
            forkserver.ensure_running()
        except OSError as error:
            raise RigError(f"{NO_PROCESSES} ({error}; its socket is in the temporary folder)") from None


class Workers:
    """Processes that work through lists of items, as a context manager.

    They are forked from a server of their own. If they were forked from this process, they would inherit its threads and open
    files; to start them anew costs 1.5 s each. Ctrl-C reaches this process only, which then ends the others, as at any error: an
    item may take half a minute. The processes end with this one, whatever ends it. concurrent.futures is not used, because its
    threads may hang at an interrupt and leave their processes behind.

    Parameters
    ----------
    jobs : int
        Number of processes; with 1 everything is done in this process.
    """

    def __init__(self, jobs: int = 2) -> None:
        self.jobs = max(1, jobs)
        self._processes: list = []
        self._ends: list[connection.Connection] = []

    def __enter__(self) -> Workers:
        if self.jobs > 1:
            start_server()
            while len(self._ends) < self.jobs:
                self._start()  # they load while this process goes on
        return self

    def _start(self) -> None:
        """Start one more process; RigError when the server from which it is forked has ended."""
        context = get_context("forkserver")
        here, there = context.Pipe()
        process = context.Process(target=_work, args=(there,), daemon=True)
        with Uninterrupted() as started, _callers_main_hidden():
            started.held = True  # a process that is left before it has got its work ends with a traceback
            try:
                process.start()
            except (EOFError, ConnectionError):
                raise RigError(f"{NO_PROCESSES} (their server has ended)") from None
            there.close()
            self._ends.append(here)
            self._processes.append(process)

    def pids(self) -> list[int]:
        """Return the ids of the processes that are alive."""
        return [process.pid for process in self._processes if process.is_alive()]

    def __exit__(self, kind: type[BaseException] | None, *_error: object) -> None:
        self._leave()
        for process in self._processes:
            if kind is not None:
                process.kill()
            process.join()
        self._processes = []

    def _leave(self) -> None:
        for end in self._ends:
            end.close()
        self._ends = []

    def map(self, function: Callable[[Any], Any], items: Iterable, progress: Callable[[int, int], None] | None = None) -> list:
        """Return the results of all items, in the order of the items.

        Parameters
        ----------
        function : callable
            It is called with one item. Function, items and results must be picklable, and the results small.
        items : iterable
            The items.
        progress : callable, optional
            It is called in this process with the numbers of done and of all items, as results arrive.

        Returns
        -------
        list
            function(item) of each item.

        Raises
        ------
        RigError
            When an item raised it, or has lost TRIES processes.
        RuntimeError
            With the traceback, when an item raised anything else.
        """
        items = list(items)
        results = [None] * len(items)
        with closing(self.stream(function, items)) as answers:
            for done, (place, result, error) in enumerate(answers, 1):
                if error is not None:
                    raise error
                results[place] = result
                if progress:
                    progress(done, len(items))
        return results

    def stream(self, function: Callable[[Any], Any], items: Iterable) -> Generator[tuple[int, Any, Exception | None]]:
        """Yield the result of each item as it arrives, for long lists that no failing item may stop.

        A process that is killed is replaced by a new one, which tries its item again; an item that has lost TRIES processes
        yields Lost. An interrupt is passed on. The processes end when the caller does not take all results.

        Parameters
        ----------
        function : callable
            It is called with one item.
        items : iterable
            The items.

        Yields
        ------
        place : int
            Place of the item in the list.
        result : object
            function(item); None after an error.
        error : Exception or None
            What the item raised: a RigError, or a RuntimeError with the traceback.
        """
        if self.jobs == 1:
            for place, item in enumerate(items):
                error, result = _answer(function, item)
                yield place, result, error
            return
        while len(self._ends) < self.jobs:
            self._start()
        try:
            yield from self._stream(function, enumerate(items))
        except BaseException:
            self._leave()
            raise

    def _stream(
        self, function: Callable[[Any], Any], numbered: Iterator[tuple[int, Any]]
    ) -> Iterator[tuple[int, Any, Exception | None]]:
        busy: dict[connection.Connection, tuple[int, Any]] = {}
        again: deque[tuple[int, Any]] = deque()
        lost: dict[int, int] = {}  # place -> processes
        while True:
            for end in list(self._ends):
                if end not in busy:
                    task = again.popleft() if again else next(numbered, None)
                    if task is None:
                        break
                    busy[end] = task
                    with suppress(ConnectionError):  # a process that is gone is found below, where its answer is read
                        end.send((function, task[1]))
            if not busy:
                return
            for end in connection.wait(list(busy)):
                place, item = busy.pop(end)
                try:
                    error, result = end.recv()
                except (EOFError, ConnectionError):
                    self._ends.remove(end)
                    end.close()
                    self._start()
                    lost[place] = lost.get(place, 0) + 1
                    if lost[place] < TRIES:
                        again.append((place, item))
                        continue
                    lack = "where memory is short, give it fewer jobs"
                    error, result = Lost(f"{TRIES} processes were killed from outside while they ran it; {lack}"), None
                yield place, result, error


def _work(end: connection.Connection) -> None:
    """Run in a process: answer (function, item) with (error, result) until the other side is gone."""
    while True:
        try:
            function, item = end.recv()
        except (EOFError, ConnectionError):
            return
        try:
            end.send(_answer(function, item))
        except ConnectionError:
            return


def _answer(function: Callable[[Any], Any], item: Any) -> tuple[Exception | None, Any]:
    """Return the error and the result of function(item)."""
    try:
        return None, function(item)
    except RigError as error:
        return error, None
    except MemoryError:
        return Lost("there is not enough memory for this item; give it fewer jobs"), None
    except Exception:
        return RuntimeError(traceback.format_exc()), None


@contextmanager
def _callers_main_hidden() -> Iterator[None]:
    """Let a process start without the script of the caller, which multiprocessing imports otherwise.

    The work is in modules, and a script that starts it at its end, or comes from stdin, would start or fail again in each process.
    """
    main, sys.modules["__main__"] = sys.modules["__main__"], ModuleType("__main__")
    try:
        yield
    finally:
        sys.modules["__main__"] = main


@contextmanager
def _interrupts_ignored() -> Iterator[None]:
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
