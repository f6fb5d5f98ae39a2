"""Messages of a topic as protobuf's own library encodes them."""

from __future__ import annotations

import numpy as np
import pytest
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory

from rigtwin.recording.schema import decode_rows, descriptor, encode, encode_rows, type_name

COUNTS = (1, 15, 16, 31, 32, 200, 5000)


def encode_by_protobuf(values: np.ndarray) -> bytes:
    """One message of fields f1, f2, …, by the library and our schema."""
    names = [f"f{number}" for number in range(1, len(values) + 1)]
    files = descriptor_pb2.FileDescriptorSet.FromString(descriptor("/bench", names))
    pool = descriptor_pool.DescriptorPool()
    for file in files.file:
        pool.Add(file)
    kind = message_factory.GetMessageClass(pool.FindMessageTypeByName(type_name("/bench")))
    return kind(**dict(zip(names, values.tolist(), strict=True))).SerializeToString()


@pytest.mark.parametrize("count", COUNTS)
def test_messages_are_those_of_protobuf(count: int) -> None:
    values = np.random.default_rng(count).standard_normal(count)
    assert encode(values) == encode_by_protobuf(values)


@pytest.mark.parametrize("count", COUNTS)
def test_what_is_encoded_is_decoded(count: int) -> None:
    values = np.random.default_rng(count).standard_normal((3, count))
    decoded = decode_rows(encode_rows(values).tobytes(), 3, count)
    assert decoded is not None
    assert np.array_equal(decoded, values)


@pytest.mark.parametrize("count", [16, 31, 32, 200])
def test_files_with_tags_of_one_byte_can_still_be_read(count: int) -> None:
    """As earlier releases wrote them."""
    values = np.random.default_rng(count).standard_normal((3, count))
    fields = np.empty((3, count), np.dtype([("tag", "u1"), ("value", "<f8")]))
    fields["tag"], fields["value"] = ((np.arange(1, count + 1) << 3) | 1) & 0xFF, values
    decoded = decode_rows(fields.tobytes(), 3, count)
    assert decoded is not None
    assert np.array_equal(decoded, values)


def test_another_encoding_is_left_to_the_library() -> None:
    row = encode_rows(np.ones((1, 3))).tobytes()
    assert decode_rows(row[9:] + row[:9], 1, 3) is None
    assert decode_rows(row[:-1], 1, 3) is None
