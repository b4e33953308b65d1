# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Processes that work off lists of items: forked from a server that has the compiled plant in memory already.

Used by testbench.campaign and whoever runs campaigns; imports nothing heavy, so that a verb can start the server first.
"""

from __future__ import annotations

import signal
import threading
import traceback
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from multiprocessing import connection, forkserver, get_context
from typing import Any

from ..errors import RigError

TRIES = 2  # of an item in Workers.stream whose process was killed
PRELOADED = "rig_nodes.testbench.preloaded"
NO_PROCESSES = "the processes of the campaign cannot be started; one job (--jobs 1) needs none"


def start_server(*modules: str) -> None:
    """Let the processes' server begin to load, beside what this process does next; more calls do nothing.

    modules: what the work will need, beyond the plants. The server ends with this process, however it ends. RigError
    when it cannot be started.
    """
    get_context("forkserver").set_forkserver_preload([PRELOADED, *modules])
    with _interrupts_ignored():  # by the server and its processes too, which inherit it
        try:
            forkserver.ensure_running()
        except OSError as error:
            raise RigError(f"{NO_PROCESSES} ({error}; its socket stands in the temporary folder)") from None


class Workers:
    """Processes that work off lists of items; a context manager. jobs 1: everything in this process.

    They are forked from a server of their own, not from this process, whose threads and open files they would inherit,
    and not spawned anew, which costs each of them 1.5 s. Ctrl-C reaches this process only: what has begun is finished,
    what has not is left. They end with this process, however it ends. Not concurrent.futures: its threads may hang when
    an interrupt comes, and leave its processes behind.
    """

    def __init__(self, jobs: int = 2) -> None:
        self.jobs = max(1, jobs)
        self._processes: list = []
        self._ends: list[connection.Connection] = []
        self._busy: dict[connection.Connection, int] = {}  # with which task
        self._task = 0  # tasks given so far

    def __enter__(self) -> Workers:
        if self.jobs > 1:
            start_server()
            for _ in range(self.jobs):
                self._start()
        return self

    def _start(self) -> None:
        """One more process; RigError when the server that it is forked from has ended."""
        context = get_context("forkserver")
        here, there = context.Pipe()
        process = context.Process(target=_work, args=(there,), daemon=True)
        try:
            process.start()
        except (EOFError, ConnectionError):
            raise RigError(f"{NO_PROCESSES} (their server has ended)") from None
        there.close()
        self._ends.append(here)
        self._processes.append(process)

    def pids(self) -> list[int]:
        """Of the processes that are there."""
        return [process.pid for process in self._processes if process.is_alive()]

    def __exit__(self, *_error: object) -> None:
        self._leave()
        for process in self._processes:
            process.join()
        self._processes = []

    def _leave(self) -> None:
        for end in self._ends:
            end.close()
        self._ends, self._busy = [], {}

    def map(self, function: Callable[[Any], Any], items: Iterable, progress: Callable[[int, int], None] | None = None) -> list:
        """function(item) of each item, in their order. Function, items and results must be picklable, results small.

        progress(done, of) is called in this process as results come. An error of any item ends the whole: as it was
        raised here or if it is a RigError, another one of a process as RuntimeError with its traceback. After an
        interrupt, or when a process was killed, only __exit__ is left.
        """
        items = list(items)
        if self.jobs == 1:
            results = []
            for item in items:
                results.append(function(item))
                if progress:
                    progress(len(results), len(items))
            return results
        try:
            return self._map(function, items, progress)
        except KeyboardInterrupt:
            self._leave()
            raise
        except (EOFError, ConnectionError):
            self._leave()
            raise RigError("a process of the campaign was killed from outside; where memory is short, give it one job") from None

    def stream(self, function: Callable[[Any], Any], items: Iterable) -> Iterator[tuple[int, Any, Exception | None]]:
        """(place, result, error) of each item as it comes, for long lists that nothing may stop.

        ``error`` is None, or what the item raised: a RigError, a RuntimeError with the traceback. The place of a
        process that is killed is taken by a new one, which tries its item again; an item that has lost TRIES processes
        comes with a RigError. An interrupt is passed on; after it only __exit__ is left.
        """
        if self.jobs == 1:
            for place, item in enumerate(items):
                error, result = _answer(function, item)
                yield place, result, error
            return
        try:
            yield from self._stream(function, enumerate(items))
        except (KeyboardInterrupt, GeneratorExit):
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
                    with suppress(ConnectionError):  # of a process that is gone: its end says so below
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
                    error, result = RigError(f"{TRIES} processes were killed from outside while they ran it"), None
                yield place, result, error

    def _map(self, function: Callable[[Any], Any], items: list, progress: Callable[[int, int], None] | None) -> list:
        results, told = [None] * len(items), 0
        left, places = deque(range(len(items))), {}  # items not begun; task -> item
        while told < len(items):
            for end in self._ends:
                if end not in self._busy and left:
                    self._task += 1
                    self._busy[end], places[self._task] = self._task, left.popleft()
                    end.send((function, items[places[self._task]]))
            for end in connection.wait(list(self._busy)):
                error, result = end.recv()
                place = places.get(self._busy.pop(end))
                if place is None:
                    continue  # of a list that has ended with an error
                if error is not None:
                    raise error
                results[place] = result
                told += 1
                if progress:
                    progress(told, len(items))
        return results


def _work(end: connection.Connection) -> None:
    """A process: answers (function, item) with (error, result) until the other side is gone."""
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
    """(error, result) of function(item)."""
    try:
        return None, function(item)
    except RigError as error:
        return error, None
    except Exception:
        return RuntimeError(traceback.format_exc()), None


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
