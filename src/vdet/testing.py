"""Checks that every detector, tracker and sink passes; for those of other packages too.

Each check raises `AssertionError` with what is wrong.
"""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import astuple, dataclass
from fractions import Fraction
from pathlib import Path

import numpy as np

from vdet.boxes import NO_BOXES, Box, Boxes
from vdet.config.schema import Settings
from vdet.detect.protocol import DetectorModel, VideoDetector, stage_pictures_of
from vdet.files import OutputFiles
from vdet.media import Frame, Picture, VideoInfo
from vdet.media.images import Image
from vdet.run.result import FrameResult
from vdet.run.sinks.protocol import SinkContext, SinkKind
from vdet.run.steps import StepContext, make_steps
from vdet.track.protocol import CarryingTracker, VideoTracker
from vdet.track.track import Track

RATE = 25
"""Frames a second of the scenes that the checks make."""


def check_detector(model: DetectorModel, images: Sequence[Image]) -> None:
    """Check a detector on consecutive frames of one video, BGR uint8 `(H, W, 3)`, two or more.

    * Detections lie in the frame, and the frame is left as it is.
    * A second detector gives the same for the same frames, also when frames are searched in
      threads and another video is searched in between: nothing is shared.
    * A still picture, and a frame of one colour, can be searched.
    * Stage pictures are BGR uint8 images.
    """
    assert len(images) > 1, "give two frames or more"
    before = [image.copy() for image in images]
    height, width = images[0].shape[:2]
    alone = _detect_all(model.for_video(width, height, images), images)
    for image, copy in zip(images, before, strict=True):
        assert np.array_equal(image, copy), "the detector changed a frame"
    for found in alone:
        _check_detections(found, width, height)
    detector, other = (model.for_video(width, height, images) for _ in range(2))
    with ThreadPoolExecutor(2) as pool:
        pictures = [Picture(image) for image in images]
        candidates = list(pool.map(detector.search, pictures, range(len(images))))
    for index, (one, image, expected) in enumerate(zip(candidates, images, alone, strict=True)):
        other.detect(other.search(Picture(255 - image), index))
        _check_equal(detector.detect(one), expected)
    still = model.for_video(width, height, images[:1])
    found = still.detect(still.search(Picture(images[0]), None))
    _check_detections(found, width, height)
    for name, picture in stage_pictures_of(still)(images[0], found).items():
        assert picture.dtype == np.uint8, f"stage picture {name} is {picture.dtype}, not uint8"
        assert picture.ndim == 3, f"stage picture {name} has the shape {picture.shape}"
    plain = np.full_like(images[0], 128)
    blank = model.for_video(width, height, [plain])
    _check_detections(blank.detect(blank.search(Picture(plain), 0)), width, height)


def _detect_all(detector: VideoDetector, images: Sequence[Image]) -> list[Boxes]:
    return [
        detector.detect(detector.search(Picture(image), index))
        for index, image in enumerate(images)
    ]


def _check_detections(found: Boxes, width: int, height: int) -> None:
    assert isinstance(found, Boxes), f"detect returned {type(found).__name__}"
    inside = (found.sides >= 0).all() and (found.sides <= [width, height, width, height]).all()
    assert inside, "a box lies outside the frame"


def _check_equal(found: Boxes, expected: Boxes) -> None:
    for name in ("sides", "scores"):
        assert np.allclose(getattr(found, name), getattr(expected, name), atol=1e-4), (
            f"{name} differ from those of the first detector for the same frame"
        )


def check_tracker(make: Callable[[int, int], VideoTracker]) -> None:
    """Check a tracker; `make` returns a new one for frames of a width and height.

    * Two vehicles that are always detected keep one id each, boxes lie in the frame, ids are
      positive and in order, scores are 0 to 1, what is detected is not `predicted`.
    * The detections and the frame are left as they are.
    * Without detections there is nothing to show after some seconds.
    * Ids belong to a tracker: a second one gives the same, also in between.
    * If it has `carry`: in frames that are not searched the same vehicles are shown, as predicted.
    """
    first, second = make(640, 360), make(640, 360)
    shown: list[list[Track]] = []
    for index in range(3 * RATE):
        image = _scene(index)
        found, before = _detections(index), image.copy()
        shown.append(list(first.update(found, index / RATE, Picture(image))))
        again = list(second.update(_detections(index), index / RATE, Picture(image)))
        assert again == shown[-1], "two trackers with the same input differ: they share something"
        assert np.array_equal(image, before), "the tracker changed the frame"
        _check_tracks(shown[-1])
    last = shown[-1]
    assert len(last) == len(_boxes(0)), f"{len(last)} of {len(_boxes(0))} vehicles are shown"
    assert not any(track.predicted for track in last), "a detected vehicle is called predicted"
    ids = {track.id for tracks in shown for track in tracks}
    assert ids == {track.id for track in last}, "a vehicle that is always detected changed its id"
    if isinstance(first, CarryingTracker):
        _check_carrying(make(640, 360))
    for index in range(3 * RATE, 30 * RATE):
        last = list(first.update(NO_BOXES, index / RATE, Picture(_scene(0) // 2)))
    assert last == [], "vehicles are shown long after the last detection"


def _check_carrying(tracker: VideoTracker) -> None:
    assert isinstance(tracker, CarryingTracker)
    for index in range(3 * RATE):
        time, picture = index / RATE, Picture(_scene(index))
        if index % 2 == 0:
            shown = tracker.update(_detections(index), time, picture)
            continue
        carried = tracker.carry(time, picture)
        _check_tracks(carried)
        ids = [track.id for track in carried]
        assert ids == [track.id for track in shown], "a vehicle that was not looked for is missed"
        assert all(track.predicted for track in carried), "what was not looked for is predicted"


def _check_tracks(tracks: Sequence[Track]) -> None:
    ids = [track.id for track in tracks]
    assert ids == sorted(set(ids)), f"ids {ids} are not in order, or one comes twice"
    for track in tracks:
        assert track.id > 0, f"id {track.id} is not positive"
        assert 0 <= track.score <= 1, f"score {track.score} is not in 0 to 1"
        assert track.box.area, "a track has a box without an area"
        assert track.box == track.box.clipped(640, 360), "a track's box lies outside the frame"


def _boxes(index: int) -> list[Box]:
    """Return two vehicles that drive in lanes of their own."""
    return [
        Box.sized(60 + 2 * index, 180, 90, 70),
        Box.sized(500 - 3 * index, 40, 80, 60),
    ]


def _detections(index: int) -> Boxes:
    boxes = [astuple(box) for box in _boxes(index)]
    return Boxes(boxes, [0.9, 0.95], data={"strength": [9.0, 9.5]})


def _scene(index: int) -> Image:
    """Draw the vehicles with a texture of their own on a grey road."""
    image = np.full((360, 640, 3), 90, np.uint8)
    for number, box in enumerate(_boxes(index)):
        x, y, width, height = box.xywh
        texture = np.random.default_rng(number).integers(0, 256, (height, width, 3))
        image[y : y + height, x : x + width] = texture
    return image


def check_sink(
    kind: SinkKind, path: Path, settings: Settings | None = None, *, still: bool = False
) -> None:
    """Check a sink that writes to `path`, which must not be there yet.

    With `still` it gets one still picture, else three frames of a video.

    * Nothing is there before the run ends, nor after a run that ends with an error.
    * After a run that ends well the output is there, and no temporary file is left.
    * The frame's image is left as it is.
    * The same output can be written again after a failed run.
    """
    run = _SinkRun(kind, path, settings or Settings(), still)
    try:
        run.write(error=ZeroDivisionError())
    except ZeroDivisionError:
        pass
    else:
        raise AssertionError("the sink hid the error that ended the run")
    assert not _content(path), "a failed run left its output"
    run.write()
    assert _content(path), "a run that ended well left no output"


@dataclass(frozen=True)
class _SinkRun:
    kind: SinkKind
    path: Path
    settings: Settings
    still: bool

    def write(self, error: Exception | None = None) -> None:
        """Write a picture or some frames through the sink; raise `error` after them."""
        folder = self.path if self.kind.marker else self.path.parent
        folder.mkdir(parents=True, exist_ok=True)
        try:
            with OutputFiles() as files, self.kind.open(self.path, self._context(files)) as sink:
                for result in self._results():
                    before = result.frame.image.copy()
                    sink.write(result)
                    assert np.array_equal(result.frame.image, before), "the sink changed the frame"
                assert not _content(self.path), "the output is there before the run has ended"
                if error is not None:
                    raise error
        finally:
            left = [path.name for path in folder.iterdir() if ".vdet-" in path.name]
            assert not left, f"temporary files are left: {', '.join(left)}"

    @property
    def _video(self) -> VideoInfo | None:
        rate = Fraction(RATE)
        video = VideoInfo(Path("check.mp4"), 640, 360, rate, 1 / rate, frames=3)
        return None if self.still else video

    def _results(self) -> Iterator[FrameResult]:
        steps = make_steps(StepContext(self.settings, 640, 360, self._video))
        for index in range(1 if self.still else 3):
            result = _result(index)
            for step in steps:
                result = step.apply(result)
            yield result

    def _context(self, files: OutputFiles) -> SinkContext:
        return SinkContext(
            files,
            self.settings,
            self._video,
            stage_pictures=lambda image, _: {"frame": image},
        )


def _content(path: Path) -> list[Path]:
    """Return the files that an output consists of, temporary ones left out."""
    if path.is_dir():
        return [inside for inside in path.iterdir() if ".vdet-" not in inside.name]
    return [path] if path.exists() else []


def _result(index: int) -> FrameResult:
    frame = Frame(index, Fraction(index, RATE), Picture(_scene(index)))
    tracks = tuple(
        Track(number, box, 0.9, predicted=number == 2)
        for number, box in enumerate(_boxes(index), start=1)
    )
    return FrameResult(Path("check.mp4"), frame, _detections(index), tracks)
