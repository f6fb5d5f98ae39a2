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
from rigtwin.recording.reader import FileContent, Recording
from rigtwin.recording.records import DAMAGE, Lost, take_apart

_PREFIX = struct.Struct("<BQ")
"""Opcode and length of a record."""
READ = 2**18
"""Number of bytes read from a file at a time."""


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
        self._read, self._rest, self._begun = 0, b"", False
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
                while self.latest < until:
                    if self._take_one():
                        continue
                    added = file.read(READ)
                    if not added:
                        break
                    self._read += len(added)
                    self._rest += added
        except OSError as error:
            raise RigtwinError(f"cannot read {self.path}: {error.strerror}") from None
        self._content.forget(self.latest - self._window)
        self.ended = self._content.ended
        return self.latest > before

    def recording(self) -> Recording:
        """Return the window. Raise RigtwinError if there is no recording or no tick yet."""
        return self._content.build(self.path)

    def _take_one(self) -> bool:
        """Process the next record if it is complete. Return whether it was."""
        # A file may be caught before its magic bytes are complete.
        if not self._begun:
            if not self._rest.startswith(MCAP0_MAGIC[: len(self._rest)]):
                raise RigtwinError(f"{self.path} is not an MCAP file")
            if len(self._rest) < len(MCAP0_MAGIC):
                return False
            self._begun, self._rest = True, self._rest[len(MCAP0_MAGIC) :]
        if len(self._rest) < _PREFIX.size or self._rest.startswith(MCAP0_MAGIC):
            # The magic bytes come again at the end of a complete file; nothing follows them.
            return False
        end = _PREFIX.size + _PREFIX.unpack_from(self._rest)[1]
        if end > len(self._rest):
            return False
        record, self._rest = self._rest[:end], self._rest[end:]
        self._add(record)
        return True

    def _add(self, record: bytes) -> None:
        """Add a record of the file, with the messages in it."""
        if record[0] in (Opcode.FOOTER, Opcode.DATA_END, Opcode.MESSAGE_INDEX):
            return
        reader = StreamReader(io.BytesIO(record), skip_magic=True, emit_chunks=True)
        try:
            whole = next(reader.records)
            parts = take_apart(whole) if isinstance(whole, Chunk) else [whole]
            for part in parts:
                self._content.add(part)
        except InvalidMagic:
            raise RigtwinError(f"{self.path} is not an MCAP file") from None
        # Damage in a growing file is noted like in a complete one, and reading goes on.
        except DAMAGE:
            self._content.add(Lost())
