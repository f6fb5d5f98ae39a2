"""Reader of a recording that another program is still writing."""

from __future__ import annotations

import io
import struct
from pathlib import Path

from mcap.exceptions import InvalidMagic
from mcap.opcode import Opcode
from mcap.records import Chunk
from mcap.stream_reader import StreamReader
from mcap.writer import MCAP0_MAGIC

from rigtwin.errors import RigtwinError
from rigtwin.recording.reader import FileContent
from rigtwin.recording.recorded_test import RecordedTest
from rigtwin.recording.records import (
    CHUNK_HEAD,
    DAMAGE,
    PRIVATE,
    Lost,
    find_chunk,
    is_opcode,
    length_of,
    take_apart,
)

_PREFIX = struct.Struct("<BQ")
"""Opcode and length of a record."""
READ = 2**18
"""Bytes that are read of a file at a time."""
LONGEST = 2**26
"""Bytes that a record may have; a longer one is damage."""


class GrowingRecording:
    """The last seconds of a file that grows, or of a complete one.

    Attributes
    ----------
    path
        Path of the file.
    ended
        Whether the file says that its test is over.
    """

    def __init__(self, path: Path, window: float) -> None:
        """Prepare to read a file, keeping a window of its last seconds."""
        self.path = path
        self._window = window
        self._content = FileContent()
        self._read, self._begun, self._over = 0, False, False
        self._buffer, self._at = bytearray(), 0
        self._lost, self._searched = False, 0
        self.ended = False

    @property
    def latest(self) -> float:
        """Time of the last tick read, in s."""
        return self._content.latest

    def read(self, until: float = float("inf")) -> bool:
        """Read what was added to the file since the last call.

        Parameters
        ----------
        until
            Time in s at which reading pauses, at once or a little later. The next calls continue.

        Returns
        -------
        bool
            Whether there were new ticks.

        Raises
        ------
        RigtwinError
            If the file cannot be read, is no recording, or was replaced by a shorter one.
        """
        before = self.latest
        try:
            with self.path.open("rb") as file:
                # A file that shrinks was replaced: what was read so far belongs to another test.
                if file.seek(0, io.SEEK_END) < self._read:
                    raise RigtwinError(f"{self.path} was replaced while it was read")
                file.seek(self._read)
                while self.latest < until and not self._over:
                    if self._take_one():
                        continue
                    added = file.read(READ)
                    if not added and not self._skip_damage():
                        break
                    self._read += len(added)
                    self._append(added)
        except OSError as error:
            raise RigtwinError(f"cannot read {self.path}: {error.strerror}") from None
        self._content.forget(self.latest - self._window)
        self.ended = self._content.ended
        return self.latest > before

    def recording(self) -> RecordedTest:
        """Return the window. Raise RigtwinError if there is no recording or no tick yet."""
        return self._content.build(self.path)

    def _append(self, added: bytes) -> None:
        """Adds bytes of the file to those that wait, without what was taken."""
        del self._buffer[: self._at]
        self._searched = max(self._searched - self._at, 0)
        self._at = 0
        self._buffer += added

    def _take_one(self) -> bool:
        """Takes the next record, if all of it was read."""
        waiting = len(self._buffer) - self._at
        if not self._begun:
            # A file that has just been created may hold only part of the magic bytes.
            if not MCAP0_MAGIC.startswith(self._buffer[: len(MCAP0_MAGIC)]):
                raise RigtwinError(f"{self.path} is not an MCAP file")
            if waiting < len(MCAP0_MAGIC):
                return False
            self._begun, self._at = True, len(MCAP0_MAGIC)
            return True
        if self._lost:
            return self._find_chunk()
        # The magic bytes appear a second time only at the end of a complete file.
        if self._buffer.startswith(MCAP0_MAGIC, self._at):
            self._over = True
            return False
        if waiting < _PREFIX.size:
            return False
        opcode, length = _PREFIX.unpack_from(self._buffer, self._at)
        # A corrupt length would otherwise make the reader wait for bytes that never come.
        if not is_opcode(opcode) or length > LONGEST:
            self._note_damage()
            return True
        end = self._at + _PREFIX.size + length
        if end > len(self._buffer):
            return False
        if self._add(bytes(memoryview(self._buffer)[self._at : end])):
            self._at = end
        else:
            # Its length may be what is damaged: the next chunk may lie within it.
            self._note_damage()
        return True

    def _note_damage(self) -> None:
        self._content.add(Lost())
        self._lost, self._searched = True, self._at + 1

    def _find_chunk(self) -> bool:
        """Goes on at the next chunk behind damage; False if it has not been read yet."""
        chunk = find_chunk(self._buffer, self._searched)
        if chunk is None:
            # A chunk's head may be cut by the end of what was read, so that many bytes are kept.
            self._at = self._searched = max(len(self._buffer) - CHUNK_HEAD, self._searched)
            return False
        self._lost, self._at = False, chunk
        return True

    def _skip_damage(self) -> bool:
        """At the end of the file: whether a record that seems to go on has a later chunk within it,
        so that its length is damaged; reading then goes on at that chunk."""
        if self._lost or not self._begun:
            return False
        chunk = find_chunk(self._buffer, max(self._searched, self._at + 1))
        self._searched = max(len(self._buffer) - CHUNK_HEAD, self._at)
        if chunk is None:
            return False
        self._content.add(Lost())
        self._at = chunk
        return True

    def _add(self, record: bytes) -> bool:
        """Takes a record; False if it is damaged."""
        # These say nothing about the content: a summary's place, a checksum, an index, or another
        # program's data.
        if record[0] >= PRIVATE or record[0] in (
            Opcode.FOOTER,
            Opcode.DATA_END,
            Opcode.MESSAGE_INDEX,
        ):
            return True
        reader = StreamReader(io.BytesIO(record), skip_magic=True, emit_chunks=True)
        try:
            whole = next(reader.records)
            # A chunk whose own lengths do not fill its record has one that is damaged.
            if isinstance(whole, Chunk) and length_of(whole) != len(record) - _PREFIX.size:
                return False
            parts = take_apart(whole) if isinstance(whole, Chunk) else [whole]
            for part in parts:
                self._content.add(part)
        except InvalidMagic:
            raise RigtwinError(f"{self.path} is not an MCAP file") from None
        # Damage in a growing file is noted like in a complete one, and reading goes on.
        except DAMAGE:
            return False
        return True
