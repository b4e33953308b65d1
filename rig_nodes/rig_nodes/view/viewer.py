# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The Rerun viewer as a process: its program, its environment, and its window.

`rig view` and view.picture use it. The viewer listens on loopback only and sends no usage statistics to its makers.
"""

from __future__ import annotations

import ctypes
import json
import os
import signal
import subprocess
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import IO

from ..base import RigError, quoted
from .convert import import_rerun

PR_SET_PDEATHSIG = 1
START = 2.0  # s; a viewer that cannot open a window ends within this time


def program() -> str:
    """Return the path of the viewer's program; RigError when the installed rerun-sdk does not contain it.

    The `rerun` on the PATH is a script that starts this program as its child and leaves the child running when it is ended.
    """
    import_rerun()
    import rerun_cli

    path = Path(rerun_cli.__file__).with_name("rerun")
    if not os.access(path, os.X_OK):
        raise RigError(f"{path}: rerun-sdk has no viewer here; install its wheel: 'pip install rerun-sdk'")
    return str(path)


def surroundings(folder: Path) -> dict[str, str]:
    """Return the environment of a viewer that keeps its settings in ``folder``, with usage statistics switched off."""
    settings = folder / "rerun" / "analytics.json"
    settings.parent.mkdir(parents=True, exist_ok=True)
    settings.write_text(
        json.dumps(
            {
                "analytics_enabled": False,
                "analytics_id": "",
                "metadata": {},
                "config_file_path": str(settings),
                "data_dir_path": str(folder / "rerun" / "analytics"),
            }
        ),
        encoding="utf-8",
    )
    return {**os.environ, "XDG_CONFIG_HOME": str(folder)}


def in_theme(surrounding: dict[str, str], folder: Path, theme: str) -> dict[str, str]:
    """Return the environment of a viewer with a window in a theme, "dark" or "light", whose own state is kept in ``folder``.

    The viewer has no option for the theme and takes it from the state of its last use, so this function writes such a state.
    """
    rr = import_rerun()
    state = folder / "rerun" / "app.ron"
    state.parent.mkdir(parents=True, exist_ok=True)
    options = f"(options:(theme_preference:{theme.capitalize()}))"
    state.write_text(json.dumps({"rerun.version": rr.__version__, "egui": options}), encoding="utf-8")
    return {**surrounding, "XDG_DATA_HOME": str(folder)}


def child(
    arguments: Sequence[str], environment: Mapping[str, str], words: IO[bytes] | int = subprocess.DEVNULL, outlives: bool = False
) -> subprocess.Popen:
    """Start the viewer's program; it ends with this process unless it ``outlives`` it. ``words`` takes what it prints as errors."""
    libc = ctypes.CDLL(None)
    return subprocess.Popen(
        [program(), *arguments],
        env=environment,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=words,
        start_new_session=True,
        preexec_fn=None if outlives else lambda: libc.prctl(PR_SET_PDEATHSIG, signal.SIGKILL),
    )


def has_display() -> bool:
    """Return True when a window can be opened."""
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def command_for(source: Path | str) -> str:
    """Return the command that shows a file or an address, with the version that reads it."""
    rr = import_rerun()
    return f"rerun {quoted(source)} (rerun-sdk {rr.__version__}: pip install rerun-sdk=={rr.__version__})"


def open_window(view: Path | str, theme: str | None = None) -> int:
    """Show a file, or the live view at an address, in a viewer that outlives this command.

    Parameters
    ----------
    view : Path or str
        The file or the address.
    theme : str, optional
        "dark" or "light"; by default the user's choice in the viewer's settings.

    Returns
    -------
    int
        The viewer's process id.

    Raises
    ------
    RigError
        When the viewer ends at once, e.g. because a graphics driver is missing; the error contains its last output.
    """
    home = Path(os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache"), "rig_nodes")
    environment = surroundings(home)
    if theme:
        environment = in_theme(environment, home / theme, theme)
    with tempfile.TemporaryFile() as words:
        viewer = child(["--bind", "127.0.0.1", "--port", "auto", str(view)], environment, words, outlives=True)
        try:
            code = viewer.wait(START)
        except subprocess.TimeoutExpired:
            viewer.returncode = 0  # set so that Python does not warn about the viewer, which keeps running
            return viewer.pid
        words.seek(0)
        lines = [line.strip() for line in words.read().decode(errors="replace").splitlines() if line.strip()]
    raise RigError(
        f"the viewer ended at once with code {code} ({lines[-1] if lines else 'it printed nothing'}); "
        f"'rig view RUN --picture view.png' needs no display"
    )
