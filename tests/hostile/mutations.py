"""Seeded damage to a good file, as of a broken download or an attacker."""

import random
import re
from collections.abc import Callable, Sequence

HEADER = 512
"""Bytes at the start of a file that get half of all damage: fields there have the most effect."""
WORST = 4
"""Most faults in one mutated file."""
_FIELDS = (0, 1, 0x7F, 0x80, 0xFF, 0x7FFF, 0xFFFF, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF)
_WORD = re.compile(r"[\w.+-]+")
_NUMBER = re.compile(r"[\d.+-]+")

_Fault = Callable[[bytearray, random.Random], None]


def mutated(
    data: bytes, *, seed: int, count: int, tokens: Sequence[bytes | str] = ()
) -> list[bytes]:
    """Return `count` damaged versions of `data`, the same ones for the same `seed`.

    Each has one to `WORST` faults: bits flipped, fields set to extreme numbers, blocks zeroed, cut
    out, doubled or moved, the end cut off. With `tokens`, the words and marks of a text format,
    half of the faults insert one of these at a random place, or overwrite what is there.
    """
    rng = random.Random(seed)
    words = [token.encode() if isinstance(token, str) else token for token in tokens]
    return [_mutate(data, words, rng) for _ in range(count)]


def with_other_words(text: str, words: Sequence[str], *, seed: int, count: int) -> list[bytes]:
    """Return `count` versions of `text` with the same structure, in which one or two words differ.

    The word is a number of `text`, sometimes a name. It is replaced by one of `words`, or by
    another word of `text`.
    """
    rng = random.Random(seed)
    return [_reword(text, words, rng).encode() for _ in range(count)]


def _reword(text: str, words: Sequence[str], rng: random.Random) -> str:
    for _ in range(rng.randint(1, 2)):
        places = list(_WORD.finditer(text))
        numbers = [place for place in places if _NUMBER.fullmatch(place.group())]
        old = rng.choice(numbers if numbers and rng.random() < 0.9 else places)
        other = rng.choice(places)
        new = rng.choice(words) if rng.random() < 0.8 else other.group()
        text = text[: old.start()] + new + text[old.end() :]
    return text


def _mutate(data: bytes, tokens: Sequence[bytes], rng: random.Random) -> bytes:
    damaged = bytearray(data)
    for _ in range(rng.randint(1, WORST)):
        if tokens and rng.random() < 0.5:
            _splice(damaged, rng.choice(tokens), rng)
        elif damaged:
            rng.choice(_FAULTS)(damaged, rng)
    return bytes(damaged)


def _place(data: bytearray, rng: random.Random) -> int:
    """Choose a byte; with probability 0.5 one of the first `HEADER`."""
    end = len(data) if rng.random() < 0.5 else min(len(data), HEADER)
    return rng.randrange(max(1, end))


def _block(data: bytearray, rng: random.Random) -> slice:
    """Choose a block; its length is log-uniform."""
    start = _place(data, rng)
    length = round(2 ** rng.uniform(0, max(1, len(data).bit_length() - 1)))
    return slice(start, min(len(data), start + max(1, length)))


def _splice(data: bytearray, token: bytes, rng: random.Random) -> None:
    start = _place(data, rng)
    over = len(token) if rng.random() < 0.5 else 0
    data[start : start + over] = token


def _flip_bits(data: bytearray, rng: random.Random) -> None:
    for _ in range(rng.choice((1, 1, 2, 8, 32))):
        data[_place(data, rng)] ^= 1 << rng.randrange(8)


def _set_field(data: bytearray, rng: random.Random) -> None:
    start, size = _place(data, rng), rng.choice((1, 2, 4, 8))
    value = rng.choice(_FIELDS) % (1 << 8 * size)
    field = value.to_bytes(size, rng.choice(("big", "little")))
    data[start : start + size] = field[: len(data) - start]


def _zero(data: bytearray, rng: random.Random) -> None:
    block = _block(data, rng)
    data[block] = bytes(block.stop - block.start)


def _cut_out(data: bytearray, rng: random.Random) -> None:
    del data[_block(data, rng)]


def _cut_off(data: bytearray, rng: random.Random) -> None:
    del data[_place(data, rng) :]


def _double(data: bytearray, rng: random.Random) -> None:
    block = _block(data, rng)
    data[block.stop : block.stop] = data[block]


def _move(data: bytearray, rng: random.Random) -> None:
    """Move a block to another place."""
    block = _block(data, rng)
    moved = data[block]
    del data[block]
    start = _place(data, rng)
    data[start:start] = moved


_FAULTS: tuple[_Fault, ...] = (
    _flip_bits, _flip_bits, _set_field, _set_field, _zero, _cut_out, _cut_off, _double, _move,
)  # fmt: skip
