# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The frames of the UDP protocol are the same in Python, in the C header and on the page."""

import re
import subprocess
from pathlib import Path

from rig_nodes.controllers.udp.frames import ANSWER, BODIES, BYE, HEADER, HELLO, INFO, OWN, READY, SAMPLE, pack

from .conftest import ALFA46_C, CONTROLLERS, INCLUDE


def test_the_frames_are_those_of_the_c_header(tmp_path):
    """Sizes and places of every member must agree between the C compiler and Python's struct."""
    source = r"""
#include "rig_udp.h"
#include <stddef.h>
int main(void) {
  rig_udp_frame f; memset(&f, 0, sizeof f); (void)rig_udp_serve;
  for (unsigned kind = RIG_HELLO; kind <= RIG_OWN; kind++) printf("%u ", rig_udp_size(kind));
  rig_udp_client c; memset(&c, 0, sizeof c); c.session = 7; c.socket = 1;
  f.body.answer.more[2] = 0.25; f.body.answer.more[3] = 0.5; f.body.answer.gear = 2; f.body.answer.flags = 5;
  strcpy(f.body.answer.message, "no speed");
  printf("\n"); fflush(stdout);
  f.header.magic = RIG_UDP_MAGIC; f.header.version = RIG_UDP_VERSION; f.header.kind = RIG_ANSWER; f.header.session = 7;
  f.header.frame = 9; f.header.size = rig_udp_size(RIG_ANSWER) + 64; f.body.answer.more[7] = 0.125;
  fwrite(&f, 1, f.header.size, stdout);
  return 0;
}
"""
    (tmp_path / "sizes.c").write_text(source)
    sources = [tmp_path / "sizes.c", ALFA46_C]
    subprocess.run(["cc", "-std=gnu99", f"-I{INCLUDE}", "-o", tmp_path / "sizes", *sources, "-lm"], check=True)
    sizes, data = subprocess.run([tmp_path / "sizes"], capture_output=True, check=True).stdout.split(b"\n", 1)
    assert list(map(int, sizes.split())) == [
        HEADER.size + BODIES[kind].size for kind in (HELLO, INFO, 3, 4, READY, SAMPLE, ANSWER, BYE, OWN)
    ]
    assert data == pack(ANSWER, 7, 9, 0, 2, 0, 5, "no speed", more=(0.0, 0.0, 0.25, 0.5, 0.0, 0.0, 0.0, 0.125))


def test_the_page_says_the_kinds_and_their_bytes():
    page = (Path(__file__).parents[2] / "docs" / "how_to" / "udp.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| (\d) [A-Z]+ \|.*\| (\d+)[^|]*\|$", page, re.M)
    sizes = {kind: HEADER.size + body.size for kind, body in BODIES.items()}
    assert {int(kind): int(size) for kind, size in rows} == sizes


def test_the_c_header_is_usable_from_cpp(tmp_path):
    source = CONTROLLERS / "examples" / "udp_main.c"
    flags = ["-std=c++17", "-Wall", "-Wextra", "-Werror", f"-I{INCLUDE}"]
    subprocess.run(["c++", "-x", "c++", *flags, "-c", "-o", tmp_path / "mine.o", source], check=True)
