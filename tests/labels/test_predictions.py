import json
from pathlib import Path

import pytest

from vdet.errors import TruthError
from vdet.labels.label import SavedTracks
from vdet.labels.reading import read_tracks

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


@pytest.mark.parametrize(
    ("suffix", "content", "message"),
    [
        ("txt", TXT + "4,1,12,21,30,40\n", ":3: MOTChallenge has 10 columns"),
        ("txt", TXT + "3,1,50,21,30,40,1,-1,-1,-1\n", ":3: id 1 occurs twice in the same frame"),
        ("txt", "0,1,12,21,30,40,1,-1,-1,-1\n", ":1: the frame comes before the video's first"),
        ("csv", "", ":1: the header must name each of these columns once: frame, time"),
        ("csv", CSV + "3,0.12,1,11,20,30\n", ":4: this line has 6 cells, but the header has 8"),
        (
            "csv",
            CSV + "3,soon,1,11,20,30,40,detected\n",
            ":4: time: Input should be a valid number",
        ),
        ("csv", CSV + "3,0.12,1,11,20,0,40,detected\n", ":4: the box has no area"),
        ("csv", CSV + '3,"0.12\n', ":4: unexpected end of data"),
        ("csv", SCORED.format("1.5"), ":2: score: Input should be less than or equal to 1"),
        ("csv", SCORED.format("nan"), ":2: score: Input should be a finite number"),
        ("jsonl", "", ": is empty; it should have a record for every frame"),
        ("jsonl", JSONL + "{\n", ":5: Invalid JSON"),
        ("jsonl", JSONL + "[" * 100_000 + "\n", ":5: Invalid JSON"),
        ("jsonl", JSONL + record(frame=3), ":5: frame 3 comes after frame 3"),
        ("jsonl", JSONL + record(frame="x"), ":5: frame: Input should be a valid integer"),
        ("jsonl", JSONL + record(time=0.11), ":5: frame 4 is at 0.11 s; times must"),
        ("csv", CSV + "1,0.09,2,1,1,9,9,detected\n", ":3: frame 2 is at 0.08 s; times must"),
        (
            "csv",
            HEADER + "".join(f"{n},{n / 25 / 86400},1,1,1,9,9,detected\n" for n in range(3)),
            ":4: more than 10,000 frames a second; times must be seconds",
        ),
        ("jsonl", JSONL + record(tracks=None), ":5: tracks: Input should be a valid"),
        (
            "jsonl",
            JSONL + record(video=VIDEO),
            ":5: another video begins; each video needs its own",
        ),
        ("jsonl", WHOLE + record(frame=5), ":2: another video begins; each video needs its own"),
        ("jsonl", record(last=False) + "\n" + record(frame=5), ": is cut off after frame 5; copy"),
        *(
            ("jsonl", record(video=VIDEO | {"begin": begin}), ":1: video.begin: Input should ")
            for begin in ("0001-01-01T00:00+14:00", "9999-12-31T23:59-14:00", "2026-05-01T07:00")
        ),
    ],
)
def test_a_wrong_line_is_refused_with_its_number(
    tmp_path: Path, suffix: str, content: str, message: str
) -> None:
    with pytest.raises(TruthError) as caught:
        read(tmp_path, suffix, content)
    assert f"tracks.{suffix}{message}" in str(caught.value)
