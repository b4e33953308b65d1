"""The plug for a C shared library that exports what include/rig_controller.h declares, or for one C file.

Made by load.py. The library runs in this process; what can be known before it is called is checked before.
"""

from __future__ import annotations

import ctypes as ct
import os
import platform
import shlex
import shutil
import struct
import subprocess
import sys
import tempfile
from pathlib import Path

from ..alfa46.settings import Alfa46Config
from ..errors import RigError
from .plug import Plug, chosen_level
from .seam import OUTPUTS, ControllerInputs, ControllerOutputs, Status

INCLUDE = Path(__file__).parent / "include"
ABI, TEXT = 1, 128
LEVEL_BITS = {"duty": 1, "current": 2}
FUNCTIONS = ("rig_controller_abi", "rig_controller_create", "rig_controller_step", "rig_controller_destroy")
# -ffp-contract=off: no fused multiply-add, so that the same source gives the same bits on every machine
FLAGS = ("-std=c99", "-O2", "-ffp-contract=off", "-Wall", "-Wextra", "-fPIC", "-shared")
MACHINES = {3: "i386", 40: "arm", 62: "x86_64", 183: "aarch64", 243: "riscv64"}  # e_machine of the ELF format
THREE = ct.c_double * OUTPUTS


class AbiInfo(ct.Structure):
    """rig_controller_abi_info"""

    _fields_ = [
        (name, ct.c_uint32)
        for name in ("abi", "levels", "info_size", "parameter_size", "inputs_size", "outputs_size")
    ]


class Parameter(ct.Structure):
    """rig_parameter"""

    _fields_ = [("name", ct.c_char_p), ("value", ct.c_double)]


class Info(ct.Structure):
    """rig_controller_info"""

    _fields_ = [
        ("size", ct.c_uint32),
        ("level", ct.c_uint32),
        ("period", ct.c_double),
        ("command_high", ct.c_double),
        ("parameters", ct.POINTER(Parameter)),
        ("parameter_count", ct.c_uint32),
        ("message", ct.c_char * TEXT),
    ]


class Inputs(ct.Structure):
    """rig_controller_inputs"""

    _fields_ = [
        ("size", ct.c_uint32),
        ("gear_request", ct.c_uint32),
        ("sample", ct.c_uint64),
        ("time", ct.c_double),
        ("current", THREE),
        ("n_wej", ct.c_double),
        ("n_wyj", ct.c_double),
        ("p1", ct.c_double),
        ("p2", ct.c_double),
    ]


class Outputs(ct.Structure):
    """rig_controller_outputs"""

    _fields_ = [
        ("size", ct.c_uint32),
        ("flags", ct.c_uint32),
        ("gear", ct.c_uint32),
        ("shifting", ct.c_uint32),
        ("command", THREE),
        ("setpoint", THREE),
        ("message", ct.c_char * TEXT),
    ]


def check_elf(path: Path, name: str) -> None:
    """RigError unless the file is a whole shared object for this machine, which the loader would not say."""
    data, size = path.read_bytes()[:64], path.stat().st_size
    if data[:4] != b"\x7fELF":
        raise RigError(
            f"controller {name}: the file is no shared library (it does not begin like an ELF file)"
        )
    if len(data) < 64:
        raise RigError(
            f"controller {name}: the file is cut off: {size} bytes are less than the header of a library"
        )
    order = "<" if data[5] == 1 else ">"
    kind, machine = struct.unpack_from(order + "HH", data, 16)
    bits, here = {1: 32, 2: 64}.get(data[4], 0), platform.machine()
    found = MACHINES.get(machine, f"machine {machine}")
    if found != here or bits != 64:
        raise RigError(
            f"controller {name}: the library is for {found}, {bits} bits; this machine is {here}, 64 bits"
        )
    if kind != 3:
        raise RigError(f"controller {name}: the file is an object file or a program; link it with -shared")
    (section_table,) = struct.unpack_from(order + "Q", data, 40)
    entry, count = struct.unpack_from(order + "HH", data, 58)
    if section_table + entry * count > size:
        raise RigError(
            f"controller {name}: the file is cut off: {size} bytes of at least "
            f"{section_table + entry * count}"
        )


def compile_library(source: Path, target: Path, name: str) -> None:
    """Compile one C file into a shared library; RigError with the compiler's first complaint."""
    compiler = shlex.split(os.environ.get("CC", "")) or next(
        ([found] for found in map(shutil.which, ("cc", "gcc", "clang")) if found), None
    )
    if not compiler:
        raise RigError(
            f"controller {name}: there is no C compiler here; install one (Debian package gcc) or give a "
            ".so file"
        )
    try:
        done = subprocess.run(
            [*compiler, *FLAGS, f"-I{INCLUDE}", "-o", str(target), str(source), "-lm"],
            capture_output=True,
            text=True,
            errors="replace",
            stdin=subprocess.DEVNULL,
            check=False,
        )
    except OSError as error:
        raise RigError(
            f"controller {name}: the compiler {compiler[0]} does not start ({error.strerror})"
        ) from None
    if done.returncode:
        lines = done.stderr.splitlines() or ["no reason given"]
        first = next((line for line in lines if "error" in line or "undefined reference" in line), lines[0])
        raise RigError(f"controller {name}: it does not compile: {first.strip()}")


def load_library(path: Path, name: str) -> tuple[ct.CDLL, int]:
    """(the library with its functions declared, its level bits); RigError when it does not fit."""
    check_elf(path, name)
    try:
        library = ct.CDLL(str(path.resolve()))
    except OSError as error:
        raise RigError(f"controller {name}: the library cannot be loaded: {error}") from None
    if sys.float_info.min / 2.0 == 0.0:
        # some compilers link start-up code into -ffast-math libraries that sets the process's arithmetic
        raise RigError(
            f"controller {name}: loading the library switches the rounding of tiny numbers of the whole rig; "
            "build it without -ffast-math"
        )
    missing = [function for function in FUNCTIONS if not hasattr(library, function)]
    if missing:
        raise RigError(
            f"controller {name}: the library does not export {', '.join(missing)}; see rig_controller.h"
        )
    library.rig_controller_abi.restype = ct.POINTER(AbiInfo)
    library.rig_controller_abi.argtypes = []
    library.rig_controller_create.argtypes = [ct.POINTER(Info), ct.POINTER(ct.c_void_p)]
    library.rig_controller_step.argtypes = [ct.c_void_p, ct.POINTER(Inputs), ct.POINTER(Outputs)]
    library.rig_controller_destroy.restype = None
    library.rig_controller_destroy.argtypes = [ct.c_void_p]
    pointer = library.rig_controller_abi()
    if not pointer:
        raise RigError(f"controller {name}: rig_controller_abi returned no description")
    abi = pointer.contents
    if abi.abi != ABI:
        raise RigError(
            f"controller {name}: the library was made for ABI {abi.abi} of rig_controller.h, this rig has "
            f"ABI {ABI}; compile it again with this rig's header"
        )
    for struct_name, structure in (
        ("info", Info),
        ("parameter", Parameter),
        ("inputs", Inputs),
        ("outputs", Outputs),
    ):
        size = getattr(abi, f"{struct_name}_size")
        if size != ct.sizeof(structure):
            raise RigError(
                f"controller {name}: the library's {struct_name} struct has {size} bytes, this rig's "
                f"{ct.sizeof(structure)}; compile it without packing, with this rig's header"
            )
    return library, abi.levels


def _text(message: bytes) -> str:
    return message.decode("utf-8", "replace")


class CLibrary(Plug):
    """A controller of a library; a .c file is compiled first, into a folder that is gone afterwards."""

    def __init__(self, file: str, config: Alfa46Config, level: str | None = None):
        path, name = Path(file), f"c:{file}"
        if not path.is_file():
            raise RigError(f"controller {name}: there is no such file")
        if path.suffix == ".c":
            with tempfile.TemporaryDirectory(prefix="rig-controller-") as folder:
                built = Path(folder) / f"{path.stem}.so"
                compile_library(path, built, name)
                self._library, bits = load_library(built, name)
        else:
            self._library, bits = load_library(path, name)
        levels = tuple(key for key, bit in LEVEL_BITS.items() if bits & bit)
        if not levels:
            raise RigError(
                f"controller {name}: its levels are {bits}, expected 1 (duty), 2 (current) or 3 (both)"
            )
        super().__init__(name, config, chosen_level(level, levels, name))
        self._inputs, self._outputs = Inputs(size=ct.sizeof(Inputs)), Outputs()
        self._instance = ct.c_void_p()
        self._arguments = ct.byref(self._inputs), ct.byref(self._outputs)
        parameters = (Parameter * len(self.info.parameters))(
            *((key.encode(), value) for key, value in self.info.parameters.items())
        )
        info = Info(
            ct.sizeof(Info),
            LEVEL_BITS[self.level],
            self.info.period,
            self.info.command_high,
            parameters,
            len(parameters),
        )
        status = self._library.rig_controller_create(ct.byref(info), ct.byref(self._instance))
        if status != Status.OK:
            raise RigError(
                f"controller {name}: create refused with status {status}: "
                f"{_text(info.message) or 'it gave no reason'}"
            )

    def _answer(self, inputs: ControllerInputs) -> ControllerOutputs:
        given, out = self._inputs, self._outputs
        given.gear_request, given.sample, given.time = inputs.gear_request, inputs.sample, inputs.time
        given.current[:] = inputs.current
        given.n_wej, given.n_wyj, given.p1, given.p2 = inputs.n_wej, inputs.n_wyj, inputs.p1, inputs.p2
        ct.memset(ct.byref(out), 0, ct.sizeof(out))
        out.size = ct.sizeof(out)
        status = self._library.rig_controller_step(self._instance, *self._arguments)
        return ControllerOutputs(
            out.command[:],
            out.setpoint[:],
            out.gear,
            bool(out.shifting),
            out.flags,
            status,
            _text(out.message) if status != Status.OK else "",
        )

    def _end(self) -> None:
        self._library.rig_controller_destroy(self._instance)
