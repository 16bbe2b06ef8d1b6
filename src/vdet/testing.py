"""Checks that every detector, tracker and sink should pass, also those of other packages.

Each check raises `AssertionError`, which says what is wrong.
"""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from fractions import Fraction
from pathlib import Path

import numpy as np

from vdet.boxes import NO_BOXES, Boxes, Image, visible
from vdet.config.schema import Settings
from vdet.detect.protocol import DetectorModel, VideoDetector, stage_pictures_of
from vdet.files import OutputFiles
from vdet.media import Frame, Picture, VideoInfo
from vdet.run.result import FrameResult
from vdet.run.sinks.protocol import SinkContext, SinkKind
from vdet.track.track import TimedTracker, Track, VideoTracker
from vdet.traffic.live import LiveTraffic

RATE = 25
"""Frames a second of the scenes that the checks make."""

WIDTH, HEIGHT = 640, 360
"""Size of their frames, pixels."""


def check_detector(model: DetectorModel, images: Sequence[Image]) -> None:
    """Check a detector on two or more consecutive frames of one video, BGR uint8 `(H, W, 3)`.

    * Detections lie in the frame, and the frame is not changed.
    * A second detector finds the same in the same frames, also when frames are searched in
      threads: detectors share nothing.
    * A still picture can be searched.
    * Stage pictures are BGR uint8 images.
    """
    height, width = images[0].shape[:2]
    first, second = (model.for_video(width, height, images) for _ in range(2))
    pictures = [Picture(image.copy()) for image in images]
    with ThreadPoolExecutor(2) as pool:
        candidates = list(pool.map(second.search, pictures, range(len(images))))
    for index, (image, searched) in enumerate(zip(images, candidates, strict=True)):
        found, again = _found(first, image, index), second.detect(searched)
        is_same = len(found) == len(again) and np.allclose(found.sides, again.sides, atol=1e-4)
        assert is_same, "boxes differ between two detectors: they share something"
    still = model.for_video(width, height, images[:1])
    found = _found(still, images[0], None)
    for name, picture in stage_pictures_of(still)(images[0], found).items():
        is_image = picture.dtype == np.uint8 and picture.ndim == 3
        assert is_image, f"stage picture {name} is not uint8 of shape (H, W, 3)"


def _found(detector: VideoDetector, image: Image, index: int | None) -> Boxes:
    before = image.copy()
    found = detector.detect(detector.search(Picture(image), index))
    assert np.array_equal(image, before), "the detector changed a frame"
    inside = visible(found.sides, (image.shape[1], image.shape[0]))
    assert np.array_equal(inside, found.sides), "a box lies outside the frame"
    return found


def check_tracker(make: Callable[[int, int], VideoTracker]) -> None:
    """Check a tracker; `make` returns a new one for frames of a width and height.

    * Two vehicles that are always detected keep one id each. Boxes lie in the frame, ids are
      positive and in order, scores are 0 to 1, and what is detected is "detected".
    * The frame is not changed.
    * A second tracker shows the same: trackers share nothing.
    * Nothing is shown some seconds after the last detection.
    * `at`, if there is one, shows the same vehicles a moment later, between detections.
    """
    first, second = make(WIDTH, HEIGHT), make(WIDTH, HEIGHT)
    ids: set[int] = set()
    for index in range(3 * RATE):
        picture = Picture(_scene(index))
        tracks, again = (
            list(tracker.update(_detections(index), index / RATE, picture))
            for tracker in (first, second)
        )
        _check_tracks(tracks)
        assert again == tracks, "two trackers differ: they share something"
        assert (picture.image == _scene(index)).all(), "the tracker changed the frame"
        ids |= {track.id for track in tracks}
    assert len(tracks) == 2, f"{len(tracks)} of 2 vehicles are shown"
    states = {track.state for track in tracks}
    assert states == {"detected"}, "a detected vehicle is not called detected"
    assert len(ids) == 2, "a vehicle that is always detected changed its id"
    if isinstance(second, TimedTracker):
        later = second.at(3.0)
        _check_tracks(later)
        assert {track.id for track in later} == ids, "a vehicle is lost a moment later"
        assert all(track.state == "interpolated" for track in later), "not called interpolated"
    for index in range(3 * RATE, 30 * RATE):
        tracks = first.update(NO_BOXES, index / RATE, Picture(_scene(0) // 2))
    assert not tracks, "vehicles are shown long after the last detection"


def _check_tracks(tracks: Sequence[Track]) -> None:
    ids = [track.id for track in tracks]
    assert ids == sorted(set(ids)), f"ids {ids} are not in order, or one comes twice"
    for track in tracks:
        assert track.id > 0, f"id {track.id} is not positive"
        assert 0 <= track.score <= 1, f"score {track.score} is not in 0 to 1"
        assert track.box.area, "a track has a box without an area"
        assert track.box == track.box.clipped(WIDTH, HEIGHT), "a track lies outside the frame"


def check_sink(
    kind: SinkKind, path: Path, settings: Settings | None = None, *, still: bool = False
) -> None:
    """Check a sink that writes to `path`, which must not be there yet.

    With `still` it gets one still picture, else three frames of a video.

    * Nothing is there before the run ends, nor after a run that ends with an error.
    * After a run that ends well the output is there, and no temporary file is left.
    * The frame's image is not changed.
    * The same output can be written after a failed run.
    """
    folder = path if kind.marker else path.parent
    folder.mkdir(parents=True, exist_ok=True)
    for fails in (True, False):
        with suppress(KeyboardInterrupt):
            _write(kind, path, settings or Settings(), still=still, fails=fails)
        assert bool(_content(path)) is not fails, (
            "a failed run left its output" if fails else "a run that ended well left no output"
        )
    assert not list(folder.glob("*.vdet-*")), "temporary files are left"


def _write(kind: SinkKind, path: Path, settings: Settings, *, still: bool, fails: bool) -> None:
    """Write a picture or three frames through the sink; the run may end with an error."""
    count, rate, traffic = 1 if still else 3, Fraction(RATE), LiveTraffic(settings, WIDTH, HEIGHT)
    info = VideoInfo(Path("check.mp4"), WIDTH, HEIGHT, rate, 1 / rate, frames=count)
    with OutputFiles() as files:
        context = SinkContext(files, settings, None if still else info, traffic=traffic)
        with kind.open(path, context) as sink:
            for index in range(count):
                result = _result(index)
                traffic.add(result.frame_tracks)
                sink.write(result)
                assert (result.frame.image == _scene(index)).all(), "the sink changed the frame"
            traffic.end()
            assert not _content(path), "the output is there before the run has ended"
            if fails:
                raise KeyboardInterrupt


def _content(path: Path) -> list[Path]:
    """Return the files that an output consists of, temporary ones left out."""
    files = path.iterdir() if path.is_dir() else [path]
    return [file for file in files if file.exists() and ".vdet-" not in file.name]


def _detections(index: int) -> Boxes:
    """Return two vehicles that drive in lanes of their own."""
    x, other = 60 + 2 * index, 500 - 3 * index
    sides = [(x, 180, x + 90, 250), (other, 40, other + 80, 100)]
    return Boxes(sides, [0.9, 0.95], data={"strength": [9.0, 9.5]})


def _scene(index: int) -> Image:
    """Draw the vehicles with a texture of their own on a grey road."""
    image = np.full((HEIGHT, WIDTH, 3), 90, np.uint8)
    for number, found in enumerate(_detections(index)):
        part = found.box.cut(image)
        part[:] = np.random.default_rng(number).integers(0, 256, part.shape)
    return image


def _result(index: int) -> FrameResult:
    frame = Frame(index, Fraction(index, RATE), Picture(_scene(index)))
    detections = _detections(index)
    left, right = (found.box for found in detections)
    tracks = (Track(1, left, 0.9, "detected"), Track(2, right, 0.9, "predicted"))
    return FrameResult(Path("check.mp4"), frame, detections, tracks)
