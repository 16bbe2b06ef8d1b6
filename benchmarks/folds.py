"""The five-fold check of `make folds`: thresholds on frames that the model has not seen.

The labelled frames are cut into five blocks; the vehicles and false alarms mined from a block are
kept from the model that searches it. Every threshold is then chosen on four blocks and scored on
the fifth.
"""

import argparse
import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import joblib
import numpy as np
import numpy.typing as npt
from vdet.pipeline.following import seek_horizon

from vdet.config.loading import load_settings
from vdet.config.schema import Settings
from vdet.detect.svm.detector import Detector
from vdet.detect.svm.model import LinearModel
from vdet.detect.svm.windows import Windows
from vdet.evaluate.labelled_video import LabelledVideo, Row
from vdet.evaluate.scores import score
from vdet.evaluate.truth import read_truth
from vdet.learn.augmentation import views_of
from vdet.learn.boxes import describe_boxes, learn_boxes
from vdet.learn.dataset import PatchFile, find_boxed, find_patches
from vdet.learn.extraction import extract
from vdet.learn.fitting import fit
from vdet.learn.training_set import lesson_of
from vdet.media import VideoReader
from vdet.pipeline.threads import single_threaded_libraries
from vdet.track.factory import Follow, tracker_of
from vdet.workers import make_workers

BLOCKS = 5
LEAST = 0.2  # probability of the windows that are kept for the sweeps
SETTINGS = (
    f"search.probability={LEAST}",
    "training.calibration.folds=2",
    "training.views.mirror=false",  # half the memory and a third of the time of the shipped model
)
SWEEPS = {
    "search.probability": (0.2, 0.3, 0.4, 0.5),
    "heat.votes.least": (0.04, 0.08, 0.12),
    "heat.votes.sharpness": (2.0, 3.0, 4.0, 6.0),
    "heat.votes.agreement": (0.25, 0.35, 0.45),
    "tracker.motion.strong": (0.3, 0.5, 0.6, 0.7, 0.8),
    "tracker.motion.leak": (0.1, 0.2, 0.3),
    "tracker.motion.needed": (1.5, 2.5, 4.0),
}

Numbers = npt.NDArray[np.intp]


def main() -> None:
    """Train five times, search once, sweep, print a table a threshold."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.folds", description=main.__doc__)
    parser.add_argument("video", type=Path)
    parser.add_argument("truth", type=Path)
    parser.add_argument("patches", type=Path, nargs="+", help="the sets, the mined one among them")
    options = parser.parse_args()
    truth = read_truth(options.truth)
    settings = load_settings(None, SETTINGS)
    models = _models(options.patches, truth.last_frame, settings)
    with single_threaded_libraries():
        searched, size = _search(options.video, truth.last_frame, models, settings)
        for key, values in SWEEPS.items():
            print(
                "\n".join(_sweep(key, values, searched, models[0], size=size, truth=truth)),
                flush=True,
            )


def _block_of(frames: Numbers, last: int) -> Numbers:
    """Return the block of each frame, counted from 1; -1 for patches of no frame (0)."""
    return np.where(frames > 0, (frames - 1) * BLOCKS // last, -1)


def _frames_of(files: Sequence[PatchFile]) -> Numbers:
    found = (re.search(r"/mined_.*/frame(\d+)_", f"/{file.name}") for file in files)
    return np.array([int(match[1]) if match else 0 for match in found], np.intp)


def _models(sources: Sequence[Path], last: int, settings: Settings) -> list[LinearModel]:
    files, boxed = find_patches(sources), find_boxed(sources)
    training = settings.training
    workers = make_workers()
    data = extract(
        files,
        settings.features,
        max_broken=0,
        workers=workers,
        look=partial(views_of, settings=training.views),
        seed=training.seed,
    )
    boxes = describe_boxes(files, boxed, settings, workers=workers, progress=lambda _: None)
    assert boxes is not None
    boxed_data = boxes.boxed
    assert boxed_data is not None
    assert boxes.filled is not None
    filled = lesson_of(boxes.filled, np.ones(len(boxes.filled.vectors), bool))
    blocks = _block_of(_frames_of(files), last), _block_of(_frames_of(boxed), last)

    def without(block: int) -> LinearModel:
        kept, kept_boxed = (each != block for each in blocks)
        lesson = lesson_of(data, kept)
        model = fit(lesson.vectors, lesson.vehicle, settings.features, training, lesson.origins)
        told = [lesson, lesson_of(boxed_data, kept_boxed)]
        return replace(model, boxes=learn_boxes(told, filled, settings))

    at_once = joblib.Parallel(n_jobs=2, prefer="threads", verbose=5)
    return list(at_once(joblib.delayed(without)(block) for block in range(BLOCKS)))


def _search(
    video: Path, last: int, models: Sequence[LinearModel], settings: Settings
) -> tuple[list[Windows], tuple[int, int]]:
    """Return the likely windows of each frame, searched by the model that has not seen it."""
    found = []
    with VideoReader(video, frames=last) as reader:
        size = reader.info.width, reader.info.height
        frames, horizon = seek_horizon(reader, settings)
        detectors = [Detector(model, settings, *size, horizon=horizon) for model in models]
        for frame in frames:
            block = int(_block_of(np.array([frame.index + 1]), last)[0])
            windows = detectors[block].search(frame.image, frame.index)
            found.append(windows.detected(LEAST))
    return found, size


def _sweep(
    key: str,
    values: Sequence[float],
    searched: Sequence[Windows],
    model: LinearModel,
    *,
    size: tuple[int, int],
    truth: LabelledVideo,
) -> Iterator[str]:
    """Give the lines of a table: the F1 of each value, whole and block by block."""
    variants = [load_settings(None, [f"{key}={value}"]) for value in values]
    found = [
        _tracks(Detector(model, each, *size), tracker_of(each, *size), searched)
        for each in variants
    ]
    by_block = np.array([_f1_by_block(each, truth) for each in found])
    yield f"\n{key}: F1, id switches, false tracks; F1 of the blocks"
    for value, each, blocks in zip(values, found, by_block, strict=True):
        whole = score(each, truth)
        numbers = "  ".join(f"{f1:.3f}" for f1 in blocks)
        yield (
            f"  {value:6}  {whole.f1:.3f} {whole.id_switches:2} {whole.false_tracks:2}   {numbers}"
        )
    chosen = [int((by_block.sum(axis=1) - by_block[:, block]).argmax()) for block in range(BLOCKS)]
    held = np.mean([by_block[value, block] for block, value in enumerate(chosen)])
    picks = ", ".join(f"{values[value]}" for value in chosen)
    yield f"  chosen without each block: {picks}; F1 on the one left out {held:.3f}"


def _tracks(detector: Detector, track: Follow, searched: Sequence[Windows]) -> LabelledVideo:
    blank = np.zeros((1, 1, 3), np.uint8)
    rows = []
    for number, windows in enumerate(searched, start=1):
        for each in track(blank, detector.accumulate(windows).regions):
            box = each.box
            rows.append(Row(0, number, each.id, box.x, box.y, box.width, box.height))
    return LabelledVideo.from_rows(rows, frame_count=len(searched), rate=25.0)


def _f1_by_block(found: LabelledVideo, truth: LabelledVideo) -> list[float]:
    last = truth.last_frame
    parts = [
        [each.where(_block_of(each.frames, last) == block) for each in (found, truth)]
        for block in range(BLOCKS)
    ]
    return [score(prediction, part).f1 for prediction, part in parts]


if __name__ == "__main__":
    main()
