"""Pictures and label files that lie in folders of their own, and belong together by name."""

from collections.abc import Iterator
from pathlib import Path

from vdet.errors import TruthError
from vdet.files import printable
from vdet.media.images import is_picture_name


def pictures_below(folder: Path) -> list[Path]:
    """Return the pictures in a folder and in those below it, in order; hidden files are none."""
    return sorted(filter(is_picture_name, folder.rglob("*")))


def labelled_pairs(labels: Path, suffix: str, pictures: Path) -> Iterator[tuple[Path, Path]]:
    """Yield each label file in a folder with the picture of its name.

    Raises
    ------
    TruthError
        A label file has no picture, or two.
    """
    by_name: dict[str, list[Path]] = {}
    for picture in pictures_below(pictures):
        by_name.setdefault(picture.stem, []).append(picture)
    for file in sorted(labels.glob(f"*{suffix}")):
        if file.name.startswith("."):
            continue
        found = by_name.get(file.stem, [])
        if len(found) != 1:
            what = "two pictures" if found else "no picture"
            raise TruthError(f"{file}: there is {what} {printable(file.stem)} in {pictures}")
        yield file, found[0]
