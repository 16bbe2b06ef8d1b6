"""The search of a frame on one thread, against OpenCV's detector and against decoding."""

import itertools
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from unittest.mock import patch

import av
import cv2
import numpy as np

from benchmarks.rounds import Task, measure
from vdet.boxes import Float32Array
from vdet.config.schema import DetectorSettings, NetworkSettings, SvmSettings
from vdet.detect.detectors import load_detector
from vdet.detect.svm.detector import SvmDetector, SvmModel
from vdet.detect.svm.model import LinearModel, describe
from vdet.detect.svm.windows import (
    WINDOW_SIDES,
    DenseSearch,
    FramePyramid,
    FrameStrip,
    WindowGrid,
)
from vdet.media import Picture, Planes
from vdet.media.frame import Coding

HEIGHTS = (720, 1080, 2160)
DECODED = 60
_OF_SVM, _OF_NETWORK = 3, 2
"""Every N-th frame is searched of the project video, which has 25 frames a second."""

_STRIDES = {"svm dense": _OF_SVM, "svm detection": _OF_SVM, "network detection": _OF_NETWORK}


class PatchSearch:
    """The original's search: each window is cropped, resized, described and classified on its own.

    It is slow and simple. The tests and benchmarks compare the dense search with it.
    """

    def __init__(self, model: LinearModel, grid: WindowGrid) -> None:
        self._model = model
        self._boxes = grid.boxes.tolist()

    def search(self, frame: FramePyramid, probability: float) -> tuple[Float32Array, Float32Array]:
        """Search a frame as `DenseSearch.search`."""
        side, regression = self._model.features.patch, self._model.box_regression
        patches = (
            frame.cut(FrameStrip(slice(y, y + height), slice(x, x + width), side, side))
            for x, y, width, height in self._boxes
        )
        vectors = np.stack([describe(patch, self._model.features) for patch in patches])
        probabilities = self._model.probabilities(vectors)
        sides = np.tile(WINDOW_SIDES, (len(vectors), 1))
        if regression is not None:
            hits = probabilities >= probability
            sides[hits] = regression.sides(vectors[hits, : self._model.features.hog_length])
        return probabilities, sides


def search_times(
    path: Path, pictures: Sequence[Picture], svm: SvmModel, seed: SvmModel, rounds: int
) -> dict[str, float]:
    """Return seconds for a frame of a video, for the dense searches and their references.

    Where not every frame of the video is searched, the searched ones count for the others too.
    """
    searches: dict[str, Task] = {
        "svm dense": _search(svm, pictures),
        "seed patch": _search(seed, pictures, PatchSearch),
        "seed dense": _search(seed, pictures),
        "detectMultiScale": _detect_multi_scale(pictures),
        "svm detection": _detection(SvmSettings(), pictures),
        "network detection": _detection(NetworkSettings(), pictures),
        "decoding": partial(_decode, path),
    }
    frames = dict.fromkeys(searches, len(pictures)) | {"decoding": DECODED}
    return {
        name: seconds / frames[name] / _STRIDES.get(name, 1)
        for name, seconds in measure(searches, rounds).items()
    }


def _search(config: SvmModel, pictures: Sequence[Picture], engine: type = DenseSearch) -> Task:
    """Search the pictures."""
    width, height = pictures[0].width, pictures[0].height
    with patch("vdet.detect.svm.detector.DenseSearch", engine):
        search = SvmDetector(config.model, config.settings, width, height)

    def run() -> None:
        for picture in pictures:
            search.search(picture, 0)

    return run


def _detection(settings: DetectorSettings, pictures: Sequence[Picture]) -> Task:
    """Search the pictures as frames of a video, and make detections of what is found."""
    width, height = pictures[0].width, pictures[0].height
    detector = load_detector(settings).for_video(width, height, [pictures[0].image])

    def run() -> None:
        for index, picture in enumerate(pictures):
            detector.detect(detector.search(picture, index))

    return run


def _detect_multi_scale(pictures: Sequence[Picture]) -> Task:
    """OpenCV's own sliding-window detector: 64×64, stride 8, scale 1.1, rows 380-660."""
    hog = cv2.HOGDescriptor((64, 64), (16, 16), (8, 8), (8, 8), 9)
    weights = np.random.default_rng(0).normal(0, 0.01, hog.getDescriptorSize() + 1)
    hog.setSVMDetector(weights.astype(np.float32))
    bands = [np.ascontiguousarray(picture.image[380:660]) for picture in pictures]

    def run() -> None:
        for band in bands:
            hog.detectMultiScale(band, hitThreshold=5, winStride=(8, 8), scale=1.1)

    return run


def _decode(path: Path) -> None:
    """Decode frames to planes with one thread."""
    with av.open(str(path)) as container:
        stream = container.streams.video[0]
        stream.thread_type = "NONE"
        for _ in itertools.islice(container.decode(stream), DECODED):
            pass


def times_by_height(pictures: Sequence[Picture], svm: SvmModel, rounds: int) -> dict[str, float]:
    """Return the dense search's seconds a frame for frames of several heights."""
    images = [picture.image for picture in pictures[:3]]
    tasks: dict[str, Task] = {}
    for height in HEIGHTS:
        size = images[0].shape[1] * height // images[0].shape[0], height
        scaled = [np.asarray(cv2.resize(image, size), np.uint8) for image in images]
        tasks[str(height)] = _search(svm, [Picture(Planes.of_image(i, Coding())) for i in scaled])
    times = measure(tasks, rounds)
    return {name: seconds / len(images) for name, seconds in times.items()}
