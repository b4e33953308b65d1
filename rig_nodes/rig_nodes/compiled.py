# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The place where compiled code is kept between processes; every package with compiled code calls it before numba is loaded.

numba's own cache looks only at the file of a function, not at what it calls, so the folder has a key of all compiled sources,
the numba version and the processor.
"""

from __future__ import annotations

import hashlib
import os
import platform
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec, PathFinder
from importlib.metadata import version
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any, ClassVar

from .errors import RigError

if TYPE_CHECKING:
    import numpy as np

# Options of numba for what only compiled code calls: without the two functions by which Python and C would call it, which
# cost a third of the time to compile a small one. forceinline is said, because numba would take the caller's.
INNER = {"error_model": "numpy", "forceinline": False, "no_cpython_wrapper": True, "no_cfunc_wrapper": True}
INLINED = {**INNER, "forceinline": True}
_records: dict = {}  # record types that were made, each with itself as the key
_SOURCES = ("engine", "parts", "plant", "plant/friction", "alfa46", "instruments")


def one_record(dtype: np.dtype) -> np.dtype:
    """Return the first of all equal numpy record types that were made.

    numba knows the type of an argument by the object itself. A different object, even if equal, is compared field by field in each
    call, which costs more than the call does.
    """
    return _records.setdefault(dtype, dtype)


def cache_root() -> Path:
    """Return the environment's own folder if there is one that can be written, otherwise the user's cache."""
    if sys.prefix != sys.base_prefix and os.access(sys.prefix, os.W_OK):
        return Path(sys.prefix) / "var" / "kernel-cache"
    home = os.environ.get("XDG_CACHE_HOME") or os.path.join(os.path.expanduser("~"), ".cache")
    return Path(home) / "rig_nodes" / "kernel-cache"


def own_folder(folder: Path) -> bool:
    """Say whether a folder belongs to this user and no other user can write to it; files elsewhere may be planted."""
    try:
        about = folder.stat()
    except OSError:
        return False
    return about.st_uid == os.getuid() and not about.st_mode & 0o022


def _sources() -> hashlib._Hash:
    """A hash over all compiled sources."""
    key = hashlib.sha256()
    for folder in _SOURCES:
        for source in sorted((Path(__file__).resolve().parent / folder).glob("*.py")):
            key.update(source.name.encode())
            key.update(source.read_bytes())
    return key


def sources_key() -> str:
    """Return a key of the physics, the same on every machine; a sweep that is continued must have the key of its beginning."""
    return _sources().hexdigest()[:16]


def cache_key() -> str:
    """Return a key of everything that decides the machine code."""
    key, package = _sources(), Path(__file__).resolve().parent
    key.update(f"{version('numba')} {version('numpy')} {platform.python_version()} {_processor()}".encode())
    # numba finds its files by the source's path too, so a second checkout gets a folder of its own
    key.update(str(package).encode())
    return key.hexdigest()[:16]


def _processor() -> str:
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as info:
            return "".join(sorted({line for line in info if line.startswith(("model name", "flags"))}))
    except OSError:
        return platform.processor()


class _LeftOut(MetaPathFinder):
    """Keeps numba from loading what nothing here uses, which would take a quarter of a second of each start.

    numba asks for ``coverage`` only to learn whether it measures this process, for scipy's BLAS for products of matrices, and for
    ``yaml`` to read settings from a file of its own. It does without each of them; what is loaded already it finds as ever.
    """

    asks: ClassVar = {
        "coverage": "numba.misc.coverage_support",
        "yaml": "numba.core.config",
        "scipy": "numba.np.arraymath",
    }  # package -> who asks as it is loaded

    def find_spec(self, fullname: str, path: Sequence[str] | None, target: object = None) -> ModuleSpec | None:
        """Find numba's cache only; raise ModuleNotFoundError for a package that is left out while its asking module is loaded."""
        if fullname == "numba.core.caching":
            return _spec_of_cache(path)
        asking = sys.modules.get(self.asks.get(fullname.partition(".")[0], ""))
        if getattr(getattr(asking, "__spec__", None), "_initializing", False):
            raise ModuleNotFoundError(f"{fullname} is left out while numba is loaded", name=fullname)
        return None


def _spec_of_cache(path: Sequence[str] | None) -> ModuleSpec | None:
    """Return what Python needs to load numba's cache, whose functions are then read without all that compiling needs.

    numba prepares its compiler before it reads a function from its cache, which takes 0.14 s of processor time and is needed only
    where the function is not there; the compiler prepares itself then.
    """
    spec = PathFinder.find_spec("numba.core.caching", path)
    if spec is None or spec.loader is None:
        return spec
    load: Callable[[ModuleType], None] = spec.loader.exec_module

    def loaded(module: ModuleType) -> None:
        load(module)
        cache = getattr(module, "Cache", None)  # a numba that has it otherwise goes its own way
        if all(hasattr(cache, name) for name in ("load_overload", "_load_overload", "_guard_against_spurious_io_errors")):
            cache.load_overload = _read_only

    spec.loader.exec_module = loaded  # type: ignore[method-assign]
    return spec


def _read_only(cache: Any, signature: object, context: object) -> object:
    """Return a function from numba's cache, or None; in place of the method load_overload of numba's Cache."""
    from numba.core.runtime import rtsys

    rtsys.initialize(context)  # what the cached code calls
    with cache._guard_against_spurious_io_errors():
        return cache._load_overload(signature, context)


def use_kernel_cache() -> None:
    """Set numba's cache folder, unless the user has chosen one, and what numba leaves out; it is called before numba is imported.

    The folder holds machine code and numba's pickled index of it, which are executed as they are read. Only the folder's owner and
    rights protect them.

    Raises
    ------
    RigError
        When the folder belongs to another user, or others can write to it.
    """
    if not any(isinstance(finder, _LeftOut) for finder in sys.meta_path):
        sys.meta_path.insert(0, _LeftOut())
    if "NUMBA_CACHE_DIR" not in os.environ:
        os.environ["NUMBA_CACHE_DIR"] = str(cache_root() / cache_key())
        if "numba" in sys.modules:  # other code imported it, so it has read its settings already
            sys.modules["numba"].config.CACHE_DIR = os.environ["NUMBA_CACHE_DIR"]
    folder = Path(os.environ["NUMBA_CACHE_DIR"])
    with suppress(OSError):  # if the folder cannot be made, numba finds another place
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    if folder.is_dir() and not own_folder(folder):
        raise RigError(
            f"{folder}: the compiled code in it would run as it is, and others can write to it; delete it, or "
            "name a folder of your own by NUMBA_CACHE_DIR"
        )
