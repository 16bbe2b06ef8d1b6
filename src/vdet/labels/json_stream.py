"""Large JSON documents, read piece by piece, so that a file need not be held in memory."""

import codecs
import itertools
import json
from collections.abc import Container, Iterator
from typing import BinaryIO

MAX_ENTRY = 16_000_000
"""Largest size of an entry of a list, in characters."""

_CHUNK = 1_000_000  # bytes
_SPACE = " \t\n\r"
_ENDS = _SPACE + ",:]}"  # what may follow a value


class JsonLists:
    """The lists in the JSON object that a binary file holds; they are read once.

    Attributes
    ----------
    place
        The entry that is being read, as "annotations.3"; "" outside the lists.
    found
        The names of the lists that were found.
    """

    def __init__(self, file: BinaryIO) -> None:
        self.place = ""
        self.found: set[str] = set()
        self._file = file
        self._decode = codecs.getincrementaldecoder("utf-8-sig")().decode
        self._text, self._at, self._ended = "", 0, False

    def entries(self, names: Container[str]) -> Iterator[tuple[str, int, str]]:
        """Yield the name of the list, the number and the text of each entry of the lists `names`.

        An object of such a name is one entry.

        Raises
        ------
        ValueError
            The file is not UTF-8 or not a JSON object, or an entry is larger than `MAX_ENTRY`.
        """
        self._take("{")
        while True:
            name = str(json.loads(self._value()))
            self._take(":")
            if name in names and self._next() == "[":
                self.found.add(name)
                yield from self._list(name)
            elif (text := self._value()).startswith("{") and name in names:
                yield name, 0, text
            if self._take(",}") == "}":
                break
        if self._next():
            raise ValueError("invalid JSON: more text follows the object")

    def _list(self, name: str) -> Iterator[tuple[str, int, str]]:
        self._take("[")
        if self._next() == "]":
            self._take("]")
            return
        for number in itertools.count():
            self.place = f"{name}.{number}"
            yield name, number, self._value()
            if self._take(",]") == "]":
                break
        self.place = ""

    def _next(self) -> str:
        """Go to the next character that is no space and return it; "" at the end."""
        while True:
            while self._at == len(self._text) and not self._ended:
                self._read_on()
            char = self._text[self._at : self._at + 1]
            if not char or char not in _SPACE:
                return char
            self._at += 1

    def _take(self, wanted: str) -> str:
        char = self._next()
        if not char or char not in wanted:
            raise ValueError(f"invalid JSON: expected {' or '.join(wanted)}")
        self._at += 1
        return char

    def _value(self) -> str:
        """Return the text of the next value."""
        self._next()
        while True:
            begin, end, mistake = self._at, len(self._text), "an entry is too large"
            try:
                _, end = _DECODER.raw_decode(self._text, begin)
            except json.JSONDecodeError as error:  # or the rest has not been read
                mistake = f"invalid JSON: {error.msg}"
            except RecursionError:
                raise ValueError("invalid JSON: nested too deeply") from None
            else:
                # A number may go on with a dot or an exponent that has not been read.
                follows = self._text[end : end + 1]
                if self._ended or (follows and follows in _ENDS):
                    self._at = end
                    return self._text[begin:end]
            if self._ended or end - begin > MAX_ENTRY:
                raise ValueError(mistake)
            self._read_on()

    def _read_on(self) -> None:
        # As much again as there is, so that a long entry is not decoded too often.
        part = self._file.read(max(_CHUNK, len(self._text) - self._at))
        self._text = self._text[self._at :] + self._decode(part, not part)
        self._at, self._ended = 0, not part


_DECODER = json.JSONDecoder()
