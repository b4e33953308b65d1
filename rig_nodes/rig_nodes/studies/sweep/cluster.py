# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Runs members of a sweep on a Dask cluster: one that runs already, or processes on this machine.

The verb ``sweep`` uses it; Dask is loaded only here, when it is asked for.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from itertools import islice
from typing import TYPE_CHECKING

from ...base import RigError, optional
from ...runs import Lost

if TYPE_CHECKING:
    from dask.distributed import Client, Future

LOCAL = "local:"
AHEAD = 4  # tasks that are handed to each process in advance, so that it never waits for the next one
PATIENCE = "10s"  # for the scheduler's answer


@contextmanager
def dask_stream(address: str) -> Iterator[Callable]:
    """Yield a stream like Workers.stream that runs on Dask.

    Parameters
    ----------
    address : str
        ``local:N`` starts N processes on loopback; everything else is the address of a scheduler.

    Raises
    ------
    RigError
        When Dask is not installed, the number is not right, or no scheduler answers at the address.
    """
    optional("distributed", "sweep")
    from dask.distributed import Client, LocalCluster

    if address.startswith(LOCAL):
        count = address.removeprefix(LOCAL)
        if not count.isdigit() or int(count) < 1:
            raise RigError(f"--dask {address}: expected a number of processes, e.g. local:2")
        with (
            LocalCluster(
                n_workers=int(count), threads_per_worker=1, host="127.0.0.1", dashboard_address=None, silence_logs=50
            ) as cluster,
            Client(cluster) as client,
        ):
            yield lambda function, items: _stream(client, function, items)
        return
    try:
        client = Client(address, timeout=PATIENCE)
    except (OSError, ValueError) as error:
        raise RigError(
            f"--dask {address}: no scheduler answers there ({error or 'no answer'}); start one with "
            "'dask scheduler', or use local:2"
        ) from None
    with client:
        yield lambda function, items: _stream(client, function, items)


def _stream(client: Client, function: Callable, items: Iterable) -> Iterator[tuple[int, dict | None, Exception | None]]:
    """Yield (place, result, error) of each item as it finishes; only some items are submitted at a time."""
    from dask.distributed import KilledWorker, as_completed

    numbered = enumerate(items)
    places = {}

    def submit(place: int, item: object) -> Future:
        future = client.submit(function, item, pure=False)
        places[future.key] = place
        return future

    threads = sum(client.nthreads().values()) or 1
    running = as_completed([submit(*task) for task in islice(numbered, AHEAD * threads)])
    for future in running:
        task = next(numbered, None)
        if task is not None:
            running.add(submit(*task))
        place, error = places.pop(future.key), future.exception()
        if error is None:
            yield place, future.result(), None
        else:
            text = str(error) or repr(error)
            if isinstance(error, (KilledWorker, MemoryError)):  # of a process, not of the run: another attempt may succeed
                error = Lost(text)
            yield place, None, error if isinstance(error, RigError) else RuntimeError(text)
        future.release()
