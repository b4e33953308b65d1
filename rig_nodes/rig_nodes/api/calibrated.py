# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The search for a rig's unknown parameters from Python, what `rig calibrate` does; it is ``rig_nodes.calibrate``."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from importlib import import_module
from typing import TYPE_CHECKING, Any

from ..base import SI, RigError, beside, find_config, load_yaml, quoted, unknown
from ..studies import calibrate as search
from ..studies import calibration_of, programme_of, rows_file, write_values
from .given import seed_of, texts, whole
from .rig import Rig, rig_from
from .table import Table

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from ..studies import Found, Miss, Parameter


@dataclass(frozen=True)
class Calibrated:
    """What a calibration found; :meth:`write` puts it into the rig.

    Parameters
    ----------
    rig : str
        Name, folder or file of the rig.
    found : Found
        Values, misses, spreads and sensitivities.
    known : dict of str to Parameter
        The searched parameters by ``stage.name``.
    curves : list
        The trade-offs of rows that pull against each other.
    """

    rig: str
    found: Found
    known: dict[str, Parameter]
    curves: list[Any]

    @property
    def parameters(self) -> Table:
        """A row for each parameter in SI: ``value``, bounds, and how well it is determined alone and with the others fitted."""
        of, known = self.found, self.known
        rows = [
            {
                "name": name,
                "value": value,
                "spread": of.spread[name],
                "profile": of.profile[name],
                "low": known[name].low,
                "high": known[name].high,
                "sets": ", ".join(known[name].of),
            }
            for name, value in of.values.items()
        ]
        return Table(dict.fromkeys(("name", "value", "spread", "profile", "low", "high", "sets"), ""), rows)

    @property
    def rows(self) -> Table:
        """A row for each that was searched on: its values ``before`` and ``after`` in SI, and its ``miss`` then in tolerances."""
        rows = [
            {"stage": stage, "row": after.row, "before": before.value, "after": after.value, "miss": after.tolerances}
            for stage, misses in self.found.after.items()
            for before, after in zip(self.found.before[stage], misses)
        ]
        return Table(dict.fromkeys(("stage", "row", "before", "after", "miss"), ""), rows)

    def as_dict(self) -> dict[str, Any]:
        """Return the result as `rig calibrate --json` writes it."""

        def plain(miss: Miss) -> dict:
            return {"row": miss.row, "value": miss.value, "tolerances": miss.tolerances}

        found = self.found
        return {
            "values": found.values,
            "spread": found.spread,
            "profile": found.profile,
            "sensitivities": found.sensitivities,
            "before": [plain(miss) for misses in found.before.values() for miss in misses],
            "after": [plain(miss) for misses in found.after.values() for miss in misses],
            "trade_offs": [asdict(curve) for curve in self.curves],
            "bounds": {name: [one.low, one.high] for name, one in self.known.items()},
            "units": SI,
        }

    def write(self) -> None:
        """Put the values into the rig's rig.yaml and the settings of its controller; RigError when they cannot be written."""
        file = find_config("rigs", self.rig)
        node = load_yaml(file)
        controller = find_config("controllers", beside(file, node["controller"])) if "controller" in node else file
        write_values(self.found.values, self.known, file, controller)


def calibrate(
    rig: Rig | str,
    *,
    generations: int = 120,
    starts: int = 0,
    stages: Sequence[str] | None = None,
    trade_offs: bool = False,
    jobs: int = 1,
    seed: int = 1,
    watch: Callable[[float, str], None] | None = None,
) -> Calibrated:
    """Find a rig's unknown parameters on its rows, as `rig calibrate`; nothing is changed until the result is written.

    Parameters
    ----------
    rig : Rig or str
        The rig, whose calibration.yaml says what may change.
    generations : int
        Of the search over the bounds; 0 only searches from where the rig is.
    starts : int
        Least squares from so many random places of the bounds too.
    stages : sequence of str, optional
        Only these of calibration.yaml.
    trade_offs : bool
        True to find too, on the laboratory's rows, what it costs to mend each of two that pull against each other.
    jobs : int
        Processes.
    seed : int
        Seed of the search.
    watch : callable, optional
        Called with the number of the generation and a text.

    Returns
    -------
    Calibrated
        The ``parameters`` and ``rows`` as tables, and ``write()``.

    Raises
    ------
    RigError
        When the rig has no rows or calibration of its own, there is no such stage, or a value that is tried is refused.

    Examples
    --------
    >>> rig_nodes.calibrate("three_speed", stages=["shifts"])
    Traceback (most recent call last):
    rig_nodes.base.errors.RigError: stages: there is no stage 'shifts'; ...
    """
    generations, starts, jobs = whole("generations", generations), whole("starts", starts), whole("jobs", jobs, 1)
    used, chosen = rig_from(rig), None if stages is None else texts("stages", stages)
    rows = rows_file(used.source)
    programme = programme_of(rows)
    if programme is not None and rows.parent != find_config("rigs", used.source).parent:
        base = rows.parent.name
        raise RigError(f"the rows of '{used.source}' are those of '{base}'; ./rig calibrate --rig {quoted(base)} searches on these")
    calibration = calibration_of(used.source, used.config)
    if trade_offs and programme is None:
        raise RigError(f"trade-offs belong to the laboratory's rows; those of '{used.source}' are its own")
    for stage in chosen or ():
        if stage not in calibration.stages:
            raise RigError(f"stages: {unknown('stage', stage, calibration.stages)}")
    show, curves = watch or (lambda _turn, _text: None), []

    def progress(stage: str, turn: int, cost: float) -> None:
        show(turn, f"{stage}: generation {turn}, misses cost {cost:.3f}")

    def pair(stage: str, one: str, other: str) -> None:
        show(0.0, f"{stage}: {one} against {other}")

    seed = seed_of(seed)
    found, config = search(used.config, calibration, generations, jobs, seed, chosen, progress, starts)
    if trade_offs:
        curves = import_module(f"{programme}.trade_off").trade_offs(config, found.after, found.sensitivities, jobs, pair)
    return Calibrated(used.source, found, calibration.parameters, curves)
