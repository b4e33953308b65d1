# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The plug for a folder of Simulink Coder's or Embedded Coder's generated C or C++ with a rig_shim.c or rig_shim.cpp.

load.py makes it (include/rig_simulink.h describes the shim). The files of the folder and of all folders in it are
compiled together and run like a C library, in a process of their own.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

from ...base import RigError
from .library import COMPILERS, CLibrary, compile_library

SHIM = "rig_shim"  # followed by a suffix of C or C++
HEADERS = (".h", ".hpp", ".hh")
# main programs of the generator, which a library does not need
MAINS = ("ert_main", "rt_main", "grt_main", "rt_cppclass_main", "rt_malloc_main", "classic_main")


class SimulinkModel(CLibrary):
    """The model in a folder."""

    prefix = "simulink"

    def _load(self, rest: str, name: str) -> int:
        folder = Path(rest)
        if not folder.is_dir():
            raise RigError(f"controller {name}: there is no such folder; give the one with the generated C files")
        files = sorted(path for path in folder.rglob("*") if path.is_file())
        sources = [path for path in files if path.suffix in COMPILERS and path.stem not in MAINS]
        shims = [path for path in sources if path.stem == SHIM]
        if not shims:
            raise RigError(
                f"controller {name}: the folder has no {SHIM}.c or {SHIM}.cpp; './rig controller new simulink "
                "DIR' writes one to copy and change"
            )
        if len(shims) > 1:
            raise RigError(
                f"controller {name}: the folder has {len(shims)} shims, expected one: "
                f"{', '.join(str(path.relative_to(folder)) for path in shims)}"
            )
        headers = dict.fromkeys(path.parent for path in files if path.suffix in HEADERS)
        with tempfile.TemporaryDirectory(prefix="rig-controller-") as built:
            library = Path(built) / "model.so"
            compile_library(sources, library, name, (*(f"-I{place}" for place in (folder, *headers)), self._record_beside(built)))
            return self._start(library, name)
