"""The list of boxes of still pictures."""

import json
from pathlib import Path
from typing import Any

import pytest

from red_cars import road
from run.red_runs import result_of, write
from vdet.boxes import Box
from vdet.config.schema import LaneSettings
from vdet.lanes.road import RoadFinder
from vdet.media import Picture
from vdet.run.sinks import Output
from vdet.track.track import Track

BOX = Box.sized(1, 2, 3, 4)
FINDER = RoadFinder(None, LaneSettings(), 320, 240)
ITEMS = (
    {
        "image": "a.png",
        "width": 320,
        "height": 240,
        "boxes": [
            {"x": 1, "y": 2, "width": 3, "height": 4, "score": 0.5679, "class": "car"}
            | {"foot": [2.5, 6.0], "distance": 23.46, "lane": -1},
            {"x": 1, "y": 2, "width": 3, "height": 4, "score": 0.5, "class": None}
            | {"foot": [2.5, 6.0], "distance": None, "lane": None},
        ],
        "lane": None,
    },
    {"image": str(Path("in") / "b.png"), "width": 64, "height": 48, "boxes": []},
)


RESULTS = (
    result_of(
        Track(1, BOX, 0.567891, "detected", "car", distance=23.4567, lane=-1),
        Track(2, BOX, 0.5, "detected"),
        source=Path("a.png"),
        image=road(),
        found=FINDER.update(FINDER.observe(Picture(road()))),
    ),
    result_of(source=Path("in") / "b.png", image=road()[:48, :64]),
)


def read(text: str) -> list[dict[str, Any]]:
    items: list[dict[str, Any]] = json.loads(text)
    return items


def test_there_is_an_item_a_picture_with_a_list_of_boxes(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "boxes.json"
    for target in (path, Path("-")):
        write(Output("json", target), RESULTS, video=None)
    assert read(path.read_text(encoding="utf-8")) == list(ITEMS)
    assert read(capsys.readouterr().out) == list(ITEMS)
