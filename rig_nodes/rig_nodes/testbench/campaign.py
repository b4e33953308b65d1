"""Many runs on all cores: what is measured of each comes back, the rows stay where they were made.

Used by the validation and the calibration.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from functools import partial
from multiprocessing import get_context
from typing import Any

from ..errors import RigError
from .configuration import load_rig
from .procedure import Series, run_repeat
from .record import Run
from .rig import Rig


class Workers:
    """Processes that work off lists of items; a context manager. jobs 1: everything in this process.

    They are spawned, not forked, and load the compiled plant from the cache, which :func:`warm_up` has filled. Ctrl-C
    reaches this process only; what has begun is finished, what has not is left.
    """

    def __init__(self, jobs: int = 2):
        self.jobs = max(1, jobs)
        self._pool: ProcessPoolExecutor | None = None

    def __enter__(self) -> Workers:
        if self.jobs > 1:
            warm_up()
            self._pool = ProcessPoolExecutor(self.jobs, get_context("spawn"))
            with _interrupts_ignored():  # by the processes too, which are started here
                for _ in range(self.jobs):
                    self._pool.submit(_begin)
        return self

    def __exit__(self, *_error) -> None:
        if self._pool is not None:
            self._pool.shutdown(wait=True, cancel_futures=True)
            self._pool = None

    def map(self, function: Callable[[Any], Any], items: Iterable,
            progress: Callable[[int, int], None] | None = None) -> list:
        """function(item) of each item, in their order. Function, items and results must be picklable, results small.

        progress(done, of) is called in this process as results come. An exception of any item ends the whole.
        """
        items = list(items)
        if self._pool is None:
            results = []
            for item in items:
                results.append(function(item))
                if progress:
                    progress(len(results), len(items))
            return results
        futures = [self._pool.submit(function, item) for item in items]
        left, told = set(futures), 0
        try:
            while left:
                done, left = wait(left, return_when=FIRST_COMPLETED)
                for future in done:
                    future.result()
                    told += 1
                    if progress:
                        progress(told, len(items))
        except BrokenProcessPool:
            raise RigError("a process of the campaign was killed from outside; with less memory take jobs=1") from None
        finally:
            for future in left:
                future.cancel()
        return [future.result() for future in futures]


def warm_up() -> None:
    """Compile the plant, or load it: so that of several processes none does it beside another."""
    Rig(load_rig()).advance_samples(1)


def _begin() -> None:
    """First task of a process."""


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


def run_campaign(series: list[Series], measure: Callable[[Series, Run], Any], rig: str = "hydmag",
                 settings: dict[str, str] | None = None, workers: Workers | None = None,
                 progress: Callable[[int, int], None] | None = None) -> list[list]:
    """measure(series, run) of every repeat of every series: one list for each series, one result for each repeat.

    measure: a function of a module, so that other processes find it; it runs where the rows are. rig, settings: as
    run_repeat's. workers: those of the caller, kept for the next campaign; without them two, for this one.
    """
    if workers is None:
        with Workers() as own:
            return run_campaign(series, measure, rig, settings, own, progress)
    tasks = [(one, repeat) for one in series for repeat in range(one.repeats)]
    results = iter(workers.map(partial(_measured, measure, rig, settings), tasks, progress))
    return [[next(results) for _ in range(one.repeats)] for one in series]


def _measured(measure, rig, settings, task):
    series, repeat = task
    return measure(series, run_repeat(series, repeat, rig, settings))
