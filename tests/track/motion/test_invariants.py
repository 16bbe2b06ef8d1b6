"""What holds for the motion tracker whatever it is given."""

from hypothesis import given, settings
from hypothesis import strategies as st

from track.motion.scenes import HEIGHT, WIDTH, follow
from vdet.boxes import Box


@st.composite
def scored_boxes(draw: st.DrawFn) -> tuple[Box, float]:
    """A detection anywhere in the frame or across its border."""
    x = draw(st.integers(-150, WIDTH))
    y = draw(st.integers(-150, HEIGHT))
    box = Box.sized(x, y, draw(st.integers(1, 600)), draw(st.integers(1, 400)))
    return box, draw(st.floats(0, 1))


# A few detections that come back make vehicles live longer than fresh ones in each frame would.
clips = st.lists(scored_boxes(), min_size=1, max_size=5).flatmap(
    lambda pool: st.lists(st.lists(st.sampled_from(pool), max_size=4), max_size=25)
)
Clip = list[list[tuple[Box, float]]]
few = settings(deadline=None, max_examples=50)


@few
@given(clips)
def test_boxes_lie_in_the_frame_and_have_an_area(clip: Clip) -> None:
    for track in (track for tracks in follow(clip) for track in tracks):
        assert track.box.clipped(WIDTH, HEIGHT) == track.box
        assert track.box.area > 0


@few
@given(clips)
def test_ids_are_unique_and_ordered_in_a_frame_and_given_without_gaps(clip: Clip) -> None:
    shown = follow(clip, confirm_seconds=0.04)
    for tracks in shown:
        numbers = [track.id for track in tracks]
        assert numbers == sorted(set(numbers))
    seen = [track.id for tracks in shown for track in tracks]
    assert list(dict.fromkeys(seen)) == list(range(1, len(set(seen)) + 1))


@few
@given(clips, st.integers(0, 25))
def test_the_future_does_not_change_the_past(clip: Clip, frames: int) -> None:
    assert follow(clip[:frames]) == follow(clip)[:frames]
