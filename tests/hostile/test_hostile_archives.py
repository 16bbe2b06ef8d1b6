"""Damaged and wicked zip files of patches through `vdet train`."""

import io
import stat
import struct
import warnings
import zipfile
import zlib

import cv2
import numpy as np
import pytest

from hostile.mutations import mutated
from hostile.trials import Trial, try_files

SMALL = (*("--set", "detector.features={patch: 16, histogram: {bins: 8}}"), *("--jobs", "1"))
EACH = 12  # patches of each class
Members = list[tuple[zipfile.ZipInfo | str, bytes]]


def picture(red: int, number: int) -> bytes:
    noise = np.random.default_rng(number).integers(0, 99, (16, 16, 3), dtype=np.uint8)
    noise[..., 2] += np.uint8(red)
    return cv2.imencode(".png", noise)[1].tobytes()


def patches() -> Members:
    """Give the members of a data set that is whole."""
    return [
        (f"{kind}/{group}/{number}.png", picture(red, number))
        for kind, red in (("vehicles", 150), ("non-vehicles", 0))
        for number in range(EACH)
        for group in ["far" if number % 2 else "near"]
    ]


def zipped(members: Members, compression: int = zipfile.ZIP_DEFLATED) -> bytes:
    file = io.BytesIO()
    with (
        zipfile.ZipFile(file, "w", compression) as archive,
        warnings.catch_warnings(action="ignore"),  # a name that is there twice
    ):
        for name, data in members:
            archive.writestr(name, data)
    return file.getvalue()


def with_field(data: bytes, local: int, central: int, kind: str, value: int) -> bytes:
    """Set a field in the headers of all members."""
    changed = bytearray(data)
    for mark, offset in ((b"PK\x03\x04", local), (b"PK\x01\x02", central)):
        at = changed.find(mark)
        while at >= 0:
            struct.pack_into(kind, changed, at + offset, value)
            at = changed.find(mark, at + 4)
    return bytes(changed)


def huge_picture() -> bytes:
    png = picture(0, 0)
    header = b"IHDR" + struct.pack(">II", 100_000, 100_000) + png[24:29]
    return png[:12] + header + struct.pack(">I", zlib.crc32(header)) + png[33:]


def special(name: str, mode: int) -> zipfile.ZipInfo:
    info = zipfile.ZipInfo(name)
    info.external_attr = mode << 16
    return info


def many(name: str, data: bytes) -> Members:
    return [(f"vehicles/far/{name}{number}.png", data) for number in range(EACH - 1)]


BAD_NAMES = ("../vehicles/far/x.png", "/vehicles/far/x.png", "vehicles\\..\\x.png")
WICKED = {
    "a set in a set": "no images in vehicles/",
    "nothing": "no images in vehicles/",
    "one class": "no images in non-vehicles/",
}
WICKED |= dict.fromkeys(
    [
        *("/vehicles/far/x.png", "a symbolic link"),
        *("encrypted", "wrong checksums", "unknown compression"),
        *("other sizes than claimed", "bombs", "bombs that claim to be small"),
        *("pictures of 10¹⁰ pixels", "no pictures", "empty pictures"),
    ],
    ": is not a readable image",
)
"""What is rejected, and the words that say why. Nothing is unpacked to a file."""


def wicked_sets() -> dict[str, bytes]:
    whole = patches()
    packed, stored = zipped(whole), zipped(whole, zipfile.ZIP_STORED)
    bombs = zipped([*whole, *many("bomb", bytes(17_000_000))])
    link = special("vehicles/far/x.png", stat.S_IFLNK | 0o777)
    return {name: zipped([*whole, (name, b"")]) for name in BAD_NAMES} | {
        "a symbolic link": zipped([*whole, (link, b"/etc/passwd")]),
        "encrypted": with_field(packed, 6, 8, "<H", 1),
        "wrong checksums": with_field(stored, 14, 16, "<I", 7),
        "unknown compression": with_field(packed, 8, 10, "<H", 99),
        "other sizes than claimed": with_field(packed, 22, 24, "<I", 10),
        "bombs": bombs,
        "bombs that claim to be small": with_field(bombs, 22, 24, "<I", 100),
        "pictures of 10¹⁰ pixels": zipped([*whole, *many("huge", huge_picture())]),
        "no pictures": zipped([*whole, *many("text", b"text")]),
        "empty pictures": zipped([(name, b"") for name, _ in whole]),
        "a set in a set": zipped([("vehicles/set.zip", packed)]),
        "nothing": zipped([]),
        "one class": zipped(whole[:EACH]),
    }


def bad_sets() -> dict[str, bytes]:
    """Give 50 sets: a whole one, wicked and damaged ones."""
    sets = {"whole": zipped(patches())} | wicked_sets()
    for compression in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        count = (50 - len(sets)) // (1 + (compression == zipfile.ZIP_STORED))
        damaged = mutated(zipped(patches(), compression), seed=compression, count=count)
        sets |= {f"damaged {compression}-{number}": data for number, data in enumerate(damaged)}
    return sets


@pytest.fixture(scope="module")
def trials(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Trial]:
    sets, folder = bad_sets(), tmp_path_factory.mktemp("sets")
    done = try_files(
        folder / "a",
        {f"{number}.zip": data for number, data in enumerate(sets.values())},
        lambda path, out: ["train", path, "-o", out / f"{path.stem}.npz", *SMALL],
    )
    assert {path.suffix for path in (folder / "a" / "out").iterdir()} == {".npz"}
    assert list(folder.iterdir()) == [folder / "a"]
    return dict(zip(sets, done, strict=True))


def test_bad_sets_are_trained_on_or_refused(trials: dict[str, Trial]) -> None:
    assert len(trials) == 50
    assert trials["whole"].code == 0


@pytest.mark.parametrize("name", WICKED)
def test_a_wicked_set_is_refused_by_name(trials: dict[str, Trial], name: str) -> None:
    assert trials[name].code == 1
    assert WICKED[name] in trials[name].err
