"""The search of a frame on one thread, against OpenCV's detector and against decoding."""

from collections.abc import Sequence
from pathlib import Path

import av
import cv2
import numpy as np

from benchmarks.material import ShippedConfig
from benchmarks.rounds import Task, measure
from vdet.config.schema import DetectorSettings, NetworkSettings, SvmSettings
from vdet.detect.factory import load_detector
from vdet.detect.svm.search import FrameSearch
from vdet.media.images import Image

HEIGHTS = (360, 720, 1080, 2160)
DECODED = 60


def search_times(
    path: Path, images: Sequence[Image], default: ShippedConfig, seed: ShippedConfig, rounds: int
) -> dict[str, float]:
    """Return seconds a frame for the dense searches and their references."""
    searches = {
        "default dense": _search(default, "dense", images),
        "seed patch": _search(seed, "patch", images),
        "seed dense": _search(seed, "dense", images),
        "detectMultiScale": _detect_multi_scale(images),
        "default detection": _detection(SvmSettings(), images),
        "network detection": _detection(NetworkSettings(), images),
    }
    times = measure(searches, rounds)
    per_frame = {name: seconds / len(images) for name, seconds in times.items()}
    return per_frame | _decoding(path, default, images, rounds)


def _search(config: ShippedConfig, engine: str, images: Sequence[Image]) -> Task:
    """Search the images as frames of a video, with alternating window sets."""
    height, width = images[0].shape[:2]
    search = FrameSearch(config.model, config.with_engine(engine), width, height)

    def run() -> None:
        for index, image in enumerate(images):
            search.search(image, search.sets_of(index))

    return run


def _detection(settings: DetectorSettings, images: Sequence[Image]) -> Task:
    """Search the images as frames of a video, and make detections of what is found."""
    height, width = images[0].shape[:2]
    detector = load_detector(settings).for_video(width, height, images[:1])

    def run() -> None:
        for index, image in enumerate(images):
            detector.detect(detector.search(image, index))

    return run


def _detect_multi_scale(images: Sequence[Image]) -> Task:
    """OpenCV's own sliding-window detector: 64×64, stride 8, scale 1.1, rows 380-660."""
    hog = cv2.HOGDescriptor((64, 64), (16, 16), (8, 8), (8, 8), 9)
    weights = np.random.default_rng(0).normal(0, 0.01, hog.getDescriptorSize() + 1)
    hog.setSVMDetector(weights.astype(np.float32))
    bands = [np.ascontiguousarray(image[380:660]) for image in images]

    def run() -> None:
        for band in bands:
            hog.detectMultiScale(band, hitThreshold=5, winStride=(8, 8), scale=1.1)

    return run


def _decoding(
    path: Path, default: ShippedConfig, images: Sequence[Image], rounds: int
) -> dict[str, float]:
    """Time decoding to BGR with one thread, interleaved with the search."""

    def decode() -> None:
        with av.open(str(path)) as container:
            stream = container.streams.video[0]
            stream.thread_type = "NONE"
            for number, frame in enumerate(container.decode(stream)):
                frame.to_ndarray(format="bgr24")
                if number + 1 == DECODED:
                    return

    tasks = {"decoding": decode, "default dense": _search(default, "dense", images)}
    times = measure(tasks, rounds)
    return {
        "decoding": times["decoding"] / DECODED,
        "default dense beside decoding": times["default dense"] / len(images),
    }


def times_per_megapixel(
    images: Sequence[Image], default: ShippedConfig, rounds: int
) -> dict[int, float]:
    """Return the default search's seconds a megapixel for frames of several heights."""
    tasks: dict[str, Task] = {}
    areas: dict[str, float] = {}
    for height in HEIGHTS:
        width = images[0].shape[1] * height // images[0].shape[0]
        scaled = [np.asarray(cv2.resize(image, (width, height)), np.uint8) for image in images[:2]]
        tasks[str(height)] = _search(default, "dense", scaled)
        areas[str(height)] = 2 * width * height / 1e6
    times = measure(tasks, rounds)
    return {int(name): seconds / areas[name] for name, seconds in times.items()}
