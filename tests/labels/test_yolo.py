import io
import zipfile
from pathlib import Path

from labels.saving import car
from vdet.boxes import Box
from vdet.labels.formats import ImageTracks
from vdet.labels.yolo import YOLO


def written(*images: ImageTracks) -> zipfile.ZipFile:
    file = io.BytesIO()
    assert YOLO.images is not None
    YOLO.images(file, images)
    return zipfile.ZipFile(file)


def test_a_line_is_class_middle_and_size() -> None:
    tracks = [car(1, Box.sized(0, 0, 640, 360), class_name="bus"), car(2, Box.sized(0, 0, 4, 9))]
    archive = written(ImageTracks(Path("road/a.png"), (1280, 720), tracks))
    assert archive.read("labels/road/a.txt").splitlines()[0] == (
        b"0 0.250000 0.250000 0.500000 0.500000"
    )
    assert archive.read("data.yaml").decode() == (
        'path: .\ntrain: images\nval: images\nnames: ["bus", "car"]\n'
    )


def test_a_box_outside_the_image_is_left_out() -> None:
    archive = written(
        ImageTracks(Path("a.png"), (1280, 720), [car(1, Box.sized(1280, 10, 20, 20))])
    )
    assert archive.read("labels/a.txt") == b""
