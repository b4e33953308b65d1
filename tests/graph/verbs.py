# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Runs verbs of `rig` and its executables, each in a fresh process, forked from one in which Python and ROS are loaded."""

import multiprocessing
import os
import pkgutil
import sys
from concurrent.futures import ProcessPoolExecutor
from tempfile import TemporaryFile

# pytest too, because each process loads the main module of the process that starts it
LOADED = ["pytest", "rig_nodes.cli.main", "rig_nodes.nodes.running_rig", "rig_nodes.nodes.rig_container"]


class Verbs:
    """A context manager in which :meth:`run` runs a verb as a terminal does, but without the start of Python."""

    def __enter__(self) -> "Verbs":
        fresh = multiprocessing.get_context("forkserver")
        fresh.set_forkserver_preload(LOADED)
        self._processes = ProcessPoolExecutor(1, fresh, max_tasks_per_child=1)
        return self

    def __exit__(self, *_):
        self._processes.shutdown()

    def run(self, *words: str) -> tuple[int, str, str]:
        """Returns exit code, stdout and stderr of a verb."""
        return self.of("rig_nodes.cli.main:main", *words)

    def of(self, entry: str, *words: str, env: dict[str, str] | None = None) -> tuple[int, str, str]:
        """Returns the same for an executable.

        ``entry`` is its entry point, module:function, and it runs in this folder; ``env`` replaces this process's environment.
        """
        return self._processes.submit(_outcome, entry, words, dict(os.environ) if env is None else env, os.getcwd()).result(60)


def _outcome(entry: str, words: tuple[str, ...], env: dict[str, str], folder: str) -> tuple[int, str, str]:
    os.chdir(folder)
    os.environ.clear()
    os.environ.update(env)
    sys.argv = [entry, *words]
    with TemporaryFile("w+") as out, TemporaryFile("w+") as error:
        os.dup2(out.fileno(), 1)
        os.dup2(error.fileno(), 2)
        try:
            code = pkgutil.resolve_name(entry)()
        except SystemExit as end:
            code = end.code
        for stream in (sys.stdout, sys.stderr):
            stream.flush()
        for file in (out, error):
            file.seek(0)
        return code, out.read(), error.read()
