"""How results are shown: what stands in tables, values and pages, not how it looks."""

from dataclasses import astuple, replace
from pathlib import Path

import numpy as np

from evaluate.scenes import TEN, drive, video
from labels.saving import Row, checked_video, row
from labels.writers import Boxed, Labelled, write_coco
from pages.html import Elements
from vdet.boxes import Box, Boxes
from vdet.evaluate.results import (
    DETECTED,
    TRUE,
    ClipResult,
    Counting,
    MeasuredImage,
    MeasuredSet,
    RunName,
    images_report,
    mistake_tiles,
    video_report,
    worst_tiles,
)
from vdet.evaluate.scores import compare
from vdet.labels.reading import read_labelled_images

NAME = RunName("svm", None, None, ("b=1",))


class TestVideo:
    def clips(self, *found: range) -> list[ClipResult]:
        """Return as many clips; in each the vehicle is found in these of ten frames."""
        truth = video([(n, replace(track, class_name="car")) for n, track in drive(1, TEN)])
        tracks = [
            [(n, replace(track, class_name="bus")) for n, track in drive(1, frames)]
            for frames in found
        ]
        comparisons = [compare(video(track), truth) for track in tracks]
        return [ClipResult(f"clip {n}", one, 10) for n, one in enumerate(comparisons)]

    def test_several_clips_have_a_row_each_and_a_total_and_classes_a_table(self) -> None:
        report = video_report(self.clips(TEN, range(1, 6)), NAME)
        lines = report.lines
        assert [line.split("  ")[0] for line in lines[3:6]] == ["clip 0", "clip 1", "total"]
        assert lines[7].split("  ")[0] == "class"
        assert lines[8].split() == ["car", "2", "2", "0", "0.000", "0.000", "0.000", "bus", "2"]
        assert [value["named"] for value in report.values["classes"]] == [{"bus": 2}]
        assert "clip 1" in Elements(report.page()).text


class TestMistakesInVideo:
    def low(self, id_: int, frames: range, x: float = 0) -> list[Row]:
        return [row(0, frame, id_, x, 60, 40, 40) for frame in frames]

    def test_one_is_shown_by_its_middle_frame_with_boxes(self, clip_path: Path) -> None:
        found = checked_video([*self.low(1, TEN, x=20), *self.low(2, range(1, 4), x=250)])
        truth = checked_video(self.low(7, TEN))
        tiles = mistake_tiles(clip_path, compare(found, truth))
        images = {tile.title: tile.image for tile in tiles}
        assert set(images) == {
            "missed vehicle 7, frame 5",
            "false alarm, track 1, frame 5",
            "false alarm, track 2, frame 3",
        }
        missed = images["missed vehicle 7, frame 5"]
        for color in (TRUE, DETECTED):
            assert np.any((missed == color).all(axis=2))

    def test_the_picture_of_one_at_the_edge_lies_inside_the_frame(self, clip_path: Path) -> None:
        truth = checked_video(self.low(7, TEN, x=290))
        (picture,) = mistake_tiles(clip_path, compare(video(), truth))
        assert picture.image[:, -8:].any(axis=2).mean() > 0.9, "no black border"


class TestPictures:
    COUNTING = Counting(0.5, 0.0)
    CAR = Boxed("car", (20, 10, 40, 30))

    def measured(self, folder: Path, *found: tuple[float, float, float, float]) -> MeasuredSet:
        """Return the set where these boxes are found in two pictures, one without a car."""
        cow = Boxed("cow", (0, 0, 5, 5))
        pictures = {"a": Labelled(100, 60, (self.CAR, cow)), "b": Labelled(100, 60)}
        labelled = read_labelled_images(write_coco(folder, pictures))
        boxes = np.array([astuple(Box.sized(*box)) for box in found], np.float64).reshape(-1, 4)
        shown = Boxes(boxes, np.full(len(found), 0.9))
        images = [
            MeasuredImage.of(picture, 100, shown, self.COUNTING) for picture in labelled.images
        ]
        return MeasuredSet(labelled, images)

    def test_a_page_where_nothing_is_found_can_be_made(self, tmp_path: Path) -> None:
        report = images_report([self.measured(tmp_path)], self.COUNTING, NAME)
        assert "1 missed" in report.page()

    def test_those_with_mistakes_are_shown_with_their_boxes(self, tmp_path: Path) -> None:
        first, second = worst_tiles(self.measured(tmp_path, (70, 10, 20, 30)))
        assert (first.title, first.caption) == ("a.png", "1 missed, 1 false alarm")
        assert (second.title, second.caption) == ("b.png", "0 missed, 1 false alarm")
        for color in (TRUE, DETECTED):
            assert np.any((first.image == color).all(axis=2))
