"""Which classes found vehicles are given, in pictures and in video."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from evaluate.scenes import TEN, drive, video
from labels.saving import Row
from vdet.boxes import Box, Boxes
from vdet.evaluate.results import Counting, MeasuredImage
from vdet.evaluate.scores import ClassResult, class_results, compare
from vdet.labels.images import LabelledImage
from vdet.track.track import Track


def test_vehicles_of_a_picture_are_counted_by_their_class_and_that_of_their_detection() -> None:
    places, true = [(x, 0, x + 100, 100) for x in range(0, 800, 200)], ["car", "truck", "truck"]
    labels = [
        Track(0, Box(*box), 1.0, "detected", name)
        for box, name in zip(places, [*true, "vehicle"], strict=True)
    ]
    picture = LabelledImage(Path("a.png"), Path("a.txt"), tuple(labels))
    boxes = np.array([*places[:2], places[3], (900, 0, 999, 100)])
    found = Boxes(boxes, [0.9] * 4, classes=[0, 0, 1, 1], names=["car", "truck"])
    shown = MeasuredImage.of(picture, 1000, found, Counting(0.5, 0)).shown
    assert class_results(shown) == (
        ClassResult("car", 1, 1, 1, 0.5, 1, 2 / 3, {"car": 1}),
        ClassResult("truck", 2, 1, 0, 0, 0, 0, {"car": 1}),
    )


def named(name: str, *tracks: list[Row]) -> list[Row]:
    return [(index, replace(track, class_name=name)) for rows in tracks for index, track in rows]


def test_a_vehicle_of_a_video_has_the_last_class_of_the_track_that_finds_it_most() -> None:
    truth = video(named("Lorry", drive(7, TEN), drive(8, TEN, x=300), drive(9, TEN, x=600)))
    found = video(
        named("car", drive(1, range(3)), drive(3, TEN, x=900)),
        named("car", drive(2, range(4, 8))),
        named("truck", drive(2, range(8, 11))),
        named("bus", drive(4, TEN, x=300)),
    )
    truck = ClassResult("truck", 3, 2, 1, 1, 1 / 3, 0.5, {"truck": 1, "bus": 1})
    assert class_results(compare(found, truth)) == (truck,)


def test_there_is_no_table_where_tracks_have_no_class() -> None:
    truth = video(named("car", drive(7, TEN)))
    assert class_results(compare(video(drive(1, TEN)), truth)) == ()
    assert class_results(compare(replace(truth), video(drive(1, TEN)))) == ()
