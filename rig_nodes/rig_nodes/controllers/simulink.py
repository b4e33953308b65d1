"""The plug for a folder of Simulink Coder's or Embedded Coder's generated C with a rig_shim.c (include/rig_simulink.h).

Made by load.py. The files are compiled together and run as a C library does, in a process of their own.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

from ..errors import RigError
from .c_library import CLibrary, compile_library

SHIM = "rig_shim.c"
MAINS = ("ert_main.c", "rt_main.c")  # main programs of the generator's, which a library has no use for


class SimulinkModel(CLibrary):
    """The model of a folder."""

    prefix = "simulink"

    def _load(self, rest: str, name: str) -> int:
        folder = Path(rest)
        if not folder.is_dir():
            raise RigError(f"controller {name}: there is no such folder; give the one with the generated C files")
        if not (folder / SHIM).is_file():
            raise RigError(f"controller {name}: the folder has no {SHIM}; './rig controller new simulink DIR' writes "
                           "one to copy and change")
        sources = sorted(path for path in folder.glob("*.c") if path.name not in MAINS)
        with tempfile.TemporaryDirectory(prefix="rig-controller-") as built:
            library = Path(built) / "model.so"
            compile_library(sources, library, name, (f"-I{folder}",))
            return self._start(library, name)
