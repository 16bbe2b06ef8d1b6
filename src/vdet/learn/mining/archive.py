"""A zip file of patches, whole or not at all; the same patches give the same bytes."""

import csv
import io
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import cv2

from vdet.files import replacing
from vdet.learn.dataset import COLUMNS, TABLE, Sides
from vdet.media.images import Image

_LONG_AGO = (1980, 1, 1, 0, 0, 0)  # the first time that the format knows
_READABLE = 0o644 << 16


class PatchArchive:
    """Takes patches in the order in which they are to stand in the file."""

    def __init__(self, file: zipfile.ZipFile) -> None:
        self._file = file
        self._rows: list[tuple[str, Sides]] = []

    def add(self, name: str, patch: Image, sides: Sides | None = None) -> None:
        """Add a patch (BGR uint8) as a PNG picture of a name; and where in it the vehicle is."""
        _, data = cv2.imencode(".png", patch)
        self._write(name, data.tobytes(), zipfile.ZIP_STORED)
        if sides is not None:
            self._rows.append((name, sides))

    def add_table(self) -> None:
        """Add the table of all boxes, in sides of the patch, four decimals; after all patches."""
        text = io.StringIO(newline="")
        table = csv.writer(text, lineterminator="\n")
        table.writerow(COLUMNS)
        for name, sides in self._rows:
            table.writerow([name, *("" if side is None else f"{side:.4f}" for side in sides)])
        self._write(TABLE, text.getvalue().encode("utf-8"), zipfile.ZIP_DEFLATED)

    def _write(self, name: str, data: bytes, method: int) -> None:
        info = zipfile.ZipInfo(name, _LONG_AGO)
        info.create_system = 3  # elsewhere than on Unix the default is another
        info.external_attr = _READABLE
        self._file.writestr(info, data, method)


@contextmanager
def patch_archive(path: Path) -> Iterator[PatchArchive]:
    """Give an archive that stands at `path` once the block has ended well. Raises `OutputError`."""
    with replacing(path) as temporary, zipfile.ZipFile(temporary, "w") as file:
        archive = PatchArchive(file)
        yield archive
        archive.add_table()
