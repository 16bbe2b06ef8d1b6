from pathlib import Path

import pytest

from vdet.errors import TruthError
from vdet.evaluate.rows import Row
from vdet.evaluate.truth.cvat import cvat_rows

FILE = Path("annotations.xml")
BOX = '<box frame="0" outside="0" occluded="0" xtl="10" ytl="20" xbr="40.5" ybr="60"/>'


def document(content: str) -> str:
    return (
        '<?xml version="1.0" encoding="utf-8"?>\n<annotations>\n<version>1.1</version>\n'
        f"<meta><task><size>100</size></task></meta>\n{content}\n</annotations>\n"
    )


def track(content: str, label: str = "car") -> str:
    return document(f'<track id="3" label="{label}" source="manual">{content}</track>')


def test_frames_count_from_0_in_the_file_and_sides_are_corners() -> None:
    assert cvat_rows(FILE, track(BOX)) == [Row(5, 1, 3, 10, 20, 30.5, 40)]


def test_a_box_outside_is_not_there() -> None:
    assert not cvat_rows(FILE, track(BOX.replace('outside="0"', 'outside="1"')))


def test_an_occluded_box_counts() -> None:
    (row,) = cvat_rows(FILE, track(BOX.replace('occluded="0"', 'occluded="1"')))
    assert not row.ignored


def test_a_track_labelled_ignore_is_an_ignore_region() -> None:
    (row,) = cvat_rows(FILE, track(BOX, "ignore"))
    assert row.ignored


def test_a_pedestrian_is_passed_over() -> None:
    assert not cvat_rows(FILE, track(BOX, "pedestrian"))


def test_attributes_of_a_box_are_passed_over() -> None:
    box = BOX.replace("/>", '><attribute name="colour">red</attribute></box>')
    assert len(cvat_rows(FILE, track(box))) == 1


def test_a_file_without_tracks_has_no_rows() -> None:
    assert cvat_rows(FILE, document("")) == []


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
def test_what_is_not_plain_cvat_video_is_refused_by_its_line(text: str, message: str) -> None:
    with pytest.raises(TruthError) as caught:
        cvat_rows(FILE, text)
    assert str(caught.value).startswith(f"annotations.xml:{message}")
    assert "\n" not in str(caught.value)
