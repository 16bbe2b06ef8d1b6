"""Damaged and malicious pictures given to `vdet detect-image`."""

import struct
import zlib
from pathlib import Path

import cv2
import numpy as np
import pytest

from hostile.mutations import mutated
from hostile.trials import try_files
from quick import only_windows
from vdet.errors import ImageError
from vdet.media.images import read_image

IMAGE = cv2.resize(np.random.default_rng(0).integers(0, 256, (6, 8, 3), dtype=np.uint8), (64, 48))
FORMATS: dict[str, tuple[str, list[int]]] = {
    "8-bit.png": (".png", []),
    "16-bit.png": (".png", []),
    "baseline.jpg": (".jpg", []),
    "progressive.jpg": (".jpg", [cv2.IMWRITE_JPEG_PROGRESSIVE, 1]),
    "restarts.jpg": (".jpg", [cv2.IMWRITE_JPEG_RST_INTERVAL, 4]),
    "plain.bmp": (".bmp", []),
    "lzw.tiff": (".tiff", [cv2.IMWRITE_TIFF_COMPRESSION, 5]),
    "deflate.tiff": (".tiff", [cv2.IMWRITE_TIFF_COMPRESSION, 8]),
    "lossy.webp": (".webp", [cv2.IMWRITE_WEBP_QUALITY, 80]),
    "lossless.webp": (".webp", [cv2.IMWRITE_WEBP_QUALITY, 101]),
}
MUTATIONS = 12  # of each
FEW_WINDOWS = only_windows("size: 160, overlap: 0.5, top: 380, bottom: 600")


def encoded(suffix: str, picture: cv2.typing.MatLike, options: list[int] | None = None) -> bytes:
    written, data = cv2.imencode(suffix, picture, options or [])
    assert written
    return data.tobytes()


def black(width: int, height: int) -> bytes:
    return encoded(".png", np.zeros((height, width), np.uint8))


def png_of(width: int, height: int) -> bytes:
    """Return a small PNG whose header, with the right checksum, claims another size."""
    png = encoded(".png", IMAGE)
    header = b"IHDR" + struct.pack(">II", width, height) + png[24:29]
    return png[:12] + header + struct.pack(">I", zlib.crc32(header)) + png[33:]


def with_size(suffix: str, old: bytes, new: bytes) -> bytes:
    """Return a small picture whose header claims another size."""
    data = encoded(suffix, IMAGE)
    assert data.count(old) == 1
    return data.replace(old, new)


BOMBS = {
    "claims 10¹⁰ pixels.png": png_of(100_000, 100_000),
    "as many as OpenCV would read.png": png_of(32_768, 32_767),
    "64 million black pixels.png": black(8000, 8000),
    "a long line.png": black(40_000, 16),
    "claims.bmp": with_size(".bmp", struct.pack("<ii", 64, 48), struct.pack("<ii", 30_000, 30_000)),
    "claims.jpg": with_size(".jpg", struct.pack(">HH", 48, 64), struct.pack(">HH", 65_000, 65_000)),
}


def test_damaged_pictures_are_read_or_refused(tmp_path: Path) -> None:
    contents = dict(BOMBS)
    for seed, (name, (suffix, options)) in enumerate(FORMATS.items()):
        picture = IMAGE.astype(np.uint16) * 257 if name == "16-bit.png" else IMAGE
        whole = encoded(suffix, picture, options)
        damaged = mutated(whole, seed=seed, count=MUTATIONS)
        contents |= {f"{number}-{name}": data for number, data in enumerate(damaged)}
    trials = try_files(
        tmp_path, contents, lambda path, out: ["detect-image", path, "-o", out, *FEW_WINDOWS]
    )
    assert len(trials) == MUTATIONS * len(FORMATS) + len(BOMBS)
    assert {trial.code for trial in trials} == {0, 1}
    for trial in trials[: len(BOMBS)]:
        assert "has more than 33,554,432 pixels, or a side of more than" in trial.err
    written = sum(trial.code == 0 for trial in trials)
    assert len(list((tmp_path / "out").iterdir())) == written > 12


def test_an_endless_file_is_read_up_to_the_limit() -> None:
    with pytest.raises(ImageError, match=r"/dev/zero: is larger than 256,000,000 bytes"):
        read_image(Path("/dev/zero"))
