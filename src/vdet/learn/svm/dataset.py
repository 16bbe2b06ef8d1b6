"""Read labelled patches from folders or zip files, by group; write them to a zip file.

The layout is that of the Udacity set: `vehicles/<group>/*.png` and `non-vehicles/<group>/*.png`, in
folders, in zip files, or one class in each. A table beside these folders, `boxes.csv`, may give the
sides of the vehicle in a patch. Patches with a vehicle off their centre or of another size are then
in `boxes/<group>/`.
"""

import csv
import io
import math
import re
import zipfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

import cv2

from vdet.boxes import Image
from vdet.errors import DataError, escaped, printable
from vdet.files import is_hidden, staged
from vdet.media.images import IMAGE_SUFFIXES, decode_image

CLASSES = {"vehicles": True, "non-vehicles": False}
BOXED = "boxes"
"""Folder of the patches with box sides that belong to neither class."""
TABLE = "boxes.csv"
COLUMNS = ("name", "left", "top", "right", "bottom")
MAX_PATCH_BYTES = 16_000_000

Sides = tuple[float, float, float, float]
"""Left, top, right and bottom of a vehicle from the centre of a patch, in its widths and heights.

Right and down are positive; NaN for an unknown side, for example outside the frame.
"""

NO_SIDES: Sides = (math.nan, math.nan, math.nan, math.nan)
"""No side is known."""


@dataclass(frozen=True, slots=True)
class PatchFile:
    """A patch file: `name` in the zip file or folder `source`."""

    source: Path
    name: str
    group: str
    """Class and folder, `vehicles/GTI_Far`; patches of one group may be near-duplicates."""
    vehicle: bool
    sides: Sides | None = None
    """Sides of the vehicle in the patch, if known."""

    @property
    def is_boxed(self) -> bool:
        """Whether it is in `boxes/` and belongs to neither class; it has `sides`."""
        return self.group.split("/")[0] == BOXED

    def __str__(self) -> str:
        return f"{self.source}: {printable(self.name)}"


def find_patches(sources: Sequence[Path]) -> list[PatchFile]:
    """List the patches, group by group, in numeric order of file names.

    Raises
    ------
    DataError
        A source cannot be read or has no patch, one of the two classes has no patch, or a table of
        boxes is damaged.
    """
    files = [file for source in dict.fromkeys(sources) for file in _find_in(source)]
    for name, vehicle in CLASSES.items():
        if not any(file.vehicle is vehicle and not file.is_boxed for file in files):
            raise DataError(f"{', '.join(map(str, sources))}: no images in {name}/<group>/")
    return sorted(files, key=lambda file: (file.group, _numeric(file.name), file.source))


def _find_in(source: Path) -> list[PatchFile]:
    root = _root_of(source)
    if isinstance(root, Path):  # only files: devices and pipes may be endless
        names = [p.relative_to(root).as_posix() for p in root.rglob("*") if p.is_file()]
    else:
        names = root.root.namelist()
    boxes = _read_table(source, root) if TABLE in names else {}
    files = [file for name in names if (file := _patch_file(source, name, boxes))]
    if not files:
        raise DataError(
            f"{source}: no images in vehicles/<group>/ or non-vehicles/<group>/; see vdet mine"
        )
    return files


def _patch_file(source: Path, name: str, boxes: Mapping[str, Sides]) -> PatchFile | None:
    """Return the patch file of a name in a source; None if it is not a patch."""
    path = PurePosixPath(name)
    if is_hidden(path) or path.suffix.lower() not in IMAGE_SUFFIXES:
        return None
    sides = boxes.get(name)
    classes = CLASSES | ({BOXED: True} if sides else {})
    folders = [source.resolve().name, *path.parts[:-1]]
    for depth in range(len(folders) - 1, -1, -1):
        if folders[depth] in classes:
            group = escaped("/".join(folders[depth:]))
            return PatchFile(source, name, group, classes[folders[depth]], sides)
    return None


def _numeric(name: str) -> list[tuple[int, str]]:
    """Return a sort key in which image10 follows image9; numbers may have any length."""
    parts = re.split(r"0*([0-9]+)", name)
    return [(len(part) if part.isdecimal() else 0, part) for part in parts]


_Root = Path | zipfile.Path
"""A folder, or the top of a zip file."""


def _root_of(source: Path) -> _Root:
    """Return a folder or the top of a zip file."""
    if source.is_dir():
        return source
    if not source.exists():
        raise DataError(f"{source}: folder or zip file not found")
    try:
        return zipfile.Path(source)
    except Exception as error:  # zipfile raises a dozen kinds on damaged data
        raise DataError(f"{source}: is not a folder or a readable zip file") from error


def read_patches(files: Sequence[PatchFile]) -> Iterator[Image | None]:
    """Yield the image of each patch, BGR uint8 of any size; None if it is unreadable.

    Each zip file is opened once.
    """
    roots = {source: _root_of(source) for source in {file.source for file in files}}
    for file in files:
        yield decode_image(_content(roots[file.source], file.name))


def _content(root: _Root, name: str) -> bytes:
    """Return the content of a file; empty if it cannot be read."""
    try:
        with root.joinpath(name).open("rb") as file:
            return file.read(MAX_PATCH_BYTES)  # a bomb is not unpacked any further
    except Exception:  # zipfile and zlib raise a dozen kinds on damaged data
        return b""


def _read_table(source: Path, root: _Root) -> dict[str, Sides]:
    """Return the sides of each patch in the source's table."""
    try:
        text = _content(root, TABLE).decode("utf-8")
        rows = list(csv.reader(io.StringIO(text, newline="")))
        if not rows or tuple(rows[0]) != COLUMNS:
            raise ValueError(f"its first line is not {','.join(COLUMNS)}")
        return {name: _sides(values) for name, *values in rows[1:]}
    except (ValueError, csv.Error) as error:
        raise DataError(f"{source}: {TABLE} is damaged ({error}); mine it again") from error


def _sides(values: Sequence[str]) -> Sides:
    left, top, right, bottom = (float(value or "nan") for value in values)
    return left, top, right, bottom


AddPatch = Callable[[str, Image, Sides | None], None]
"""Adds a patch (BGR uint8) by name, with the sides of its vehicle."""


@contextmanager
def patch_archive(path: Path, *, overwrite: bool = False) -> Iterator[AddPatch]:
    """Write a zip file of patches as PNG images, with a table of all sides to four decimals.

    It appears at `path` if the block ends without an error. The same patches give the same bytes.
    Raises `OutputError`.
    """
    table = io.StringIO(newline="")
    rows = csv.writer(table, lineterminator="\n")
    rows.writerow(COLUMNS)
    with staged(path, overwrite=overwrite) as temporary, zipfile.ZipFile(temporary, "w") as file:

        def add(name: str, patch: Image, sides: Sides | None) -> None:
            _store(file, name, cv2.imencode(".png", patch)[1].tobytes())
            if sides is not None:
                rows.writerow(
                    [name, *("" if math.isnan(side) else f"{side:.4f}" for side in sides)]
                )

        yield add
        _store(file, TABLE, table.getvalue().encode())


def _store(archive: zipfile.ZipFile, name: str, data: bytes) -> None:
    """Write a member without time, so that the same data give the same file."""
    info = zipfile.ZipInfo(name)  # of the earliest time
    info.external_attr = 0o644 << 16
    archive.writestr(info, data)
