"""Ground truth: what its labels mean, and its frames."""

import math
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from labels.saving import Row, car, checked_video, frame, row, video_of, written
from labels.writers import exported
from vdet.boxes import Box
from vdet.config.loading import load_settings
from vdet.config.schema import Role
from vdet.errors import TruthError
from vdet.evaluate.results import score_files
from vdet.evaluate.scores import compare
from vdet.labels.label import NO_ID, Format, SavedTracks, SourceVideo, numbered_lines, track_formats
from vdet.labels.lines import MOT as MOT_FORMAT
from vdet.labels.reading import Roles, read_truth

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
    assert index == 2
    assert [(label.id, label.score) for label in labels] == [(1, 1), (2, 1), (3, 1)]
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


ROLES: list[tuple[list[str], dict[Role | None, str]]] = [
    (
        [],
        {
            "vehicle": "Car, van, TRUCK, lorry, bus, vehicle, Pick-up, tuk-tuk, Motorbike, Cyclist",
            "ignored": "DontCare, dont_care, Ignore region, Misc, trailer, Pedestrian, rider",
            None: "cow, traffic sign, ",
        },
    ),
    (
        ["labels.roles={pedestrian: vehicle, tram: other, cow: ignored}"],
        {"vehicle": "person, car", "other": "Tram", "ignored": "cow, misc, dont care"},
    ),
    (  # classes that the detector does not look for are ignored
        ["detector.classes=[truck, tractor]"],
        {"vehicle": "truck, tractor", "ignored": "car, bus, motorcycle, bicycle, person, vehicle"},
    ),
    (
        ["detector.classes=[vehicle]"],
        {"vehicle": "car, truck, bus, vehicle", "ignored": "motorcycle, bicycle, person"},
    ),
    (  # what the detector finds is no background
        ["detector.classes=[car, bicycle]", "labels.roles={cyclist: other, person: other}"],
        {"vehicle": "car", "ignored": "bicycle", "other": "person"},
    ),
]


@pytest.mark.parametrize(("assignments", "expected"), ROLES)
def test_settings_give_each_word_its_role_in_any_spelling(
    assignments: list[str], expected: dict[Role | None, str]
) -> None:
    roles = Roles.from_settings(load_settings((), assignments))
    for role, words in expected.items():
        found = {word: roles.role_of(word) for word in words.split(", ")}
        assert set(found.values()) == {role}, found


@pytest.mark.parametrize(
    ("classes", "learnt"),
    [
        (["car", "tractor"], {"Car": "car", "tractor": "tractor", "rickshaw": "vehicle"}),
        (["person"], {"pedestrian": "person"}),
    ],
)
def test_a_network_learns_its_classes_and_vehicles_of_unknown_kind(
    classes: list[str], learnt: dict[str, str]
) -> None:
    roles = Roles.for_training(load_settings((), [f"train.net.classes={classes}"]))
    words = ("Car", "bus", "tractor", "rickshaw", "pedestrian", "rider", "cow")
    found = {word: roles.class_of(word) for word in words if roles.role_of(word) == "vehicle"}
    assert found == learnt


def test_until_keeps_the_frames_up_to_the_last() -> None:
    rows = [row(0, frame, id_, 10 * id_, 0, 5, 5) for frame in (1, 2, 4) for id_ in (1, 2)]
    part = checked_video(rows).until(3)
    assert {index: len(tracks) for index, tracks in part.frames.items()} == {1: 2, 2: 2}
    assert part.length == 3


NOW = 1_777_618_800.0


@pytest.mark.parametrize(
    ("times", "rate", "expected"),
    [
        ({0: 0.0, 2: 0.08}, None, {0: 0.0, 2: 0.08}),
        ({0: 1.4, 2: 1.48}, None, {0: 0.0, 2: 0.08}),
        ({0: -0.12, 2: -0.04}, None, {0: 0.0, 2: 0.08}),
        ({37: 3601.48, 38: 3601.52}, None, {37: 1.48, 38: 1.52}),
        ({10: NOW + 1, 12: NOW + 1.2}, 10.0, {10: 1.0, 12: 1.2}),
        ({1500: 63.0, 1501: 63.04}, None, {1500: 63.0, 1501: 63.04}),  # the rate varies
        ({25: 1.0}, 25.0, {25: 1.0}),
    ],
)
def test_times_count_from_the_first_frame_of_the_video(
    times: dict[int, float], rate: float | None, expected: dict[int, float]
) -> None:
    begin = datetime(2026, 5, 1, 7, tzinfo=UTC)
    saved = SavedTracks({}, times=times, begin=begin, video=SourceVideo("a.ts", 9, 9, rate=rate))
    counted = saved.from_first_frame()
    assert counted.times == pytest.approx(expected, abs=1e-5)
    assert counted.begin is not None
    moments = [
        [(tracks.begin + timedelta(seconds=time)).timestamp() for time in tracks.times.values()]
        for tracks in (saved, counted)
        if tracks.begin
    ]
    assert moments[0] == pytest.approx(moments[1]), "the clock times are the same"


FILE = Path("gt.txt")


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        (row(7, -1, 1, 0, 0, 5, 5), "the frame comes before the video's first"),
        (row(7, 1, -1, 0, 0, 5, 5), "id -1 is negative"),
        (row(7, 1, -2, 0, 0, 5, 5, ignored=True), "id -2 is negative"),
        (row(7, 1, 3, 9, 9, 5, 5), "id 3 occurs twice in the same frame"),
        (row(7, 1, 1, 0, 0, 0, 5), "the box has no area: 0 wide, 5 high"),
        (row(7, 1, 1, 0, 0, -5, -5), "the box has no area: -5 wide, -5 high"),
        (row(7, 1, 1, 0, 0, 1e-200, 1e-200), "the box has no area"),
    ],
)
def test_an_impossible_row_is_refused_with_its_line(wrong: Row, message: str) -> None:
    rows = [row(1, 1, 3, 0, 0, 5, 5), row(2, 2, 3, 0, 0, 5, 5), wrong]
    with pytest.raises(TruthError) as caught:
        checked_video(rows, FILE)
    assert str(caught.value).startswith(f"gt.txt:7: {message}")


def test_a_frame_may_have_many_ignore_regions_without_an_id() -> None:
    rows = [row(line, 1, NO_ID, 0, 0, 5, 5, ignored=True) for line in (1, 2, 3)]
    assert len(checked_video(rows, FILE).frames[1]) == 3


def test_words_for_a_class_become_ours_and_others_stay() -> None:
    labels = ("Van", "lorry", "tractor", None)
    rows = [row(1, 0, number, 0, 0, 9, 9, name=label) for number, label in enumerate(labels)]
    names = [track.class_name for track in next(iter(video_of(rows))).tracks]
    assert names == ["car", "truck", "tractor", None]


def test_a_rate_gives_times_to_frames_without() -> None:
    saved = video_of((row(1, 5, 1, 0, 0, 9, 9), row(1, 6, 1, 0, 0, 9, 9)), times={6: 0.5})
    assert not saved.has_times
    assert math.isnan(next(iter(saved)).time)
    timed = saved.at_rate(10)
    assert timed.has_times
    assert [frame.time for frame in timed] == [0.5, 0.5]


def test_frames_ascend_where_a_set_of_their_numbers_does_not() -> None:
    assert [frame.index for frame in SavedTracks({}, (7, 8))] == [7, 8]


def test_blank_lines_count_and_a_byte_order_mark_is_no_text() -> None:
    lines = list(numbered_lines(Path("a"), b"\xef\xbb\xbfa\r\n\r\n b \nc"))
    assert lines == [(1, "a"), (3, "b"), (4, "c")]


@pytest.mark.parametrize("content", [b"\xff\xfe\x00", bytes(range(256))])
def test_a_file_that_is_not_text_is_refused(content: bytes) -> None:
    with pytest.raises(TruthError, match="gt: is not a text file"):
        list(numbered_lines(Path("gt"), content))
