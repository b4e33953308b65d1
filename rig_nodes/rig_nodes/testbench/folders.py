"""Where a run is written, and settings given on the command line; used by ``run`` and ``simulate``."""

from __future__ import annotations

from pathlib import Path

from ..errors import RigError


def run_folder(out: str | None, name: str) -> Path:
    """The folder for a run: ``out``, which must be new or empty, or the next free runs/<name>-<n>."""
    if out is not None:
        folder = Path(out)
        if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
            raise RigError(f"--out {out}: it exists and is not an empty folder; choose a new name")
    else:
        number = 1
        while (folder := Path("runs") / f"{name}-{number}").exists():
            number += 1
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RigError(f"{folder}: cannot be made ({error.strerror}); choose another place with --out") from None
    return folder


def parse_settings(settings: list[str]) -> dict[str, str]:
    """KEY=VALUE pairs of --set as a dict; RigError when one is not a pair or comes twice."""
    out: dict[str, str] = {}
    for text in settings:
        key, sign, value = text.partition("=")
        if not sign or not key or not value:
            raise RigError(f"--set {text}: expected KEY=VALUE, e.g. alfa46.t12=\"200 ms\"")
        if key in out:
            raise RigError(f"--set {key} is given twice")
        out[key] = value
    return out
