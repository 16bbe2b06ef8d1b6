"""The page on videos: its contents, not its looks."""

from pathlib import Path

import numpy as np

from labels.saving import checked_video, row
from pages.html import Elements
from vdet.evaluate.show_video import mistake_tiles, video_page
from vdet.evaluate.tiles import FOUND, TRUE
from vdet.evaluate.video import RunResult, score_video
from vdet.labels.label import Label
from vdet.labels.video import LabelledVideo

TEN = range(1, 11)


def video(*rows: Label) -> LabelledVideo:
    return checked_video(rows)


def drive(id_: int, frames: range, x: float = 0) -> list[Label]:
    return [row(0, frame, id_, x, 60, 40, 40) for frame in frames]


def test_a_timeline_names_vehicles_tracks_and_false_alarms() -> None:
    found = video(*drive(4, range(1, 5)), *drive(9, range(6, 11)), *drive(5, TEN, x=200))
    clip = score_video("clip", found, video(*drive(7, TEN)))
    text = Elements(video_page([RunResult.of((), [clip])], "")).text
    for name in ("vehicle 7", "#4", "#9", "missed: 5–5", "false alarms", "false alarm, track 5"):
        assert name in text


def test_a_mistake_is_shown_by_its_middle_frame_with_boxes(clip_path: Path) -> None:
    found = video(*drive(1, TEN, x=20), *drive(2, range(2, 5), x=250))
    result = score_video("clip", found, video(*drive(7, TEN)), video=clip_path)
    tiles = {tile.title: tile for tile in mistake_tiles(result)}
    assert set(tiles) == {
        "vehicle 7 missed, frame 5",
        "false alarm, track 1, frame 5",
        "false alarm, track 2, frame 3",
    }
    missed = tiles["vehicle 7 missed, frame 5"]
    assert missed.image.shape[1] == 330
    for color in (TRUE, FOUND):
        assert np.any((missed.image == color).all(axis=2))


def test_the_picture_of_a_mistake_at_the_edge_lies_inside_the_frame(clip_path: Path) -> None:
    result = score_video("clip", video(), video(*drive(7, TEN, x=290)), video=clip_path)
    (picture,) = mistake_tiles(result)
    assert picture.image[:, -8:].any(axis=2).mean() > 0.9, "no black border"
