# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A run again: its commands through a plant, or its transducers through a controller; ``Run.rerun`` and `rig rerun`."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from ..analysis import build_report, gather, info_of, moved_lines, write_report
from ..base import RigError, brief, waiting
from ..controllers import load_controller
from ..rig import config_of_record
from ..runs import check_controller, check_whole, different_topics, rerun_controller, rerun_plant
from .rig import Rig, rig_from, spec_of, with_settings
from .run import Run
from .simulated import controller_log
from .temporary import Temporary

if TYPE_CHECKING:
    from ..analysis import Gathered
    from ..controllers import Plug
    from ..rig import RigConfig
    from ..runs import Answers

AGAIN = "running the bag again"
PLANT = "plant"


class Rerun(NamedTuple):
    """A run that was run again, and how it compares with the first one.

    Parameters
    ----------
    run : Run
        The new run.
    topics : int
        After a plant the number of topics that are compared.
    different : list of str
        Those that are not bit for bit as recorded.
    moved : list of str
        Sentences on the metrics of shifts that moved, where topics differ.
    notes : list of str
        Sentences on what could not be repeated.
    answers : Answers or None
        After a controller: ``samples``, those with the ``same`` bits, the ``largest`` difference of a command (duty, or [A]), the
        time of the ``first`` other answer [s], ``gears``, ``missing``, and why it came to an ``end`` early.
    """

    run: Run
    topics: int
    different: list[str]
    moved: list[str]
    notes: list[str]
    answers: Answers | None


def rerun_of(run: Run, through: str | type, rig: Rig | str | None, settings: Mapping[str, Any] | None, level: str | None) -> Rerun:
    """Run a run again into a temporary folder; the arguments are as of ``Run.rerun``."""
    if not isinstance(through, str | type):
        raise RigError(f"through is {brief(through)}, expected 'plant', or a controller: its specification or its class")
    if through == PLANT and level is not None:
        raise RigError("level is of a controller; the recorded commands have their own")
    bag = gather(run.folder)
    check_whole(bag)
    if rig is None:
        rig = Rig(str(run.folder), config_of_record(bag.record, str(bag.path)), {})
    config = with_settings(rig_from(rig), settings or {}).config
    with Temporary() as kept:
        if through == PLANT:
            found = rerun_into(kept.folder, bag, config)
        else:
            spec = spec_of(through)
            check_controller(config)
            plug = load_controller(spec, config, level)
            plug.wait(60.0)
            found = rerun_into(kept.folder, bag, config, plug, spec)
    return found._replace(run=Run(kept.folder, None, kept))


def rerun_into(folder: Path, bag: Gathered, config: RigConfig, controller: Plug | None = None, spec: str = "") -> Rerun:
    """Run a bag again into a folder; stderr says so while it lasts.

    Parameters
    ----------
    folder : Path
        The new run's folder, which is there and empty.
    bag : Gathered
        The bag.
    config : RigConfig
        The rig.
    controller : Plug, optional
        A controller that answers the recorded transducers, and that is closed at the end; by default the recorded commands go
        through a plant.
    spec : str
        The controller's specification, for the record.

    Returns
    -------
    Rerun
        The new run.

    Raises
    ------
    RigError
        When the bag does not hold what is needed, or does not fit the rig.
    """
    if controller is not None:
        with controller_log(folder), waiting(AGAIN):
            answers = rerun_controller(bag, config, controller, spec, folder)
        return Rerun(Run(folder), 0, [], [], [], answers)
    with waiting(AGAIN):
        notes, end = rerun_plant(bag, config, folder)
    new = gather(folder)
    report = build_report(new, {**info_of(new), "mode": "rerun", "end": end})
    write_report(folder, report)
    different = different_topics(bag, new)
    moved = moved_lines(build_report(bag, info_of(bag)), report) if different else []
    return Rerun(Run(folder, report), len(new.types) - 1, different, moved, notes, None)
