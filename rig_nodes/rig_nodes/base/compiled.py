# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Functions that numba compiles, and the place where compiled code is kept between processes.

Every package with compiled code calls :func:`use_kernel_cache` before anything loads numba. numba's own cache looks only at the
file of a function, not at what it calls, so the folder has a key of all compiled sources, the numba version and the processor.
Of several processes that need the same code one compiles it, and the others wait for what it keeps.
"""

from __future__ import annotations

import fcntl
import gc
import hashlib
import os
import platform
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import cache, cached_property, update_wrapper
from importlib import import_module
from importlib.machinery import ModuleSpec, PathFinder
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from .errors import RigError
from .versions import version_of

# Options of numba for what only compiled code calls: without the two functions by which Python and C would call it, which
# take a third of the compile time of a small one, and without counting references to arrays, which takes an eighth of that of a
# large one and serves only what allocates. forceinline is stated, because numba would otherwise take the caller's.
INNER = {"error_model": "numpy", "forceinline": False, "no_cpython_wrapper": True, "no_cfunc_wrapper": True, "_nrt": False}
ALLOCATES = {**INNER, "_nrt": True}
INLINED = {**INNER, "forceinline": True}
_records: dict = {}  # record types that were made, each with itself as the key
_SOURCES = ("driveline", "plant", "plant/engine", "plant/friction", "plant/instruments", "plant/parts")


def one_record(dtype: np.dtype) -> np.dtype:
    """Return the first of all equal numpy record types that were made.

    numba recognises the type of an argument by the identity of the type object. A different object, even if equal, is compared
    field by field in each call, which takes longer than the call itself.
    """
    return _records.setdefault(dtype, dtype)


def _kind(argument: object) -> object:
    """Return what numba takes the type of an argument from; it takes 4 ms itself for arrays of records, and this one 20 us."""
    if isinstance(argument, tuple):
        return type(argument), tuple(map(_kind, argument))
    if isinstance(argument, np.ndarray):
        return argument.dtype, argument.ndim, argument.flags.num
    return type(argument)


class Compiled:
    """A function of compiled code, which numba makes of a Python function when it is first called, compiled or called by another.

    So numba is loaded only where something is computed: a report or a view, which reads rigs and bags, needs a rig's parts but
    neither the 0.2 s nor the 65 MB of numba. All attributes of numba's own function can be read here too.

    Attributes
    ----------
    py_func : function
        The Python function.
    """

    def __init__(self, function: Callable, make: Callable[[Callable], Any]) -> None:
        """Keep the function and what makes numba's function of it."""
        update_wrapper(self, function)
        self.py_func, self._make, self._entries = function, make, {}

    @cached_property
    def made(self) -> Any:
        """Numba's own function; a direct call of it saves 0.1 us."""
        return self._make(self.py_func)

    @property
    def _numba_type_(self) -> object:
        """The type of numba's function, for which numba asks where compiled code calls this one."""
        if hasattr(self.made, "_numba_type_"):
            return self.made._numba_type_
        from numba.core.registry import cpu_target

        context = cpu_target.typing_context
        context.refresh()  # registers the intrinsic in it
        return context.resolve_value_type(self.made)

    def entry_for(self, *arguments: Any) -> Callable:
        """Return what numba compiles for arguments of these types, to be called with such arguments only.

        A call of numba's own function looks at the type of every argument, which takes 6 us for tuples of arrays. This one takes
        0.5 us and looks at none: an argument of another type is read as if it were of the type given here.

        Parameters
        ----------
        *arguments
            Arguments as they will be.

        Returns
        -------
        callable
            The compiled function.
        """
        kinds = _kind(arguments)
        if kinds not in self._entries:
            from numba import typeof

            signature = tuple(map(typeof, arguments))
            self.made.compile(signature)
            self._entries[kinds] = self.made.overloads[signature].entry_point
        return self._entries[kinds]

    def __call__(self, *arguments: Any, **named: Any) -> Any:
        """Call numba's function."""
        return self.made(*arguments, **named)

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):  # Python looks such names up by itself
            raise AttributeError(name)
        return getattr(self.made, name)

    def __deepcopy__(self, _memo: dict) -> Compiled:  # numba copies what it compiles
        return self


@cache
def _compile_without_collections() -> None:
    """Let no garbage be looked for while numba compiles: what it makes is kept until the end, so a tenth of the time is saved."""
    from numba.core import event

    class Compiling(event.Listener):
        """Switches the collector off from the start of the outermost compilation to its end."""

        depth, before = 0, False

        def on_start(self, _event: event.Event) -> None:
            if not self.depth:
                self.before = gc.isenabled()
                gc.disable()
            self.depth += 1

        def on_end(self, _event: event.Event) -> None:
            self.depth -= 1
            if not self.depth and self.before:
                gc.enable()

    event.register("numba:compile", Compiling())


def njit(**options: Any) -> Callable[[Callable], Compiled]:
    """Return the decorator of a function that numba compiles; the options are those of numba's own njit."""

    def make(function: Callable) -> Any:
        from numba import njit as njit_of_numba

        _compile_without_collections()
        return njit_of_numba(**options)(function)

    return lambda function: Compiled(function, make)


def intrinsic(function: Callable) -> Compiled:
    """Return an intrinsic of numba, made of the function that gives its types and builds its code."""

    def make(function: Callable) -> Any:
        from numba.extending import intrinsic as intrinsic_of_numba

        return intrinsic_of_numba(function)

    return Compiled(function, make)


class _LateModule:
    """A module that is loaded when something of it is first needed."""

    def __init__(self, name: str) -> None:
        """Keep the name of the module."""
        self._name = name

    def __getattr__(self, name: str) -> Any:
        return getattr(import_module(self._name), name)


if TYPE_CHECKING:
    from llvmlite import ir
    from numba import types
    from numba.core import cgutils
else:  # modules with which intrinsics are built
    ir, types, cgutils = map(_LateModule, ("llvmlite.ir", "numba.core.types", "numba.core.cgutils"))


def cache_root() -> Path:
    """Return the environment's own folder if there is one that can be written, otherwise the user's cache."""
    if sys.prefix != sys.base_prefix and os.access(sys.prefix, os.W_OK):
        return Path(sys.prefix) / "var" / "kernel-cache"
    home = os.environ.get("XDG_CACHE_HOME") or os.path.join(os.path.expanduser("~"), ".cache")
    return Path(home) / "rig_nodes" / "kernel-cache"


def own_folder(folder: Path) -> bool:
    """Return whether a folder belongs to this user and only this user can write to it, so that its files can be trusted."""
    try:
        about = folder.stat()
    except OSError:
        return False
    return about.st_uid == os.getuid() and not about.st_mode & 0o022


def _sources() -> hashlib._Hash:
    """A hash over all compiled sources."""
    key = hashlib.sha256()
    for folder in _SOURCES:
        for source in sorted((Path(__file__).resolve().parents[1] / folder).glob("*.py")):
            key.update(source.name.encode())
            key.update(source.read_bytes())
    return key


def sources_key() -> str:
    """Return a key of the physics, the same on every machine; a sweep that is continued must have the key of its beginning."""
    return _sources().hexdigest()[:16]


def cache_key() -> str:
    """Return a key of everything that decides the machine code."""
    key, package = _sources(), Path(__file__).resolve().parents[1]
    key.update(Path(__file__).read_bytes())  # how it is compiled
    key.update(f"{version_of('numba')} {version_of('numpy')} {platform.python_version()} {_processor()}".encode())
    # numba finds its files by the source's path too, so a second checkout gets a folder of its own
    key.update(str(package).encode())
    return key.hexdigest()[:16]


def _processor() -> str:
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as info:
            return "".join(sorted({line for line in info if line.startswith(("model name", "flags"))}))
    except OSError:
        return platform.processor()


class _OfNumba:
    """Finder of modules that sets numba's cache folder when numba is loaded, and leaves out modules that nothing here uses.

    Those would take a quarter of a second. numba imports ``coverage`` only to check whether it measures this process, scipy to
    check its version and for its BLAS in products of matrices, and ``yaml`` to read a settings file of its own. It works without
    each of them; a module that is loaded already is found as usual.
    """

    asks: ClassVar = {
        "coverage": ("numba.misc.coverage_support",),
        "yaml": ("numba.core.config",),
        "scipy": ("numba", "numba.np.arraymath"),
    }  # module that is left out -> the module of numba that imports it

    def find_spec(self, fullname: str, path: Sequence[str] | None, target: object = None) -> ModuleSpec | None:
        """Find changed modules of numba; raise ModuleNotFoundError for one that is left out while its importer is loaded."""
        if fullname == "numba":
            _set_folder()
        if changes := _CHANGES.get(fullname):
            return _changed(PathFinder.find_spec(fullname, path), changes)
        asking = (sys.modules.get(name) for name in self.asks.get(fullname.partition(".")[0], ()))
        if any(getattr(getattr(module, "__spec__", None), "_initializing", False) for module in asking):
            raise ModuleNotFoundError(f"{fullname} is left out while numba is loaded", name=fullname)
        return None


def _changed(spec: ModuleSpec | None, changes: Sequence[Callable[[ModuleType], None]]) -> ModuleSpec | None:
    """Return what Python needs to load a module, which is then changed."""
    if spec is None or spec.loader is None:
        return spec
    load: Callable[[ModuleType], None] = spec.loader.exec_module

    def loaded(module: ModuleType) -> None:
        load(module)
        for change in changes:
            change(module)

    spec.loader.exec_module = loaded  # type: ignore[method-assign]
    return spec


def _has(kind: object, *names: str) -> bool:
    """Return whether a class has methods of these names; a version of numba without them is left as it is."""
    return all(hasattr(kind, name) for name in names)


def _without_compiler(caching: ModuleType) -> None:
    """Have functions read from numba's cache without preparing the compiler.

    numba prepares its compiler and compiles its functions for the memory of arrays before it reads a function from its cache, which
    takes 0.16 s of processor time and is needed only where the function is not there; the compiler prepares all of it then.
    """
    cache = getattr(caching, "Cache", None)
    if _has(cache, "load_overload", "_load_overload", "_guard_against_spurious_io_errors"):
        cache.load_overload = _read_only


def _saved_alone(caching: ModuleType) -> None:
    """Have one process at a time add to the index of a function, which names the file of the code for each signature.

    numba reads the index, adds a name and writes it; two that do so at once would take the same name for different code.
    """
    kind = getattr(caching, "IndexDataCacheFile", None)
    if not _has(kind, "save"):
        return
    save = kind.save

    def save_(index: Any, key: object, data: object) -> None:
        with _alone(index._index_path):
            save(index, key, data)

    kind.save = save_


def _read_only(cache: Any, signature: object, context: object) -> object:
    """Return a function from numba's cache, or None; in place of the method load_overload of numba's Cache."""
    _register_helpers(context)
    with cache._guard_against_spurious_io_errors():
        return cache._load_overload(signature, context)


@cache
def _register_helpers(context: Any) -> None:
    """Register with LLVM the addresses of the C functions of numba's memory management, which cached code calls."""
    from llvmlite.binding import add_symbol
    from numba.core.runtime import _nrt_python, rtsys

    helpers = getattr(_nrt_python, "c_helpers", None)
    if helpers is None:
        rtsys.initialize(context)
        return
    for name, address in helpers.items():
        add_symbol(name if name.startswith("_") else f"NRT_{name}", address)


def _with_late_extensions(dispatcher: ModuleType) -> None:
    """Have numba look for its extensions, which takes 0.01 s, when it compiles and not before it reads from its cache."""
    kind = getattr(dispatcher, "Dispatcher", None)
    if _has(kind, "_compilation_chain_init_hook"):
        kind._compilation_chain_init_hook = lambda self: None


@cache
def _lock_file(folder: str) -> int:
    """Return the descriptor of the file on which the processes that compile into a folder wait for each other.

    It stays open, because closing any descriptor of a file gives back all that this process has locked in it.
    """
    Path(folder).mkdir(mode=0o700, parents=True, exist_ok=True)
    return os.open(Path(folder) / "compiling.lock", os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)


@contextmanager
def _alone(what: str) -> Iterator[None]:
    """Let one process at a time do what is named; a process that ends, however it does, lets the next one go on.

    Each name locks its own byte of one file, so what has another name is done meanwhile. Where no file can be locked nobody waits.
    """
    byte = int.from_bytes(hashlib.sha256(what.encode()).digest()[:7], "big")
    locked = False
    try:
        with suppress(OSError):
            file = _lock_file(os.environ["NUMBA_CACHE_DIR"])
            fcntl.lockf(file, fcntl.LOCK_EX, 1, byte)
            locked = True
        yield
    finally:
        if locked:
            fcntl.lockf(file, fcntl.LOCK_UN, 1, byte)


def _compiled_once(dispatcher: ModuleType) -> None:
    """Have a process wait for another one that compiles the same function for the same types, and then read what that one kept."""
    kind = getattr(dispatcher, "Dispatcher", None)
    if not _has(kind, "compile"):
        return
    compile_ = kind.compile

    def compile_or_wait(function: Any, signature: object) -> object:
        if function._cache.cache_path is None:  # it is never kept, as an inner function
            return compile_(function, signature)
        # within the lock of this process's threads, so that none of them waits for that one while it keeps others out
        with dispatcher.global_compiler_lock, _alone(f"{function.__module__}.{function.__qualname__} {signature}"):
            return compile_(function, signature)

    kind.compile = compile_or_wait


def _with_code_of_entries(codegen: ModuleType) -> None:
    """Have numba make machine code only of functions that Python, C or an address enters.

    What only compiled code calls is copied into its callers before that, so its own machine code would never run, and it is
    optimised with them; optimised by itself before, it would take a tenth of the compile time.
    """
    kind, target = getattr(codegen, "JITCodeLibrary", None), getattr(codegen, "JITCPUCodegen", None)
    steps = ("finalize", "_optimize_final_module", "_finalize_final_module", "_finalize_dynamic_globals", "_object_caching_enabled")
    if not (_has(kind, *steps) and _has(target, "set_env")):
        return
    finalize, optimize, make, set_env = kind.finalize, kind._optimize_final_module, kind._finalize_final_module, target.set_env
    kind.is_inner = False

    def finalize_(library: Any) -> None:
        # asked before its callees are linked into it; what is never kept in the cache is numba's own, and entered by other names
        names = [one.name for one in library._final_module.functions]
        library.is_inner = library._object_caching_enabled and not any(name.startswith(("cpython.", "cfunc.")) for name in names)
        finalize(library)

    def optimize_(library: Any) -> None:
        if not library.is_inner:
            optimize(library)

    def make_(library: Any) -> None:
        if library.is_inner:
            library._finalize_dynamic_globals()
            library._finalized = True
        else:
            make(library)

    def set_env_(target: Any, name: str, environment: object) -> None:
        if target._engine.is_symbol_defined(name):
            set_env(target, name, environment)

    kind.finalize, kind._optimize_final_module, kind._finalize_final_module = finalize_, optimize_, make_
    target.set_env = set_env_


def _without_lock_events(_base: ModuleType) -> None:
    """Have LLVM called without an event before and after each of the 67 000 calls.

    numba's timers of all compilations that are under way take up each event, which is a tenth of the compile time; nothing here
    reads what they measure.
    """
    from llvmlite.binding import ffi

    lock = getattr(ffi.lib, "_lock", None)
    if _has(lock, "_cblist"):
        lock._cblist.clear()


def _with_kept_texts(npytypes: ModuleType) -> None:
    """Have the text of a record's type made once: each of numba's passes asks for it, which is a twentieth of the compile time."""
    if _has(kind := getattr(npytypes, "Record", None), "__repr__"):
        kind.__repr__ = cache(kind.__repr__)


_CHANGES = {
    "numba.core.base": (_without_lock_events,),
    "numba.core.caching": (_without_compiler, _saved_alone),
    "numba.core.dispatcher": (_with_late_extensions, _compiled_once),
    "numba.core.codegen": (_with_code_of_entries,),
    "numba.core.types.npytypes": (_with_kept_texts,),
}


def use_kernel_cache() -> None:
    """Make numba keep compiled code in its own folder and leave out modules that it does not need; called before numba is imported.

    Raises
    ------
    RigError
        Here or when numba is loaded: the folder belongs to another user, or others can write to it.
    """
    if any(isinstance(finder, _OfNumba) for finder in sys.meta_path):
        return
    sys.meta_path.insert(0, _OfNumba())
    if "numba" in sys.modules:  # other code imported it, so it has read its settings already
        _set_folder()
        sys.modules["numba"].config.CACHE_DIR = os.environ["NUMBA_CACHE_DIR"]
        for name, changes in _CHANGES.items():
            for change in changes:
                change(sys.modules[name])


def _set_folder() -> None:
    """Set numba's cache folder, unless the user has chosen one.

    The folder holds machine code and numba's pickled index of it, which are executed as they are read. Only the folder's owner and
    rights protect them.
    """
    if "NUMBA_CACHE_DIR" not in os.environ:
        os.environ["NUMBA_CACHE_DIR"] = str(cache_root() / cache_key())
    folder = Path(os.environ["NUMBA_CACHE_DIR"])
    with suppress(OSError):  # if the folder cannot be made, numba finds another place
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    if folder.is_dir() and not own_folder(folder):
        raise RigError(
            f"{folder}: the compiled code in it would run as it is, and others can write to it; delete it, or "
            "name a folder of your own by NUMBA_CACHE_DIR"
        )
