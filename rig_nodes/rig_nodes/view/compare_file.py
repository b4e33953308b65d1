# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A comparison as a Rerun file: each signal of all recordings in one plot, above its differences; `rig compare --rrd` writes it."""

from __future__ import annotations

import math
import os
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..analysis import Comparison
from ..base import RigError
from ..rig import Signal
from . import layout
from .convert import APPLICATION, import_rerun
from .curves import times
from .palette import CURVES, rgb

if TYPE_CHECKING:
    from types import ModuleType

    from rerun import RecordingStream, SeriesLines


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
    axis = rrb.TimeAxis(link="LinkToGlobal")
    curves = [curve for curve in found.curves if curve.name in signals]
    views, columns = [], math.ceil(math.sqrt(max(len(curves), 1)))  # as a grid arranges them
    for curve in curves:
        title = f"{curve.name} [{signals[curve.name].display_unit}]"
        plots = [("recordings", title), ("differences", f"{title}, difference from the first")]
        both = [
            rrb.TimeSeriesView(
                name=name,
                origin=f"{curve.name}/{part}",
                axis_x=axis,
                plot_legend=rrb.PlotLegend("RightTop", visible=part == "recordings"),
            )
            for part, name in plots
        ]
        if not views:
            ends = [at for one in curves for at in (one.time[0], one.time[-1])]
            layout.open_with(both[0], layout.with_room((min(ends), max(ends)), layout.room_for(found.names, columns)))
        views.append(rrb.Vertical(*both, row_shares=[2, 1], name=curve.name))
    rec = rr.RecordingStream(APPLICATION, recording_id="comparison", send_properties=False)
    try:
        handle, name = tempfile.mkstemp(prefix=".compare-", suffix=".rrd", dir=path.parent)
    except OSError as error:
        raise RigError(f"{path}: cannot be written ({error.strerror}); choose another place") from None
    os.close(handle)
    try:
        rec.save(name, default_blueprint=layout.whole(rrb.Grid(*views), "collapsed", "expanded", "paused"))
        for curve in curves:
            shown = [np.asarray(signals[curve.name].shown(values), float) for values in curve.values]
            for n, values in enumerate(shown):
                colour = rgb(CURVES[n]) if n < len(CURVES) else None
                line = rr.SeriesLines(names=found.names[n], colors=colour, widths=1.5, aggregation_policy="MinMax")
                _send(rr, rec, f"{curve.name}/recordings/{n}", line, curve.time, values)
                if n:
                    _send(rr, rec, f"{curve.name}/differences/{n}", line, curve.time, values - shown[0])
        rec.flush()
        rec.disconnect()
        os.chmod(name, 0o644)  # mkstemp makes the file private
        os.replace(name, path)
    finally:
        Path(name).unlink(missing_ok=True)


def _send(rr: ModuleType, rec: RecordingStream, entity: str, line: SeriesLines, t: np.ndarray, values: np.ndarray) -> None:
    rec.log(entity, line, static=True)
    known = np.isfinite(values)
    rec.send_columns(entity, [times(rr, t[known])], rr.Scalars.columns(scalars=values[known]))
