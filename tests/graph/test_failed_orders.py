# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""An order of a sequence that fails is a line on the terminal when it happens, not only in the bag or at the end."""

import re

from running_graph import rig_run

from rig_nodes.cli.main import main

NOT_SO = """
description: waits for a speed that nobody orders
steps:
  - oil: {pressure: 4 MPa}
  - wait: {until: {signal: n_wej, above: 100 rpm}, timeout: 200 ms}
  - shift: {to: I}
"""


def test_a_step_that_fails_is_a_line_of_run_and_of_simulate_before_the_end(tmp_path, capsys):
    sequence = tmp_path / "not_so.yaml"
    sequence.write_text(NOT_SO)
    why = r"'wait until n_wej above 100 rpm' did not come true within 0\.2 s"
    code, output = rig_run(tmp_path / "run", "--speed", "max", sequence=sequence)
    assert code == 1
    lines = output.splitlines()
    (at,) = [k for k, line in enumerate(lines) if re.match(rf" +0\.\d\d s  step 2 of 3 failed: .*{why}", line)]
    assert any("the rig is tripped" in line for line in lines[at:]) and "step 2 of 3: wait" in lines[at - 1]
    assert main(["simulate", str(sequence), "--out", str(tmp_path / "simulated")]) == 1
    assert re.search(rf"^ +0\.\d\d s  failed: .*{why}", capsys.readouterr().out, re.M)
