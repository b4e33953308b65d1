# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Builds FMUs: the rig as one (`rig export fmu`), and a shift controller in C or C++ as one (`rig export controller-fmu`).

The files are compiled with the user's compilers against the FMI headers that FMPy provides.
"""

from __future__ import annotations

import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from hashlib import sha256
from pathlib import Path
from types import MappingProxyType

from ... import __version__
from ...base import (
    CONFIG_DIR,
    RIG_FILE,
    RIGS_DIR,
    RigError,
    atomic_write,
    beside,
    find_config,
    no_file,
    optional,
    printable,
    with_bases,
)
from ...controllers import COMPILERS, INCLUDE, LEVEL_BITS, NAME, CLibrary, ControllerRecord, flat_parameters, header_text, record_of
from ...rig import RigConfig, load_rig
from .description import Variable, c_header, model_description, token_of
from .rig_variables import rig_variables

SOURCES = Path(__file__).parent / "c"
COMMON = ("instance.c", "state.c")  # of both versions of FMI
PLATFORMS = {2: "linux64", 3: "x86_64-linux"}  # folders of binaries/
# -ffp-contract=off: no fused multiply-add, so that the same source gives the same bits on every machine
FLAGS = ("-O2", "-ffp-contract=off", "-Wall", "-Wextra", "-fPIC")
STAMP = (1980, 1, 1, 0, 0, 0)  # date of every file in the FMU, so that the same input gives the same file


def fmpy_headers() -> Path:
    """Return the folder of the FMI headers; RigError when FMPy is not installed."""
    return Path(optional("fmpy").__file__).parent / "c-code"


def compiler(suffix: str) -> list[str]:
    """Return the user's compiler for a source file, with the language's standard.

    Parameters
    ----------
    suffix : str
        Suffix of the source file, a key of COMPILERS.

    Returns
    -------
    list of str
        Begin of the command.

    Raises
    ------
    RigError
        When there is no such compiler.
    """
    variable, names, standard, missing = COMPILERS[suffix]
    found = shlex.split(os.environ.get(variable, "")) or next(([path] for path in map(shutil.which, names) if path), None)
    if not found:
        raise RigError(f"an FMU is compiled, but there is no {missing}")
    return [*found, "-std=gnu11" if suffix == ".c" else standard]  # the rig's own C files use POSIX


def compile_model(fmi: int, header: str, sources: Sequence[Path], target: Path, flags: Sequence[str] = ()) -> None:
    """Compile fmi2.c or fmi3.c with C and C++ sources into one shared library.

    Parameters
    ----------
    fmi : int
        2 or 3.
    header : str
        Text of variables.h.
    sources : sequence of Path
        The model's source files.
    target : Path
        The library to write.
    flags : sequence of str
        Further options of the compiler.

    Raises
    ------
    RigError
        When there is no compiler, or with its first error message.
    """
    with tempfile.TemporaryDirectory(prefix="rig-fmu-") as folder:
        Path(folder, "variables.h").write_text(header, encoding="utf-8")
        includes, objects = [f"-I{folder}", f"-I{SOURCES}", f"-I{INCLUDE}", f"-I{fmpy_headers()}"], []
        for number, path in enumerate([SOURCES / f"fmi{fmi}.c", *(SOURCES / name for name in COMMON), *sources]):
            objects.append(f"{folder}/{number}.o")
            _run([*compiler(path.suffix), *FLAGS, *flags, *includes, "-c", "-o", objects[-1], str(path)])
        # with C++ sources the C++ compiler links, for its runtime
        suffix = next((path.suffix for path in sources if COMPILERS[path.suffix] is not COMPILERS[".c"]), ".c")
        _run([*compiler(suffix), "-shared", "-Wl,-Bsymbolic", "-o", str(target), *objects, "-lm"])


def _run(command: list[str]) -> None:
    try:
        done = subprocess.run(command, capture_output=True, text=True, errors="replace", stdin=subprocess.DEVNULL, check=False)
    except OSError as error:
        raise RigError(f"the compiler {command[0]} does not start ({error.strerror})") from None
    if done.returncode:
        lines = done.stderr.splitlines() or ["no reason given"]
        first = next((line for line in lines if "error" in line or "undefined reference" in line), lines[0])
        raise RigError(f"the FMU does not compile: {printable(first.strip())}")


@dataclass(frozen=True)
class Model:
    """What an FMU is made of.

    Parameters
    ----------
    identifier : str
        The model's identifier, a name in C.
    text : str
        Description of the model.
    variables : sequence of Variable
        The FMU's variables, in the order of their value references.
    sources : sequence of Path
        C and C++ files of the model.
    defines : dict of str to int
        Constants for variables.h.
    resources : dict of str to str
        Text of each file in the FMU's resources, by name.
    flags : sequence of str
        Further options of the compiler.
    more : str
        C text for variables.h.
    saves : bool
        Whether its state can be saved and brought back.
    """

    identifier: str
    text: str
    variables: Sequence[Variable]
    sources: Sequence[Path]
    defines: dict[str, int] = field(default_factory=dict)
    resources: dict[str, str] = field(default_factory=dict)
    flags: Sequence[str] = ()
    more: str = ""
    saves: bool = True


def write_fmu(target: Path, fmi: int, model: Model) -> None:
    """Compile and zip an FMU into ``target``, which is replaced only by a complete one.

    Parameters
    ----------
    target : Path
        The FMU's file.
    fmi : int
        2 or 3.
    model : Model
        What it is made of.

    Raises
    ------
    RigError
        When the version is unknown, the target's folder is missing, or the model does not compile.
    """
    if fmi not in PLATFORMS:
        raise RigError(f"FMI {fmi} is asked for; expected 2 or 3")
    # without resources the model is in its sources, and a state of other sources is not its own
    code = "" if model.resources else sha256(b"".join(path.read_bytes() for path in model.sources)).hexdigest()
    token = token_of(model.identifier, model.variables, f"{fmi}{code}")
    header = c_header(fmi, model.variables, token, model.defines) + model.more
    tool = bool(model.resources)
    xml = model_description(fmi, model.identifier, model.text, model.variables, token, __version__, tool=tool, saves=model.saves)
    if not target.parent.is_dir():
        raise RigError(f"{target}: there is no folder {target.parent}")
    with tempfile.TemporaryDirectory(prefix="rig-fmu-") as folder:
        library = Path(folder, f"{model.identifier}.so")
        compile_model(fmi, header, model.sources, library, model.flags)
        whole = Path(folder, "whole.fmu")
        with zipfile.ZipFile(whole, "w", zipfile.ZIP_DEFLATED) as archive:

            def put(name: str, data: bytes) -> None:
                archive.writestr(zipfile.ZipInfo(name, STAMP), data, zipfile.ZIP_DEFLATED)

            put("modelDescription.xml", xml.encode())
            put(f"binaries/{PLATFORMS[fmi]}/{model.identifier}.so", library.read_bytes())
            for name, content in model.resources.items():
                put(f"resources/{name}", content.encode())
        atomic_write(target, whole.read_bytes())


def build_rig_fmu(target: str | Path, rig: str, overrides: dict[str, str] | None = None, fmi: int = 2) -> None:
    """Write the rig as a co-simulation FMU of FMI 2.0 or 3.0.

    The files of a rig that is not installed go into the FMU. The FMU starts this interpreter with this package
    (docs/how_to/fmu.md).

    Parameters
    ----------
    target : str or Path
        The FMU's file.
    rig, overrides
        As rig.configuration.load_rig takes them.
    fmi : int
        2 or 3.

    Raises
    ------
    RigError
        When the rig cannot be an FMU, or as in :func:`write_fmu`.
    """
    config = load_rig(rig, overrides)
    if config.cut_out:
        raise RigError(f"{', '.join(config.cut_out)} is cut out of this rig; a rig as an FMU has all devices inside")
    file, files = files_of(rig)
    origin = {"rig": rig, **({"file": file} if file else {}), "set": overrides or {}}
    resources = {
        "tool.txt": f"{sys.executable}\n{Path(__file__).resolve().parents[3]}\n",
        "rig.json": json.dumps(origin, indent=1) + "\n",
        **files,
    }
    model = Model(
        _identifier(f"{config.name}_rig"),
        f"The virtual powertrain test rig: {config.description}",
        rig_variables(config),
        [SOURCES / "rig_process.c"],
        resources=resources,
        flags=["-Werror"],
    )
    write_fmu(Path(target), fmi, model)


def files_of(rig: str) -> tuple[str, dict[str, str]]:
    """Return the files of a rig that is not installed.

    They are in the same folders relative to each other, so that a base or a controller that is named by its relative path
    is found.

    Parameters
    ----------
    rig : str
        Name or file of the rig.

    Returns
    -------
    tuple
        (file, files): the name of the rig's own file among the FMU's resources, and the text of each file by its name
        there; both are empty for an installed rig.

    Raises
    ------
    RigError
        When a base or a controller is named by an absolute path of this machine.
    """
    found = []
    for path, node in with_bases(rig):
        found.append(Path(path).absolute())
        for key in ("base", "controller"):
            name = str(node.get(key, ""))
            if os.path.isabs(os.path.expanduser(name)):
                raise RigError(
                    f"{path}: {key} is {name}, which an FMU cannot take along; name it by its path relative to this file"
                )
        if "controller" in node:
            found.append(Path(find_config("controllers", beside(path, node["controller"]))).absolute())
    own = [
        Path(os.path.normpath(path)) for path in found if not path.is_relative_to(RIGS_DIR) and not path.is_relative_to(CONFIG_DIR)
    ]
    if not own:
        return "", {}
    root = os.path.commonpath([path.parent.parent if path.name == RIG_FILE else path.parent for path in own])
    names = {path: f"rig/{path.relative_to(root).as_posix()}" for path in own}
    return names[own[0]], {name: path.read_text(encoding="utf-8") for path, name in names.items()}


def controller_variables(
    config: RigConfig,
    levels: tuple[str, ...],
    wants: Sequence[str] = (),
    signals: Mapping[str, str] = MappingProxyType({}),
    settings: Mapping[str, float] = MappingProxyType({}),
) -> list[Variable]:
    """Return the seam as variables of an FMU: the rig's settings as parameters, the sample in, the answer out.

    Parameters
    ----------
    config : RigConfig
        The rig's configuration.
    levels : tuple of str
        Levels at which the controller works.
    wants, signals, settings
        The controller's own, as a plug has them.

    Returns
    -------
    list of Variable
        The variables, in the order of their value references.
    """
    limit, record = float(config.alfa46.values.current_limit), record_of(config)
    out = _parameters(config, record, levels, settings)
    outputs = range(1, len(record.outputs) + 1)
    out.append(
        Variable(
            "gear_request",
            "integer",
            "input",
            f"Gear ordered last: {record.gears_text}",
            0,
            low=min(record.gear_names),
            high=max(record.gear_names),
        )
    )
    out += [Variable(f"current_{k}", "real", "input", f"Measured coil current of output {k}", 0.0, "A") for k in outputs]
    known = config.catalogue.signals
    transducers = [*record.transducers, *(known[name] for name in wants)]
    out += [Variable(signal.name, "real", "input", signal.text, 0.0, signal.unit) for signal in transducers]
    text = f"duty 0 to 1, or current setpoint 0 to {limit:g} A, depending on the parameter level"
    out += [Variable(f"command_{k}", "real", "output", f"Command of output {k}: {text}") for k in outputs]
    out += [Variable(f"setpoint_{k}", "real", "output", f"Current setpoint of output {k}", unit="A") for k in outputs]
    return [
        *out,
        Variable("gear", "integer", "output", "Gear taken last"),
        Variable("shifting", "boolean", "output", "A shift is still running"),
        Variable("flags", "integer", "output", "Bit k: at level current, output k stays on at a setpoint of zero"),
        Variable("status", "integer", "output", "0: an answer; 1: none to this sample, the outputs are older"),
        *(
            Variable(name, "real", "output", "Signal of the controller's own", unit="" if unit == "-" else unit)
            for name, unit in signals.items()
        ),
    ]


def _parameters(
    config: RigConfig, record: ControllerRecord, levels: tuple[str, ...], settings: Mapping[str, float]
) -> list[Variable]:
    """Return level, record and settings of a controller as parameters of an FMU."""
    level = Variable(
        "level",
        "integer",
        "parameter",
        "What command means: 0 duty, 1 current setpoint [A]",
        ("duty", "current").index(levels[0]),
        low=0 if "duty" in levels else 1,
        high=len(levels) - 1 if "duty" in levels else 1,
    )
    out = [
        level,
        Variable(
            "rig_record",
            "integer",
            "parameter",
            f"Record {record.id} of the rig {record.rig}; it cannot be changed",
            record.number,
            low=record.number,
            high=record.number,
        ),
    ]
    for name, value in flat_parameters(config.alfa46).items():
        unit = (
            "s"
            if name.endswith(".time") or name in ("t12", "t21", "t23", "t32", "sample_time", "derivative_time")
            else ("A" if name.endswith(".current") or name == "current_limit" else "")
        )
        out.append(Variable(name, "real", "parameter", f"Setting {name} of the Alfa46 [SI]", value, unit))
    own = "Setting of the controller's own"
    return [*out, *(Variable(name, "real", "parameter", own, value, tunable=True) for name, value in settings.items())]


def controller_defines(
    record: ControllerRecord, variables: Sequence[Variable], wants: int = 0, signals: int = 0, settings: int = 0
) -> dict[str, int]:
    """Return the constants with which c/controller_model.c finds the values of :func:`controller_variables`.

    Parameters
    ----------
    record : ControllerRecord
        The rig's record.
    variables : sequence of Variable
        As :func:`controller_variables` returns them.
    wants, signals, settings : int
        Numbers of the controller's own.

    Returns
    -------
    dict of str to int
        Places and numbers, by the name of the constant.
    """
    names = [v.name for v in variables]
    first = names.index("gear_request")
    return {
        "MODEL_LEVEL": 0,
        "MODEL_RECORD": 1,
        "MODEL_VALVES": len(record.outputs),
        "MODEL_TRANSDUCERS": len(record.transducers),
        "MODEL_LIMIT": names.index("current_limit"),
        "MODEL_INPUTS": first,
        "MODEL_OUTPUTS": names.index("command_1"),
        "MODEL_TUNABLE": first - settings,
        "MODEL_WANTS": wants,
        "MODEL_SIGNALS": signals,
        "MODEL_SETTINGS": settings,
    }


def record_text(record: ControllerRecord) -> str:
    """Return the record by name as C text, from which c/controller_model.c reports it to the controller."""

    def text(word: str) -> str:
        return json.dumps(word)

    outputs = ", ".join(text(output.name) for output in record.outputs)
    transducers = ", ".join(f"{{{text(signal.name)}, {text(signal.unit)}}}" for signal in record.transducers)
    gears = ", ".join(f"{{{gear.number}, {text(gear.name)}}}" for gear in record.gears)
    return (
        f"#define MODEL_ID {text(record.id)}\n#ifdef RIG_CONTROLLER_H\n"
        f"static const char *const MODEL_VALVE_NAMES[] = {{{outputs}}};\n"
        f"static const rig_transducer MODEL_TRANSDUCER_LIST[] = {{{transducers}}};\n"
        f"static const rig_gear MODEL_GEARS[] = {{{gears}}};\n#endif\n"
    )


def build_controller_fmu(
    sources: Sequence[str | Path], target: str | Path, config: RigConfig, fmi: int = 2, flags: Sequence[str] = ()
) -> None:
    """Write C and C++ files with the functions of rig_controller.h as a co-simulation FMU.

    Parameters
    ----------
    sources : sequence of str or Path
        The source files.
    target : str or Path
        The FMU's file.
    config : RigConfig
        The configuration of the rig for which the controller is made.
    fmi : int
        2 or 3.
    flags : sequence of str
        Further options of the compiler, e.g. folders of headers.

    Raises
    ------
    RigError
        When a file is missing, does not compile, or does not fit rig_controller.h or the rig.
    """
    files = [Path(source) for source in sources]
    for path in files:
        if not path.is_file():
            raise RigError(f"{path}: {no_file(path)}")
        if path.suffix not in COMPILERS:
            raise RigError(f"{path}: expected a source file that ends in {', '.join(COMPILERS)}")
    target, identifier = Path(target), _identifier(Path(target).stem)
    model, record = [SOURCES / "controller_model.c", *files], record_of(config)
    more = record_text(record)
    with tempfile.TemporaryDirectory(prefix="rig-fmu-") as folder:
        Path(folder, NAME).write_text(header_text(record), encoding="utf-8")
        flags = [*flags, f"-I{folder}"]  # for sources without a rig_record.h of their own
        probe = Path(folder, f"{identifier}.so")  # a first build, to ask at which levels the controller works
        variables = controller_variables(config, ("duty", "current"))
        header = c_header(fmi, variables, "", controller_defines(record, variables)) + more
        compile_model(fmi, header, model, probe, flags)
        found = _Described(probe, str(files[0]), record)
        levels = tuple(name for name, bit in LEVEL_BITS.items() if found.bits & bit)
        if not levels:
            raise RigError(f"{files[0]}: its levels are {found.bits}, expected 1 (duty), 2 (current) or 3 (both)")
        own = found.wants, found.signals, found.settings
        variables = controller_variables(config, levels, *own)
        names = [v.name for v in variables]
        if twice := next((name for name in names if names.count(name) > 1), None):
            raise RigError(f"{files[0]}: its own '{twice}' is the name of another variable of the FMU; rename it")
        text, defines = f"A shift controller for the rig {config.name}", controller_defines(record, variables, *map(len, own))
        write_fmu(target, fmi, Model(identifier, text, variables, model, defines, flags=flags, more=more, saves=found.saves))


class _Described(CLibrary):
    """A library of rig_controller.h that is loaded to read its levels (``bits``) and the names of its own."""

    def __init__(self, library: Path, name: str, record: ControllerRecord) -> None:
        self._host, self._made_for = None, record
        try:
            self.bits = self._load(str(library), name)
        finally:
            if self._host is not None:
                self._host.kill()


def _identifier(name: str) -> str:
    """Return a name that is valid in C."""
    name = re.sub(r"\W", "_", name, flags=re.ASCII)
    return f"_{name}" if not name or name[0].isdigit() else name
