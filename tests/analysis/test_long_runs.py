# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The memory of a verb does not grow with the length of a run, and where there is too little, one sentence says so."""

import resource
import subprocess
import sys

import pytest

MB = 1 << 20
# each verb runs in a process of its own, which prints its greatest memory
PEAK = """
import re, resource, sys
from rig_nodes.cli.main import main
code = main(sys.argv[1:])
with open("/proc/self/status") as file:
    print("peak", re.search(r"VmHWM:\\s+(\\d+)", file.read())[1])
sys.exit(code)
"""
SEQUENCE = """description: shifts up and down
steps:
  - oil: {{pressure: 4 MPa}}
  - wait: {{until: {{signal: p_p, above: 3.9 MPa}}, timeout: 3 s}}
  - shift: {{to: I, timeout: 3 s}}
  - motor: {{speed: 1500 rpm}}
  - load: {{torque: 60 Nm}}
  - wait: {{for: 2 s}}
  - repeat:
      times: {times}
      steps:
        - shift: {{to: II, timeout: 5 s}}
        - wait: {{for: 1 s}}
        - shift: {{to: I, timeout: 5 s}}
        - wait: {{for: {pause} s}}
"""


def peak(*words):
    """Runs a verb; returns the greatest memory of its process [bytes]."""
    done = subprocess.run([sys.executable, "-c", PEAK, *map(str, words)], capture_output=True, text=True, timeout=900)
    assert done.returncode == 0, done.stderr
    return 1024 * int(done.stdout.split()[-1])


def peaks(folder, times, pause):
    """Returns the greatest memory of simulate, report and compare of a run with so many pairs of shifts [bytes]."""
    file, run = folder / f"long{times}.yaml", folder / f"run{times}"
    file.write_text(SEQUENCE.format(times=times, pause=pause))
    return peak("simulate", file, "--out", run), peak("report", run), peak("compare", run, run)


@pytest.mark.campaign  # 17 s of processor time
def test_a_run_three_times_as_long_takes_no_more_memory(tmp_path):
    # 2.4 MB for each second more where a bag is in memory as a whole; a clutch's heat alone is 5 kB
    short, long = peaks(tmp_path, 3, 4), peaks(tmp_path, 10, 4)
    more = [(b - a) / MB for a, b in zip(short, long)]
    # compare holds the rows of both, which it thins out from 100 s on
    assert more[0] < 45 and more[1] < 45 and more[2] < 130, more


@pytest.mark.campaign
def test_an_hour_takes_less_than_600_megabytes(tmp_path):
    assert [one / MB < 600 for one in peaks(tmp_path, 515, 2)] == [True, True, True]


def test_too_little_memory_is_one_sentence(tmp_path):
    def little():
        resource.setrlimit(resource.RLIMIT_AS, (700 * MB, 700 * MB))

    code = "from rig_nodes.cli.main import main; import sys; sys.exit(main(sys.argv[1:]))"
    grabbing = "import rig_nodes.cli.check as v; v.main = lambda args: bytearray(1 << 40); "
    done = subprocess.run(
        [sys.executable, "-c", grabbing + code, "check", "hydmag"], capture_output=True, text=True, preexec_fn=little, timeout=60
    )
    assert done.returncode == 1 and done.stdout == ""
    assert done.stderr == "rig: there is not enough memory for this; what was begun is not finished\n"
