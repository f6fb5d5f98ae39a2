"""Protobuf message types of the topics, made from the channel table.

All fields are doubles, so every message of a topic has the same length and whole blocks are
encoded and decoded at once.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np
from google.protobuf import descriptor_pb2
from numpy.typing import NDArray

from rigtwin.errors import RigtwinError
from rigtwin.recording.channels import CHANNELS

WRITTEN_FORMAT = "1"
"""Format number in the metadata of the recordings that this version reads and writes."""
RECORD = "rigtwin"
"""Name of the metadata record that says what the test was."""
TWIN_RECORD = "rigtwin.twin"
"""Name of the metadata record that says how a twin made the recording."""
END_RECORD = "rigtwin.end"
"""Name of the metadata record that says why the test ended."""
TRANSITION_RECORD = "rigtwin.transition"
"""Name of the metadata records that say when and why a session went from one state to the next,
one for each."""
CARD_RECORD = "rigtwin.card"
"""Name of the metadata record that holds the channel table."""
LATENESS_RECORD = "rigtwin.lateness"
"""Name of the metadata record that says how late the ticks of a loop in real time were."""

NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
"""Of a field, as protobuf takes it."""
_DOUBLE_WIRE_TYPE = 1


def type_name(topic: str) -> str:
    """Full name of a topic's message type, e.g. `rigtwin.Command`."""
    return "rigtwin." + topic.strip("/").capitalize()


def check_names(topic: str, names: Sequence[str]) -> None:
    """Raises RigtwinError for names that the fields of a topic cannot have together: a recording
    with them could be written and not be read."""
    for name in names:
        if not NAME.fullmatch(name):
            raise RigtwinError(
                f"{topic}.{name}: expected a name of letters without accents, digits and _"
            )
    # Readers tell fields apart by their names in camel case too.
    seen: dict[str, str] = {}
    for name in names:
        same = re.sub(r"_(.?)", lambda found: found.group(1).upper(), name)
        if same in seen:
            raise RigtwinError(f"{topic} cannot have both {seen[same]} and {name}; rename one")
        seen[same] = name


def descriptor(topic: str, names: Sequence[str]) -> bytes:
    """Describes a topic's message type as an MCAP schema holds it.

    Parameters
    ----------
    topic : str
        Its name, with the slash.
    names : sequence of str
        Of the fields, all of them doubles.

    Returns
    -------
    bytes
        A serialized FileDescriptorSet.
    """
    file = descriptor_pb2.FileDescriptorProto(
        name=f"rigtwin/{topic.strip('/')}.proto", package="rigtwin", syntax="proto3"
    )
    message = file.message_type.add(name=type_name(topic).partition(".")[2])
    for number, name in enumerate(names, start=1):
        message.field.add(
            name=name,
            number=number,
            type=descriptor_pb2.FieldDescriptorProto.TYPE_DOUBLE,
            label=descriptor_pb2.FieldDescriptorProto.LABEL_OPTIONAL,
        )
    return descriptor_pb2.FileDescriptorSet(file=[file]).SerializeToString()


FIELD = np.dtype([("tag", "u1"), ("value", "<f8")])
"""An encoded field; a message is one of these for each channel of its topic."""


def tags(count: int) -> NDArray[np.uint8]:
    """Protobuf tags of fields 1 … count."""
    return ((np.arange(1, count + 1) << 3) | _DOUBLE_WIRE_TYPE).astype(np.uint8)


def list_topics() -> tuple[str, ...]:
    """Topics of the channel table, in order."""
    return tuple(dict.fromkeys(channel.topic for channel in CHANNELS))


def encode(values: NDArray[np.float64]) -> bytes:
    """One message of a topic, of its fields' values."""
    message = np.empty(len(values), FIELD)
    message["tag"], message["value"] = tags(len(values)), values
    return message.tobytes()
