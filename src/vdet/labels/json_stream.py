"""JSON documents of any size, read value by value."""

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

import ijson

from vdet.errors import TruthError, printable

MAX_ENTRY = 16_000_000
"""Maximum number of bytes between two values of a JSON document."""

_CHUNK = 65_536  # bytes; a string that continues in the next chunk is read again from its start
_MAX_DEPTH = 1000
_STARTS: dict[str, Callable[[], Any]] = {"start_map": dict, "start_array": list}
_ENDS = ("end_map", "end_array")


def json_values(path: Path, file: IO[bytes], *places: str) -> Iterator[tuple[str, Any]]:
    """Yield the values at some places of a JSON document, each with its place.

    Places are those of ijson: `info.year` is one value, `images.item` is every entry of a list.
    Only a few values are in memory at a time.

    Raises
    ------
    TruthError
        It is not JSON, is nested too deeply, or has more than `MAX_ENTRY` bytes without such a
        value.
    """
    events, finder, size = ijson.sendable_list(), _Finder(places), 0
    parser = ijson.basic_parse_coro(events, use_float=True)
    while chunk := file.read(_CHUNK):
        size += len(chunk)
        if size > MAX_ENTRY:
            raise TruthError(f"{path}: has an entry of more than {MAX_ENTRY:,} bytes")
        with _json_errors(path):
            parser.send(chunk)
            values = list(finder.values(events))
        events.clear()
        size = 0 if values else size
        yield from values
    with _json_errors(path):
        parser.close()


class _Finder:
    """Builds the values at some places of a JSON document from parser events."""

    def __init__(self, places: Iterable[str]) -> None:
        self._places = {tuple(place.split(".")): place for place in places}
        self._deepest = max(map(len, self._places))
        self._keys: list[str] = []  # the last key of each open map, "item" for each open list
        self._parts: list[Any] = []  # the open maps and lists of the current value

    def values(self, events: Iterable[tuple[str, Any]]) -> Iterator[tuple[str, Any]]:
        """Yield each value that further events complete, with its place.

        Raises `ValueError` if the document is nested too deeply.
        """
        keys, parts = self._keys, self._parts
        for event, value in events:
            if event == "map_key":
                keys[-1] = value
            elif event in _STARTS:
                self._open(event)
            elif event in _ENDS:
                keys.pop()
                part = parts.pop() if parts else None
                if part is not None and not parts:
                    yield self._places[(*keys,)], part
            elif parts:
                self._add(value)
            elif self._is_wanted():
                yield self._places[(*keys,)], value

    def _is_wanted(self) -> bool:
        return len(self._keys) <= self._deepest and (*self._keys,) in self._places

    def _open(self, event: str) -> None:
        value = _STARTS[event]()
        if self._parts:
            self._add(value)
        if self._parts or self._is_wanted():
            self._parts.append(value)
        self._keys.append("item" if event == "start_array" else "")
        if len(self._keys) > _MAX_DEPTH:
            raise ValueError("nested too deeply")

    def _add(self, value: Any) -> None:
        parent = self._parts[-1]
        if isinstance(parent, list):
            parent.append(value)
        else:
            parent[self._keys[-1]] = value


@contextmanager
def _json_errors(path: Path) -> Iterator[None]:
    try:
        yield
    except (ijson.JSONError, ValueError) as error:
        what = printable(str(error).partition("\n")[0].strip())
        raise TruthError(f"{path}: is not JSON: {what}") from error
