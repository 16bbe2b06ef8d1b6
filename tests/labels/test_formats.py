"""Formats of tracks: each is recognized, read and written, and mistakes are named."""

import json
from dataclasses import astuple
from pathlib import Path
from typing import Any

import pytest

from labels.saving import car, frame, written
from labels.writers import exported
from vdet.errors import OutputError, TruthError
from vdet.labels.coco import COCO, read_coco
from vdet.labels.label import (
    Format,
    SavedTracks,
    check_track_name,
    format_for,
    track_formats,
    track_suffixes,
)
from vdet.labels.lines import MOT
from vdet.labels.reading import read_tracks, read_truth


def test_every_format_has_an_ending_of_its_own() -> None:
    suffixes = track_suffixes()
    assert [format_for(Path(f"a.b{suffix.upper()}")) for suffix in suffixes] == track_formats()


@pytest.mark.parametrize(
    ("name", "form"),
    [("gt.txt", MOT), ("gt", MOT), ("gt.csv", MOT), ("instances_default.json", COCO)],
)
def test_the_content_tells_the_format_where_the_name_leaves_it_open(
    tmp_path: Path, name: str, form: Format
) -> None:
    path = tmp_path / name
    path.write_bytes(written(form, [frame(2, car(5))]))
    ((index, (row,)),) = read_tracks(path).frames.items()
    assert (index, row.id) == (2, 5)


def test_tracks_are_not_written_under_the_name_of_a_format_that_is_gone() -> None:
    with pytest.raises(OutputError, match=r"use \.txt or \.coco\.json"):
        check_track_name(Path("a.kitti.txt"))


HEADER = "frame,time,id,x,y,width,height,state\n"
SCORED = "frame,time,id,x,y,width,height,score\n0,0.0,1,10,20,30,40,{}\n"
TXT = "1,1,11,21,30,40,1,-1,-1,-1\n3,1,12,21,30,40,1,-1,-1,-1\n"
CSV = f"{HEADER}0,0.0,1,10,20,30,40,detected\n2,0.08,1,11,20,30,40,predicted\n"
JSONL = "".join(f'{{"frame": {n}, "time": {n / 25}, "tracks": []}}\n' for n in range(4))


def read(folder: Path, suffix: str, content: str) -> SavedTracks:
    path = folder / f"tracks.{suffix}"
    path.write_text(content, encoding="utf-8", newline="")
    return read_tracks(path)


@pytest.mark.parametrize(("suffix", "content"), [("txt", ""), ("csv", HEADER)])
def test_an_empty_file_is_a_video_without_boxes(tmp_path: Path, suffix: str, content: str) -> None:
    assert read(tmp_path, suffix, content).frames == {}


def test_times_may_be_those_of_a_wall_clock(tmp_path: Path) -> None:
    rows = "".join(f"{n},{1.7e9 + n / 25:.6f},1,1,1,9,9,detected\n" for n in range(3))
    assert len(read(tmp_path, "csv", HEADER + rows).frames) == 3


def record(**changes: object) -> str:
    track = {"id": 1, "x": 10, "y": 20, "width": 30, "height": 40}
    return json.dumps({"frame": 4, "time": 0.16, "tracks": [track]} | changes)


VIDEO = {"name": "in.mp4", "width": 320, "height": 240}
WHOLE = record(video=VIDEO, last=True) + "\n"


@pytest.mark.parametrize(
    "content", [WHOLE, record(last=False) + "\n" + record(frame=5, time=0.2, last=True)]
)
def test_a_file_of_tracks_says_that_it_is_whole(tmp_path: Path, content: str) -> None:
    assert [frame.index for frame in read(tmp_path, "jsonl", content)][:1] == [4]


def test_truth_of_the_older_form_has_ten_columns_and_a_flag(tmp_path: Path) -> None:
    path = tmp_path / "gt.txt"
    path.write_text("4, 7, 11.5, 21, 20, 10, 1, -1, -1, -1\n4,8,1,1,9,9,0,-1,-1,-1")
    assert [label.ignored for label in read_truth(path).tracks] == [False, True]


def test_truth_with_spaces_is_read_and_several_classes_are_named(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path = tmp_path / "gt.txt"
    path.write_text("1 7 11 21 20 10 1 4 0 0\n1 8 1 1 9 9 1 1 0 0\n1 9 1 1 9 9 0 0 0 0\n")
    boxes = [astuple(label.box) for label in read_truth(path).tracks]
    assert boxes == [(10, 20, 30, 30), (0, 0, 9, 9), (0, 0, 9, 9)]
    text = "column 8 has the classes 1, 4, which are all read as vehicles"
    assert caplog.messages == [f"{path}: {text}; keep only the rows of vehicles"]


def test_truth_of_uavdt_has_vehicles_partly_outside_and_a_file_of_ignore_regions(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path, regions = tmp_path / "M01_gt_whole.txt", tmp_path / "M01_gt_ignore.txt"
    path.write_text("1,7,11,21,20,10,2,1,1\n1,8,1,1,9,9,3,1,3\n")
    regions.write_text("1,7,101,1,50,50,1,-1,-1\n")
    found = [(label.id, label.box.x1, label.ignored) for label in read_truth(path).tracks]
    assert found == [(7, 10, False), (8, 0, False), (-1, 100, True)]
    assert caplog.messages == []
    path.write_text("1,7,11,21,20,10,0,-1,-1,-1\n")
    assert all(label.ignored for label in read_truth(path).tracks)
    text = "has no vehicle, only ignore regions; column 7 is 0 in all lines"
    assert caplog.messages == [f"{path}: {text}"]


def test_tracks_are_written_without_a_heading() -> None:
    assert written(MOT, [frame(4, car())]) == b"5,1,11,21,30,40,0.7500,-1,-1,-1\n"


def test_truth_can_be_read_as_tracks_without_its_ignore_regions(tmp_path: Path) -> None:
    path = tmp_path / "gt.txt"
    path.write_text("1,7,1,1,20,10,0,3,1\n1,8,1,1,20,10,1,3,1\n")
    assert [row.id for row in read_tracks(path).tracks] == [8]


FRAMES = [frame(4, car(3)), frame(5), frame(6, car(3), car(5, class_name="bus", state="predicted"))]


FILE = Path("a.json")


def document() -> dict[str, Any]:
    made: dict[str, Any] = json.loads(written(COCO, FRAMES))
    return made


def test_images_name_their_frame_and_annotations_their_track() -> None:
    made = document()
    assert [image["frame_index"] for image in made["images"]] == [4, 5, 6]
    assert {image["video_id"] for image in made["images"]} == {made["videos"][0]["id"]}
    assert [(a["image_id"], a["track_id"]) for a in made["annotations"]] == [(1, 3), (3, 3), (3, 5)]
    categories = {item["id"]: item["name"] for item in made["categories"]}
    assert {t["id"]: categories[t["category_id"]] for t in made["tracks"]} == {3: "car", 5: "bus"}


def test_cvat_finds_what_it_needs_to_import_tracks() -> None:
    vehicle = document()["annotations"][2]
    assert vehicle["segmentation"] == []
    assert vehicle["attributes"] == {"occluded": True, "track_id": 5, "keyframe": True}
    assert [image["file_name"] for image in document()["images"]] == [
        *("frame_000004.png", "frame_000005.png", "frame_000006.png")
    ]


def test_tracks_that_cvat_exports_are_read() -> None:
    saved = read_coco(FILE, exported({0: [7], 5: [], 10: [7, 8]}))
    assert saved.covered == (0, 5, 10)
    assert saved.size == (300, 200)
    ids = {index: [row.id for row in rows] for index, rows in saved.frames.items()}
    assert ids == {0: [7], 10: [7, 8]}
    assert {astuple(row.box) for row in saved.tracks} == {(1, 1, 9, 9)}


def changed(name: str, number: int, **values: object) -> bytes:
    made = document()
    made[name][number] |= values
    return json.dumps(made).encode()


NINE = "1,7,1,1,20,10,1,3,1\n\n"
OTHERS = [
    ("gt.txt", "1;1;10;20;30;40", ": columns are separated by semicolons; they must be sep"),
    ("gt.csv", "frame\ttime\tid", ": columns are separated by tabs; they must be separated "),
    ("gt.txt", "1 2 3", ":1: MOTChallenge has 9 or 10 columns; this line has 3"),
    ("a.json", "{}", ": is not COCO: images: Field required"),
    ("a.json", "", ": is empty; tracks and ground truth must be"),
    ("0000.txt", "0 3 Car 0 2 -1.57", ": KITTI tracks are no longer read"),
    ("t.xml", "<annotations>", ": XML is not supported; export the labels as COCO"),
    ("gt.txt", f"{NINE}2,7,1,1,20,10,1,3,1,1", ":3: MOTChallenge has 9 columns; this line has 10"),
    ("gt.txt", f"{NINE}2,7,nan,1,20,10,1,3,1", ":3: left: Input should be a finite number"),
    ("gt.txt", f"{NINE}2,7,1e8,1,20,10,1,3,1", ":3: left: Input should be less than or equal to 1"),
    ("gt.txt", f"{NINE}2.5,7,1,1,20,10,1,3,1", ":3: frame: Input should be a valid integer"),
    ("gt.txt", f"{NINE}2,7,1,1,20,10,0.9,3,1", ":3: with nine columns, column 7 must be a flag, "),
]
WRONG_LINES = [
    ("txt", TXT + "4,1,12,21,30,40\n", ":3: MOTChallenge has 10 columns"),
    ("txt", TXT + "3,1,50,21,30,40,1,-1,-1,-1\n", ":3: id 1 occurs twice in the same frame"),
    ("txt", "0,1,12,21,30,40,1,-1,-1,-1\n", ":1: the frame comes before the video's first"),
    ("csv", "", ":1: the header must name each of these columns once: frame, time"),
    ("csv", CSV + "3,0.12,1,11,20,30\n", ":4: this line has 6 cells, but the header has 8"),
    ("csv", CSV + "3,soon,1,11,20,30,40,detected\n", ":4: time: Input should be a valid num"),
    ("csv", CSV + "3,0.12,1,11,20,0,40,detected\n", ":4: the box has no area"),
    ("csv", CSV + '3,"0.12\n', ":4: unexpected end of data"),
    ("csv", SCORED.format("1.5"), ":2: score: Input should be less than or equal to 1"),
    ("jsonl", "", ": is empty; it should have a record for every frame"),
    ("jsonl", JSONL + "{\n", ":5: Invalid JSON"),
    ("jsonl", JSONL + "[" * 100_000 + "\n", ":5: Invalid JSON"),
    ("jsonl", JSONL + record(frame=3), ":5: frame 3 comes after frame 3"),
    ("jsonl", JSONL + record(time=0.11), ":5: frame 4 is at 0.11 s; times must"),
    ("csv", CSV + "1,0.09,2,1,1,9,9,detected\n", ":3: frame 2 is at 0.08 s; times must"),
    (
        "csv",
        HEADER + "".join(f"{n},{n / 25 / 86400},1,1,1,9,9,detected\n" for n in range(3)),
        ":4: more than 10,000 frames a second; times must be seconds",
    ),
    ("jsonl", JSONL + record(video=VIDEO), ":5: another video begins; each video needs its own"),
    ("jsonl", WHOLE + record(frame=5), ":2: another video begins; each video needs its own"),
    ("jsonl", record(last=False) + "\n" + record(frame=5), ": is cut off after frame 5; copy"),
    *(
        ("jsonl", record(video=VIDEO | {"begin": begin}), ":1: video.begin: Input should ")
        for begin in ("0001-01-01T00:00+14:00", "9999-12-31T23:59-14:00", "2026-05-01T07:00")
    ),
]
WRONG_COCO = [
    (b"{", ": is not COCO: Invalid JSON: EOF while parsing an object"),
    (changed("images", 1, id=1), ": is not COCO: an id of images or categories occurs twice"),
    (changed("images", 1, frame_index=4), ": a frame_index occurs twice; use one file"),
    (changed("images", 1, time=0.15), ":images.1: frame 5 is at 0.15 s; times must"),
    (changed("images", 1, frame_index=-1), ": is not COCO: images.1.frame_index: Input should"),
    (changed("categories", 1, id=1), ": is not COCO: an id of images or categories occurs"),
    (changed("annotations", 2, image_id=9), ":annotations.2: image 9 or category 2 not found"),
    (changed("annotations", 2, category_id=9), ":annotations.2: image 3 or category 9 not"),
    (changed("annotations", 2, bbox=[1, 2, 3]), ": is not COCO: annotations.2.bbox.3: Field"),
    (changed("images", 1, frame_index=None, file_name="im5.png"), ": needs the frame_index of"),
    (changed("images", 1, frame_index=None, file_name="frame_123456789.txt"), ": needs the fr"),
    (exported({0: [1]}, attributes={}), ": needs the frame_index of each image and the track_"),
    (exported({0: [1]}, attributes={"track_id": "x"}), ": needs the frame_index of each image"),
]


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        *OTHERS,
        *((f"tracks.{suffix}", content, message) for suffix, content, message in WRONG_LINES),
        *(("a.json", content.decode(), message) for content, message in WRONG_COCO),
    ],
)
def test_what_cannot_be_read_is_refused_with_its_place(
    tmp_path: Path, name: str, content: str, message: str
) -> None:
    path = tmp_path / name
    path.write_text(content, encoding="utf-8", newline="")
    with pytest.raises(TruthError) as caught:
        read_tracks(path)
    assert str(caught.value).startswith(f"{path}{message}")
