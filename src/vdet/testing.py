"""Checks that every detector, tracker and sink should pass, including those of other packages.

Each check raises an `AssertionError` that says what is wrong.
"""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from fractions import Fraction
from pathlib import Path

import numpy as np

from vdet.boxes import NO_BOXES, Boxes, Image, clipped
from vdet.config.schema import Settings
from vdet.detect.detectors import DetectorModel
from vdet.files import OutputFiles
from vdet.media import Frame, Picture, VideoInfo
from vdet.run.sinks.protocol import SinkContext, SinkKind
from vdet.run.steps import FrameResult, findings_in
from vdet.track.track import Track, VideoTracker
from vdet.traffic.counter import LiveTraffic

RATE = 25
"""Frame rate of the videos that the checks make."""

WIDTH, HEIGHT = 640, 360
"""Size of their frames, pixels."""

_IMAGE: Image = np.random.default_rng(1).integers(0, 256, (HEIGHT, WIDTH, 3), np.uint8)
"""Their frames all show this noise."""


def check_detector(model: DetectorModel, images: Sequence[Image]) -> None:
    """Check a detector on two or more consecutive frames of one video, BGR uint8 `(H, W, 3)`.

    * Detections lie in the frame, and the frame is not changed.
    * A second detector finds the same in the same frames, also if frames are searched in threads:
      detectors share no state.
    * A single image can be searched.
    """
    height, width = images[0].shape[:2]
    frames = [image.copy() for image in images]
    first, second = (model.for_video(width, height, frames) for _ in range(2))
    detections = [
        first.detect(first.search(Picture(image), index)) for index, image in enumerate(frames)
    ]
    with ThreadPoolExecutor(2) as pool:
        candidates = pool.map(second.search, map(Picture, frames), range(len(frames)))
        for a, b in zip(detections, map(second.detect, candidates), strict=True):
            is_same = len(a) == len(b) and np.allclose(a.sides, b.sides, atol=1e-4)
            assert is_same, "boxes differ between two detectors: they share something"
    still = model.for_video(width, height, frames[:1])
    for boxes in (*detections, still.detect(still.search(Picture(frames[0]), None))):
        inside = clipped(boxes.sides, (width, height))
        assert np.array_equal(inside, boxes.sides), "a box lies outside the frame"
    assert np.array_equal(frames, images), "the detector changed a frame"


def check_tracker(make: Callable[[int, int], VideoTracker]) -> None:
    """Check a tracker; `make` returns a new one for frames of a width and height.

    * Two vehicles that are always detected keep one id each. Boxes lie in the frame, ids are
      positive and in order, scores are 0 to 1, and the state is "detected".
    * The frame is not changed.
    * A second tracker shows the same: trackers share no state.
    * Nothing is shown some seconds after the last detection.
    """
    first, second = make(WIDTH, HEIGHT), make(WIDTH, HEIGHT)
    ids: set[int] = set()
    picture = Picture(_IMAGE.copy())
    for index in range(3 * RATE):
        detections, time = _detections(index), index / RATE
        tracks = first.update(detections, time, picture)
        _check_tracks(tracks)
        is_same = second.update(detections, time, picture) == tracks
        assert is_same, "two trackers differ: they share something"
        ids |= {track.id for track in tracks}
    assert len(tracks) == 2, f"{len(tracks)} of 2 vehicles are shown"
    assert len(ids) == 2, "a vehicle that is always detected changed its id"
    assert {track.state for track in tracks} == {"detected"}, "not called detected"
    for index in range(3 * RATE, 30 * RATE):
        tracks = first.update(NO_BOXES, index / RATE, picture)
    assert not tracks, "vehicles are shown long after the last detection"
    assert (picture.image == _IMAGE).all(), "the tracker changed the frame"


def _check_tracks(tracks: Sequence[Track]) -> None:
    ids = [track.id for track in tracks]
    assert ids == sorted(set(ids)), f"ids {ids} are not in order, or one occurs twice"
    for track in tracks:
        assert track.id > 0, f"id {track.id} is not positive"
        assert 0 <= track.score <= 1, f"score {track.score} is not in 0 to 1"
        assert track.box.area, "a track has a box without an area"
        assert track.box == track.box.clipped(WIDTH, HEIGHT), "a track lies outside the frame"


def check_sink(
    kind: SinkKind, path: Path, settings: Settings | None = None, *, still: bool = False
) -> None:
    """Check a sink that writes to `path`, which must not exist yet.

    With `still` it receives one image, else three frames of a video.

    * The output does not exist before the run ends, nor after a run that fails.
    * After a successful run the output exists, and no temporary file is left.
    * The frame's image is not changed.
    * The same output can be written after a failed run.
    """
    for fails in (True, False):
        with suppress(KeyboardInterrupt):
            _write(kind, path, settings or Settings(), still=still, fails=fails)
        fault = "a failed run left its output" if fails else "a successful run left no output"
        assert _is_there(path) is not fails, fault
    assert not list(path.parent.rglob("*.vdet-*")), "temporary files are left"


def _write(kind: SinkKind, path: Path, settings: Settings, *, still: bool, fails: bool) -> None:
    """Write an image or three frames through the sink; the run may end with an error."""
    video, rate, picture = Path("check.mp4"), Fraction(RATE), Picture(_IMAGE.copy())
    info = None if still else VideoInfo(video, WIDTH, HEIGHT, rate, 1 / rate, frames=3)
    traffic = LiveTraffic(settings, WIDTH, HEIGHT)
    with OutputFiles() as files:
        context = SinkContext(files, settings, info, traffic=traffic)
        with kind.open(path, context) as sink:
            for index in range(1 if still else 3):
                frame, detections = Frame(index, index / rate, picture), _detections(index)
                near, far = (detection.box for detection in detections)
                tracks = Track(1, near, 0.9, "detected"), Track(2, far, 0.9, "predicted")
                result = FrameResult(video, frame, detections, tracks)
                traffic.add(result.frame_tracks)
                sink.write(result)
            assert (picture.image == _IMAGE).all(), "the sink changed the frame"
            traffic.end(findings_in(context.facts))
            assert not _is_there(path), "the output exists before the run has ended"
            if fails:
                raise KeyboardInterrupt


def _is_there(path: Path) -> bool:
    """Return whether an output is a file, or has files apart from temporary ones."""
    return path.is_file() or any(path.glob("[!.]*"))


def _detections(index: int) -> Boxes:
    """Return two vehicles that drive in different lanes."""
    near, far = 60 + 2 * index, 500 - 3 * index
    sides = [(near, 180, near + 90, 250), (far, 40, far + 80, 100)]
    return Boxes(sides, [0.9, 0.95], data={"strength": [9.0, 9.5]})
