"""The charts and pictures of the report on videos: their contents, not their looks."""

from pathlib import Path

import numpy as np

from vdet.evaluate.clips.evaluate import RunResult, score_video, total
from vdet.evaluate.report.video_charts import sweep_chart, tightness_chart, timeline_chart
from vdet.evaluate.report.video_page import FOUND_COLOR, TILE, TRUE_COLOR, loss_pictures
from vdet.labels.rows import Row
from vdet.labels.video import LabelledVideo, checked_video

TEN = range(1, 11)


def video(*rows: Row) -> LabelledVideo:
    return checked_video(Path("scene"), rows)


def drive(id_: int, frames: range, x: float = 0) -> list[Row]:
    return [Row(0, frame, id_, x, 60, 40, 40) for frame in frames]


def run(assignments: tuple[str, ...], found: range) -> RunResult:
    clip = score_video("clip", video(*drive(1, found)), video(*drive(7, TEN)))
    return RunResult(assignments, (clip,), total([clip]))


def test_a_timeline_names_vehicles_tracks_and_false_alarms() -> None:
    found = video(*drive(4, range(1, 5)), *drive(9, range(6, 11)), *drive(5, TEN, x=200))
    svg = timeline_chart(score_video("clip", found, video(*drive(7, TEN))))
    for name in ("vehicle 7", "#4", "#9", "false alarms"):
        assert f"<!-- {name} -->" in svg


def test_a_timeline_without_vehicles_can_be_drawn() -> None:
    svg = timeline_chart(score_video("clip", video(), video()))
    assert "<!-- false alarms -->" in svg


def test_a_sweep_names_the_values_of_its_key() -> None:
    svg = sweep_chart([run((f"heat.threshold={n}",), range(1, 11 - n)) for n in (1, 2, 4)])
    for name in ("1", "2", "4"):
        assert f"<!-- {name} -->" in svg


def test_a_grid_has_a_line_for_each_value_of_the_second_key() -> None:
    grid = [run((f"a={a}", f"b={b}"), range(1, 3 + a + b)) for a in (1, 2) for b in (1, 2)]
    svg = sweep_chart(grid)
    assert "<!-- b=1 -->" in svg
    assert "<!-- b=2 -->" in svg


def test_a_sweep_in_which_nothing_is_found_can_be_drawn() -> None:
    assert "<svg" in sweep_chart([run((f"a={n}",), range(0)) for n in (1, 2)])


def test_the_same_chart_twice_is_the_same_file() -> None:
    assert tightness_chart(run((), TEN)) == tightness_chart(run((), TEN))


def test_a_loss_is_shown_by_its_middle_frame_with_boxes(clip_path: Path) -> None:
    found = video(*drive(1, TEN, x=20), *drive(2, range(2, 5), x=250))
    result = score_video("clip", found, video(*drive(7, TEN)), video=clip_path)
    (missed,) = loss_pictures(result, "missed")
    assert missed.title == "vehicle 7 missed, frame 5"
    assert missed.image.shape == (TILE[1], TILE[0], 3)
    for color in (TRUE_COLOR, FOUND_COLOR):
        assert np.any((missed.image == color).all(axis=2))
    titles = [picture.title for picture in loss_pictures(result, "false alarm")]
    assert titles == ["false alarm, track 1, frame 5", "false alarm, track 2, frame 3"]


def test_the_picture_of_a_loss_at_the_edge_lies_inside_the_frame(clip_path: Path) -> None:
    result = score_video("clip", video(), video(*drive(7, TEN, x=290)), video=clip_path)
    (picture,) = loss_pictures(result, "missed")
    assert picture.image[:, -8:].any(axis=2).mean() > 0.9, "no black border"


def test_without_a_video_there_are_no_pictures() -> None:
    assert loss_pictures(score_video("clip", video(), video(*drive(7, TEN))), "missed") == []
