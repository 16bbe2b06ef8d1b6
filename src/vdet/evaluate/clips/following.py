"""Cars followed through the same frames under several settings at once.

The search takes nearly all the time, so settings that search alike share it: every frame is
searched once for them, and only heat and tracker are run for each.
"""

from collections.abc import Iterable, Iterator, Sequence

from vdet.config.schema import SearchSettings, Settings
from vdet.detect.svm.detector import Detector
from vdet.detect.svm.model import LinearModel
from vdet.detect.svm.windows import Windows
from vdet.media import Frame
from vdet.media.images import Image
from vdet.pipeline.following import follow, seek_horizon
from vdet.pipeline.threads import quiet_libraries
from vdet.track.factory import tracker_of
from vdet.track.track import Track

Tracks = tuple[Track, ...]


def follow_under_all(
    frames: Iterable[Frame],
    model: LinearModel,
    variants: Sequence[Settings],
    width: int,
    height: int,
) -> Iterator[tuple[Frame, list[Tracks]]]:
    """Give each frame with the tracks shown in it under each of the settings.

    What is given for one setting does not depend on the others, and is what
    `vdet.pipeline.following.follow` gives for it.

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
    rest: Iterable[Frame] = frames
    horizons: dict[_SearchKey, float] = {}
    for settings in variants:
        if (key := _search_key(settings)) not in horizons:
            rest, horizons[key] = seek_horizon(rest, settings)
    followers = [
        _Follower(model, settings, width, height, horizons[_search_key(settings)])
        for settings in variants
    ]
    searchers = {follower.search_key: follower for follower in followers}
    with quiet_libraries():
        for frame in rest:
            found = {key: searcher.search(frame) for key, searcher in searchers.items()}
            tracks = [each.update(frame.image, found[each.search_key]) for each in followers]
            yield frame, tracks


_SearchKey = tuple[int, SearchSettings]


def _search_key(settings: Settings) -> _SearchKey:
    """Return what settings that search alike have in common."""
    return settings.reference_height, settings.search


class _Follower:
    """Detector and tracker under one setting."""

    def __init__(
        self, model: LinearModel, settings: Settings, width: int, height: int, horizon: float
    ) -> None:
        self._detector = Detector(model, settings, width, height, horizon=horizon)
        self._track = tracker_of(settings, width, height)
        self.search_key = _search_key(settings)

    def search(self, frame: Frame) -> Windows:
        return self._detector.search(frame.image, frame.index)

    def update(self, image: Image, windows: Windows) -> Tracks:
        return tuple(self._track(image, self._detector.accumulate(windows).regions))
