"""Footage of one camera: what the teacher finds in it, and the parts to learn from and to check."""

import hashlib
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

import cv2
import numpy as np

from vdet.config.schema import Settings
from vdet.detect.detections import NO_DETECTIONS, Detections
from vdet.detect.protocol import DetectorModel
from vdet.detect.svm.detector import horizon_of
from vdet.errors import ImageError, VideoError
from vdet.evaluate.labelled_video import LabelledVideo
from vdet.learn.adapt.labels import WatchedFrame, label
from vdet.learn.adapt.teacher import Teacher
from vdet.media import Frame, VideoReader
from vdet.media.images import Image
from vdet.pipeline.loop import Progress, no_progress, peek
from vdet.pipeline.threads import map_ordered, single_threaded_libraries

_BYTES = 1 << 20
_SMALL = (64, 36)  # width and height, pixels


@dataclass(frozen=True, slots=True, eq=False)
class WatchedClip:
    """A clip as the teacher sees it.

    Attributes
    ----------
    path, sha256
        The file.
    width, height
        Size of its frames, pixels.
    horizon
        Its row as the search of the linear model finds it in the first frames, share of the height.
    frames
        In the order of the clip, as many as were watched.
    learnt
        Number of frames to learn from; the others are kept back for the check.
    """

    path: Path
    sha256: str
    width: int
    height: int
    horizon: float
    frames: tuple[WatchedFrame, ...]
    learnt: int

    def sample(self, most: int) -> tuple[int, ...]:
        """Return numbers of at most `most` frames to learn from, which differ about equally."""
        frames = self.frames[: self.learnt]
        change = np.cumsum([frame.change for frame in frames])
        wanted = np.linspace(0, change[-1], min(most, len(frames)))
        chosen = np.unique(np.searchsorted(change, wanted))
        return tuple(frames[row].number for row in chosen.tolist())

    def labels(self, settings: Settings) -> LabelledVideo:
        """Return the labels of the frames to learn from."""
        return label(self.frames[: self.learnt], settings, self.width, self.height)

    def kept_back(self, settings: Settings) -> LabelledVideo:
        """Return the labels of the others."""
        return label(self.frames[self.learnt :], settings, self.width, self.height)


def watch(
    path: Path,
    model: DetectorModel | None,
    settings: Settings,
    *,
    seconds: Fraction | None = None,
    threads: int = 1,
    progress: Progress = no_progress,
) -> WatchedClip:
    """Let the teacher search the frames of a clip.

    Parameters
    ----------
    model
        The teacher; None where labels are there already.
    seconds
        How much of the clip is watched; None for all of it.
    progress
        Called with the expected number of frames; what it returns is called with 1 for each.

    Raises
    ------
    VideoError
        The clip cannot be read or searched.
    """
    with VideoReader(path, end=seconds, settings=settings.input) as reader:
        info = reader.info
        teacher = Teacher(model, info.width, info.height) if model else None
        advance = progress(reader.expected)

        def search(frame: Frame) -> Detections:
            return teacher.detect(frame.image) if teacher else NO_DETECTIONS

        images, read = peek(reader)
        horizon = horizon_of(settings.svm, images)
        del images
        frames: list[WatchedFrame] = []
        before: Image | None = None
        try:
            with single_threaded_libraries(), map_ordered(search, read, threads) as watched:
                for frame, detections in watched:
                    small = _small(frame.image)
                    change = 0.0 if before is None else float(cv2.absdiff(small, before).mean())
                    time = float(frame.time - info.start)
                    frames.append(WatchedFrame(frame.index + 1, time, detections, change))
                    before = small
                    advance(1)
        except ImageError as error:
            raise VideoError(f"{path}: {error}") from error
    learnt = round(len(frames) * (1 - settings.adapt.check))
    size = info.width, info.height
    return WatchedClip(path, _digest(path), *size, horizon, tuple(frames), learnt)


def _small(image: Image) -> Image:
    """Return a small grey picture, which tells how much a frame differs from the one before."""
    grey = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
    return np.asarray(cv2.resize(grey, _SMALL, interpolation=cv2.INTER_AREA), np.uint8)


def _digest(path: Path) -> str:
    digest = hashlib.sha256()
    with path.open("rb") as file:
        while data := file.read(_BYTES):
            digest.update(data)
    return digest.hexdigest()
