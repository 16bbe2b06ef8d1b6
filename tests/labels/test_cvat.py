import io
import zipfile
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from labels.saving import VIDEO, car, frame, read_back, written
from vdet.errors import TruthError
from vdet.labels import cvat
from vdet.labels.cvat import CVAT, read_cvat, read_cvat_pictures
from vdet.labels.formats import SourceVideo
from vdet.labels.label import Label
from vdet.labels.pictures import LabelledPicture
from vdet.track.track import FrameTracks
from writing import write_image

FILE = Path("annotations.xml")
BOX = '<box frame="0" outside="0" occluded="0" xtl="10" ytl="20" xbr="40.5" ybr="60"/>'


def document(content: str) -> str:
    return (
        '<?xml version="1.0" encoding="utf-8"?>\n<annotations>\n<version>1.1</version>\n'
        "<meta><task><size>100</size><original_size><width>640</width><height>360</height>"
        f"</original_size></task></meta>\n{content}\n</annotations>\n"
    )


def track(content: str, label: str = "car") -> str:
    return document(f'<track id="3" label="{label}" source="manual">{content}</track>')


def task(start: int, stop: int, boxes: str, rule: str = "") -> bytes:
    meta = f"<start_frame>{start}</start_frame><stop_frame>{stop}</stop_frame>"
    meta += f"<frame_filter>{rule}</frame_filter>"
    return track(boxes).replace("<size>", f"{meta}<size>").encode()


def rows(text: str) -> tuple[Label, ...]:
    return read_cvat(FILE, text.encode()).labels


class TestReading:
    def test_too_many_boxes_between_key_frames_are_refused(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(cvat, "_MAX_LABELS", 1000)
        end = BOX.replace('frame="0"', 'frame="9000000"')
        with pytest.raises(TruthError, match=r"track 3: has more than 1,000 boxes; cut it"):
            rows(track(BOX + end))

    def test_a_declared_encoding_does_not_matter(self) -> None:
        for name in ("latin-1", "utf-7", "hex"):
            text = track(BOX, "Überlandbus").replace('"utf-8"', f'"{name}"')
            assert rows(text)[0].name == "Überlandbus"

    def test_a_box_moves_to_the_next_one_until_one_is_outside(self) -> None:
        keys = "".join(
            f'<box frame="{frame}" outside="{outside}" xtl="{x}" ytl="0" xbr="{x + 9}" ybr="9"/>'
            for frame, outside, x in ((2, 0, 10), (4, 0, 30), (6, 1, 30), (98, 0, 50))
        )
        read = read_cvat(FILE, task(0, 99, keys))
        places = [(label.frame - 1, label.box[0]) for label in read.labels]
        assert places == [(2, 10), (3, 20), (4, 30), (5, 30), (98, 50), (99, 50)]

    def test_only_frames_of_the_task_are_read(self) -> None:
        keys = BOX.replace('frame="0"', 'frame="40"') + BOX.replace('frame="0"', 'frame="50"')
        read = read_cvat(FILE, task(40, 60, keys, "step=5"))
        assert [label.frame - 1 for label in read.labels] == [40, 45, 50, 55, 60]
        assert list(read.known or ()) == [40, 45, 50, 55, 60]

    def test_the_zip_file_that_cvat_exports_is_read(self, tmp_path: Path) -> None:
        path = tmp_path / "task.zip"
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr("annotations.xml", track(BOX))
        assert len(read_cvat(path, path.read_bytes()).labels) == 1


class TestWriting:
    def tracks(self, frames: list[FrameTracks], video: SourceVideo = VIDEO) -> list[ET.Element]:
        return ET.fromstring(written(CVAT, frames, video)).findall("track")

    def frames_of(self, track: ET.Element, **values: str) -> list[int]:
        boxes = track.findall("box")
        wanted = [box for box in boxes if values.items() <= box.attrib.items()]
        return [int(box.attrib["frame"]) for box in wanted]

    def test_every_box_is_a_key_frame_as_others_are_not_imported(self) -> None:
        (track,) = self.tracks([frame(index, car()) for index in (0, 1, 2)])
        assert self.frames_of(track, keyframe="1") == self.frames_of(track) == [0, 1, 2]

    def test_a_part_of_a_video_ends_with_a_box_outside(self) -> None:
        part = SourceVideo("in.mp4", 1280, 720, frames=100)
        (track,) = self.tracks([frame(0, car()), frame(1, car())], part)
        assert self.frames_of(track, outside="1") == [2]

    def test_the_task_is_described_as_cvat_exports_it(self) -> None:
        text = written(CVAT, [frame(0, car(), car(2, class_name="bus")), frame(1)])
        root = ET.fromstring(text)
        assert root.findtext("version") == "1.1"
        task = root.find("meta/task")
        assert task is not None
        values = {item: task.findtext(item) for item in ("name", "size", "mode", "stop_frame")}
        assert values == {
            "name": "road & rail.mp4",
            "size": "2",
            "mode": "interpolation",
            "stop_frame": "1",
        }
        assert [item.text for item in task.findall("labels/label/name")] == ["bus", "car"]
        assert task.findtext("original_size/width") == "1280"

    def test_names_that_xml_cannot_hold_are_escaped(self, tmp_path: Path) -> None:
        text = written(CVAT, [frame(0, car(class_name='<"\x1b">'))])
        (only,) = read_back(CVAT, tmp_path, text)
        assert only.tracks[0].class_name == '<"\\x1b">'


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (document("<meta>"), "6: broken XML: mismatched tag"),
        (document("").replace('"utf-8"', '"utf-16"') + "\0", " is not text (UTF-8)"),
        (track(BOX).replace('id="3"', ""), "track : <track> without its 'id'"),
        (track(BOX).replace("label", "x"), "track 3: <track> without its 'label'"),
        (document('<image id="0" name="a.png"/>'), " CVAT for images"),
        ("<svg/>", " <svg> where the format has <annotations>"),
        (
            track('<polygon frame="0" points="1,2;3,4"/>'),
            "track 3: <polygon> is not a box; only boxes",
        ),
        (track(BOX.replace(' xtl="10"', "")), "track 3: <box> without its 'xtl'"),
        (track(BOX.replace("10", "NaN")), "track 3: 'NaN' is not a number"),
        (track(BOX.replace("/>", ' rotation="30"/>')), "track 3: the box is rotated"),
        (task(0, 9_000_000, BOX).decode(), "meta: has more than 1,000,000 frames; cut the video"),
        (task(0, 9, BOX, "step=x").decode(), "meta: unknown frame filter 'step=x'; only step="),
        (
            task(1, 9, BOX, "step=2").decode(),
            "track 3: the task has no frame 0; it has every 2. frame from 1 to 9",
        ),
        (
            document("<meta><job/></meta>"),
            "meta: has several tasks; export each as 'CVAT for video 1.1'",
        ),
        (document("").replace("640", "wide"), "meta: 'wide' is not a number"),
        (document("").replace("640", "6" * 2000), "meta: '66666"),
    ],
)
def test_other_xml_than_cvat_video_is_refused_with_its_line(text: str, message: str) -> None:
    with pytest.raises(TruthError) as caught:
        rows(text)
    assert str(caught.value).startswith(f"annotations.xml:{message}")
    assert "\n" not in str(caught.value)


def test_a_zip_file_without_annotations_is_refused() -> None:
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("readme.txt", "nothing")
    with pytest.raises(TruthError, match=r"a\.xml: has no annotations\.xml; export"):
        read_cvat(Path("a.xml"), file.getvalue())


def test_the_size_of_a_picture_may_be_unknown(tmp_path: Path) -> None:
    write_image(tmp_path / "a.png", np.zeros((8, 12, 3), np.uint8))
    path = tmp_path / "annotations.xml"
    path.write_bytes(document('<image id="0" name="a.png" width="0" height="0"/>').encode())
    assert list(read_cvat_pictures(path)) == [LabelledPicture(tmp_path / "a.png", path, (), None)]
