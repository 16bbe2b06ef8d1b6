from pathlib import Path

import pytest

from labels.saving import car, checked_video, frame, row, written
from labels.writers import exported
from vdet.boxes import Box
from vdet.errors import TruthError
from vdet.evaluate.results import score_files
from vdet.evaluate.scores import compare
from vdet.labels.formats import Format, track_formats
from vdet.labels.lines import MOT as MOT_FORMAT
from vdet.labels.reading import read_truth

MOT = "1,7,11,21,30,40,1,3,1\n2,7,11,21,30,40,1,3,1\n"
CSV = "frame,time,id,x,y,width,height,class\n0,0,7,11,21,30,40,car\n"


def write(tmp_path: Path, content: str) -> Path:
    path = tmp_path / "truth"
    path.write_text(content, encoding="utf-8")
    return path


def test_a_frame_beyond_the_video_is_refused(tmp_path: Path) -> None:
    path = write(tmp_path, MOT)
    truth = read_truth(path)
    truth.check_end(Path("a.mp4"), 2)
    with pytest.raises(TruthError, match=r"a\.mp4: has 1 frames, but .* has a box in frame 2"):
        truth.check_end(Path("a.mp4"), 1)


@pytest.mark.parametrize("content", [MOT + CSV, CSV + MOT])
def test_mixed_formats_are_refused_where_the_second_begins(tmp_path: Path, content: str) -> None:
    with pytest.raises(TruthError, match=r"truth:3: .* has \d"):
        read_truth(write(tmp_path, content))


def test_an_unknown_label_is_refused_with_its_line(tmp_path: Path) -> None:
    path = write(tmp_path, f"{CSV}0,0,8,11,21,30,40,Spaceship")
    with pytest.raises(TruthError, match=r"truth:3: label 'Spaceship' is unknown; set its role"):
        read_truth(path)


@pytest.mark.parametrize(
    "form", [track_format for track_format in track_formats() if track_format is not MOT_FORMAT]
)
def test_tracks_of_every_format_can_be_truth(tmp_path: Path, form: Format) -> None:
    path = tmp_path / f"truth{form.suffix}"
    kinds = (None, "bus", "person")
    tracks = [car(number, class_name=name) for number, name in enumerate(kinds, start=1)]
    path.write_bytes(written(form, [frame(2, *tracks)]))
    ((index, labels),) = read_truth(path).frames.items()
    assert [(index, label.id, label.score) for label in labels] == [
        *((2, 1, 1), (2, 2, 1), (2, 3, 1))
    ]
    assert {label.box for label in labels} == {Box(10, 20, 40, 60)}
    assert [label.ignored for label in labels] == [False, False, True]


STEPPED = {
    "a.json": exported({0: [1], 5: [1], 10: [1]}).decode(),
    "a.jsonl": "".join(
        f'{{"frame": {f}, "time": {f}, "tracks": '
        '[{"id": 1, "x": 1, "y": 1, "width": 8, "height": 8}]}\n'
        for f in (0, 5, 10)
    ),
}


@pytest.mark.parametrize("name", STEPPED)
def test_only_frames_that_the_truth_is_about_are_compared(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    path.write_text(STEPPED[name])
    truth = read_truth(path)
    found = checked_video([row(0, n, 1, 1, 1, 8, 8) for n in range(11) if n != 5])
    comparison = compare(found, truth)
    assert [frame.number for frame in comparison.frames] == [0, 5, 10]
    assert truth.spread(4, 0, 11) == {0, 5, 10}


def test_what_is_found_after_the_last_vehicle_is_false(tmp_path: Path) -> None:
    path, found = tmp_path / "gt.json", tmp_path / "found.txt"
    path.write_bytes(exported({0: [1], 5: [], 10: []}))
    found.write_text("".join(f"{n},1,2,2,8,8,1,-1,-1,-1\n" for n in (1, 6, 11)))
    result = score_files(found, path)
    assert (result.until, result.scores.false_positives, result.scores.vehicle_boxes) == (11, 2, 1)
    assert read_truth(path).until(8).length == 6
