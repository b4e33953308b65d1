# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Files that are nearly bags: each is read, or refused in one sentence, within seconds; a campaign tries 20 000 of them."""

import random
import time

import pytest

from rig_nodes.bags.cdr import encoder
from rig_nodes.bags.reader import Bag
from rig_nodes.bags.writer import BagWriter
from rig_nodes.base.errors import BagError

HANGS = 5.0  # s
TOLD = 2000  # files after which a campaign prints how far it is
INTERESTING = [b"", b"\x00", b"\xff" * 8, b"\x7f\xff\xff\xff", (2**63).to_bytes(8, "little"), b"\x89MCAP0\r\n"]


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    """Bytes of a bag of some messages with its description."""
    folder = tmp_path_factory.mktemp("small")
    encode = encoder("rig_msgs/msg/Measurement").encode
    with BagWriter(folder, "run") as writer:
        for seq in range(30):
            writer.write("/motor/n_wej", "rig_msgs/msg/Measurement", encode(seq * 10_000_000, seq, seq * 1.5), seq * 10_000_000)
    return (folder / "run_0.mcap").read_bytes()


def damaged(data, draw):
    """Returns the bytes with one to four random changes."""
    data = bytearray(data)
    for _ in range(draw.randint(1, 4)):
        a, b = sorted(draw.randrange(len(data) + 1) for _ in range(2))
        b = min(b, a + draw.choice((1, 8, 100, len(data))))
        how = draw.randrange(6)
        if how == 0 and a < len(data):
            data[a] ^= 1 << draw.randrange(8)
        elif how == 1:
            data[a:b] = draw.choice(INTERESTING)
        elif how == 2:
            data[a:a] = data[a:b]
        elif how == 3:
            del data[a:b]
        elif how == 4:
            data[a:b] = draw.randbytes(b - a)
        else:
            del data[draw.randrange(len(data) + 1) :]
    return bytes(data)


def content(bag):
    """Returns times and values of all messages, by topic."""
    return {topic: [(time, one.seq, one.value) for time, one in bag.messages(topic)] for topic in bag.counts}


def what_is_wrong(found, damage, whole):
    """Returns what a bag, whose messages have checksums, was taken for without being it; empty where it is right.

    ``damage`` is what the reader says of a bag that it has recovered, whose messages are then a part of the whole.
    """
    for topic, messages in found.items():
        rest = iter(whole.get(topic, ()))
        if not all(one in rest for one in messages):
            return f"{topic} holds messages that nobody has recorded in this order"
    return "" if found == whole or damage else "it lacks messages, and is called whole"


@pytest.mark.parametrize("count", [150, pytest.param(20_000, marks=pytest.mark.campaign)])
def test_a_file_that_is_nearly_a_bag_is_read_or_refused_in_a_sentence(small, tmp_path, count, soon_done, capsys):
    draw, refused, longest = random.Random(41), 0, 0.0
    path = tmp_path / "run_0.mcap"
    path.write_bytes(small)
    whole = content(Bag(path))
    assert {topic: len(messages) for topic, messages in whole.items()} == {"/motor/n_wej": 30}
    for number in range(count):
        path.write_bytes(damaged(small, draw))
        began = time.monotonic()
        try:
            with soon_done(HANGS):
                bag = Bag(path, recover=bool(number % 2))
                found, _ = content(bag), bag.end
            assert what_is_wrong(found, bag.damage, whole) == ""
        except BagError as error:
            refused += 1
            assert "\n" not in str(error) and str(path) in str(error), (number, str(error))
        except Exception as error:
            kept = tmp_path.parent / f"bag_{number}.mcap"
            kept.write_bytes(path.read_bytes())
            raise AssertionError(f"file {number}, kept as {kept}: {type(error).__name__}: {error}") from error
        longest = max(longest, time.monotonic() - began)
        if (number + 1) % TOLD == 0:
            with capsys.disabled():
                print(f"\n{number + 1} files: {refused} refused, the others read; longest {longest:.2f} s", end="")
