from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vdet.errors import TruthError
from vdet.evaluate.labelled_video import LabelledVideo, Row
from vdet.evaluate.truth import cvat_rows, kitti_rows, read_truth

MOT = "1,7,11,21,30,40,1,3,1\n2,7,11,21,30,40,1,3,1\n"
KITTI = "".join(
    f"{frame} 7 Car 0 0 -1 10 20 40 60 1.5 1.6 4.0 2.0 1.5 20.0 -1.6\n" for frame in (0, 1)
)
CVAT = (
    '<annotations><track id="7" label="car">\n'
    + "".join(
        f'<box frame="{frame}" outside="0" xtl="10" ytl="20" xbr="40" ybr="60"/>\n'
        for frame in (0, 1)
    )
    + "</track></annotations>"
)


def write(tmp_path: Path, content: str) -> Path:
    path = tmp_path / "truth"
    path.write_text(content, encoding="utf-8")
    return path


@pytest.mark.parametrize("content", [MOT, KITTI, CVAT], ids=["MOT", "KITTI", "CVAT"])
def test_the_same_truth_is_read_from_every_format(tmp_path: Path, content: str) -> None:
    video = read_truth(write(tmp_path, content))
    assert video.frames.tolist() == [1, 2]
    assert video.ids.tolist() == [7, 7]
    assert video.boxes.tolist() == [[10, 20, 30, 40]] * 2
    assert not video.ignored.any()


@pytest.mark.parametrize("content", [MOT, KITTI, CVAT], ids=["MOT", "KITTI", "CVAT"])
def test_a_frame_beyond_the_video_is_refused_with_its_line(tmp_path: Path, content: str) -> None:
    with pytest.raises(TruthError, match=r"truth:[23]: the frame is number 2 of a video of 1;"):
        read_truth(write(tmp_path, content), frame_count=1)


@pytest.mark.parametrize("content", ["", " \n\n"])
def test_an_empty_file_is_refused(tmp_path: Path, content: str) -> None:
    with pytest.raises(TruthError, match="truth: is empty; give MOTChallenge"):
        read_truth(write(tmp_path, content))


@pytest.mark.parametrize("content", [MOT + KITTI, KITTI + MOT, MOT + CVAT])
def test_mixed_formats_are_refused_where_the_second_begins(tmp_path: Path, content: str) -> None:
    with pytest.raises(TruthError, match=r"truth:3: \w+( tracking)? has .* columns"):
        read_truth(write(tmp_path, content))


def read_or_refuse(path: Path) -> None:
    """Fail on any other exception, and on a message of several lines."""
    try:
        result: LabelledVideo | str = read_truth(path)
    except TruthError as error:
        result = str(error)
    assert isinstance(result, LabelledVideo) or "\n" not in result


@given(st.binary(max_size=200))
def test_any_bytes_are_truth_or_a_truth_error(
    tmp_path_factory: pytest.TempPathFactory, content: bytes
) -> None:
    path = tmp_path_factory.getbasetemp() / "any-bytes"
    path.write_bytes(content)
    read_or_refuse(path)


@given(st.data(), st.sampled_from([MOT, KITTI, CVAT]))
def test_damaged_truth_is_truth_or_a_truth_error(
    tmp_path_factory: pytest.TempPathFactory, data: st.DataObject, content: str
) -> None:
    at = data.draw(st.integers(0, len(content)))
    end = data.draw(st.integers(at, min(len(content), at + 12)))
    damage = data.draw(st.text(st.characters(exclude_categories=["Cs"]), max_size=6))
    path = tmp_path_factory.getbasetemp() / "damaged"
    path.write_text(content[:at] + damage + content[end:], encoding="utf-8", newline="")
    read_or_refuse(path)


BOXES = st.tuples(
    st.integers(-2000, 2000), st.integers(-2000, 2000), st.integers(1, 900), st.integers(1, 900)
)


@given(st.dictionaries(st.tuples(st.integers(1, 50), st.integers(0, 9)), BOXES, min_size=1))
def test_truth_that_is_written_is_read_back(
    tmp_path_factory: pytest.TempPathFactory,
    truth: dict[tuple[int, int], tuple[int, int, int, int]],
) -> None:
    path = tmp_path_factory.getbasetemp() / "written"
    lines = [
        f"{frame},{id_},{x + 1},{y + 1},{width},{height},1,3,1\n"
        for (frame, id_), (x, y, width, height) in truth.items()
    ]
    path.write_text("".join(lines))
    video = read_truth(path)
    keys = zip(video.frames.tolist(), video.ids.tolist(), strict=True)
    boxes = (tuple(box) for box in video.boxes.tolist())
    assert dict(zip(keys, boxes, strict=True)) == truth


KITTI_FILE = Path("0000.txt")
KITTI_REST = "1.5 1.6 4.0 2.0 1.5 20.0 -1.6"


def kitti_line(frame: int, track: int, name: str, box: str = "10.5 20 40.5 60") -> str:
    return f"{frame} {track} {name} 0 2 -1.57 {box} {KITTI_REST}"


def test_kitti_frames_count_from_0_and_boxes_are_corners() -> None:
    assert list(kitti_rows(KITTI_FILE, kitti_line(0, 3, "Car"))) == [Row(1, 1, 3, 10.5, 20, 30, 40)]


def test_kitti_car_van_and_truck_are_vehicles() -> None:
    text = "\n".join(
        kitti_line(0, track, name) for track, name in enumerate(["Car", "Van", "Truck"])
    )
    assert [row.ignored for row in kitti_rows(KITTI_FILE, text)] == [False] * 3


def test_kitti_dontcare_is_an_ignore_region() -> None:
    assert [row.ignored for row in kitti_rows(KITTI_FILE, kitti_line(0, -1, "DontCare"))] == [True]


def test_kitti_people_are_neither_vehicles_nor_ignore_regions() -> None:
    assert not list(
        kitti_rows(KITTI_FILE, kitti_line(0, 1, "Pedestrian") + "\n" + kitti_line(0, 2, "Cyclist"))
    )


@pytest.mark.parametrize(
    ("second", "message"),
    [
        (
            kitti_line(1, 3, "Car") + " 0.9",
            "KITTI tracking has 17 columns between spaces; this line has 18",
        ),
        ("2,7,1,1,20,10,1,3,1", "KITTI tracking has 17 columns between spaces; this line has 1"),
        (kitti_line(1, 3, "Spaceship"), "label 'Spaceship' is unknown"),
        (kitti_line(1, 3, "Car", "10 20 nan 60"), "'nan' is not a number"),
    ],
)
def test_a_wrong_kitti_line_is_refused_with_its_number(second: str, message: str) -> None:
    with pytest.raises(TruthError) as caught:
        list(kitti_rows(KITTI_FILE, kitti_line(0, 3, "Car") + "\n" + second))
    assert str(caught.value).startswith(f"0000.txt:2: {message}")


CVAT_FILE = Path("annotations.xml")
BOX = '<box frame="0" outside="0" occluded="0" xtl="10" ytl="20" xbr="40.5" ybr="60"/>'


def document(content: str) -> str:
    return (
        '<?xml version="1.0" encoding="utf-8"?>\n<annotations>\n<version>1.1</version>\n'
        f"<meta><task><size>100</size></task></meta>\n{content}\n</annotations>\n"
    )


def track(content: str, label: str = "car") -> str:
    return document(f'<track id="3" label="{label}" source="manual">{content}</track>')


def test_cvat_frames_count_from_0_and_boxes_are_corners() -> None:
    assert cvat_rows(CVAT_FILE, track(BOX)) == [Row(5, 1, 3, 10, 20, 30.5, 40)]


def test_a_cvat_box_outside_is_left_out() -> None:
    assert not cvat_rows(CVAT_FILE, track(BOX.replace('outside="0"', 'outside="1"')))


def test_an_occluded_cvat_box_counts() -> None:
    (row,) = cvat_rows(CVAT_FILE, track(BOX.replace('occluded="0"', 'occluded="1"')))
    assert not row.ignored


def test_a_cvat_track_labelled_ignore_is_an_ignore_region() -> None:
    (row,) = cvat_rows(CVAT_FILE, track(BOX, "ignore"))
    assert row.ignored


def test_a_cvat_pedestrian_is_skipped() -> None:
    assert not cvat_rows(CVAT_FILE, track(BOX, "pedestrian"))


def test_attributes_of_a_cvat_box_are_ignored() -> None:
    box = BOX.replace("/>", '><attribute name="colour">red</attribute></box>')
    assert len(cvat_rows(CVAT_FILE, track(box))) == 1


def test_a_cvat_file_without_tracks_has_no_rows() -> None:
    assert cvat_rows(CVAT_FILE, document("")) == []


BOMB = (
    '<?xml version="1.0"?>\n<!DOCTYPE lolz [<!ENTITY a "ha"><!ENTITY b "&a;&a;&a;&a;">]>\n'
    "<annotations><version>&b;</version></annotations>"
)
EXTERNAL = '<!DOCTYPE annotations SYSTEM "http://example.org/evil.dtd"><annotations></annotations>'


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (BOMB, "2: the XML declares a document type"),
        (EXTERNAL, "1: the XML declares a document type"),
        (document("<version>&b;</version>"), "5: broken XML: undefined entity"),
        (document("<meta>"), "6: broken XML: mismatched tag"),
        (document('<track label="car"/>'), "5: <track> without its 'id'"),
        (document('<track id="3"/>'), "5: <track> without its 'label'"),
        (document('<image id="0" name="a.png"/>'), "5: CVAT for images"),
        ("<svg/>", "1: <svg> where CVAT for video 1.1 has <annotations>"),
        (track(BOX, "cow"), "5: label 'cow' is unknown"),
        (track('<polygon frame="0" points="1,2;3,4"/>'), "5: <polygon> in a track; only boxes"),
        (track(BOX.replace(' xtl="10"', "")), "5: <box> without its 'xtl'"),
        (track(BOX.replace("10", "NaN")), "5: 'NaN' is not a number"),
        (track(BOX.replace("/>", ' rotation="30"/>')), "5: the box is rotated"),
    ],
)
def test_other_xml_than_cvat_video_is_refused_with_its_line(text: str, message: str) -> None:
    with pytest.raises(TruthError) as caught:
        cvat_rows(CVAT_FILE, text)
    assert str(caught.value).startswith(f"annotations.xml:{message}")
    assert "\n" not in str(caught.value)
