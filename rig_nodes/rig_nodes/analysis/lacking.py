# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Where rows of channels are missing, in words; the analyses use it for the reason why they give no result."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..base import number_text


def what_is_missing(channels: Mapping[str, np.ndarray], start: float, period: float) -> str:
    """Return a sentence on the rows without values, such as ``M_wej has no values for 35 ms at 9.00 s``; empty when there are none.

    Parameters
    ----------
    channels : mapping of str to (n,) array of float
        The channels that are needed.
    start : float
        Time of their first row [s].
    period : float
        Time between rows [s].
    """
    missing = {name: ~np.isfinite(values) for name, values in channels.items()}
    names = [name for name, rows in missing.items() if rows.any()]
    if not names:
        return ""
    rows = np.logical_or.reduce([missing[name] for name in names])
    edges = np.flatnonzero(np.diff(rows, prepend=False, append=False))
    gaps = list(zip(edges[::2].tolist(), edges[1::2].tolist()))
    first, last = max(gaps, key=lambda gap: gap[1] - gap[0])
    many = f" in {len(gaps)} gaps, the longest" if len(gaps) > 1 else ""
    everything = (
        "the file has no rows"
        if len(names) == len(channels)
        else f"{', '.join(names)} {'has' if len(names) == 1 else 'have'} no values"
    )
    return f"{everything} for{many} {number_text(1e3 * (last - first) * period, 3)} ms at {start + first * period:.2f} s"
