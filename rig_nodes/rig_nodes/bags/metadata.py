# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""A bag's data about its topics: quality of service, and the metadata.yaml that rosbag2 of Jazzy reads.

The writer produces it, without anything that depends on the host or the wall clock; the replay reads the profiles.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from io import StringIO
from textwrap import indent

from ..rig import QOS, Offer
from . import limits

VERSION = 9
# text that YAML takes without quotes for a text, also YAML 1.1
_PLAIN = re.compile(r"(?!(?i:y|n|yes|no|on|off|true|false|null)\Z)[A-Za-z/][\w/]*")
_INDENT = " " * 4  # of what belongs to a topic
_TOPICS = "TOPICS"  # placeholder until the list of topics is filled in
FOREVER = {"sec": 9223372036, "nsec": 854775807}
OFFERED = "offered_qos_profiles"  # key of a channel's metadata
NOT_OFFERED = "[]\n"  # profiles of a topic of which none were recorded
# names of the policies' values by their numbers in versions before 9
_WORDS = {
    "history": ("system_default", "keep_last", "keep_all", "unknown"),
    "reliability": ("system_default", "reliable", "best_effort", "unknown", "best_available"),
    "durability": ("system_default", "transient_local", "volatile", "unknown", "best_available"),
    "liveliness": ("system_default", "automatic", "manual_by_node", "manual_by_topic", "unknown", "best_available"),
}


def _profile(offer: Offer) -> dict:
    deadline = {"sec": 0, "nsec": offer.deadline_ms * 1_000_000} if offer.deadline_ms else FOREVER
    return {
        "history": "keep_last",
        "depth": offer.depth,
        "reliability": "reliable" if offer.reliable else "best_effort",
        "durability": "transient_local" if offer.latched else "volatile",
        "deadline": deadline,
        "lifespan": FOREVER,
        "liveliness": "automatic",
        "liveliness_lease_duration": FOREVER,
        "avoid_ros_namespace_conventions": False,
    }


# Class of the signal catalogue -> offered profile in rosbag2's form.
PROFILES = {qos: _profile(offer) for qos, offer in QOS.items()}


@dataclass(frozen=True)
class Offered:
    """How a topic was offered when it was recorded.

    ``deadline_ns`` is 0 without a deadline; ``problem`` says what of the recorded text could not be read.
    """

    reliable: bool = True
    latched: bool = False
    deadline_ns: int = 0
    problem: str = ""


def offered_by(text: str) -> Offered:
    """Read the quality of service that rosbag2 stores in a channel, in the form of any version.

    Since Jazzy the values are words, before they were numbers. Of several publishers the strictest profile counts, so that every
    subscriber that received one of them also receives the replay. What is missing or cannot be read is reliable and not latched.

    Parameters
    ----------
    text : str
        The profiles as rosbag2 stores them.

    Returns
    -------
    Offered
        The profile to offer.
    """
    profiles, problem = _recorded(text)
    deadlines = [profile["deadline"] for profile in profiles]
    finite = [d["sec"] * 1_000_000_000 + d["nsec"] for d in deadlines if d["sec"] < FOREVER["sec"] and d["nsec"] < 1_000_000_000]
    return Offered(
        reliable=not profiles or any(profile["reliability"] != "best_effort" for profile in profiles),
        latched=any(profile["durability"] == "transient_local" for profile in profiles),
        deadline_ns=min((d for d in finite if d > 0), default=0),
        problem=problem,
    )


@lru_cache(maxsize=256)
def profiles_of_today(text: str) -> str:
    """Return recorded profiles of any version as rosbag2 of Jazzy stores them; what is missing or cannot be read is the default."""
    profiles, _ = _recorded(text)
    written = _yaml(profiles)
    return written if len(written) <= limits.PROFILES else _yaml(profiles[:1])  # a copy must be read too


def _recorded(text: str) -> tuple[list[dict], str]:
    """Return recorded profiles in the form of PROFILES, and what of their text could not be read."""
    if len(text) > limits.PROFILES:
        return [PROFILES["measurement"]], f"it has {len(text)} characters, more than the {limits.PROFILES} that are read"
    from ruamel.yaml import YAML
    from ruamel.yaml.error import YAMLError

    if "\n" not in text:
        text = text.replace("\\n", "\n")  # programs that write it through Python often leave the ends of lines escaped
    try:
        given = YAML(typ="safe", pure=True).load(text) or []
        lacking = {key for profile in given for key in ("reliability", "durability") if key not in profile}
        return [_in_words(profile) for profile in given], f"it gives no {' and no '.join(sorted(lacking))}" if lacking else ""
    except (YAMLError, AttributeError, LookupError, TypeError, ValueError, ArithmeticError, RecursionError) as error:
        problem = f"{type(error).__name__} {error}".strip().splitlines()[0]
        return [PROFILES["measurement"]], f"it is no list of profiles ({problem})"


def _in_words(profile: Mapping) -> dict:
    """Return a recorded profile with all its policies, in words."""
    found = {key: profile.get(key, default) for key, default in PROFILES["measurement"].items()}
    for key, words in _WORDS.items():
        found[key] = dict(enumerate(words)).get(found[key], found[key])
        if found[key] not in words:
            raise ValueError(f"{key} is {found[key]}")
    for key, default in PROFILES["measurement"].items():
        if default is FOREVER:
            sec, nsec = int(found[key]["sec"]), int(found[key]["nsec"])
            # no version of rosbag2 reads other times
            found[key] = {"sec": sec, "nsec": nsec} if 0 <= sec <= FOREVER["sec"] and 0 <= nsec < 1 << 32 else FOREVER
    if not 0 <= int(found["depth"]) < 1 << 63:
        raise ValueError(f"depth is {found['depth']}")
    return {
        **found,
        "depth": int(found["depth"]),
        "avoid_ros_namespace_conventions": bool(found["avoid_ros_namespace_conventions"]),
    }


@cache
def profile_text(qos: str) -> str:
    """Return the offered profile of a quality-of-service class as rosbag2 stores it in a channel."""
    return _yaml([PROFILES[qos]])


@dataclass(frozen=True)
class File:
    """A file of a bag: its name, first and last time of its messages [ns], and their number."""

    name: str
    start_ns: int
    end_ns: int
    count: int


def bag_metadata(files: Sequence[File], topics: list[dict], packed: bool = False, custom: Mapping[str, str] | None = None) -> str:
    """Return the ``rosbag2_bagfile_information`` of a bag, as YAML.

    Parameters
    ----------
    files : sequence of File
        The files in their order, at least one.
    topics : list of dict
        Dicts with ``name``, ``type``, ``offered`` (profiles as text), ``hash`` (RIHS01) and ``count``, in the order of the file.
    packed : bool
        True when the files are packed with zstd as a whole.
    custom : mapping of str to str, optional
        Further facts about the bag.

    Returns
    -------
    str
        The YAML text.
    """
    # a file without messages has no times
    held = [file for file in files if file.count] or list(files)
    start, end = min(file.start_ns for file in held), max(file.end_ns for file in held)
    information = _yaml(
        {
            "version": VERSION,
            "storage_identifier": "mcap",
            "duration": {"nanoseconds": end - start},
            "starting_time": {"nanoseconds_since_epoch": start},
            "message_count": sum(file.count for file in files),
            "topics_with_message_count": _TOPICS if topics else [],
            "compression_format": "zstd" if packed else "",
            "compression_mode": "FILE" if packed else "",
            "relative_file_paths": [file.name for file in files],
            "files": [
                {
                    "path": file.name,
                    "starting_time": {"nanoseconds_since_epoch": file.start_ns},
                    "duration": {"nanoseconds": file.end_ns - file.start_ns},
                    "message_count": file.count,
                }
                for file in files
            ],
            "custom_data": dict(custom) if custom else None,
            "ros_distro": "jazzy",
        }
    )
    return information.replace(f" {_TOPICS}\n", "\n" + "".join(_entry(topic) for topic in topics))


@cache
def _entry_form() -> str:
    """Return what the library writes for one topic, with the names of its fields in braces."""
    about = {
        "name": "{name}",
        "type": "{type}",
        "serialization_format": "cdr",
        OFFERED: "{offered}",
        "type_description_hash": "{hash}",
    }
    return _yaml([{"topic_metadata": about, "message_count": "{count}"}]).replace("'", "").replace(" {offered}\n", "{offered}")


def _entry(topic: dict) -> str:
    """Return one entry of topics_with_message_count; names of other programs may need quotes, those of ROS do not."""
    quoted = {
        key: json.dumps(value) if isinstance(value, str) and not _PLAIN.fullmatch(value) else value for key, value in topic.items()
    }
    # profiles are inserted as text, because the library is slow and many topics share a few of them
    offered = topic["offered"]
    quoted["offered"] = f" {offered}" if offered == NOT_OFFERED else "\n" + indent(offered, _INDENT)
    return _entry_form().format(**quoted)


def metadata_file(information: str) -> str:
    """Return the content of metadata.yaml, made from the text of :func:`bag_metadata`."""
    return "rosbag2_bagfile_information:\n" + "".join(f"  {line}\n" for line in information.splitlines())


def _yaml(data: object) -> str:
    from ruamel.yaml import YAML

    yaml = YAML(typ="safe", pure=True)
    yaml.default_flow_style = False
    yaml.width = 1000
    yaml.sort_base_mapping_type_on_output = False
    yaml.representer.ignore_aliases = lambda _: True
    stream = StringIO()
    yaml.dump(data, stream)
    return stream.getvalue()
