# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The plug for a C shared library that exports what include/rig_controller.h declares, or for one C file.

load.py makes it. The library runs in a process of its own (hosted.py, host.py): a crash, an exit() or an endless loop in it is a
fatal status here. What can be checked before the library is called is checked before.
"""

from __future__ import annotations

import ctypes as ct
import os
import platform
import shlex
import shutil
import struct
import subprocess
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

from ...base import RigError, no_file
from ..hosted import Host, HostedPlug, Hosting
from ..own_signals import checked_settings, checked_signals, once_each
from ..plug import DECLARED, chosen_level
from ..record import ControllerRecord, record_of
from ..seam import ControllerInputs, ControllerOutputs, Status, checked_wants
from .host import ABI, TEXT, Info, Inputs, Outputs, Parameter
from .record_header import NAME, header_text

if TYPE_CHECKING:
    from ...rig import RigConfig

INCLUDE = Path(__file__).parents[1] / "include"
# -I -S: no site, no PYTHON variables of the user; a user's breakpoints are in the library, not in Python
LIBRARY = Hosting("the library", str(Path(__file__).parent), "host", "rig-library", ("rig_controller_destroy",), ("-I", "-S"))
IN_SIZE = ct.sizeof(Inputs)
LEVEL_BITS = {"duty": 1, "current": 2}
# -ffp-contract=off: no fused multiply-add, so that the same source gives the same bits on every machine
FLAGS = ("-O2", "-ffp-contract=off", "-Wall", "-Wextra", "-fPIC", "-shared")
CPP = ("CXX", ("c++", "g++", "clang++"), "-std=c++17", "C++ compiler here; install one (Debian package g++)")
COMPILERS = {  # suffix of a source file -> environment variable, names to look for, standard, advice when there is none
    ".c": ("CC", ("cc", "gcc", "clang"), "-std=c99", "C compiler here; install one (Debian package gcc)"),
    ".cpp": CPP,
    ".cc": CPP,
    ".cxx": CPP,
}
CPP_SUFFIXES = tuple(suffix for suffix, entry in COMPILERS.items() if entry is CPP)
MACHINES = {3: "i386", 40: "arm", 62: "x86_64", 183: "aarch64", 243: "riscv64"}  # e_machine of the ELF format


def check_elf(path: Path, name: str) -> None:
    """Check that a file is a whole shared object for this machine; the loader's own message would not show what is wrong.

    Parameters
    ----------
    path : Path
        The file.
    name : str
        The controller's name, for the error's sentence.

    Raises
    ------
    RigError
        When the file is no ELF file, is cut off, is for another machine, or is not linked with -shared.
    """
    data, size = path.read_bytes()[:64], path.stat().st_size
    if data[:4] != b"\x7fELF":
        raise RigError(f"controller {name}: the file is no shared library (it does not begin like an ELF file)")
    if len(data) < 64:
        raise RigError(f"controller {name}: the file is cut off: {size} bytes are less than the header of a library")
    order = "<" if data[5] == 1 else ">"
    kind, machine = struct.unpack_from(order + "HH", data, 16)
    bits, here = {1: 32, 2: 64}.get(data[4], 0), platform.machine()
    found = MACHINES.get(machine, f"machine {machine}")
    if found != here or bits != 64:
        raise RigError(f"controller {name}: the library is for {found}, {bits} bits; this machine is {here}, 64 bits")
    if kind != 3:
        raise RigError(f"controller {name}: the file is an object file or a program; link it with -shared")
    (section_table,) = struct.unpack_from(order + "Q", data, 40)
    entry, count = struct.unpack_from(order + "HH", data, 58)
    if section_table + entry * count > size:
        raise RigError(f"controller {name}: the file is cut off: {size} bytes of at least {section_table + entry * count}")


def compile_library(sources: list[Path], target: Path, name: str, flags: tuple[str, ...] = ()) -> None:
    """Compile C and C++ files into a shared library.

    C files among C++ files are compiled as C, in the compiler's default C standard, because one call of the C++ compiler
    compiles both.

    Parameters
    ----------
    sources : list of Path
        The source files.
    target : Path
        The library to write.
    name : str
        The controller's name, for the error's sentence.
    flags : tuple of str
        Further options of the compiler.

    Raises
    ------
    RigError
        When there is no compiler, or with the compiler's first error message.
    """
    cpp = [path for path in sources if path.suffix in CPP_SUFFIXES]
    c = [path for path in sources if path.suffix not in CPP_SUFFIXES]
    variable, names, standard, missing = COMPILERS[(cpp or c)[0].suffix]
    given = [standard, *map(str, sources)]
    if cpp and c:
        given = ["-x", "c", *map(str, c), "-x", "c++", *map(str, cpp), "-x", "none"]
    compiler = shlex.split(os.environ.get(variable, "")) or next(([found] for found in map(shutil.which, names) if found), None)
    if not compiler:
        raise RigError(f"controller {name}: there is no {missing} or give a .so file")
    try:
        done = subprocess.run(
            [*compiler, *FLAGS, *flags, f"-I{INCLUDE}", "-o", str(target), *given, "-lm"],
            capture_output=True,
            text=True,
            errors="replace",
            stdin=subprocess.DEVNULL,
            check=False,
        )
    except OSError as error:
        raise RigError(f"controller {name}: the compiler {compiler[0]} does not start ({error.strerror})") from None
    if done.returncode:
        lines = done.stderr.splitlines() or ["no reason given"]
        first = next((line for line in lines if "error" in line or "undefined reference" in line), lines[0])
        raise RigError(f"controller {name}: it does not compile: {first.strip()}")


def _check_description(found: dict, name: str, record: ControllerRecord) -> int:
    """Return the library's level bits; RigError when the library does not fit, according to the host's description of it."""
    if "error" in found:
        raise RigError(f"controller {name}: the library cannot be loaded: {found['error']}")
    if "missing" in found:
        raise RigError(f"controller {name}: the library does not export {', '.join(found['missing'])}; see rig_controller.h")
    abi = found["abi"]
    if abi is None:
        raise RigError(f"controller {name}: rig_controller_abi returned no description")
    if abi["abi"] != ABI:
        raise RigError(
            f"controller {name}: the library was made for ABI {abi['abi']} of rig_controller.h, this rig has "
            f"ABI {ABI}; compile it again with this rig's header and rig_record.h"
        )
    for struct_name, structure in (("info", Info), ("parameter", Parameter), ("inputs", Inputs), ("outputs", Outputs)):
        size = abi[f"{struct_name}_size"]
        if size != ct.sizeof(structure):
            raise RigError(
                f"controller {name}: the library's {struct_name} struct has {size} bytes, this rig's "
                f"{ct.sizeof(structure)}; compile it without packing, with this rig's header"
            )
    if abi["record"] not in ("", record.id):
        raise RigError(f"controller {name}: the library was {record.made_for_another(abi['record'])}, and compile it again")
    return abi["levels"]


class CLibrary(HostedPlug):
    """A controller in a library, in a process of its own.

    A .c or .cpp file is compiled first, into a folder that is removed afterwards.
    """

    prefix, level_from = "c", DECLARED

    def __init__(self, rest: str, config: RigConfig, level: str | None = None) -> None:
        """Load the library; ``rest`` is FILE.so, FILE.c or FILE.cpp."""
        name, self._made_for = f"{self.prefix}:{rest}", record_of(config)
        try:
            bits = self._load(rest, name)
            levels = tuple(key for key, bit in LEVEL_BITS.items() if bits & bit)
            if not levels:
                raise RigError(f"controller {name}: its levels are {bits}, expected 1 (duty), 2 (current) or 3 (both)")
            super().__init__(name, config, chosen_level(level, levels, name))
            self._create()
        except BaseException:
            if hasattr(self, "_host"):
                self._host.kill()
            raise

    def _load(self, rest: str, name: str) -> int:
        """Start the host with the library and return the library's level bits."""
        path = Path(rest)
        if not path.is_file():
            raise RigError(f"controller {name}: {no_file(path)}")
        if path.suffix not in COMPILERS:
            return self._start(path, name)
        with tempfile.TemporaryDirectory(prefix="rig-controller-") as folder:
            built = Path(folder) / f"{path.stem}.so"
            compile_library([path], built, name, (self._record_beside(folder),))
            return self._start(built, name)

    def _record_beside(self, folder: str) -> str:
        """Return the compiler's option for a rig_record.h of this rig, for sources without one of their own."""
        (Path(folder) / NAME).write_text(header_text(self._made_for), encoding="utf-8")
        return f"-I{folder}"

    def _start(self, library: Path, name: str) -> int:
        check_elf(library, name)
        self._host = Host(LIBRARY, name, [str(library.resolve())])
        found = self._host.hear("while it was loaded")
        bits = _check_description(found, name, self._made_for)
        self._host.process = found["process"]
        self.wants = checked_wants(found["wants"], name, self._made_for.all_transducers)
        self.signals = checked_signals(found["signals"], name)
        self.settings = checked_settings(once_each(found["settings"], "settings", name), name)
        self.saves = bool(found["saves"])
        outputs, transducers = len(self._made_for.outputs), len(self._made_for.transducers)
        # size, gear_request, sample, time; currents, transducers, wanted transducers, the controller's settings
        self._sample = struct.Struct(f"=IIQd{outputs + transducers + len(self.wants) + len(self.settings)}d")
        # sample, status, size, flags, gear, shifting, two pointers, message; commands, setpoints, the controller's signals
        self._reply = struct.Struct(f"=Qq4I16x{TEXT}s{2 * outputs + len(self.signals)}d")
        return bits

    def _create(self) -> None:
        info = {
            "level": LEVEL_BITS[self.level],
            "period": self.info.period,
            "command_high": self.info.command_high,
            "parameters": dict(self.info.parameters),
            "record": self.rig_record.id,
            "outputs": self.info.outputs,
            "transducers": list(self.info.transducers.items()),
            "gears": list(self.info.gears.items()),
        }
        self._tell(info)
        created = self._host.hear("in rig_controller_create")
        if created["damage"]:
            raise RigError(f"controller {self.name}: {created['damage']}")
        if created["status"] != Status.OK:
            raise RigError(
                f"controller {self.name}: create refused with status {created['status']}: "
                f"{created['message'] or 'it gave no reason'}"
            )

    def _answer(self, inputs: ControllerInputs) -> ControllerOutputs:
        values = (*inputs.current, *inputs.measured, *inputs.others.values(), *inputs.settings.values())
        sample = self._sample.pack(IN_SIZE, inputs.gear_request, inputs.sample, inputs.time, *values)
        data = self._asked(inputs.sample, sample, self.step_timeout)
        if len(data) != self._reply.size or data[:8] != inputs.sample.to_bytes(8, "little"):
            self._fail(Status.FATAL, inputs.sample, self._host.unreadable(data))
        _, status, _, flags, gear, shifting, message, *values = self._reply.unpack(data)
        text = ""
        if status != Status.OK:
            text = message.partition(b"\0")[0].decode("utf-8", "replace")
        return self._outputs_in(values, gear, bool(shifting), flags, status, text)
