# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A missing program or library is reported in one sentence with the name of its package."""

import shutil
import subprocess
import sysconfig

import pytest


def without(*names):
    return lambda name: None if name in names else f"/usr/bin/{name}"


COMPILERS = ("c++", "g++", "clang++", "cc", "gcc", "clang")


@pytest.mark.parametrize(
    ("situation", "words"),
    [
        ({"version": (3, 10, 13), "which": without("python3.14")}, ["3.11", "3.10", "start it as 'python3.13"]),
        ({"version": (3, 10, 13), "which": lambda name: None}, ["3.11", "3.10", "python3.12-venv"]),
        ({"version": (3, 15, 0)}, ["3.14", "3.15"]),
        ({"machine": "aarch64"}, ["x86-64", "aarch64"]),
        ({"system": "darwin"}, ["Linux", "darwin"]),
        ({"glibc": (2, 17)}, ["glibc 2.28", "2.17"]),
        ({"glibc": (0, 0)}, ["glibc 2.28", "another C library"]),
        ({"has_module": lambda name: name != "ensurepip"}, ["venv", "python3-venv"]),
        ({"include": "/nowhere"}, ["Python.h", "/nowhere", "python3-dev"]),
        ({"which": without(*COMPILERS)}, ["C++ compiler", "g++"]),
    ],
)
def test_missing_thing_is_named(launcher, situation, words, monkeypatch, tmp_path):
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.delenv("CXX", raising=False)
    sentence = launcher.find_missing(root=str(tmp_path), **situation)
    assert "\n" not in sentence
    for word in words:
        assert word in sentence


def test_nothing_is_missing_where_the_tests_run(launcher, tmp_path):
    if not shutil.which("g++"):
        pytest.skip("no compiler on this machine")
    assert launcher.find_missing(root=str(tmp_path)) is None


@pytest.mark.parametrize("name", ["my rig", "Prüfstand", "стенд", "a\n", "it's", "a;b", "(copy)", "a*", "\udcff"])
def test_a_path_that_the_build_tools_do_not_take_is_refused_at_once_in_one_plain_line(launcher, tmp_path, name):
    folder = tmp_path / name
    folder.mkdir()
    said = launcher.find_missing(root=str(folder), which=without())
    assert "move the checkout" in said and said.isascii() and said.isprintable()


@pytest.mark.parametrize("name", ["-x", "a+b", "user@lab.org", "a,b=c", "~me", "rig_2.0", "50%", "C#", "n" * 200])
def test_a_path_that_they_take_is_not(launcher, tmp_path, name):
    folder = tmp_path / name
    folder.mkdir()
    assert launcher.find_missing(root=str(folder), which=without(), include=sysconfig.get_path("include")) is None


@pytest.mark.parametrize("minor", [6, 8, 10])
def test_old_python_gets_a_sentence(checkout, launcher, tmp_path, minor):
    python = shutil.which(f"python3.{minor}")
    if not python or subprocess.run([python, "-c", ""], capture_output=True).returncode:
        pytest.skip(f"no Python 3.{minor} on this machine")
    shutil.copy(checkout / "rig", tmp_path)
    done = subprocess.run([python, tmp_path / "rig", "doctor"], capture_output=True, text=True, timeout=30)
    assert done.returncode == 2
    assert done.stderr.startswith("rig: Python 3.11") and done.stderr.count("\n") == 1
    assert not (tmp_path / ".venv").exists()


@pytest.mark.parametrize(
    ("output", "words"),
    [
        ("WARNING: Retrying: NewConnectionError('Temporary failure in name resolution')", "network or proxy"),
        ("SSLError(SSLCertVerificationError: CERTIFICATE_VERIFY_FAILED", "ca-certificates"),
        ("ERROR: THESE PACKAGES DO NOT MATCH THE HASHES FROM THE REQUIREMENTS FILE.", "requirements.lock"),
        ("OSError: [Errno 28] No space left on device", "disk is full"),
        ("all is well\nCMake Error at CMakeLists.txt:12:\n\n  no such message\nmore", "no such message"),
    ],
)
def test_failure_of_a_tool_is_explained(launcher, output, words):
    sentence = launcher.explain(output, "installing the packages failed", "/somewhere/setup.log")
    assert words in sentence and "\n" not in sentence
