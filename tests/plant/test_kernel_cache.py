# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Compiled code is kept under a key of its sources, independent of the module that is imported first."""

import os
import stat
import subprocess
import sys

import pytest

import rig_nodes.base.compiled


@pytest.mark.parametrize(
    "first",
    [
        "rig_nodes.plant.alfa46_law",
        "rig_nodes.rig.configuration",
        "numba",
        pytest.param("rig_nodes.plant.instruments.noise", marks=pytest.mark.campaign),
        pytest.param("rig_nodes.plant.engine.loop", marks=pytest.mark.campaign),
    ],
)
def test_every_way_in_leads_to_the_keyed_folder(first):
    code = (
        f"import {first}; from rig_nodes.plant.engine import loop; from rig_nodes.plant import alfa46_law as law; "
        "print(loop.advance._cache.cache_path); print(law.law_step._cache.cache_path)"
    )
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    folder = str(rig_nodes.base.compiled.cache_root() / rig_nodes.base.compiled.cache_key())
    assert all(path.startswith(folder) for path in out), out


def test_a_start_loads_neither_coverage_nor_scipys_algebra_which_can_be_loaded_afterwards():
    code = (
        "import sys; from rig_nodes.plant.engine import loop; import numba.np.arraymath; "
        "print([name for name in ('coverage', 'scipy.linalg') if name in sys.modules]); "
        "import scipy.linalg.cython_blas as blas; print(blas.__name__)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["[]", "scipy.linalg.cython_blas"]


@pytest.mark.parametrize("first", ["numpy", pytest.param("numba", marks=pytest.mark.campaign)])
def test_what_is_read_from_the_cache_works_in_what_is_compiled_then(tmp_path, first):
    """A function from the cache, for which the compiler is not prepared, is called from Python and from code that is compiled."""
    (tmp_path / "own.py").write_text(
        "import numpy as np\nfrom rig_nodes.base.compiled import njit, use_kernel_cache\n\nuse_kernel_cache()\n\n"
        "@njit(cache=True)\ndef twice(x):\n    return 2.0 * x\n\n"
        "@njit(cache=True)\ndef squares(n):\n    return np.arange(n) ** 2\n\n"
        "@njit()\ndef four_and(x, n):\n    return twice(twice(x)) + squares(n).sum()\n"
    )
    code = (
        "import sys, own; hits = lambda one: sum(one.stats.cache_hits.values()); "
        "print(own.twice(3.0), 'numba.np.npdatetime' in sys.modules, own.squares(4).tolist(), own.four_and(3.0, 4), "
        "hits(own.twice), hits(own.squares))"
    )
    env = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "cache"), "PYTHONPATH": str(tmp_path)}
    starts = [
        subprocess.run([sys.executable, "-c", f"import {one}; {code}"], capture_output=True, text=True, check=True, env=env)
        for one in (first, "numpy", "numba")
    ]
    compiled, read = "6.0 True [0, 1, 4, 9] 26.0 0 0", "6.0 False [0, 1, 4, 9] 26.0 1 1"
    assert [done.stdout.strip() for done in starts] == [compiled, read, read]


def together(code, folder, cache):
    """Runs the code in two processes that begin at the same time; returns what each printed."""
    env = {**os.environ, "NUMBA_CACHE_DIR": str(cache)}
    command = [sys.executable, "-c", f"import own; print('there', flush=True); input(); {code}"]
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True, "env": env, "cwd": folder}
    started = [subprocess.Popen(command, **pipes) for _ in range(2)]
    for process in started:
        assert process.stdout.readline() == "there\n"
    for process in started:
        process.stdin.write("\n")
        process.stdin.flush()
    return sorted(process.communicate()[0].strip() for process in started)


def test_of_processes_that_need_the_same_code_one_compiles_it(tmp_path):
    (tmp_path / "own.py").write_text(
        "from rig_nodes.base.compiled import njit, use_kernel_cache\n\nuse_kernel_cache()\n\n"
        "@njit(cache=True)\ndef inner(x):\n    return 2.0 * x\n\n"
        "@njit(cache=True)\ndef outer(x):\n    return inner(x) + 1.0\n"
    )
    code = "print(own.outer(3.0), sum(own.outer.stats.cache_hits.values()))"
    assert together(code, tmp_path, tmp_path / "cache") == ["7.0 0", "7.0 1"]


def test_what_processes_keep_at_the_same_time_is_found_under_its_own_name(tmp_path):
    (tmp_path / "own.py").write_text(
        "import os\nfrom rig_nodes.base.compiled import use_kernel_cache\n\nuse_kernel_cache()\n"
        "import numba\nfrom numba.core.caching import IndexDataCacheFile\n"
        "index = IndexDataCacheFile(os.environ['NUMBA_CACHE_DIR'], 'function', 'stamp')\n"
        "def keep(count):\n    for k in range(count):\n        index.save((os.getpid(), k), (os.getpid(), k))\n"
    )
    code = "own.keep(100); print(all(own.index.load((own.os.getpid(), k)) == (own.os.getpid(), k) for k in range(100)))"
    assert together(code, tmp_path, tmp_path / "cache") == ["True"] * 2


def test_an_edited_source_changes_the_key(tmp_path, monkeypatch):
    package = tmp_path / "rig_nodes"
    (package / "plant").mkdir(parents=True)
    (package / "plant" / "valve.py").write_text("a = 1\n")
    how = package / "base" / "compiled.py"
    how.parent.mkdir()
    how.write_text("options = 1\n")
    monkeypatch.setattr(rig_nodes.base.compiled, "__file__", str(how))
    keys = [rig_nodes.base.compiled.cache_key()]
    for source in (package / "plant" / "valve.py", how):
        source.write_text("a = 2\n")
        keys.append(rig_nodes.base.compiled.cache_key())
    assert len(set(keys)) == 3


def test_compiled_code_that_others_could_have_written_is_not_run(tmp_path):
    def start(folder):
        return subprocess.run(
            [sys.executable, "-m", "rig_nodes", "simulate", "no-such-sequence"],
            capture_output=True,
            text=True,
            env={**os.environ, "NUMBA_CACHE_DIR": str(folder)},
        )

    open_one = tmp_path / "open"
    open_one.mkdir()
    open_one.chmod(0o777)
    done = start(open_one)
    assert done.returncode == 2 and f"rig: {open_one}: the compiled code in it would run" in done.stderr
    assert len(done.stderr.splitlines()) == 1 and not any(open_one.iterdir())
    new = tmp_path / "new" / "folder"
    assert "no-such-sequence" in start(new).stderr
    assert stat.S_IMODE(new.stat().st_mode) == 0o700, "whatever the umask"
    if os.getuid() == 0:
        os.chown(new, 12345, -1)
        assert "others can write to it" in start(new).stderr
