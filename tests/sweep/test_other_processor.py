# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A member on another processor is the same within 1e-9; features of this processor are hidden from compiler and libraries."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

pq = pytest.importorskip("pyarrow.parquet")
SCRIPT = Path(__file__).with_name("other_processor.py")
# x86-64 of 2003: no AVX, no fused multiply-add in compiled code, in libm and in numpy's loops
SIMPLE = {
    "NUMBA_CPU_NAME": "x86-64",
    "NUMBA_CPU_FEATURES": "",
    "NPY_DISABLE_CPU_FEATURES": "X86_V3 X86_V4 AVX512_ICL AVX2 FMA3 AVX512F",  # the names of numpy 2 and of numpy 1
    "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX512F,-AVX512VL,-AVX2,-AVX,-FMA,-FMA4,-BMI2,-SSE4_1,-SSE4_2",
}
UNLIKE = 1e-9


def ran(folder: Path, **more: str) -> list[dict]:
    env = {**os.environ, "NUMBA_CACHE_DIR": str(folder / "cache"), **more} if more else dict(os.environ)
    subprocess.run([sys.executable, str(SCRIPT), str(folder / "sweep")], env=env, check=True, timeout=600)
    return pq.read_table(folder / "sweep" / "results.parquet").to_pylist()


@pytest.mark.campaign
def test_a_member_is_the_same_within_1e_9_on_a_simpler_processor(tmp_path, record_property):
    """Everything is compiled anew, which takes a minute, so the test is not part of the default run."""
    (tmp_path / "here").mkdir()
    (tmp_path / "there").mkdir()
    rows, others = ran(tmp_path / "here"), ran(tmp_path / "there", **SIMPLE)
    assert len(rows) == len(others) == 6 and {row["end"] for row in rows} == {"ended"}
    unlike = 0.0
    for row, other in zip(rows, others):
        assert row.keys() == other.keys()
        for name, value in row.items():
            if isinstance(value, float) and other[name] is not None:
                unlike = max(unlike, abs(other[name] - value) / max(abs(value), 1e-6))
            else:
                assert other[name] == value, name
    record_property("unlike", unlike)
    assert unlike <= UNLIKE
