"""Wicked files of boxes, truth and tracks."""

from collections.abc import Callable
from pathlib import Path

import pytest

from vdet.errors import TruthError
from vdet.evaluate.comparison import MAX_IDS, compare
from vdet.labels import label
from vdet.labels.label import MAX_IN_FRAME
from vdet.labels.reading import read_predictions, read_truth
from vdet.labels.xml_reader import MAX_DEPTH

DEEP = 1_000_000
CSV = "frame,time,id,x,y,width,height,predicted\n0,0.00,1,90,40,60,50,0\n"
ENTITY_BOMB = (
    '<!DOCTYPE annotations [<!ENTITY a "xxxxxxxxxx">'
    + "".join(
        f'<!ENTITY {new} "{f"&{old};" * 10}">'
        for old, new in zip("abcdefgh", "bcdefghi", strict=True)
    )
    + "]><annotations>&i;</annotations>"
)
WICKED = {
    "entity bomb": ("t.xml", ENTITY_BOMB, ":1: the XML declares a document type"),
    "outside file": (
        "t.xml",
        '<!DOCTYPE a SYSTEM "file:///etc/passwd"><annotations/>',
        "declares a document type",
    ),
    "unknown entity": ("t.xml", "<annotations>&xxe;</annotations>", "broken XML: undefined entity"),
    "deep": (
        "t.xml",
        "<annotations>" + "<a>" * 1_000_000,
        f"more than {MAX_DEPTH} nested elements",
    ),
    "no number": ("t.txt", "1" * 200_000 + "x,1,1,1,1,1,1,1,1", "is not a number"),
    "no number, KITTI": ("t.txt", "9" * 200_000 + "x " * 17, "is not a number"),
    "NUL": ("t.txt", "1,1,90,40.5,60,50,1,3,0.75\n\0", "is not text"),
    "a long line": ("t.txt", "1," * 3_000_000, "has 3000001|columns between commas"),
    "a long label": ("t.txt", "1 1 " + "x" * 1_000_000 + " 0" * 14, "is unknown; give it a role"),
}


def refused_by_name(
    read: Callable[[Path], object], folder: Path, file: str, text: str, words: str
) -> None:
    """Hold that `read` refuses a file of that text, and says why in one line that can be shown."""
    path = folder / file
    path.write_text(text, encoding="utf-8")
    with pytest.raises(TruthError, match=words) as error:
        read(path)
    assert str(error.value).isprintable()
    assert len(str(error.value)) < 1000


@pytest.mark.parametrize("name", WICKED)
def test_wicked_truth_is_refused_by_name(tmp_path: Path, name: str) -> None:
    refused_by_name(read_truth, tmp_path, *WICKED[name])


WICKED_TRACKS = {
    "a huge cell": ("t.csv", CSV + "1," + "9" * 200_000 + "\n", "field larger than field limit"),
    "an open quote": ("t.csv", CSV + '"' + "\n" * 100_000, "unexpected end of data"),
    "deep": ("t.jsonl", "[" * 1_000_000, ":1: .*recursion limit"),
    "a huge number": ("t.jsonl", '{"frame": ' + "9" * 100_000 + "}", ":1: "),
    "no end of tracks": ("t.jsonl", '{"frame": 0, "time": 0, "tracks": [' + "{}," * 99_999, ":1: "),
    "deep COCO": ("t.coco.json", '{"images": ' + "[" * DEEP, "is not COCO .*recursion limit"),
    "no numbers in COCO": (
        "t.coco.json",
        '{"images": [], "categories": [], "annotations": [{"bbox": [1e999, NaN, 1, 1]}]}',
        "is not COCO with tracks: annotations.0",
    ),
    "a huge id in COCO": ("t.coco.json", '{"images": [{"id": ' + "9" * DEEP, "is not COCO"),
    "a long class": (
        "t.csv",
        CSV.replace("predicted\n", "class\n").replace(",0\n", "," + "x" * 1000 + "\n"),
        ":2: the label has more than 100 characters",
    ),
    "no zip file": ("t.yolo.zip", "PK" + "x" * DEEP, "neither a folder nor a readable zip"),
}


@pytest.mark.parametrize("name", WICKED_TRACKS)
def test_wicked_tracks_are_refused_by_name(tmp_path: Path, name: str) -> None:
    refused_by_name(read_predictions, tmp_path, *WICKED_TRACKS[name])


def test_a_file_without_an_end_is_not_read_to_its_end() -> None:
    with pytest.raises(TruthError, match="/dev/zero: is larger than 64,000,000 bytes"):
        read_truth(Path("/dev/zero"))


def test_too_many_boxes_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(label, "MAX_LABELS", 10)
    path = tmp_path / "t.txt"
    path.write_text("".join(f"{n},1,1,1,1,1,1,1,1\n" for n in range(1, 11)))
    assert len(read_truth(path)) == 10
    path.write_text(path.read_text() + "11,1,1,1,1,1,1,1,1\n")
    with pytest.raises(TruthError, match=r"t\.txt:11: has more than 10 boxes; cut it into parts"):
        read_truth(path)


@pytest.mark.parametrize("many", ["ids", "in one frame"])
def test_more_than_can_be_compared_is_refused_before_it_is(tmp_path: Path, many: str) -> None:
    path = tmp_path / "t.txt"
    if many == "ids":
        path.write_text("".join(f"{n},{n},1,1,9,9,1,-1,-1,-1\n" for n in range(1, MAX_IDS + 2)))
    else:
        path.write_text("".join(f"1,{n},1,1,9,9,1,-1,-1,-1\n" for n in range(MAX_IN_FRAME + 1)))
    boxes = read_predictions(path)
    with pytest.raises(TruthError, match="are too many to compare; cut the video into parts"):
        compare(boxes, boxes)
