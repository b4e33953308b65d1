# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A run's bag as `ros2 bag record` writes it: log times are dates, and the stamps in the messages are those of the run."""

from mcap.reader import make_reader
from mcap.writer import Writer

DATE = 1_790_000_000_000_000_000  # ns


def with_dates(folder, path):
    """Writes the bag of a run's folder, which has one file, anew; returns the new file."""
    (source,) = folder.glob("*.mcap")
    channels = {}
    with open(source, "rb") as file, open(path, "wb") as made:
        writer = Writer(made)
        writer.start(profile="ros2", library="libmcap 1.3.1")
        for schema, channel, message in make_reader(file).iter_messages():
            if channel.topic not in channels:
                known = writer.register_schema(schema.name, schema.encoding, schema.data)
                channels[channel.topic] = writer.register_channel(channel.topic, channel.message_encoding, known, channel.metadata)
            time = DATE + message.log_time
            writer.add_message(channels[channel.topic], time, message.data, time)
        writer.finish()
    return path
