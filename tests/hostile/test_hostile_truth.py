"""Damaged and wicked files of boxes, truth and tracks, through `vdet eval tracks`."""

from itertools import product
from pathlib import Path

import pytest

from hostile.mutations import mutated, with_other_words
from hostile.trials import try_files
from labels.saving import car, frame, written
from vdet.boxes import Box
from vdet.errors import TruthError
from vdet.labels import coco, lines
from vdet.labels.reading import read_tracks, read_truth

BOXES = [(frame, id_) for frame, id_ in product(range(6), (1, 2)) if (frame, id_) != (2, 1)]
GT = "".join(f"{f + 1},{i},{90 * i + 3 * f},40.5,60,50,1,3,0.75\n" for f, i in BOXES)
FRAMES = [
    frame(f, *(car(i, Box.sized(90 * i, 40, 60, 50)) for at, i in BOXES if at == f))
    for f in range(6)
]
RESULTS, COCO, CSV, JSONL = (
    written(form, FRAMES).decode() for form in (lines.MOT, coco.COCO, lines.CSV, lines.JSON_LINES)
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
    *("[" * 200, '{"frame": 1}', "null", '"bbox": [1', "true", "]}", "\\u0000"),
)
EACH = 10  # of each format, of each of two kinds


def test_damaged_files_of_boxes_are_read_or_refused(tmp_path: Path) -> None:
    found, true = tmp_path / "found.txt", tmp_path / "gt.txt"
    found.write_text(RESULTS)
    true.write_text(GT)
    truths = {"mot.txt": GT, "a.coco.json": COCO}
    tracks = {"results.txt": RESULTS, "tracks.csv": CSV, "tracks.jsonl": JSONL}
    contents: dict[str, bytes] = {}
    for seed, (name, text) in enumerate((truths | tracks).items()):
        damaged = mutated(text.encode(), seed=seed, count=EACH, tokens=TOKENS)
        damaged += with_other_words(text, WORDS, seed=seed, count=EACH)
        contents |= {f"{number}-{name}": data for number, data in enumerate(damaged)}

    def arguments(path: Path, out: Path) -> list[str | Path]:
        is_truth = path.name.partition("-")[2] in truths
        files = [found, path] if is_truth else [path, true]
        return ["eval", "tracks", *files, "--json", out / f"{path.name}.json"]

    trials = try_files(tmp_path, contents, arguments)
    assert 4 < sum(trial.code == 0 for trial in trials) < 100


DEEP = 1_000_000
CSV_HEAD = "frame,time,id,x,y,width,height,class\n"
WICKED = {
    "no number": ("t.txt", "1" * 200_000 + "x,1,1,1,1,1,1,1,1", "integer, exceeded maximum size"),
    "a long line": ("t.txt", "1," * 3_000_000, "t.txt:1: .* this line has 3000001"),
    "a huge cell": ("t.csv", CSV_HEAD + "1," + "9" * 200_000, "t.csv:2: this line has 2 cells"),
    "an open quote": ("t.csv", CSV_HEAD + '"' + "\n" * 100_000, "unexpected end of data"),
    "deep": ("t.jsonl", "[" * 900_000, ":1: .*recursion limit"),
    "a huge number": ("t.jsonl", '{"frame": ' + "9" * 100_000 + "}", ":1: "),
    "no end of tracks": ("t.jsonl", '{"frame": 0, "time": 0, "tracks": [' + "{}," * 99_999, ":1: "),
    "deep COCO": ("t.coco.json", '{"images": ' + "[" * DEEP, "Invalid JSON: recursion limit"),
    "brackets in keys of COCO": ("t.coco.json", '{"]": ' * DEEP, "Invalid JSON: recursion limit"),
    "a long key in COCO": ("t.coco.json", '{"' + "k" * 17 * DEEP, "is not COCO: Invalid JSON"),
    "no numbers in COCO": (
        "t.coco.json",
        '{"images": [], "categories": [], "annotations": [{"bbox": [1e999, NaN, 1, 1]}]}',
        "is not COCO: annotations.0.image_id: Field required",
    ),
    "a huge id in COCO": ("t.coco.json", '{"images": [{"id": ' + "9" * DEEP, "Invalid JSON"),
}


@pytest.mark.parametrize("name", WICKED)
def test_wicked_files_are_refused_by_name(tmp_path: Path, name: str) -> None:
    file, text, words = WICKED[name]
    path = tmp_path / file
    path.write_text(text, encoding="utf-8")
    for read in (read_truth, read_tracks):
        with pytest.raises(TruthError, match=words) as error:
            read(path)
        assert str(error.value).isprintable()
        assert len(str(error.value)) < 1000


def test_a_file_without_an_end_is_not_read_to_its_end() -> None:
    with pytest.raises(TruthError, match="/dev/zero: is larger than 300,000,000 bytes"):
        read_truth(Path("/dev/zero"))
