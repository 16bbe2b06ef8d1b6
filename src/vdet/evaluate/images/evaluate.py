"""Scores of a detector in several sets of labelled pictures."""

from collections.abc import Sequence
from dataclasses import dataclass

from vdet.detect.protocol import DetectorModel
from vdet.evaluate.images.scores import (
    Counting,
    ImageScores,
    MeasuredImage,
    Source,
    mean_scores,
    score_source,
)
from vdet.evaluate.images.search import search_images
from vdet.labels.pictures import LabelledPictures
from vdet.progress import Progress, no_progress


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
        searched = search_images(each.pictures, model, threads=threads, advance=advance)
        measured = [MeasuredImage.of(image, counting) for image in searched]
        sources.append(score_source(measured, counting))
    return ImagesResult(counting, tuple(sets), tuple(sources), mean_scores(sources, counting))
