# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The C code of both FMUs under the address and undefined-behaviour sanitizers, called by a program in C."""

import json
import os
import subprocess
import sys
from pathlib import Path

from rig_nodes.controllers.c.library import INCLUDE
from rig_nodes.controllers.record import record_of
from rig_nodes.rig.configuration import load_rig
from rig_nodes.runs import fmu
from rig_nodes.runs.fmu.build import COMMON, SOURCES, controller_defines, controller_variables, fmpy_headers, record_text
from rig_nodes.runs.fmu.description import c_header
from rig_nodes.runs.fmu.rig_variables import rig_variables

PACKAGE = Path(fmu.__file__).parents[2]
ALFA46_C = INCLUDE.parent / "examples" / "alfa46.c"
SANITIZE = ["-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"]
STRICT = ["-std=gnu11", "-O0", "-Wall", "-Wextra", "-Werror"]


def build(folder, header, sources):
    """Returns the path of the program."""
    (folder / "variables.h").write_text(header)
    files = [Path(__file__).parent / "driver.c", SOURCES / "fmi2.c", *(SOURCES / name for name in COMMON), *sources]
    subprocess.run(
        [
            "cc",
            *STRICT,
            *SANITIZE,
            f"-I{folder}",
            f"-I{SOURCES}",
            f"-I{INCLUDE}",
            f"-I{fmpy_headers()}",
            "-o",
            folder / "driver",
            *files,
            "-lm",
        ],
        check=True,
    )
    return folder / "driver"


def drive(program, folder):
    """Returns the output of the program, which ends with 0 and without a report of the sanitizers."""
    done = subprocess.run(
        [program, folder.as_uri().replace("resources", "%72esources")], capture_output=True, text=True, timeout=100
    )
    assert (done.returncode, done.stderr) == (0, "") and done.stdout.endswith("done\n"), done.stdout + done.stderr
    return done.stdout


def test_the_controller(tmp_path):
    variables, record = controller_variables(load_rig("hydmag"), ("duty", "current")), record_of(load_rig("hydmag"))
    header = c_header(2, variables, "{1}", controller_defines(record, variables)) + record_text(record)
    program = build(tmp_path, header, [SOURCES / "controller_model.c", ALFA46_C])
    assert "wrong 3: the GUID or instantiation token is not that" in drive(program, tmp_path)


def test_the_rig(tmp_path):
    resources = tmp_path / "resources"
    resources.mkdir()
    (resources / "tool.txt").write_text(f"{sys.executable}\n{PACKAGE}\n")
    (resources / "rig.json").write_text(json.dumps({"rig": "hydmag", "set": {}}))
    program = build(tmp_path, c_header(2, rig_variables(load_rig("hydmag")), "{1}", {}), [SOURCES / "rig_process.c"])
    assert not {"RIG_FMU_PYTHON", "RIG_FMU_PATH"} & os.environ.keys()
    assert "one 3: record takes at most 1023 characters" in drive(program, resources)
