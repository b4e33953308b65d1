# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A sequence simulated into a folder, with its report: what `rig simulate` and ``Rig.simulate`` do."""

from __future__ import annotations

import contextlib
import logging
from typing import TYPE_CHECKING

from ..analysis import build_report, gather
from ..base import STARTING, waiting
from ..runs import Ordered, simulate, unless_empty, write_run

if TYPE_CHECKING:
    import io
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from ..controllers import Plug


@contextlib.contextmanager
def controller_log(folder: Path) -> Iterator[None]:
    """Write tracebacks of user code to the run's logs; the file is made at the first one."""

    class LateFile(logging.FileHandler):
        def _open(self) -> io.TextIOWrapper:
            (folder / "logs").mkdir(exist_ok=True)
            return super()._open()

    handler = LateFile(folder / "logs" / "controller.log", delay=True, encoding="utf-8")
    log = logging.getLogger("rig_nodes.controllers")
    log.addHandler(handler)
    try:
        yield
    finally:
        log.removeHandler(handler)
        handler.close()


def simulated(
    folder: Path, ordered: Ordered, progress: Callable[[float, str], None] | None = None, controller: Plug | None = None
) -> dict:
    """Simulate what is ordered and write the run into a folder, all but its report; stderr says so while the plant compiles.

    Parameters
    ----------
    folder : Path
        The run's folder, which is there and empty.
    ordered : Ordered
        Configuration, sequence, seed and delay.
    progress : callable, optional
        It is called with the simulated time [s] and the text of the present step.
    controller : Plug, optional
        The controller in place of the embedded one; it is closed at the end.

    Returns
    -------
    dict
        The report (analysis.build_report); its ``run["end"]`` has state and reason of the end.

    Raises
    ------
    RigError
        When sequence or controller do not fit the rig, or the folder cannot be written.
    """
    starting = contextlib.ExitStack()

    def told(t: float, text: str) -> None:
        starting.close()
        if progress is not None:
            progress(t, text)

    with controller_log(folder), unless_empty(folder), starting:
        starting.enter_context(waiting(STARTING))
        write_run(folder, ordered)
        run = simulate(ordered.config, ordered.sequence, folder, ordered.seed, told, controller, ordered.delay)
    return build_report(gather(folder, run), run)
