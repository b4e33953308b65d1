# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A logger's channels of one run of any rig.

It is the base of analysis.metrics.Recording and the input of analysis.slip_tests.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..base.errors import RigError


@dataclass(frozen=True)
class Logged:
    """A logger's channels of one run.

    Attributes
    ----------
    t0 : float
        Time of row 0 [s].
    period : float
        Time between rows [s].
    channels : dict of str to (n,) array of float
        Values by name [SI], all of the same length.

    Raises
    ------
    RigError
        When a channel of ``needed`` is missing or the shapes do not fit.
    """

    t0: float
    period: float
    channels: dict[str, np.ndarray]

    use = "the results"  # what they are needed for, as the error names it

    def __post_init__(self) -> None:
        missing = [name for name in self.needed if name not in self.channels]
        if missing:
            raise RigError(f"the recording has no channel {', '.join(missing)}; {self.use} need {', '.join(self.needed)}")
        if not self.period > 0.0:
            raise RigError(f"the recording's period is {self.period} s; it must be above 0")
        lengths = {name: np.shape(self.channels[name]) for name in self.needed or self.channels}
        if len(set(lengths.values())) != 1 or len(next(iter(lengths.values()))) != 1:
            raise RigError(f"the recording's channels have the shapes {lengths}; all must be 1-D of one length")

    @property
    def needed(self) -> tuple[str, ...]:
        """The channels that must be present."""
        return ()

    @property
    def rows(self) -> int:
        """Number of rows."""
        return len(self.channels[next(iter(self.needed or self.channels))])
