"""Damaged and wicked zip files of patches through `vdet train`; nothing is unpacked to a file."""

import io
import stat
import struct
import warnings
import zipfile

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


def zipped(members: Members) -> bytes:
    file = io.BytesIO()
    with (
        zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive,
        warnings.catch_warnings(action="ignore"),  # a name that is there twice
    ):
        for name, data in members:
            archive.writestr(name, data)
    return file.getvalue()


def with_field(data: bytes, local: int, central: int, value: int) -> bytes:
    """Set a field in the headers of all members."""
    changed = bytearray(data)
    for mark, offset in ((b"PK\x03\x04", local), (b"PK\x01\x02", central)):
        at = changed.find(mark)
        while at >= 0:
            struct.pack_into("<H", changed, at + offset, value)
            at = changed.find(mark, at + 4)
    return bytes(changed)


UNREADABLE = ": is not a readable image"


def wicked_sets() -> dict[str, tuple[bytes, str]]:
    """Give sets by their names, and the words that say why each is rejected."""
    whole, link = patches(), zipfile.ZipInfo("vehicles/far/x.png")
    link.external_attr = (stat.S_IFLNK | 0o777) << 16
    bombs: Members = [(f"vehicles/far/bomb{n}.png", bytes(17_000_000)) for n in range(EACH - 1)]
    return {
        "an absolute name": (zipped([*whole, ("/vehicles/far/x.png", b"")]), UNREADABLE),
        "a symbolic link": (zipped([*whole, (link, b"/etc/passwd")]), UNREADABLE),
        "encrypted": (with_field(zipped(whole), 6, 8, 1), UNREADABLE),
        "unknown compression": (with_field(zipped(whole), 8, 10, 99), UNREADABLE),
        "bombs": (zipped([*whole, *bombs]), UNREADABLE),
        "empty pictures": (zipped([(name, b"") for name, _ in whole]), UNREADABLE),
        "a set in a set": (zipped([("vehicles/set.zip", zipped(whole))]), "no images in vehicles/"),
        "nothing": (zipped([]), "no images in vehicles/"),
        "one class": (zipped(whole[:EACH]), "no images in non-vehicles/"),
    }


WICKED = wicked_sets()


@pytest.fixture(scope="module")
def trials(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Trial]:
    sets, folder = {"whole": zipped(patches())}, tmp_path_factory.mktemp("sets")
    sets |= {name: data for name, (data, _) in WICKED.items()}
    sets |= {f"damaged {n}": d for n, d in enumerate(mutated(sets["whole"], seed=8, count=30))}
    done = try_files(
        folder / "a",
        {f"{number}.zip": data for number, data in enumerate(sets.values())},
        lambda path, out: ["train", path, "-o", out / f"{path.stem}.npz", *SMALL],
    )
    assert {path.suffix for path in (folder / "a" / "out").iterdir()} == {".npz"}
    assert list(folder.iterdir()) == [folder / "a"]
    return dict(zip(sets, done, strict=True))


def test_a_whole_set_is_trained_on(trials: dict[str, Trial]) -> None:
    assert trials["whole"].code == 0


@pytest.mark.parametrize("name", WICKED)
def test_a_wicked_set_is_rejected_by_name(trials: dict[str, Trial], name: str) -> None:
    assert trials[name].code == 1
    assert WICKED[name][1] in trials[name].err
