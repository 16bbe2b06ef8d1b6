from evaluate.scenes import drive, video
from vdet.evaluate.comparison import compare, match
from vdet.labels.video import LabelledVideo


def partners(prediction: LabelledVideo, truth: LabelledVideo) -> list[dict[int, int]]:
    """Return for each frame the id of the track that found each vehicle, by the vehicle's id."""
    comparison = compare(prediction, truth)
    return [
        dict(
            zip(
                comparison.vehicle_ids[frame.vehicles].tolist(),
                comparison.track_ids[frame.tracks].tolist(),
                strict=True,
            )
        )
        for frame in match(comparison)
    ]


def test_an_overlap_of_a_half_finds_a_vehicle_and_less_does_not() -> None:
    truth = video(drive(1, range(1, 2)))
    assert partners(video(drive(5, range(1, 2), width=50)), truth) == [{1: 5}]
    assert partners(video(drive(5, range(1, 2), width=49)), truth) == [{}]


def test_of_two_predictions_the_closer_one_finds_the_vehicle() -> None:
    found = video(drive(5, range(1, 2), x=20), drive(6, range(1, 2), x=10))
    assert partners(found, video(drive(1, range(1, 2)))) == [{1: 6}]


def test_a_pair_is_kept_even_if_another_track_comes_closer() -> None:
    found = video(drive(5, range(1, 3), x=20), drive(6, range(2, 3), x=0))
    assert partners(found, video(drive(1, range(1, 3)))) == [{1: 5}, {1: 5}]


def test_a_pair_that_overlaps_too_little_is_split() -> None:
    found = video(drive(5, range(1, 2)) + drive(5, range(2, 3), x=60), drive(6, range(2, 3), x=20))
    assert partners(found, video(drive(1, range(1, 3)))) == [{1: 5}, {1: 6}]


def test_a_pair_split_for_a_frame_is_not_preferred_afterwards() -> None:
    # In frame 2 something is predicted, but not on the vehicle.
    found = video(
        drive(5, range(1, 2)) + drive(5, range(3, 4), x=20),
        drive(6, range(3, 4), x=10),
        drive(7, range(2, 3), x=500),
    )
    assert partners(found, video(drive(1, range(1, 4)))) == [{1: 5}, {}, {1: 6}]


def test_a_frame_without_predictions_does_not_split_a_pair() -> None:
    found = video(drive(5, range(1, 2)) + drive(5, range(3, 4), x=20), drive(6, range(3, 4), x=10))
    assert partners(found, video(drive(1, range(1, 4)))) == [{1: 5}, {}, {1: 5}]


def test_the_pairs_have_their_overlap() -> None:
    comparison = compare(video(drive(5, range(1, 2), width=80)), video(drive(1, range(1, 2))))
    (frame,) = match(comparison)
    assert frame.iou.tolist() == [0.8]
