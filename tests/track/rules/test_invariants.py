"""What holds for the rules tracker whatever it is given."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from seed import tracker_but
from vdet.boxes import Box, Boxes, Image
from vdet.config.tracker import RulesTrackerSettings
from vdet.media import Picture
from vdet.track.rules.tracker import RulesTracker
from vdet.track.track import Track

WIDTH, HEIGHT = 320, 180
TEXTURED = np.random.default_rng(0).integers(0, 256, (HEIGHT, WIDTH, 3), dtype=np.uint8)
PICTURES = [TEXTURED, np.roll(TEXTURED, 9, axis=1), np.full_like(TEXTURED, 128)]

# Small lengths, so that every rule is applied in a small frame.
EAGER = tracker_but(
    min_region=10,
    near=15,
    wide=60,
    max_combined=80,
    merge_overlap=5,
    match_distance=15,
    detections_needed=3,
    confident_detections_needed=2,
    young=2,
    max_matches=4,
    max_misses=2,
)


@st.composite
def regions(draw: st.DrawFn) -> tuple[Box, float]:
    """A region anywhere in the frame or across its border."""
    x = draw(st.integers(-30, WIDTH))
    y = draw(st.integers(-30, HEIGHT))
    box = Box.sized(x, y, draw(st.integers(1, 120)), draw(st.integers(1, 90)))
    return box, draw(st.floats(1.4, 9))


pictures = st.sampled_from(PICTURES)
frames = st.tuples(pictures, st.lists(regions(), max_size=4))
# A few regions that come back make cars live longer than fresh ones in each frame would.
lasting = st.lists(regions(), min_size=1, max_size=4).flatmap(
    lambda pool: st.lists(
        st.tuples(pictures, st.lists(st.sampled_from(pool), max_size=4)), max_size=20
    )
)
clips = st.lists(frames, max_size=12) | lasting
Clip = list[tuple[Image, list[tuple[Box, float]]]]


def run(clip: Clip, tracker: RulesTrackerSettings) -> list[list[Track]]:
    cars = RulesTracker(tracker)
    return [
        cars.update(_detections(found), n / 25, Picture(image))
        for n, (image, found) in enumerate(clip)
    ]


def _detections(found: list[tuple[Box, float]]) -> Boxes:
    corners = [(box.x1, box.y1, box.x2, box.y2) for box, _ in found]
    return Boxes(corners, [1.0] * len(found), data={"strength": [peak for _, peak in found]})


@settings(deadline=None)
@given(clips)
def test_ids_are_given_without_gaps_from_1_on(clip: Clip) -> None:
    shown = [track.id for tracks in run(clip, EAGER) for track in tracks]
    assert list(dict.fromkeys(shown)) == list(range(1, len(set(shown)) + 1))


@settings(deadline=None)
@given(clips)
def test_boxes_lie_in_the_frame_and_are_not_too_small(clip: Clip) -> None:
    for tracks in run(clip, EAGER):
        for track in tracks:
            assert min(track.box.x1, track.box.y1) >= 0
            assert track.box.x2 <= WIDTH + 1  # place and size are rounded each for itself
            assert track.box.y2 <= HEIGHT + 1
            assert min(track.box.width, track.box.height) >= EAGER.min_region
