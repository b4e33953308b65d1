# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Files of YAML that are too large, too deep, contain themselves or are mutilated: one sentence, soon, never a traceback."""

import random
import re
import shutil
import subprocess
import sys
import time
from functools import partial

import pytest

from rig_nodes.base.config import CONFIG_DIR, RIGS_DIR, load_yaml
from rig_nodes.base.errors import RigError
from rig_nodes.base.yaml_file import MOST_BYTES, MOST_DEPTH, MOST_VALUES
from rig_nodes.rig.alfa46 import read_alfa46
from rig_nodes.rig.configuration import load_rig
from rig_nodes.rigs.hydmag.laboratory.calibration_rows import STAGES_FILE, calibration
from rig_nodes.rigs.hydmag.laboratory.targets import TARGETS_FILE, load_targets
from rig_nodes.runs.procedure import load_procedure, prepare
from rig_nodes.runs.sequence import load_sequence
from rig_nodes.studies.sweep.plan import read_plan

SECONDS = 4.0  # s of processor time on a busy machine: twice the promised time
LAUGHS = "a: &a [x,x,x,x,x,x,x,x,x,x]\n" + "".join(
    f"{name}: &{name} [{','.join(['*' + before] * 10)}]\n" for before, name in zip("abcdefgh", "bcdefghi")
)
MANY = ",".join(map(str, range(2000)))


def steps(text):
    return f"description: x\nsteps:\n{text}\n"


TOO_MUCH = {
    "a circle of one": (
        load_rig,
        "description: x\nbase: tried.yaml\n",
        r"tried\.yaml:2: base: 'tried\.yaml' leads back to this rig",
    ),
    "lists in lists": (load_yaml, "a: " + "[" * 500 + "]" * 500, f":1: .* more than {MOST_DEPTH} deep"),
    "maps in maps": (load_yaml, "".join(" " * k + "a:\n" for k in range(500)), f":41: .* more than {MOST_DEPTH} deep"),
    "an open end": (load_yaml, "[" * 100_000, "deep"),
    "ten megabytes": (load_yaml, "a: 1\n" * 2_000_000, f"has 10000000 bytes, expected at most {MOST_BYTES}"),
    "a long text": (load_yaml, "a: " + "x" * (MOST_BYTES - 10), ":1: a value of 299990 characters, expected at most 10000"),
    "many values": (load_yaml, "a: [" + "1," * (MOST_BYTES // 2 - 10) + "]", f"more than {MOST_VALUES} values"),
    "laughs": (load_yaml, LAUGHS, f":5: the file has more than {MOST_VALUES} values, aliases written out"),
    "an alias of itself": (load_yaml, "a: &a [*a]", r":1: '\*a' names nothing that ends before it"),
    "a number": (load_yaml, "a: " + "9" * 5000, ":1: .* is too large a number"),
    "no number": (load_yaml, "a: .nan", ":1: .nan is no finite number"),
    "two documents": (load_yaml, "a: 1\n---\nb: 1\n", ":2: a second document begins here"),
    "a tag": (load_yaml, "a: !!python/object:os.system x", ":1: the tag .* is not known here"),
    "a long list in a sentence": (
        load_rig,
        f"description: x\nbase: hydmag\nparts: {{motor: [{MANY}]}}\n",
        r":3: parts.motor must be a map with the key 'part', found \[0, 1, 2",
    ),
    "each in each": (
        partial(load_sequence, default="hydmag"),
        steps(
            f"  - repeat:\n      each: {{a: [{MANY}]}}\n      steps:\n        - repeat:\n            each: {{b: [{MANY}]}}\n"
            "            steps: [{wait: {for: 1 ms}}]"
        ),
        "repeats make more than 200000 values of the steps",
    ),
    "times in times": (
        partial(load_sequence, default="hydmag"),
        steps("  - repeat: {times: 10000, steps: [{repeat: {times: 10000, steps: [{wait: {for: 1 s}}]}}]}"),
        ":3: repeat makes 100000000 steps, more than 10000",
    ),
    "a million steps": (
        partial(load_sequence, default="hydmag"),
        steps("  - repeat: {times: 1000000, steps: [{wait: {for: 1 s}}]}"),
        ":3: repeat.times is 1000000, expected a whole number from 1 to 10000",
    ),
    "thirty years": (
        partial(load_sequence, default="hydmag"),
        steps("  - wait: {for: 1e9 s}"),
        ":3: wait.for is 1e9 s, expected 0 to 86400 s",
    ),
    "a week in pieces": (
        partial(load_sequence, default="hydmag"),
        steps("  - repeat: {times: 7, steps: [{wait: {for: 1440 min}}]}"),
        ":2: the waits of the sequence take 604800 s in all, expected at most 86400 s",
    ),
}


@pytest.mark.parametrize("what", TOO_MUCH)
def test_what_is_too_much_is_refused_soon(tmp_path, what):
    load, text, sentence = TOO_MUCH[what]
    path = tmp_path / "tried.yaml"
    path.write_text(text)
    began = time.process_time()
    with pytest.raises(RigError, match=sentence) as refused:
        load(path)
    assert time.process_time() - began < SECONDS
    assert str(refused.value).startswith(f"{path}") and len(str(refused.value)) < len(str(path)) + 400


def test_a_file_that_eats_memory_ends_below_300_mb(tmp_path):
    """All files that are too large are read one after the other in a process of its own, numerics included."""
    for k, what in enumerate(TOO_MUCH):
        (tmp_path / f"{k}.yaml").write_text(TOO_MUCH[what][1])
    code = (
        "import sys; from rig_nodes.runs.sequence import load_sequence; "
        "from rig_nodes.rig.configuration import load_rig; from rig_nodes.base.errors import RigError\n"
        "for path in sys.argv[1:]:\n"
        "    load = load_sequence if open(path).read(99).startswith('description: x\\nsteps') else load_rig\n"
        "    try:\n        load(path)\n"
        "    except RigError:\n        pass\n"
        "print(*(line.split()[1] for line in open('/proc/self/status') if line.startswith('VmHWM')))"
    )
    done = subprocess.run([sys.executable, "-c", code, *map(str, tmp_path.iterdir())], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert int(done.stdout) < 300 * 1024, "kB"


def test_a_circle_of_several_files_and_a_long_row_of_them(tmp_path):
    for name, base in (("a", "b"), ("b", "c"), ("c", "a"), *((f"d{k}", f"d{k + 1}") for k in range(12))):
        (tmp_path / f"{name}.yaml").write_text(f"description: x\nbase: {base}.yaml\n")
    with pytest.raises(RigError, match=r"c\.yaml:2: base: 'a\.yaml' leads back to this rig"):
        load_rig(tmp_path / "a.yaml")
    with pytest.raises(RigError, match=r"d8\.yaml:2: base: the rig is based on more than 8 others"):
        load_rig(tmp_path / "d0.yaml")
    path = tmp_path / "s.yaml"
    path.write_text(f"rig: a.yaml\n{steps('  - wait: {for: 1 s}')}")
    with pytest.raises(RigError, match=r"s\.yaml:1: rig: .*c\.yaml:2: base: 'a\.yaml' leads back to this rig"):
        load_sequence(path, default="hydmag")


def test_a_base_is_named_as_seen_from_the_file_that_names_it(tmp_path, monkeypatch):
    (tmp_path / "one").mkdir()
    (tmp_path / "one" / "base.yaml").write_text('description: x\nbase: hydmag\nparts: {motor: {ramp: [700 rpm/s, "x"]}}\n')
    (tmp_path / "one" / "mine.yaml").write_text("description: x\nbase: base.yaml\n")
    (tmp_path / "one" / "s.yaml").write_text(f"rig: mine.yaml\n{steps('  - wait: {for: 1 s}')}")
    monkeypatch.chdir(tmp_path)
    assert load_rig(load_sequence("one/s.yaml").rig).motor.ramp == pytest.approx(73.304, rel=1e-4)


SLIPS = [
    ("a:\n  b: 1\n\tc: 2\n", ":3: a tab stands here; YAML takes spaces only"),
    ("a:\n  b: 1\n   c: 2\n", ":3: the line begins in column 4 and fits no line above; expected column 3"),
    ("a:\n   b: {x: 1}\n  c: 2\n", ":3: the line begins in column 3 and fits no line above; expected column 4"),
    ("a:\n  - b: 1\n - c: 2\n", ":3: the line begins in column 2 and fits no line above; expected column 3"),
    ("a:\n  b:1\n  c: 2\n", ":2: there is no space after the colon; write 'b: 1'"),
    ("a:\n  - b: 1\n  -c: 2\n", ":3: there is no space after the dash; write '- c: 2'"),
    ("a:\n  - b: 1\n  c: 2\n", ":3: the dash is missing here that the items above have"),
    ("a:\n  b: 1\n  - c: 2\n", ":3: a dash stands here where the lines above have none"),
    ("a: {b: 1\nc: 2\n", ":1: what is opened in this line is not closed; expected '}'"),
    ("a: {b: 1 c: 2}\n", ":1: a comma or '}' is missing in column 11"),
    ('a: "x\nb: 2\n', ":1: the quote that is opened here is not closed"),
    ("a: {b: ${c}}\n", r":1: \$\{...\} between braces or brackets needs quotes"),
    ("a: b: c\n", ":1: a second colon; a value with a colon in it needs quotes"),
    ("a: @b\n", ":1: a value that begins with '@' needs quotes"),
    ("a: {b: 1}}\n", ":1: '}' closes nothing that is open"),
    ("a: 1\nb: 2\na: 3\n", ":3: duplicate key 'a', first in line 1"),
    ("a: \x01\n", ":1: is not YAML"),
]


@pytest.mark.parametrize("text, sentence", SLIPS)
def test_slips_of_the_hand_are_named(tmp_path, text, sentence):
    path = tmp_path / "f.yaml"
    path.write_text(text)
    with pytest.raises(RigError, match=rf"f\.yaml{sentence}"):
        load_yaml(path)


PARAMETRIC = 'description: x\nparameters:\n  speed: 500 rpm\nsteps:\n  - oil: {pressure: 4 MPa}\n  - motor: {speed: "${speed}"}\n'


@pytest.mark.parametrize(
    "old, new, sentence",
    [
        ('"${speed}"', '"${sped}"', r":6: there is no parameter '\$\{sped\}'; did you mean '\$\{speed\}'\?"),
        ('"${speed}"', '"${speed}${speed"', r":6: the brace of '\$\{speed' is not closed; write e.g. \$\{speed\}"),
        ('"${speed}"', '"${speed + 100}"', r":6: between the braces of '\$\{speed \+ 100\}' there is no name; nothing is computed"),
        ('"${speed}"', '"$speed ${speed}"', r":6: '\$speed' has no braces; write \$\{speed\}"),
        ('{speed: "${speed}"}', '{speed:1 rpm, a: "${speed}"}', ":6: there is no space after the colon; write 'speed: 1 rpm'"),
        ("  - motor", "    motor", r":5: a step has one key, .*; found oil, motor; is there a dash missing before 'motor'\?"),
        (
            "steps:\n  - oil: {pressure: 4 MPa}\n  - motor",
            "steps:\n  motor",
            ":4: steps must be a list .*; each begins with a dash",
        ),
        ("oil: {pressure: 4 MPa}", "oil:{pressure: 4 MPa}", ":5: .*there is no space after the colon"),
        ("pressure: 4 MPa", "pressure: 40 bar, a: 1", ":5: unknown key 'a' in oil"),
        ("pressure: 4 MPa", "pressure: 900 bar", ":5: oil.pressure is 900 bar; the rig takes 0 to 100 bar"),
        ("pressure: 4 MPa", "pressure: 90 MPa", ":5: oil.pressure is 90 MPa; the rig takes 0 to 10 MPa"),
    ],
)
def test_mistakes_in_a_sequence_are_named_with_what_would_be_right(tmp_path, old, new, sentence):
    assert old in PARAMETRIC
    path = tmp_path / "f.yaml"
    path.write_text(PARAMETRIC.replace(old, new, 1))
    with pytest.raises(RigError, match=rf"f\.yaml{sentence}"):
        load_sequence(path, default="hydmag")


@pytest.mark.parametrize(
    "key, text, sentence",
    [
        ("oil_supply.temperature", "999 degC", "is 999 degC, outside -30 to 150 degC$"),
        ("motor.torque_limit", "1e9 Nm", "is 1e9 Nm, outside .* Nm$"),
        ("alfa46.current_limit", "0.9 A", "is 0.9 A, outside 0 to 0.8 A$"),
        ("alfa46.current_limit", "900 mA", "is 900 mA, outside 0 to 800 mA$"),
        ("alfa46.T12", "1 ms", "there is no value of alfa46 'T12'; did you mean 't12'"),
        ("alfa64.t12", "1 ms", "there is no value 'alfa64.t12'; did you mean 'alfa46.t12'"),
        ("t12", "1 ms", "there is no value 't12'; did you mean 'alfa46.t12'"),
        ("motor", "1", "'motor' is a part of the rig; name one of its values, e.g. motor.torque_limit"),
        ("kitchen", "1", "there is no part of the rig 'kitchen'; known are kernel, cut, rotor, w0, z5, input_shaft, motor"),
    ],
)
def test_settings_say_the_range_in_the_unit_that_was_typed_and_what_was_meant(key, text, sentence):
    with pytest.raises(RigError, match=f"^setting {re.escape(f'{key}={text}')}: (the value )?{sentence}"):
        load_rig("hydmag", {key: text})


# ---- mutilated files

SWEEP = (
    'sequence: demo\nvary:\n  alfa46.t12: "-250 ms .. -150 ms in 5"\n  alfa46.output_1.P1.current: [150 mA, 160 mA]\n'
    "method: grid\nseed: 3\nset: {alfa46.t21: 10 ms}\n"
)
ON_BASE = 'description: "x"\nbase: hydmag\nparts:\n  motor:\n    ramp: [700 rpm/s, "x"]\ncontroller_values:\n  t12: [1 ms, "x"]\n'
VALUES = [
    "null",
    "true",
    "off",
    "[]",
    "{}",
    "[1, 2]",
    "{a: 1}",
    "1",
    "-1",
    "0",
    "1e400",
    "1e308",
    "9" * 40,
    ".inf",
    "2001-01-01",
    "0x1F",
    "!!binary aGk=",
    "&a x",
    "*a",
    "'",
    '"',
    '"\\e[31m"',
    "\u202e",
    "\t",
    "| ",
    "? x",
    "${x",
    "${a+1}",
    "$a",
    "NaN",
    "inf s",
    "1 rpm",
    "-5 rpm",
    "1500",
    "1500rpm",
    "x" * 3000,
    "- 1",
    '""',
    "~nobody/x.yaml",
    "/dev/zero.yaml",
    "[[[[1]]]]",
    "true: 1",
    "[~, ~]",
    '[1 s, "x", 3]',
    "[1, x]",
    "12:30:45",
    "=",
    "<<",
    "%",
    "@x",
    "\u00a05 s",
    "\u0665 s",
]
MARKS = "{}[]:,-#&*!|>'\"%@`\t\x00\x1b\u2028\ufeff\x85 \\"


def mutilated(chance: random.Random, text: str) -> str:
    """Returns the text after one to six random changes."""
    lines = text.split("\n")
    for _ in range(chance.choice((1, 1, 1, 2, 3, 6))):
        k, k2 = chance.randrange(len(lines)), chance.randrange(len(lines))
        line, what = lines[k], chance.randrange(11)
        words = list(re.finditer(r"[^\s,\[\]{}:]+", line))
        at = chance.randrange(len(line) + 1)
        if what == 0:
            lines.insert(k, line)
        elif what == 1 and len(lines) > 1:
            del lines[k]
        elif what == 2:
            lines[k] = " " * chance.randrange(1, 5) + line
        elif what == 3:
            lines[k] = line[chance.randrange(1, 4) :]
        elif what == 4:
            lines[k], lines[k2] = lines[k2], line
        elif what == 5:
            lines[k] = line[:at] + chance.choice(MARKS) + line[at:]
        elif what == 6:
            lines[k] = line.replace(": ", ":", 1) if at % 2 else line.replace("- ", chance.choice(("", "-")), 1)
        elif what == 7:
            lines[k] = re.sub(r"[\w.]+:", lambda _: chance.choice(("1:", "~:", "[a]:", "${x}:", "? ", "'':")), line, count=1)
        elif what == 8 and ":" in line:
            lines[k] = f"{line.partition(':')[0]}: {chance.choice(VALUES)}"
        elif words:
            word = chance.choice(words)
            lines[k] = line[: word.start()] + chance.choice(VALUES) + line[word.end() :]
    return "\n".join(lines)


def read_procedure(path):
    for series in load_procedure(path, "hydmag").all_series[:2]:
        prepare(series)


def test_mutilated_files_are_taken_or_refused_and_nothing_else(tmp_path):
    """Every kind of YAML that the program reads is tried, with arbitrary files of each kind."""
    files = [
        ("sweep.yaml", SWEEP, partial(read_plan, default="hydmag")),
        ("rigs/mine.yaml", ON_BASE, load_rig),
        ("calibration.yaml", STAGES_FILE.read_text(), calibration),
    ]
    head, _, rows = TARGETS_FILE.read_text().partition("\ntargets:")
    files.append(("targets.yaml", "\n- ".join(f"{head}\ntargets:{rows}".split("\n- ")[:12]) + "\n", load_targets))
    for root, pattern, load in (
        (RIGS_DIR, "*/rig.yaml", load_rig),
        (RIGS_DIR, "*/sequences/*.yaml", partial(load_sequence, default="hydmag")),
        (RIGS_DIR, "*/procedures/*.yaml", read_procedure),
        (CONFIG_DIR, "controllers/*.yaml", read_alfa46),
    ):
        shutil.copytree(root, tmp_path / root.name, dirs_exist_ok=True)
        files += [(str(path.relative_to(root.parent)), path.read_text(), load) for path in sorted(root.glob(pattern))]
    chance, refused = random.Random(20), 0
    for turn in range(120):
        name, text, load = files[turn % len(files)]
        path, tried = tmp_path / name, mutilated(chance, text)
        path.write_text(tried)
        try:
            load(path)
        except RigError as error:
            refused += 1
            assert 10 < len(str(error)) < 1200, error
        except Exception as error:
            raise AssertionError(f"turn {turn}, {name}: {error!r} for\n{tried}") from error
        path.write_text(text)
    assert refused > 60
