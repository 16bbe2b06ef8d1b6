"""`make folds`: a five-fold check of the thresholds, on frames that the model has not seen.

The labelled frames are cut into five blocks. The model that searches a block was trained without
the vehicles and false alarms mined from it. Each threshold is chosen on four blocks and scored on
the fifth.
"""

import argparse
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from itertools import compress
from pathlib import Path

import joblib
import numpy as np
import numpy.typing as npt

from benchmarks.drawn_traffic import shown_labels
from vdet.boxes import NO_BOXES, Boxes
from vdet.config.loading import load_settings
from vdet.config.schema import Settings
from vdet.detect.svm.detector import Candidates, SvmDetector, SvmModel
from vdet.detect.svm.model import LinearModel
from vdet.detect.svm.windows import Windows
from vdet.evaluate.scores import score
from vdet.labels.label import SavedTracks
from vdet.labels.reading import read_truth
from vdet.learn.svm.patches import PatchFile, extract, find_patches
from vdet.learn.svm.training import fit, fit_boxes
from vdet.media import Frame, Picture
from vdet.media.reader import VideoReader
from vdet.run.loop import Pipeline, peek
from vdet.run.search import SearchRate
from vdet.track.factory import make_tracker
from vdet.workers import limit_library_threads

BLOCKS = 5
MIN_PROBABILITY = 0.2  # probability of the windows that are kept for the sweeps
SETTINGS = (
    f"detector.search.probability={MIN_PROBABILITY}",
    "train.svm.augmentation=false",  # half the memory, a third of the time
)
SWEEPS = {
    "detector.search.probability": (0.2, 0.3, 0.4, 0.5),
    "detector.heat.votes": (0.06, 0.12, 0.18),
    "detector.score.middle": (0.3, 0.4, 0.5, 0.6),
    "tracker.decay": (0.1, 0.2, 0.3),
    "tracker.confirm_seconds": (0.06, 0.1, 0.16),
}

Numbers = npt.NDArray[np.intp]


@dataclass(frozen=True)
class SearchedVideo:
    """The likely windows of each searched frame, by index, from a model that has not seen it."""

    width: int
    height: int
    rate: Fraction
    frames: int
    searches: SearchRate
    windows: dict[int, Windows]


@dataclass(frozen=True)
class Searching:
    """A detector that keeps the likely windows of each frame, and detects nothing.

    Attributes
    ----------
    detectors
        Of each block, from the model that was trained without it.
    last
        Number of frames.
    """

    detectors: Sequence[SvmDetector]
    last: int
    windows: dict[int, Windows] = field(default_factory=dict)

    def search(self, picture: Picture, index: int | None) -> tuple[int, Windows]:
        assert index is not None
        block = int(_block_of(np.array([index + 1]), self.last)[0])
        candidates = self.detectors[block].search(picture, index)
        return index, candidates[0].hits(MIN_PROBABILITY)

    def detect(self, candidates: tuple[int, Windows]) -> Boxes:
        index, self.windows[index] = candidates
        return NO_BOXES


@dataclass(frozen=True)
class Searched:
    """A detector whose frames were searched before."""

    detector: SvmDetector
    windows: dict[int, Windows]

    def search(self, picture: Picture, index: int | None) -> Candidates:  # noqa: ARG002
        assert index is not None
        return self.windows[index], False

    def detect(self, candidates: Candidates) -> Boxes:
        return self.detector.detect(candidates)


def main() -> None:
    """Train five models, search once, and print a table for each threshold."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.folds", description=main.__doc__)
    parser.add_argument("video", type=Path)
    parser.add_argument("truth", type=Path)
    parser.add_argument("patches", type=Path, nargs="+", help="the sets, the mined one among them")
    options = parser.parse_args()
    truth = read_truth(options.truth)
    settings = load_settings((), SETTINGS, detector="svm")
    models = _models(options.patches, truth.length, settings)
    limit_library_threads()
    searched = _search(options.video, truth.length, models, settings)
    for key, values in SWEEPS.items():
        print("\n".join(_sweep(key, values, searched, models[0], truth)), flush=True)


def _block_of(frames: Numbers, last: int) -> Numbers:
    """Return the block of each frame, counted from 1; -1 for patches of no frame (0)."""
    return np.where(frames > 0, (frames - 1) * BLOCKS // last, -1)


def _frames_of(files: Sequence[PatchFile]) -> Numbers:
    found = (re.search(r"/mined_.*/frame(\d+)_", f"/{file.name}") for file in files)
    return np.array([int(match[1]) if match else 0 for match in found], np.intp)


def _models(sources: Sequence[Path], last: int, settings: Settings) -> list[LinearModel]:
    features = settings.svm.features
    data = extract(find_patches(sources), features, augmented=False)

    def without(block: int) -> LinearModel:
        held = np.equal(_block_of(_frames_of(data.files), last), block)
        model = fit(data.of(~(held | data.is_boxed)), settings)
        regression, _ = fit_boxes(data, held, features.hog_length)
        return replace(model, box_regression=regression)

    at_once = joblib.Parallel(n_jobs=2, prefer="threads", verbose=5)
    return list(at_once(joblib.delayed(without)(block) for block in range(BLOCKS)))


def _search(
    video: Path, last: int, models: Sequence[LinearModel], settings: Settings
) -> SearchedVideo:
    """Search each frame with the model that was trained without its block."""
    with VideoReader(video, frames=last) as reader:
        info = reader.info
        images, frames = peek(reader)
        detectors = [
            SvmModel(model, settings.svm).for_video(info.width, info.height, images)
            for model in models
        ]
        searching = Searching(detectors, last)
        searches = SearchRate(settings.detector.searches_per_second, settings.detector.stride)
        tracker = make_tracker(settings, info.width, info.height)
        count = sum(1 for _ in Pipeline(searching, tracker, rate=searches).follow(frames))
    return SearchedVideo(info.width, info.height, info.rate, count, searches, searching.windows)


def _sweep(
    key: str,
    values: Sequence[float],
    searched: SearchedVideo,
    model: LinearModel,
    truth: SavedTracks,
) -> Iterator[str]:
    """Yield the lines of a table: the F1 of each value, over all blocks and by block."""
    variants = [load_settings((), [f"{key}={value}"], detector="svm") for value in values]
    found = [_tracks(searched, model, settings) for settings in variants]
    by_block = np.array([_f1_by_block(item, truth) for item in found])
    yield f"\n{key}: F1, id switches, false tracks, frames until shown; F1 of the blocks"
    for value, item, blocks in zip(values, found, by_block, strict=True):
        whole = score(item, truth)
        numbers = "  ".join(f"{f1:.3f}" for f1 in blocks)
        delay = "-" if whole.mean_delay is None else f"{whole.mean_delay:.1f}"
        yield (
            f"  {value:6}  {whole.f1:.3f} {whole.id_switches:2} {whole.false_tracks:2} {delay:>5}"
            f"   {numbers}"
        )
    chosen = [int((by_block.sum(axis=1) - by_block[:, block]).argmax()) for block in range(BLOCKS)]
    held = np.mean([by_block[value, block] for block, value in enumerate(chosen)])
    picks = ", ".join(f"{values[value]}" for value in chosen)
    yield f"  chosen without each block: {picks}; F1 on the one left out {held:.3f}"


def _tracks(searched: SearchedVideo, model: LinearModel, settings: Settings) -> SavedTracks:
    """Detect and follow vehicles in windows that were searched before; any model will do."""
    size = searched.width, searched.height
    detector = SvmDetector(model, settings.svm, *size)
    tracker = make_tracker(settings, searched.width, searched.height)
    unseen = Picture(np.zeros((1, 1, 3), np.uint8))
    frames = (Frame(n, n / searched.rate, unseen) for n in range(searched.frames))
    found = Searched(detector, searched.windows)
    return shown_labels(Pipeline(found, tracker, rate=searched.searches).follow(frames))


def _f1_by_block(found: SavedTracks, truth: SavedTracks) -> list[float]:
    last = truth.length

    def part(tracks: SavedTracks, block: int) -> SavedTracks:
        blocks = _block_of(np.array([label.frame + 1 for label in tracks.labels]), last)
        return replace(tracks, labels=tuple(compress(tracks.labels, blocks == block)))

    return [score(part(found, block), part(truth, block)).f1 for block in range(BLOCKS)]


if __name__ == "__main__":
    main()
