# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Messages of an FMU with a printf format, sent from C as FMUs do."""

import ctypes as ct
import subprocess

import pytest

from rig_nodes.controllers.fmi.log_text import SIGNATURE, formatted, text_at

CALLER = """
typedef void (*logger)(void *, const char *, int, const char *, const char *, ...);
void speak(logger say, int which) {
  switch (which) {
    case 0: say(0, "name", 3, "logError", "sensor %s lost at %.3f s, %d of %5.1f %%", "p1", 1.25, -7, 2.5); break;
    case 1: say(0, "name", 3, "logError", "100 %n%s of it"); break;
    case 2: say(0, "name", 3, "logError", "%ld %lu %#x %c|%-4s|%g", -5L, 6UL, 255u, 'z', "ab", 0.5); break;
    case 3: say(0, "name", 3, "logError", "100 %"); break;
    case 4: say(0, "name", 3, "logError", "%.*s and %s", 3, "abcdef", (const char *)0); break;
  }
}
"""


@pytest.mark.parametrize(
    ("which", "text"),
    [(0, "sensor p1 lost at 1.250 s, -7 of   2.5 %"), (2, "-5 6 0xff z|ab  |0.5"), (3, "100 %"), (4, "abc and (null)")],
)
def test_values_stand_where_the_format_has_them(which, text, speak):
    assert speak(which) == text


def test_a_format_that_is_a_users_text_harms_nothing(speak):
    """The values for its conversions are arbitrary contents of the processor's registers."""
    text = speak(1)
    assert text.startswith("100 ") and text.endswith(" of it")


def test_what_cannot_be_read_is_said():
    assert text_at(8) == "(unreadable)" and text_at(2**64 - 1) == "(unreadable)" and text_at(None) == "(null)"
    assert formatted("%d " * 40, (1, *[0.5] * 8, *[2] * 15)) == "%d " * 40


@pytest.fixture(scope="module")
def speak(tmp_path_factory):
    folder = tmp_path_factory.mktemp("log")
    (folder / "caller.c").write_text(CALLER)
    subprocess.run(["cc", "-w", "-shared", "-fPIC", "-o", folder / "caller.so", folder / "caller.c"], check=True)
    library, texts = ct.CDLL(str(folder / "caller.so")), []
    callback = SIGNATURE(lambda env, name, status, category, form, *values: texts.append(formatted(text_at(form), values)))

    def text_of(which):
        library.speak(callback, which)
        return texts.pop()

    return text_of
