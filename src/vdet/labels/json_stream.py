"""Large JSON documents, read piece by piece, so that a file need not be held in memory.

`ijson` reads such lists too, but takes twice as long for several lists of one file, and has no
limit for an entry.
"""

import codecs
import itertools
import json
import re
from collections.abc import Callable, Iterator, Mapping
from typing import Any

from pydantic import TypeAdapter

from vdet.labels.parsing import first_mistake

MAX_ENTRY = 16_000_000
"""Largest size of an entry of a list, in characters."""

_MAX_KEYS = 1000
_CHUNK = 1_000_000  # bytes
_NO_SPACE = re.compile(r"[^ \t\n\r]")
_ENDS = " \t\n\r,:]}"  # what may follow a value
_DECODER = json.JSONDecoder()


class JsonLists:
    """The lists in the JSON object that a binary file holds; they are read once.

    Parameters
    ----------
    read
        The `read` of the file.
    kinds
        What the entries of a list are, by its name, which is "data.detections" for a list in the
        object "data". An object of such a name is one entry.

    Attributes
    ----------
    found
        The names of the lists that were found.
    """

    def __init__(self, read: Callable[[int], bytes], kinds: Mapping[str, TypeAdapter[Any]]) -> None:
        self.found: set[str] = set()
        self._read, self._kinds = read, kinds
        self._parents = {name.rpartition(".")[0] for name in kinds} - {""}
        self._decode = codecs.getincrementaldecoder("utf-8-sig")().decode
        self._text, self._at, self._ended = "", 0, False

    def __iter__(self) -> Iterator[tuple[str, int, Any]]:
        """Yield the name of the list, the number and the value of each entry.

        Raises
        ------
        ValueError
            The file is not UTF-8 or not a JSON object, an object on the way to the lists has too
            many keys, an entry is larger than `MAX_ENTRY`, or it is not of its kind.
        """
        yield from self._object("")
        if self._next():
            raise ValueError("invalid JSON: more text follows the object")

    def _object(self, parent: str) -> Iterator[tuple[str, int, Any]]:
        for count in self._items("{", "}"):
            if count == _MAX_KEYS:
                raise ValueError(f"an object has more than {_MAX_KEYS:,} keys")
            name = parent + str(json.loads(self._value()))
            self._take(":")
            match self._next():
                case "{" if name in self._parents:
                    yield from self._object(f"{name}.")
                case "[" if name in self._kinds:
                    self.found.add(name)
                    for number in self._items("[", "]"):
                        yield name, number, self._entry(name, f"{name}.{number}")
                case "{" if name in self._kinds:
                    yield name, 0, self._entry(name, name)
                case _:
                    self._value()

    def _items(self, begin: str, end: str) -> Iterator[int]:
        """Yield the number of each item of a list or an object; the caller reads the item."""
        self._take(begin)
        if self._next() == end:
            self._take(end)
            return
        for number in itertools.count():
            yield number
            if self._take(f",{end}") == end:
                return

    def _entry(self, name: str, place: str) -> Any:
        try:
            return self._kinds[name].validate_json(self._value(), strict=True)
        except ValueError as error:  # also a ValidationError
            raise ValueError(f"{place}: {first_mistake(error)}") from error

    def _next(self) -> str:
        """Go to the next character that is no space and return it; "" at the end."""
        while not (found := _NO_SPACE.search(self._text, self._at)):
            self._at = len(self._text)
            if self._ended:
                return ""
            self._read_on()
        self._at = found.start()
        return found[0]

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
        part = self._read(max(_CHUNK, len(self._text) - self._at))
        self._text = self._text[self._at :] + self._decode(part, not part)
        self._at, self._ended = 0, not part
