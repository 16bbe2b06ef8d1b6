"""A set of labelled pictures, read from whichever form lies in a folder."""

from collections.abc import Callable, Iterable
from pathlib import Path

from vdet.errors import TruthError
from vdet.labels.pictures.coco import coco_labels
from vdet.labels.pictures.kitti import kitti_labels
from vdet.labels.pictures.labelled import ImageLabels, LabelledImages, checked_images
from vdet.labels.pictures.voc import voc_labels
from vdet.labels.pictures.yolo import yolo_labels

_FOLDERS: dict[tuple[str, str], Callable[[Path], Iterable[ImageLabels]]] = {
    ("image_2", "label_2"): kitti_labels,
    ("images", "labels"): yolo_labels,
    ("JPEGImages", "Annotations"): voc_labels,
}
_LOOKED_FOR = (
    "one .json file (COCO), image_2 and label_2 (KITTI), images and labels (YOLO), JPEGImages and "
    "Annotations (Pascal VOC)"
)


def read_labelled_images(path: Path) -> LabelledImages:
    """Read labelled pictures: COCO, KITTI, YOLO or Pascal VOC.

    Parameters
    ----------
    path
        A COCO file, or a folder; what lies in it tells the form.

    Raises
    ------
    TruthError
        There is no labelled set, or it has a mistake; the message names the place of the first.
    """
    return checked_images(str(path), _labels(path))


def holds_labelled_images(path: Path) -> bool:
    """Tell whether a path looks like labelled pictures, and not like a folder of patches."""
    if not path.is_dir():
        return path.suffix.lower() == ".json"
    return any(all((path / name).is_dir() for name in folders) for folders in _FOLDERS) or bool(
        _coco_files(path)
    )


def _coco_files(folder: Path) -> list[Path]:
    return sorted([*folder.glob("*.json"), *folder.glob("annotations/*.json")])


def _labels(path: Path) -> Iterable[ImageLabels]:
    if not path.is_dir():
        if path.suffix.lower() != ".json":
            raise TruthError(f"{path}: is no folder and no .json file; give labelled pictures")
        return coco_labels(path)
    for folders, read in _FOLDERS.items():
        if all((path / name).is_dir() for name in folders):
            return read(path)
    files = _coco_files(path)
    if len(files) == 1:
        return coco_labels(files[0])
    if files:
        names = ", ".join(str(file.relative_to(path)) for file in files[:5])
        raise TruthError(f"{path}: holds several .json files ({names}); give the one with labels")
    raise TruthError(f"{path}: holds no labelled pictures; looked for {_LOOKED_FOR}")
