import io
import zipfile
from pathlib import Path

import pytest

from labels.saving import car, frame, written
from vdet.boxes import Box
from vdet.errors import TruthError
from vdet.labels import yolo
from vdet.labels.yolo import YOLO, read_yolo

DATA = "names: [car, truck]\nwidth: 200\nheight: 100\n"
FILE = Path("a.zip")


def archive(**texts: str) -> bytes:
    """Return a zip file with `data.yaml` and these texts; in their names, `__` is a slash."""
    return archive_of({"data.yaml": DATA} | {k.replace("__", "/"): v for k, v in texts.items()})


def archive_of(texts: dict[str, str]) -> bytes:
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as made:
        for name, text in texts.items():
            made.writestr(name if name.endswith(".yaml") else f"{name}.txt", text)
    return file.getvalue()


def described(text: str) -> bytes:
    return archive_of({"data.yaml": text})


def member(data: bytes, name: str) -> str:
    with zipfile.ZipFile(io.BytesIO(data)) as opened:
        return opened.read(name).decode()


class TestWriting:
    def test_a_line_is_class_middle_size_and_id(self) -> None:
        data = written(YOLO, [frame(12, car(7, Box.sized(0, 0, 640, 360)))])
        text = member(data, "labels/train/frame_000012.txt")
        assert text == "0 0.250000 0.250000 0.500000 0.500000 7\n"

    def test_names_of_classes_and_pictures_stand_in_files(self) -> None:
        data = written(YOLO, [frame(0, car(1, class_name="bus"), car(2))])
        assert member(data, "data.yaml") == (
            "path: .\ntrain: train.txt\nval: train.txt\n"
            'names: ["bus", "car"]\nwidth: 1280\nheight: 720\n'
        )
        assert member(data, "train.txt") == "images/train/frame_000000.png\n"

    def test_a_box_outside_the_frame_is_left_out(self) -> None:
        data = written(YOLO, [frame(0, car(1, Box.sized(1280, 10, 20, 20)))])
        assert member(data, "labels/train/frame_000000.txt") == ""


class TestReading:
    def test_the_frame_is_the_number_at_the_end_of_the_name(self) -> None:
        saved = read_yolo(FILE, archive(labels__road_7="1 0.5 0.5 0.1 0.2 4", labels__road_3=""))
        assert saved.known == [3, 7]
        (row,) = saved.labels
        assert (row.frame, row.id, row.name) == (8, 4, "truck")
        assert row.box == pytest.approx((90, 40, 110, 60))

    def test_a_score_before_the_id_is_read(self) -> None:
        (row,) = read_yolo(FILE, archive(labels__f0="1 0.5 0.5 0.1 0.2 0.75 4")).labels
        assert (row.score, row.id) == (0.75, 4)

    def test_names_from_1_are_warned_of(self, caplog: pytest.LogCaptureFixture) -> None:
        assert read_yolo(FILE, archive(labels__f1="", labels__f2="")).known == [1, 2]
        assert caplog.messages == [
            "a.zip: frames are numbered from 0, but the first file is for frame 1"
        ]


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"PK nothing", ": is not a folder or a readable zip file"),
        (
            archive_of({"labels/f0": ""}),
            ": holds no data.yaml (YOLO); unpack it, and use the file of",
        ),
        (described("names: [car]"), ":data.yaml: needs the size of the frames"),
        (described(DATA.replace("200", "0")), ":data.yaml: needs the size of the frames"),
        (described(DATA.replace("[car, truck]", "car")), ":data.yaml: names must be"),
        (described("a: &a [b]\nc: [*a, *a]"), ":data.yaml:2:5: is not YAML: aliases"),
        (archive(labels__road=""), ": labels/road.txt must end in a frame number"),
        (
            archive(labels__f0="\n0 0.5 0.5 0.1 0.1"),
            ":labels/f0.txt:2: YOLO with tracks has 6 or 7",
        ),
        (archive(labels__f0="5 0.5 0.5 0.1 0.1 1"), ":labels/f0.txt:1: class 5 has no name"),
        (archive(labels__f0="0 1.5 0.5 0.1 0.1 1"), ":labels/f0.txt:1: a number is not between 0"),
        (archive(labels__f0="0 0.5 0.5 0.1 0.1 0.9"), ":labels/f0.txt:1: '0.9' is not a whole"),
        (archive(**{"/labels__f0": ""}), ": its member /labels/f0.txt has an absolute name"),
        (archive(**{"..__labels__f0": ""}), ": its member ../labels/f0.txt has '..' in its name"),
    ],
)
def test_what_does_not_fit_is_refused_with_its_place(data: bytes, message: str) -> None:
    with pytest.raises(TruthError) as caught:
        read_yolo(FILE, data)
    assert str(caught.value).startswith(f"a.zip{message}")
    assert "\n" not in str(caught.value)


def test_a_bomb_is_refused_before_it_is_unpacked(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(yolo, "MAX_BYTES", 100_000)
    data = archive(labels__f0=" " * 60_000, labels__f1=" " * 60_000)
    assert len(data) < 1000
    with pytest.raises(TruthError, match=r"its labels are larger than 100,000 bytes"):
        read_yolo(FILE, data)
