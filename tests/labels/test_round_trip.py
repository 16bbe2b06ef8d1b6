"""Every format of the registry: what is written is read again, and what is damaged is refused."""

import math
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import get_args

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from labels.saving import VIDEO, car, frame, read_back, written
from vdet.boxes import Box
from vdet.config.classes import STANDARD_CLASSES, UNKNOWN
from vdet.labels.coco import COCO, read_coco_images, write_coco_images
from vdet.labels.images import LabelledImage
from vdet.labels.label import Format, track_formats
from vdet.labels.lines import CSV, JSON_LINES, MOT
from vdet.track.track import FrameTracks, State, Track
from writing import write_image

WHOLE = {CSV, JSON_LINES}
"""Formats that keep all that is known of a track."""
TIMED = WHOLE | {COCO}
"""Formats that keep times and feet."""
LISTING = {JSON_LINES, COCO}
"""Formats that keep the frames without a box."""
MARKING = WHOLE | {COCO}
"""Formats that keep which vehicles are lost."""

FORMATS = track_formats()
every_format = pytest.mark.parametrize("form", FORMATS, ids=lambda form: form.name)


@st.composite
def boxes(draw: st.DrawFn) -> Box:
    """Give boxes inside the frame."""
    x, y = draw(st.integers(0, VIDEO.width - 1)), draw(st.integers(0, VIDEO.height - 1))
    right, bottom = draw(st.integers(x + 1, VIDEO.width)), draw(st.integers(y + 1, VIDEO.height))
    return Box.sized(x, y, right - x, bottom - y)


CLASSES = st.sampled_from([None, *STANDARD_CLASSES, "tractor", 'a <"b"> & c, d', "Überlandbus 🚌"])
PLACES = st.floats(-3000, 3000).map(lambda value: round(value, 2))


@st.composite
def videos(draw: st.DrawFn) -> list[FrameTracks]:
    """Give frames in order, some left out, with tracks that each keep their class."""
    classes = {number: draw(CLASSES) for number in range(1, 5)}
    frames = []
    for index in sorted(draw(st.sets(st.integers(0, 20), max_size=6))):
        ids = sorted(draw(st.sets(st.sampled_from(sorted(classes)))))
        tracks = [
            Track(
                number,
                draw(boxes()),
                draw(st.integers(1, 10_000)) / 10_000,
                draw(st.sampled_from(get_args(State))),
                classes[number],
                (draw(PLACES), draw(PLACES)),
                draw(st.none() | st.integers(0, 9999).map(lambda value: value / 100)),
                draw(st.none() | st.integers(-3, 3)),
            )
            for number in ids
        ]
        frames.append(frame(index, *tracks))
    return frames


def kept(form: Format, track: Track) -> Track:
    """Return what a format keeps of a track."""
    names: dict[Format, str | None] = {MOT: None, **dict.fromkeys(WHOLE, track.class_name)}
    whole = form in WHOLE
    marks_lost = form in MARKING and track.state == "predicted"
    state: State = track.state if whole else "predicted" if marks_lost else "detected"
    return replace(
        track,
        state=state,
        class_name=names.get(form, track.class_name or "vehicle"),
        whole_foot=track.whole_foot if form in TIMED else None,
        distance=track.distance if whole else None,
        lane=track.lane if whole else None,
    )


@every_format
@settings(max_examples=30)
@given(videos())
def test_what_is_written_is_read_again(
    tmp_path_factory: pytest.TempPathFactory, form: Format, frames: list[FrameTracks]
) -> None:
    if form is JSON_LINES and not frames:
        return  # a file without a record is no such file
    saved = read_back(form, tmp_path_factory.getbasetemp(), written(form, frames))
    found = {item.index: item.tracks for item in saved}
    assert found == {
        frame.index: tuple(kept(form, track) for track in frame.tracks)
        for frame in frames
        if frame.tracks or form in LISTING
    }
    for item in saved:
        seconds = item.index / 25 if form in TIMED else math.nan
        assert item.time == pytest.approx(seconds, nan_ok=True)
    if any(saved):
        assert saved.video == (VIDEO if form in LISTING else None)
        assert saved.size == ((1280, 720) if form in LISTING else None)


@every_format
def test_a_box_may_reach_out_of_the_frame(tmp_path: Path, form: Format) -> None:
    box = Box.sized(-5, 700, 30, 60)
    saved = read_back(form, tmp_path, written(form, [frame(2, car(1, box))]))
    assert list(saved)[-1].tracks[0].box == box


@st.composite
def labelled(draw: st.DrawFn) -> list[LabelledImage]:
    """Give pictures with boxes, some in folders; no two boxes of one are the same."""
    names = st.sampled_from(["a.png", "b/a.png", "b/c d/é & <e>.jpg", "b/2.jpg"])
    return [
        LabelledImage(
            Path(name),
            Path(),
            tuple(
                replace(car(number, box), class_name=draw(CLASSES))
                for number, box in enumerate(draw(st.sets(boxes(), max_size=4)), start=1)
            ),
            (VIDEO.width, VIDEO.height),
        )
        for name in sorted(draw(st.sets(names, min_size=1)))
    ]


@settings(max_examples=20)
@given(pictures=labelled())
def test_labels_of_pictures_are_read_again(pictures: list[LabelledImage]) -> None:
    with TemporaryDirectory() as name:
        folder = Path(name)
        path, images = folder / "set.coco.json", folder / "images"
        for picture in pictures:
            (images / picture.path).parent.mkdir(parents=True, exist_ok=True)
            write_image(images / picture.path, np.zeros((VIDEO.height, VIDEO.width, 3), np.uint8))
        with path.open("wb") as file:
            write_coco_images(file, pictures)
        found = list(read_coco_images(path))

    def boxes_by_path(labelled: list[LabelledImage], base: Path) -> dict[Path, object]:
        return {
            base / image.path: sorted(
                (label.box.pixels, label.class_name or UNKNOWN) for label in image.labels
            )
            for image in labelled
        }

    assert boxes_by_path(found, Path()) == boxes_by_path(pictures, images)
