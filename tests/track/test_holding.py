from boxing import moved_to
from vdet.boxes import NO_BOXES, Box, Boxes
from vdet.media import Picture
from vdet.track.factory import HoldingTracker
from vdet.track.track import Track

CAR = Box.sized(100, 100, 50, 40)


class SeesOne:
    """A tracker that shows one vehicle in each frame that it gets, and notes the times."""

    def __init__(self) -> None:
        self.times: list[float] = []

    def update(
        self,
        detections: Boxes,  # noqa: ARG002
        time: float,
        picture: Picture | None = None,  # noqa: ARG002
    ) -> list[Track]:
        self.times.append(time)
        return [Track(1, moved_to(CAR, 100 + round(100 * time), 100), 0.9, predicted=False)]


def test_vehicles_stay_where_they_were_in_frames_that_are_not_searched() -> None:
    tracker = HoldingTracker(SeesOne())
    (seen,) = tracker.update(NO_BOXES, 1.0)
    for time in (1.1, 1.2):
        (held,) = tracker.carry(time)
        assert (held.id, held.box, held.score) == (seen.id, seen.box, seen.score)
        assert held.predicted
    assert not seen.predicted
