# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the rig and detectors of faults come to, as `rig bench` and `rig faults bench` measure; ``rig_nodes.bench`` and others."""

from __future__ import annotations

from collections.abc import Sequence
from numbers import Real
from typing import TYPE_CHECKING, Any

from ..base import RigError, brief, need_ros, unknown
from ..studies import TITLES
from .given import seed_of, texts, whole

if TYPE_CHECKING:
    from collections.abc import Callable

    from ..studies import Course
    from .rig import Rig


def bench(rig: Rig | str, parts: Sequence[str] | None = None, *, repeats: int = 5) -> dict[str, Any]:
    """Measure how fast the rig computes on this machine, as `rig bench`.

    Parameters
    ----------
    rig : Rig or str
        The rig of the parts kernel, controllers and scaling, as it is without settings.
    parts : sequence of str, optional
        Of kernel, rigs, demo, graph, controllers, scaling and peers; all by default, which takes some minutes.
    repeats : int
        The fastest of so many runs counts.

    Returns
    -------
    dict
        ``machine`` and, under each part's name, its numbers as `rig bench --json` writes them; their names end with their units.

    Raises
    ------
    RigError
        When there is no such part, or the graph is to be measured without ROS 2.

    Examples
    --------
    >>> rig_nodes.bench("hydmag", ["kernels"])
    Traceback (most recent call last):
    rig_nodes.base.errors.RigError: there is no part to measure 'kernels'; did you mean 'kernel'?
    """
    from ..studies import machine
    from .rig import rig_from

    chosen, repeats, source = parts_of(parts), whole("repeats", repeats, 1), rig_from(rig).source
    return {"machine": machine(), **{part: measured(part, source, repeats, lambda _: None) for part in chosen}}


def parts_of(parts: Sequence[str] | None) -> list[str]:
    """Return parts of the measurement in their order, all for none and for "all"; RigError for an unknown one."""
    given = texts("parts", parts)
    for part in given:
        if part not in (*TITLES, "all"):
            raise RigError(unknown("part to measure", part, (*TITLES, "all")))
    return list(TITLES) if not given or "all" in given else [part for part in TITLES if part in given]


def measured(part: str, rig: str, repeats: int, show: Callable[[str], None]) -> dict | list[dict] | str:
    """Measure one part.

    Parameters
    ----------
    part : str
        The part.
    rig : str
        Name or file of the rig.
    repeats : int
        As of :func:`bench`.
    show : callable
        Called with a text on what is measured.

    Returns
    -------
    dict, list of dict or str
        The numbers, or why there are none.

    Raises
    ------
    RigError
        For the graph without ROS 2.
    """
    # each part imports what it measures, so that help and refusals need no compiler
    if part == "kernel":
        from ..studies import bench_kernel

        return bench_kernel(rig, repeats, show)
    if part == "rigs":
        from ..studies import bench_rigs

        return bench_rigs(repeats, show)
    if part == "demo":
        from ..studies import bench_demo

        return bench_demo(repeats, show)
    if part == "graph":
        from ..studies import bench_graph

        need_ros("rig bench graph")
        return bench_graph(min(repeats, 3), show)
    if part == "controllers":
        from ..rig import load_rig
        from ..studies import controllers_table

        show("every plug")
        rows = [cost._asdict() for cost in controllers_table(load_rig(rig))]
        return [{**row, "median_us": None, "p99_us": None} if row["missing"] else row for row in rows]
    if part == "scaling":
        from ..studies import bench_scaling

        return bench_scaling(rig, show)
    from ..studies import bench_peers

    return bench_peers(0.05 * repeats, show)


def bench_faults(
    rig: Rig | str,
    detector: Callable[[Course], Any] | None = None,
    *,
    seed: int = 1,
    healthy: int = 200,
    repeats: int = 1,
    sizes: Sequence[float] = (0.25, 0.5, 1.0, 2.0),
    jobs: int = 1,
    watch: Callable[[str, int, int], None] | None = None,
) -> dict[str, Any]:
    """Score a detector of faults on healthy and ill runs, as `rig faults bench`.

    Parameters
    ----------
    rig : Rig or str
        The rig.
    detector : callable, optional
        detector(course) gets of each run the times ``t`` [s] and the ``signals`` by name as arrays (n,) in SI, the ordered
        ``gear`` (n,) and the rig's ``config``, and returns None, or the time of its alarm [s] and the names of faults, the
        likeliest first; by default the rig's own baseline, which learns from healthy runs first.
    seed : int
        Seed of the runs.
    healthy : int
        Healthy runs.
    repeats : int
        Runs for each fault and size.
    sizes : sequence of float
        Sizes over the usual one.
    jobs : int
        Processes.
    watch : callable, optional
        Called with what is done, and the numbers of finished and of all runs.

    Returns
    -------
    dict
        Scores as `rig faults bench --json` writes them, each rate as [how many, of how many].

    Raises
    ------
    RigError
        When the rig has no gears, a number does not fit, or the detector returns something else.

    Examples
    --------
    >>> rig_nodes.bench_faults("ural2")
    Traceback (most recent call last):
    rig_nodes.base.errors.RigError: the benchmark of fault detectors is for a rig with gears ...
    """
    from ..studies import bench_faults as score
    from .rig import rig_from

    if detector is not None and not callable(detector):
        raise RigError(f"detector is {brief(detector)}, expected a function of a run's course")
    counts = seed_of(seed), whole("healthy", healthy, 1), whole("repeats", repeats, 1)
    if not isinstance(sizes, Sequence) or not sizes or not all(isinstance(one, Real) and one > 0.0 for one in sizes):
        raise RigError(f"sizes is {brief(sizes)}, expected numbers above 0, e.g. 0.5, 1 and 2")
    return score(rig_from(rig).config, *counts, [*map(float, sizes)], detector=detector, jobs=whole("jobs", jobs, 1), tell=watch)
