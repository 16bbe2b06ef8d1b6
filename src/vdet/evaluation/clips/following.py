"""Cars followed through the same frames under several settings at once.

The search takes nearly all the time, so settings that search alike share it: every frame is
searched once for them, and only heat and tracker are run for each.
"""

from collections.abc import Iterable, Iterator, Sequence

from vdet.config.scaling import scale_lengths
from vdet.config.schema import SearchSettings, Settings
from vdet.detection import Detector
from vdet.following import follow
from vdet.images import Image
from vdet.model import LinearModel
from vdet.stream import quiet_libraries
from vdet.tracking.cars import Cars
from vdet.tracking.track import Track
from vdet.video import Frame
from vdet.windows import Windows

Tracks = tuple[Track, ...]


def follow_under_all(
    frames: Iterable[Frame],
    model: LinearModel,
    variants: Sequence[Settings],
    width: int,
    height: int,
) -> Iterator[tuple[Frame, list[Tracks]]]:
    """Give each frame with the tracks shown in it under each of the settings.

    What is given for one setting does not depend on the others, and is what `vdet.pipeline.follow`
    gives for it.

    Raises
    ------
    ImageError
        No search window fits into such a frame.
    """
    if len(variants) == 1:
        with quiet_libraries():
            for result in follow(frames, model, variants[0], width, height):
                yield result.frame, [result.tracks]
        return
    followers = [_Follower(model, settings, width, height) for settings in variants]
    searchers = {follower.search_key: follower for follower in followers}
    with quiet_libraries():
        for frame in frames:
            found = {key: searcher.search(frame.image) for key, searcher in searchers.items()}
            tracks = [each.update(frame.image, found[each.search_key]) for each in followers]
            yield frame, tracks


def _search_key(settings: Settings) -> tuple[int, SearchSettings]:
    """Return what the search depends on; which windows count as detections is said after it."""
    return settings.reference_height, settings.search.model_copy(update={"probability": 0.0})


class _Follower:
    """Detector and tracker under one setting."""

    def __init__(self, model: LinearModel, settings: Settings, width: int, height: int) -> None:
        factor = height / settings.reference_height
        self._detector = Detector(model, settings, width, height)
        self._cars = Cars(scale_lengths(settings.tracker, factor))
        self.search_key = _search_key(settings)

    def search(self, image: Image) -> Windows:
        return self._detector.search(image)

    def update(self, image: Image, windows: Windows) -> Tracks:
        return tuple(self._cars.update(image, self._detector.accumulate(windows).regions))
