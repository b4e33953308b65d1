# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A user's controller in a sweep: the same specification for all members, each with an instance of its own.

studies.sweep.plan and studies.sweep.run use it.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

from ...base import MOST_DELAY, RigError
from ...controllers import PLUGS, Plug, level_line, load_controller, split_level
from ...runs import check_controller, check_level

if TYPE_CHECKING:
    from ...rig import RigConfig

# kinds that the rig itself starts; the others are one program, which cannot drive several members at a time
STARTED = ("python", "c", "simulink", "fmu")


@dataclass(frozen=True)
class Plugged:
    """The controller of a sweep's members.

    Parameters
    ----------
    spec : str
        As for --controller, with a file by its absolute path.
    level : str or None
        The level asked for; None takes the controller's first.
    delay : int
        Samples from a measurement to the effect of the answer.
    """

    spec: str
    level: str | None
    delay: int

    def check(self, config: RigConfig) -> str:
        """Return the controller's level_line; RigError when it cannot be loaded or cannot act on this rig."""
        check_controller(config)
        plug = self.load(config)
        try:
            check_level(config, plug.level)
            return level_line(plug)
        finally:
            plug.close()

    def load(self, config: RigConfig) -> Plug:
        """Return a new instance for a member with this configuration."""
        return load_controller(self.spec, config, self.level)

    def digest(self) -> str | None:
        """Return a hash of the controller's own files, so that a changed one counts as another; None for the built-in one."""
        path = _file_of(self.spec)
        if path is None:
            return None
        files = sorted(p for p in path.rglob("*") if p.is_file()) if path.is_dir() else [path]
        found = hashlib.sha256()
        for file in files:
            found.update(file.name.encode() + b"\0" + file.read_bytes())
        return found.hexdigest()


def plugged_of(spec: str | None, level: str | None, delay: int, beside: Path | None = None) -> Plugged | None:
    """Return the controller that --controller, --level and --delay ask for.

    Parameters
    ----------
    spec : str or None
        The controller's specification.
    level : str or None
        "duty" or "current".
    delay : int
        Samples from a measurement to the effect of the answer.
    beside : Path or None
        Folder to which files are relative; None takes the working folder.

    Returns
    -------
    Plugged or None
        None for the embedded Alfa46.

    Raises
    ------
    RigError
        When a sweep cannot run the controller.
    """
    if not 0 <= delay <= MOST_DELAY:
        raise RigError(f"delay is {delay}, expected 0 to {MOST_DELAY} samples")
    if spec is None and level is None and delay == 1:
        return None
    text, level = split_level(spec or "alfa46", level)
    kind, sign, rest = text.partition(":")
    if kind in PLUGS and kind not in STARTED:
        raise RigError(
            f"controller {text}: it is one program of its own, which cannot drive the members of a sweep, "
            f"each from its beginning; a sweep takes {', '.join(f'{name}:' for name in STARTED)} and alfa46"
        )
    if sign and kind in STARTED:
        file, colon, name = rest.rpartition(":") if kind == "python" else (rest, "", "")
        path = (beside or Path()) / Path(file).expanduser()
        if file and path.exists():
            text = f"{kind}:{path.absolute()}{colon}{name}"
    return Plugged(text, level, delay)


def _file_of(spec: str) -> Path | None:
    """Return the file or folder that a controller is made of, None when none is known."""
    kind, _, rest = spec.partition(":")
    named = rest.rpartition(":")[0] if kind == "python" else rest
    if kind not in STARTED or not named:
        return None
    if Path(named).exists():
        return Path(named)
    if kind != "python":
        return None
    try:
        module = find_spec(named)
    except (ImportError, ValueError):
        return None
    return Path(module.origin) if module and module.origin else None
