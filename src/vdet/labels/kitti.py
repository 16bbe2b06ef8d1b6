"""KITTI: space-separated columns; frames and pixels count from 0.

Source: Geiger, Lenz, Urtasun, "Are we ready for autonomous driving?", CVPR 2012, and the readmes of
its development kits for tracking and for objects.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path

from vdet.labels.formats import Format
from vdet.labels.images import LabelledImage, paired_files
from vdet.labels.label import Label, SavedTracks, limited
from vdet.labels.parsing import label_lines, parse_number, parse_whole, read_bytes
from vdet.track.track import FrameTracks

_TRACK_COLUMNS = 17  # frame and id, then those of an object
_TYPES = {None: "Car", "car": "Car", "vehicle": "Car", "truck": "Truck", "bus": "Truck"}
"""KITTI names of our classes. It has no bus; all other classes are Misc."""
_BEFORE = "-1 -1 -10"  # truncated, occluded, alpha: unknown
_AFTER = "-1 -1 -1 -1000 -1000 -1000 -10"  # size, place and direction in metres: unknown


def _lines(frame: FrameTracks) -> Iterator[str]:
    """Yield the 17 columns of the format and the score for each box."""
    for track in frame.tracks:
        name = _TYPES.get(track.class_name, "Misc")
        corners = " ".join(f"{side:.2f}" for side in track.box.pixels)
        yield f"{frame.index} {track.id} {name} {_BEFORE} {corners} {_AFTER} {track.score:.4f}\n"


def read_kitti(path: Path, data: bytes) -> SavedTracks:
    """Read labels of tracks, with 17 columns, or results, with a score as column 18.

    Only the columns frame, id, type, left, top, right, bottom and score are used.

    Raises
    ------
    TruthError
        A line has a wrong number of columns, or another one than the first line, or a column is not
        a number.
    """
    counts = _TRACK_COLUMNS, _TRACK_COLUMNS + 1
    labels = label_lines(path, data, _track_label, form="KITTI tracking", counts=counts)
    return SavedTracks(limited(path, labels))


def _track_label(place: int, columns: Sequence[str]) -> Label:
    frame, id_ = map(parse_whole, columns[:2])
    score = parse_number(columns[_TRACK_COLUMNS]) if len(columns) > _TRACK_COLUMNS else 1.0
    return _object_label(place, columns[2:])._replace(frame=frame + 1, id=id_, score=score)


def _object_label(place: int, columns: Sequence[str]) -> Label:
    left, top, right, bottom = map(parse_number, columns[4:8])
    return Label(place, (left, top, right, bottom), columns[0])


def read_kitti_images(images: Path, labels: Path) -> Iterator[LabelledImage]:
    """Yield the images of a set that have a label file, with 15 columns per line.

    Raises
    ------
    TruthError
        As for `read_kitti` or `paired_files`.
    """
    for image, file in paired_files(images, labels):
        if file:
            found = label_lines(file, read_bytes(file), _object_label, form="KITTI", counts=[15])
            yield LabelledImage(image, file, tuple(found))


KITTI = Format("KITTI tracking", ".kitti.txt", read_kitti, _lines)
