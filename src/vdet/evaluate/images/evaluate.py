"""Scores of a detector in several sets of labelled pictures, which are searched in parallel."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from vdet.config.schema import Settings
from vdet.detect.protocol import DetectorModel
from vdet.evaluate.images.scores import (
    Counting,
    ImageScores,
    MeasuredImage,
    Source,
    mean_scores,
    score_source,
)
from vdet.labels.pictures import LabelledPicture, LabelledPictures
from vdet.progress import Progress, no_progress
from vdet.run.pictures import detect_picture
from vdet.run.threads import map_ordered


@dataclass(frozen=True, slots=True, eq=False)
class ImagesResult:
    """What counted, the sets of pictures, the scores of each, and their mean."""

    counting: Counting
    sets: tuple[LabelledPictures, ...]
    sources: tuple[Source, ...]
    mean: ImageScores

    @property
    def named(self) -> list[tuple[str, ImageScores]]:
        """The name and the scores of each set, and of the mean of several."""
        scores = [source.scores for source in self.sources]
        named = [(each.name, one) for each, one in zip(self.sets, scores, strict=True)]
        counted = sum(one.vehicles > 0 for one in scores)
        return [*named, *([(f"mean of {counted}", self.mean)] if len(named) > 1 else [])]


def evaluate_images(
    sets: Sequence[LabelledPictures],
    model: DetectorModel,
    counting: Counting,
    *,
    threads: int = 1,
    progress: Progress = no_progress,
) -> ImagesResult:
    """Search all pictures, each for itself, and score each set.

    Parameters
    ----------
    model
        A detector that shows detections of every score, or at least those of `counting.score`.
    progress
        Called with the number of pictures; what it returns is called with 1 for each.

    Raises
    ------
    ImageError
        A picture cannot be read or searched; the message names it.
    """
    advance = progress(sum(len(each.pictures) for each in sets))
    sources = []
    for each in sets:
        measured = measure(each.pictures, model, counting, threads=threads, advance=advance)
        sources.append(score_source(measured, counting))
    return ImagesResult(counting, tuple(sets), tuple(sources), mean_scores(sources, counting))


def measure(
    pictures: Sequence[LabelledPicture],
    model: DetectorModel,
    counting: Counting,
    *,
    threads: int = 1,
    advance: Callable[[int], object] = lambda _: None,
) -> list[MeasuredImage]:
    """Search pictures, each on its own; `advance` is called with 1 after each.

    Raises
    ------
    ImageError
        A picture cannot be read or searched; the message names it.
    """
    settings = Settings()  # the whole picture, and no step

    def search(labelled: LabelledPicture) -> MeasuredImage:
        image = labelled.read()
        found = detect_picture(labelled.path, image, model, settings).detections
        return MeasuredImage.of(labelled, image.shape[1], found, counting)

    measured = []
    with map_ordered(search, pictures, threads) as results:
        for _, result in results:
            measured.append(result)
            advance(1)
    return measured
