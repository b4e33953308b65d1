# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The state of a rig at a moment, as runs.rig.Rig gives and takes it: plain data that can be pickled, for branches of a run."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cache
from typing import TYPE_CHECKING, Any

from .. import __version__
from ..base import RigError, sources_key

if TYPE_CHECKING:
    import numpy as np

    from ..rig import RigConfig


@cache
def physics() -> str:
    """Return the version of rig_nodes with the key of its compiled sources: a state goes on only in the physics that made it."""
    return f"{__version__} ({sources_key()})"


@dataclass(frozen=True)
class Snapshot:
    """The whole state of a rig at a moment.

    Parameters
    ----------
    first : RigConfig
        The configuration that the rig was made from.
    made : mapping of str to object
        What else it was made from: seed, controller, devices and delay.
    values : mapping of str to object
        Plain values by the names of the rig's attributes.
    to_come : tuple
        Commands that do not act yet: boundary, name of the function, values.
    arrays : tuple of array
        Plant; settings, outputs and state of the controller; transducers; and the logger's rows of this sample and of that before
        it (2, channels) [SI].
    noise : tuple
        Whether the noise is on, and how often it was changed.
    cuts : tuple
        What the cuts give of themselves.
    faults : tuple
        The orders of faults that are not over.
    version : str
        As of :func:`physics`; empty in a snapshot of a version that did not keep it.
    """

    first: RigConfig = field(repr=False)
    made: dict[str, Any]
    values: dict[str, Any]
    to_come: tuple = field(repr=False)
    arrays: tuple[np.ndarray, ...] = field(repr=False)
    noise: tuple[bool, int] = field(repr=False)
    cuts: tuple = field(repr=False)
    faults: tuple = field(repr=False, default=())
    version: str = field(repr=False, default="")

    def check_fits(self, first: RigConfig, made: dict[str, Any]) -> None:
        """Check that a rig can go on from here.

        Parameters
        ----------
        first : RigConfig
            The configuration that the rig was made from.
        made : dict of str to object
            What else it was made from.

        Raises
        ------
        RigError
            When the rig was made from something else or by another version; the sentence names the first difference.
        """
        if self.version != physics():
            raise RigError(
                f"the snapshot is of rig_nodes {self.version or 'of an earlier version'}, and this is {physics()}, which "
                "cannot go on with it; make a new one"
            )
        for name, value in made.items():
            if self.made[name] != value:
                raise RigError(f"the snapshot is of a run with {name} {self.made[name]}, and this one has {name} {value}")
        if first is self.first:
            return
        if first.name != self.first.name:
            raise RigError(f"the snapshot is of the rig '{self.first.name}', and this one is '{first.name}'")
        ours, theirs = first.as_dict(), self.first.as_dict()
        other = [name for name in {**ours, **theirs} if ours.get(name) != theirs.get(name)]
        if other:
            raise RigError(
                f"the snapshot is of a rig '{first.name}' with another configuration ({', '.join(other)} differ); "
                "make the session with the same settings"
            )
