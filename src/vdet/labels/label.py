"""A labelled box from a file, and the checks that apply to every format."""

from collections.abc import Iterable
from itertools import islice
from pathlib import Path
from typing import NamedTuple

from vdet.errors import TruthError
from vdet.track.track import State

MAX_LABELS = 5_000_000
"""Largest number of boxes in one file: four hours of video with fourteen vehicles in sight."""

MAX_IN_FRAME = 1000
"""Largest number of boxes of either kind, true or predicted, in one frame."""

NO_ID = -1
"""Id of a box without an id; in video, only ignore regions may have it."""

_MAX_NAME = 100  # characters

Corners = tuple[float, float, float, float]
"""x1, y1, x2, y2 in pixels from 0; the far sides are exclusive."""

Size = tuple[int, int]
"""Width and height in pixels."""


class Label(NamedTuple):
    """A labelled box of a file; there may be millions.

    Attributes
    ----------
    place
        Its line in the file, or a description of its place, such as "annotations.3".
    box
        x1, y1, x2, y2 in pixels of the frame from 0; the far sides are exclusive.
    name
        Its name in the file; None if the file has no names.
    frame
        Number of the frame, from 1; 1 in a picture.
    score
        Confidence, higher is better; 1 where the file has none.
    ignored
        Whether it is an ignore region, and not a vehicle.
    state, foot, distance, lane
        As in `vdet.track.track.Track`; None if the file does not have them.
    """

    place: int | str
    box: Corners
    name: str | None = None
    frame: int = 1
    id: int = NO_ID
    score: float = 1.0
    ignored: bool = False
    state: State = "detected"
    foot: tuple[float, float] | None = None
    distance: float | None = None
    lane: int | None = None


def from_size(x: float, y: float, width: float, height: float) -> Corners:
    """Return the corners of a box from its top-left corner and its size."""
    return x, y, x + width, y + height


def line_error(path: Path | str, place: int | str, what: str) -> TruthError:
    """Return the error for a mistake in a line, or in another place, of a file."""
    return TruthError(f"{path}:{place}: {what}")


def limited(path: Path, labels: Iterable[Label], most: int | None = None) -> tuple[Label, ...]:
    """Return the labels of a file. Raises `TruthError` if there are more than `most`.

    None stands for `MAX_LABELS`.
    """
    most = MAX_LABELS if most is None else most
    found = tuple(islice(labels, most + 1))
    if len(found) > most:
        what = f"has more than {most:,} boxes; cut it into parts"
        raise line_error(path, found[-1].place, what)
    return found


def checked_labels(path: Path, labels: Iterable[Label]) -> tuple[Label, ...]:
    """Return the labels of the file `path` if they can all be boxes of one video.

    Raises
    ------
    TruthError
        A frame before the first, a negative id of a vehicle, an id twice in a frame, a box without
        area, or a name of more than 100 characters.
    """
    checked = tuple(labels)
    keys: set[tuple[int, int]] = set()
    for label in checked:
        mistake = mistake_in_box(label)
        key = label.frame, label.id
        if label.frame < 1:
            mistake = "the frame comes before the video's first"
        elif label.id < (NO_ID if label.ignored else 0):
            mistake = f"id {label.id} is negative; number the vehicles from 0 or 1"
        elif key in keys and label.id != NO_ID:
            mistake = f"id {label.id} occurs twice in the same frame"
        if mistake is not None:
            raise line_error(path, label.place, mistake)
        keys.add(key)
    return checked


def mistake_in_box(label: Label) -> str | None:
    """Return what is wrong with the box or the name of a label; None if nothing is."""
    width, height = label.box[2] - label.box[0], label.box[3] - label.box[1]
    if width <= 0 or height <= 0 or width * height <= 0:
        return f"the box has no area: {width:g} wide, {height:g} high"
    if len(label.name or "") > _MAX_NAME:
        return f"the label must have at most {_MAX_NAME} characters"
    return None
