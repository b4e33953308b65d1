# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Bags that contain a fault for the readers: the fault of each, its bytes, and the words that its refusal must contain.

Run as a program it tries all readers on the files of a folder and prints the result of each as JSON, one line for each file.
"""

import contextlib
import io
import json
import resource
import struct
import sys
import time
import zlib
from pathlib import Path

import lz4.frame
import zstandard

MAGIC = b"\x89MCAP0\r\n"
EVENT = "rig_msgs/msg/Event"
SEPARATOR = "=" * 80 + "\n"
VALUE = "float64 value\n"
MIB = 1 << 20


def text(value):
    data = value.encode() if isinstance(value, str) else value
    return struct.pack("<I", len(data)) + data


def record(opcode, content):
    return struct.pack("<BQ", opcode, len(content)) + content


def schema(number=1, name="a/msg/B", definition=VALUE, encoding="ros2msg"):
    return record(3, struct.pack("<H", number) + text(name) + text(encoding) + text(definition))


def channel(number=1, topic="/x", of=1, encoding="cdr", metadata=b""):
    return record(4, struct.pack("<HH", number, of) + text(topic) + text(encoding) + text(metadata))


def message(data=b"\0\1\0\0" + bytes(8), number=1, ns=1, published=None):
    return record(5, struct.pack("<HIQQ", number, 0, ns, ns if published is None else published) + data)


def chunk(content, compression="", size=None, packed=None, first=1, last=1, crc=None):
    pack = {"zstd": zstandard.compress, "lz4": lz4.frame.compress}.get(compression, bytes)
    packed = pack(content) if packed is None else packed
    head = struct.pack("<QQQI", first, last, len(content) if size is None else size, zlib.crc32(content) if crc is None else crc)
    return record(6, head + text(compression) + struct.pack("<Q", len(packed)) + packed)


def file(*data, library="crafted", summary=b"", end=True):
    body = MAGIC + record(1, text("ros2") + text(library)) + b"".join(data)
    if not end:
        return body
    body += record(15, bytes(4))
    return body + summary + record(2, struct.pack("<QQI", len(body) if summary else 0, 0, 0)) + MAGIC


def one(definition=VALUE, data=b"\0\1\0\0" + bytes(8), name="a/msg/B", **options):
    """Returns a bag of one message."""
    return file(chunk(schema(name=name, definition=definition) + channel(**options) + message(data)))


def zstd_of(size):
    """Returns ``size`` zero bytes in compressed form; they are never in memory uncompressed."""
    packer = zstandard.ZstdCompressor().compressobj()
    return b"".join(packer.compress(bytes(MIB)) for _ in range(size // MIB)) + packer.flush()


def lz4_of(size):
    packer = lz4.frame.LZ4FrameCompressor()
    return packer.begin() + b"".join(packer.compress(bytes(MIB)) for _ in range(size // MIB)) + packer.flush()


def section(name, lines):
    return f"{SEPARATOR}MSG: {name}\n{lines}"


def info(json_text):
    """Returns a description of a run."""
    data = b"\0\1\0\0" + bytes(16) + text(json_text.encode() + b"\0")
    definition = "builtin_interfaces/Time stamp\nuint64 seq\nstring json\n" + section(
        "builtin_interfaces/Time", "int32 sec\nuint32 nanosec\n"
    )
    return one(definition, data, "rig_msgs/msg/RunInfo", topic="/rig/run_info")


def listed(count, definition="a/E[] x\n" + section("a/E", "int8 y\n")):
    """Returns a message that states so many messages."""
    return one(definition, b"\0\1\0\0" + struct.pack("<I", count) + bytes(count))


DOUBLING = "".join(section(f"a/T{n}", f"T{n + 1} f\nT{n + 1} g\n") for n in range(30)) + section("a/T30", "int8 x\n")
NESTED = "".join(section(f"a/T{n}", f"T{n + 1} f\n") for n in range(300)) + section("a/T300", "int8 x\n")
HEAD = schema() + channel()
MANY = [schema(), *(channel(number, f"/t{number}") for number in range(1, 10_102)), message()]

# fault -> (bytes of the bag, words of the sentence with which it is refused when it is opened or read)
BAGS = {
    "a chunk of zstd that says 16 GB": lambda: (
        file(chunk(b"", "zstd", 1 << 34, zstd_of(MIB))),
        "larger than the 268435456 that are read at byte",
    ),
    "a chunk of zstd that says 2^64 - 1": lambda: (file(chunk(b"", "zstd", 2**64 - 1, zstd_of(MIB))), "larger than the 268435456"),
    "a chunk of zstd that is 300 MB and says 1 MB": lambda: (
        file(chunk(b"", "zstd", MIB, zstd_of(300 * MIB))),
        "a chunk cannot be decompressed at byte",
    ),
    "a chunk of lz4 that is 300 MB and says so": lambda: (
        file(chunk(b"", "lz4", 300 * MIB, lz4_of(300 * MIB))),
        "larger than the 268435456",
    ),
    "a chunk of lz4 that is 300 MB and says 1 MB": lambda: (
        file(chunk(b"", "lz4", MIB, lz4_of(300 * MIB))),
        "holds more than 1048576 bytes where its head says 1048576",
    ),
    "a chunk of lz4 that says more than it is": lambda: (
        file(chunk(b"", "lz4", 4 * MIB, lz4_of(MIB))),
        "holds 1048576 bytes where its head says 4194304",
    ),
    "an unpacked chunk that says more than it is": lambda: (
        file(chunk(HEAD + message(), size=1 << 33)),
        "larger than the 268435456",
    ),
    "an unpacked chunk that says less than it is": lambda: (file(chunk(HEAD + message(), size=5)), "where its head says 5"),
    "forty chunks of 60 MB of zeros": lambda: (
        file(*[chunk(b"", "zstd", 60 * MIB, zstd_of(60 * MIB), crc=0)] * 40),
        "a record of kind 0",
    ),
    "twenty chunks of 60 MB of empty messages": lambda: (
        file(chunk(HEAD), *[chunk(message(b"") * 1_900_000, "zstd")] * 20),
        "more than 200 for each byte of the file",
    ),
    "forty messages that unpack to 60 MB each": lambda: (
        file(chunk(HEAD + message(zstandard.compress(bytes(60 * MIB))) * 40)),
        "more than 200 for each byte of the file",
    ),
    "an unknown compression": lambda: (file(chunk(HEAD, "xz")), "compressed as 'xz', expected zstd, lz4 or nothing"),
    "a wrong checksum": lambda: (file(chunk(HEAD + message(), crc=1)), "does not match its checksum"),
    "a chunk in a chunk": lambda: (file(chunk(chunk(HEAD))), "a record of kind 6 is among the messages"),
    "a record longer than its chunk": lambda: (
        file(chunk(HEAD + struct.pack("<BQ", 5, 1 << 40))),
        "a record runs past the end of its chunk",
    ),
    "a record longer than the file": lambda: (file(struct.pack("<BQ", 9, 1 << 62)), "is cut or its length is garbled"),
    "a channel that names no definition": lambda: (file(chunk(channel())), "names a message definition that is not there"),
    "a message of no channel": lambda: (file(chunk(schema() + message())), "channel 1, which is not described"),
    "a channel that becomes another topic": lambda: (
        file(chunk(HEAD + message()), chunk(channel(topic="/y") + message(ns=2), last=2)),
        "channel 1 is given twice, as /x of a/msg/B and as /y of a/msg/B, at byte",
    ),
    "a channel that becomes another type": lambda: (
        file(chunk(HEAD + message()), chunk(schema(2, "a/msg/C") + channel(of=2) + message(ns=2), last=2)),
        "channel 1 is given twice, as /x of a/msg/B and as /x of a/msg/C",
    ),
    "a definition that becomes another": lambda: (
        file(chunk(HEAD + message()), chunk(schema(definition="int8 a\n") + message(ns=2), last=2)),
        "definition 1 is given twice",
    ),
    "more topics than there can be": lambda: (file(*MANY), "more than 10000 topics"),
    "a definition of 2 MB": lambda: (one("# \n" * (2 * MIB // 3)), "larger than the 1048576 that are read"),
    "forty definitions of 1 MB each": lambda: (
        file(chunk(b"".join(schema(n, definition="#" * (MIB - 100)) for n in range(1, 41)), "zstd")),
        "more message definitions than",
    ),
    "a channel of 2 MB": lambda: (one(topic="/" + "x" * 2 * MIB), "a channel described by"),
    "a topic that is no text": lambda: (one(topic=b"/\xff\xfe"), "a record is garbled"),
    "metadata longer than its channel": lambda: (
        file(chunk(schema() + record(4, struct.pack("<HH", 1, 1) + text("/x") + text("cdr") + b"\xff\xff\xff\x7f"))),
        "the metadata of the channel of /x are garbled",
    ),
    "a log time after 2038": lambda: (file(chunk(HEAD + message(ns=2**63 - 1))), "has the log time 9223372036854775807 ns"),
    "a negative log time": lambda: (file(chunk(HEAD + message(ns=2**64 - 5))), "has the log time 18446744073709551611 ns"),
    "a summary that counts too many": lambda: (
        file(chunk(HEAD + message()), summary=record(11, struct.pack("<Q", 7) + bytes(38))),
        "the summary counts 7 messages",
    ),
    "a definition that contains itself": lambda: (one("a/B other\n"), "or a/msg/B contains itself"),
    "two definitions that contain each other": lambda: (
        one("a/C x\n" + section("a/C", "a/B y\n")),
        "goes deeper than 32 messages within each other",
    ),
    "a definition 300 deep": lambda: (one("T0 x\n" + NESTED), "goes deeper than 32 messages"),
    "a definition that doubles 30 times": lambda: (one("T0 x\n" + DOUBLING), "more than 2000 fields"),
    "an array of a billion texts": lambda: (one("string[1000000000] x\n"), "more than 2000 fields"),
    "an array of a billion numbers": lambda: (one("float64[1000000000] x\n"), "or 268435456 bytes, which is more than is read"),
    "arrays of arrays of messages": lambda: (
        one("a/C[1000] x\n" + section("a/C", "a/D[1000] x\n") + section("a/D", "float64[1000] x\n")),
        "more than 2000 fields",
    ),
    "a definition of 250 000 empty lines": lambda: (one("\n" * 250_000 + "a b c d\n"), "cannot be read"),
    "a definition of 50 000 fields": lambda: (one("".join(f"int8 f{n}\n" for n in range(50_000))), "has 50000 lines"),
    "a definition that is no text of a message": lambda: (one("class A: pass\n"), "cannot be read"),
    "a definition without its parts": lambda: (one("b/C x\n"), "cannot be read"),
    "a type that is no name": lambda: (one(name="a\x1b[31m/msg/B; import os"), "is not a message type"),
    "another encoding": lambda: (one(encoding="json"), "is encoded as json/ros2msg, expected cdr/ros2msg"),
    "four billion numbers": lambda: (one("float64[] x\n", b"\0\1\0\0" + b"\xff" * 4), "cannot be decoded"),
    "four billion texts": lambda: (one("string[] x\n", b"\0\1\0\0" + b"\xff" * 4), "cannot be decoded"),
    "four billion messages": lambda: (
        one("a/E[] x\n" + section("a/E", "int8[0] y\n"), b"\0\1\0\0" + b"\xff" * 4),
        "cannot be decoded",
    ),
    "thirty million messages in one": lambda: (listed(30 * MIB), "more than the 1048576 that are decoded"),
    "a text that is cut": lambda: (one("string x\n", b"\0\1\0\0" + struct.pack("<I", 100) + b"abc"), "cannot be decoded"),
    "a message of no bytes": lambda: (one(data=b""), "cannot be decoded"),
    "JSON 100 000 deep": lambda: (info("[" * 100_000 + "]" * 100_000), "nested deeper than the 32 levels"),
    "JSON 500 deep": lambda: (info('{"a":' * 500 + "1" + "}" * 500), "nested deeper than the 32 levels"),
    "JSON of 20 MB": lambda: (info('{"a": "' + "x" * 20 * MIB + '"}'), "characters of JSON, more than the 8388608"),
    "JSON that is a list": lambda: (info("[1, 2]"), "is no description of a run"),
    "JSON with a configuration that is a number": lambda: (info('{"configuration": 7}'), "is no description of a run"),
    "JSON with a number of 10 000 digits": lambda: (info('{"a": ' + "9" * 10_000 + "}"), "is not JSON"),
    "no JSON": lambda: (info("{"), "is not JSON"),
}


def read_all(path):
    """Makes every request to a bag that a program can make."""
    from rig_nodes.bags.reader import Bag

    bag = Bag(path)
    bag.run_info(), bag.events(), bag.gaps(), bag.check()
    for topic in bag.types:
        list(bag.messages(topic))
    bag.canonical_hash()


def index_all(path):
    """Reads a bag as the replay does, without publishing."""
    from rig_nodes.bags.metadata import offered_by
    from rig_nodes.bags.opened import OpenedBags
    from rig_nodes.base.errors import RigError

    with OpenedBags([path]) as bag:
        for topic in bag.types:
            offered_by(bag.channel(topic)[2].get("offered_qos_profiles", ""))
        for _ in bag.timeline(list(bag.types)):
            pass
        if bag.damage:
            raise RigError(bag.damage[0])  # as the command reports it


def command(verb, *options):
    def call(path):
        from rig_nodes.base.errors import RigError
        from rig_nodes.cli.main import main

        output = io.StringIO()
        with contextlib.redirect_stderr(output), contextlib.redirect_stdout(output):
            code = main([verb, str(path), *options])
        if code:
            raise RigError(output.getvalue().strip().splitlines()[-1] if code == 2 else f"exit {code}")

    return call


READERS = {"Bag": read_all, "replay": index_all, "report": command("report"), "view": command("view", "--no-open")}


def memory_mb(line_name):
    """Returns a line of the process's memory: VmRSS is the present one, VmHWM the highest since the last reset [MB]."""
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith(line_name):
            return int(line.split()[1]) / 1024
    raise AssertionError(f"the kernel tells no {line_name}")


def try_out(folder):
    """Tries every reader on every file of a folder."""
    from rig_nodes.base.errors import RigError
    from rig_nodes.cli import report, view  # noqa: F401
    from rig_nodes.rig.configuration import load_rig
    from rig_nodes.view import convert, viewer  # noqa: F401

    load_rig("hydmag")  # loaded here, so that its modules and compiled code do not count as memory of a bag
    # the limit stops a reader that takes far too much memory before it affects the machine
    resource.setrlimit(resource.RLIMIT_DATA, (2 << 30, 2 << 30))
    for path in sorted(Path(folder).glob("*/bag.mcap"), key=lambda path: int(path.parent.name)):
        tried = {}
        for name, reader in READERS.items():
            Path("/proc/self/clear_refs").write_text("5")  # the peak starts from here
            before = memory_mb("VmRSS")
            began, text = time.process_time(), ""
            try:
                reader(path)
            except RigError as error:
                text = str(error)
            except Exception as error:
                text = f"TRACEBACK {type(error).__name__}: {error}"[:300]
            tried[name] = {"text": text, "s": time.process_time() - began, "mb": memory_mb("VmHWM") - before}
        print(json.dumps(tried), flush=True)


if __name__ == "__main__":
    try_out(sys.argv[1])
