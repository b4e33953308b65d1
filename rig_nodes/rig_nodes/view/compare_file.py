# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A comparison as a Rerun file: each signal of all recordings in one plot, above its differences; `rig compare --rrd` writes it."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..analysis.side_by_side import Comparison
from ..catalogue import Signal
from ..errors import RigError
from .convert import APPLICATION, import_rerun
from .curves import times

if TYPE_CHECKING:
    from types import ModuleType

    from rerun import RecordingStream


def write_compare_file(found: Comparison, signals: Mapping[str, Signal], path: Path) -> None:
    """Write the file with its layout, whole or not at all.

    Parameters
    ----------
    found : Comparison
        The comparison.
    signals : mapping of str to Signal
        Signals of the first recording's rig, for units.
    path : Path
        The file.

    Raises
    ------
    RigError
        When rerun-sdk is missing or the file cannot be written.
    """
    rr = import_rerun()
    rrb = rr.blueprint
    curves = [curve for curve in found.curves if curve.name in signals]
    views = []
    for curve in curves:
        title = f"{curve.name} [{signals[curve.name].display_unit}]"
        plots = [("recordings", title), ("differences", f"{title}, difference from the first")]
        both = [rrb.TimeSeriesView(name=name, origin=f"{curve.name}/{part}") for part, name in plots]
        views.append(rrb.Vertical(*both, row_shares=[2, 1], name=curve.name))
    rec = rr.RecordingStream(APPLICATION, recording_id="comparison", send_properties=False)
    try:
        handle, name = tempfile.mkstemp(prefix=".compare-", suffix=".rrd", dir=path.parent)
    except OSError as error:
        raise RigError(f"{path}: cannot be written ({error.strerror}); choose another place") from None
    os.close(handle)
    try:
        rec.save(name, default_blueprint=rrb.Blueprint(rrb.Grid(*views)))
        for curve in curves:
            shown = [np.asarray(signals[curve.name].shown(values), float) for values in curve.values]
            for n, values in enumerate(shown):
                _send(rr, rec, f"{curve.name}/recordings/{n}", found.names[n], curve.time, values)
                if n:
                    _send(rr, rec, f"{curve.name}/differences/{n}", found.names[n], curve.time, values - shown[0])
        rec.flush()
        rec.disconnect()
        os.chmod(name, 0o644)  # mkstemp makes the file private
        os.replace(name, path)
    finally:
        Path(name).unlink(missing_ok=True)


def _send(rr: ModuleType, rec: RecordingStream, entity: str, name: str, t: np.ndarray, values: np.ndarray) -> None:
    rec.log(entity, rr.SeriesLines(names=name), static=True)
    known = np.isfinite(values)
    rec.send_columns(entity, [times(rr, t[known])], rr.Scalars.columns(scalars=values[known]))
