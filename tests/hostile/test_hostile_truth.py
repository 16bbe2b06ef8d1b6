"""Damaged and wicked files of boxes, truth and tracks, through `vdet eval tracks`."""

import json
from collections.abc import Callable
from itertools import product
from pathlib import Path

import pytest

from hostile.mutations import mutated, with_other_words
from hostile.trials import broken_promises, files_in, try_all
from vdet.errors import TruthError
from vdet.evaluate.comparison import MAX_IDS, compare
from vdet.labels import label
from vdet.labels.label import MAX_IN_FRAME
from vdet.labels.reading import read_predictions, read_truth

BOXES = [(frame, id_) for frame, id_ in product(range(6), (1, 2)) if (frame, id_) != (2, 1)]
GT = "".join(f"{f + 1},{i},{90 * i + 3 * f},40.5,60,50,1,3,0.75\n" for f, i in BOXES)
RESULTS = "".join(f"{f + 1},{i},{90 * i + 3 * f},41,58,51,0.9,-1,-1,-1\n" for f, i in BOXES)
KITTI = (
    "".join(
        f"{f} {i} Car 0 0 -1.57 {90 * i}.5 40 {90 * i + 60} 90 1.5 1.6 3.7 1.0 1.5 9.0 0.1\n"
        for f, i in BOXES
    )
    + "3 -1 DontCare -1 -1 -10 300 40 350 80 -1 -1 -1 -1000 -1000 -1000 -10\n"
)
CVAT = (
    '<?xml version="1.0" encoding="utf-8"?>\n<annotations>\n<version>1.1</version>\n'
    + "".join(
        f'<track id="{i}" label="car">\n'
        + "".join(
            f'<box frame="{f}" outside="0" occluded="1" xtl="{90 * i}.5" ytl="40" '
            f'xbr="{90 * i + 60}" ybr="90" z_order="0"><attribute name="a">b</attribute></box>\n'
            for f in range(6)
        )
        + "</track>\n"
        for i in (1, 2)
    )
    + "</annotations>\n"
)
CSV = "frame,time,id,x,y,width,height,state\n" + "".join(
    f"{f},{f / 25:.2f},{i},{90 * i},40,60,50,detected\n" for f, i in BOXES
)
JSONL = "".join(
    json.dumps(
        {
            "frame": f,
            "time": f / 25,
            "tracks": [
                {"id": i, "x": 90 * i, "y": 40, "width": 60, "height": 50, "state": "detected"}
                for i in (1, 2)
            ],
        }
    )
    + "\n"
    for f in range(6)
)
WORDS = (
    *("0", "-1", "1", "1e999", "-1e999", "nan", "inf", "1e-300", "10000000", "10000001"),
    *("9" * 400, "1_000", "0x10", "١", "", " ", "Car", "Pedestrian", "tractor", "1.5", "+3"),
    *(".5", "5.", "None"),
)
TOKENS = (
    *WORDS,
    *(",", ";", "\t", "\n", "\r\n", '"', "'", "\0", "\ufeff", "\x85", "\u2028"),
    *("<", ">", "&", "\xff"),
    *('<!DOCTYPE a [<!ENTITY b "c">]>', "&b;", "<![CDATA[", "]]>", "<!--", "<?xml?>", "&#0;"),
    *("<track>", "<box/>", "</annotations>", 'rotation="9"', "[" * 200, '{"frame": 1}', "null"),
)
SECONDS = 20.0
EACH = 10  # of each format, of each of two kinds


def test_damaged_files_of_boxes_are_read_or_refused(tmp_path: Path) -> None:
    inside, out = tmp_path / "in", tmp_path / "out"
    inside.mkdir()
    out.mkdir()
    found, true = tmp_path / "found.txt", tmp_path / "gt.txt"
    found.write_text(RESULTS)
    true.write_text(GT)
    truths = {"mot.txt": GT, "kitti.txt": KITTI, "cvat.xml": CVAT}
    tracks = {"results.txt": RESULTS, "tracks.csv": CSV, "tracks.jsonl": JSONL}
    runs: list[list[str | Path]] = []
    for seed, (name, text) in enumerate((truths | tracks).items()):
        damaged = mutated(text.encode(), seed=seed, count=EACH, tokens=TOKENS)
        damaged += with_other_words(text, WORDS, seed=seed, count=EACH)
        for number, data in enumerate(damaged):
            path = inside / f"{number}-{name}"
            path.write_bytes(data)
            files = [found, path] if name in truths else [path, true]
            runs.append(["eval", "tracks", *files, "--json", out / f"{path.name}.json"])
    before = files_in(inside)
    trials = try_all(runs, seconds=SECONDS)
    assert broken_promises(trials) == []
    assert files_in(inside) == before
    assert {path.parent for path in tmp_path.rglob("*")} == {tmp_path, inside, out}
    assert 12 < sum(trial.code == 0 for trial in trials) < 100


ENTITY_BOMB = (
    '<!DOCTYPE annotations [<!ENTITY a "xxxxxxxxxx">'
    + "".join(
        f'<!ENTITY {new} "{f"&{old};" * 10}">'
        for old, new in zip("abcdefgh", "bcdefghi", strict=True)
    )
    + "]><annotations>&i;</annotations>"
)
WICKED = {
    "entity bomb": ("t.xml", ENTITY_BOMB, ": the XML declares a document type"),
    "outside file": (
        "t.xml",
        '<!DOCTYPE a SYSTEM "file:///etc/passwd"><annotations/>',
        "declares a document type",
    ),
    "unknown entity": ("t.xml", "<annotations>&xxe;</annotations>", "broken XML: undefined entity"),
    "deep": (
        "t.xml",
        "<annotations>" + "<a>" * 1_000_000,
        "broken XML: no element found",
    ),
    "no number": ("t.txt", "1" * 200_000 + "x,1,1,1,1,1,1,1,1", "is not a number"),
    "no number, KITTI": ("t.txt", "9" * 200_000 + "x " * 17, "is not a number"),
    "a long line": ("t.txt", "1," * 3_000_000, "t.txt:1: the line is longer than 1,000,000 bytes"),
    "a long label": (
        "t.txt",
        "1 1 " + "x" * 1_000_000 + " 0" * 14,
        "the line is longer than 1,000,000 bytes",
    ),
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
    "a huge cell": (
        "t.csv",
        CSV + "1," + "9" * 200_000 + "\n",
        "t.csv:13: this line has 2 cells, but the header has 8",
    ),
    "an open quote": ("t.csv", CSV + '"' + "\n" * 100_000, "unexpected end of data"),
    "deep": ("t.jsonl", "[" * 900_000, ":1: .*recursion limit"),
    "a huge number": ("t.jsonl", '{"frame": ' + "9" * 100_000 + "}", ":1: "),
    "no end of tracks": ("t.jsonl", '{"frame": 0, "time": 0, "tracks": [' + "{}," * 99_999, ":1: "),
}


DEEP = 1_000_000
WICKED_TRACKS |= {
    "many names in CVAT": (
        "t.xml",
        "<annotations>" + "".join(f"<a{n}/>" for n in range(1001)),
        "has more than 1,000 different names of values",
    ),
    "many elements in CVAT": (
        "t.xml",
        "<annotations>" + "<a/>" * 8_000_000,
        "would take more than 1 GB of memory; cut it into parts",
    ),
    "deep COCO": (
        "t.coco.json",
        '{"images": ' + "[" * DEEP,
        "is not JSON: nested too deeply",
    ),
    "no numbers in COCO": (
        "t.coco.json",
        '{"images": [], "categories": [], "annotations": [{"bbox": [1e999, NaN, 1, 1]}]}',
        "is not JSON: parse error",
    ),
    "a huge id in COCO": ("t.coco.json", '{"images": [{"id": ' + "9" * DEEP, "is not JSON"),
    "an entity in CVAT": ("t.xml", ENTITY_BOMB, ": the XML declares a document type"),
    "a long class": (
        "t.csv",
        CSV.replace("state\n", "class\n").replace(",detected\n", "," + "x" * 1000 + "\n"),
        ":2: the label must have at most 100 characters",
    ),
    "no zip file": ("t.yolo.zip", "PK" + "x" * DEEP, "is not a folder or a readable zip"),
}


@pytest.mark.parametrize("name", WICKED_TRACKS)
def test_wicked_tracks_are_refused_by_name(tmp_path: Path, name: str) -> None:
    refused_by_name(read_predictions, tmp_path, *WICKED_TRACKS[name])


def test_a_file_without_an_end_is_not_read_to_its_end() -> None:
    with pytest.raises(TruthError, match="/dev/zero: is larger than 300,000,000 bytes"):
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
