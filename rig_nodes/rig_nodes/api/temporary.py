# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The temporary folder of a run that is not saved; the run and its signals hold it."""

from __future__ import annotations

import shutil
import tempfile
import weakref
from pathlib import Path


class Temporary:
    """A temporary folder, which goes with the last object that holds it, and at once after an error within ``with``.

    Attributes
    ----------
    folder : Path
        A folder in it, with the permissions that every new folder gets, so that a copy of it has them too.
    """

    def __init__(self) -> None:
        parent = tempfile.mkdtemp(prefix="rig-run-")
        self._remove = weakref.finalize(self, shutil.rmtree, parent, ignore_errors=True)
        self.folder = Path(parent) / "run"
        self.folder.mkdir()

    def __enter__(self) -> Temporary:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_error: object) -> None:
        if kind is not None:
            self._remove()

    def __deepcopy__(self, _memo: dict) -> Temporary:
        return self
