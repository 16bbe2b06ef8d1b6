"""The list of boxes of still pictures."""

import json
from dataclasses import replace
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

ITEMS = (
    {
        "image": "a.png",
        "width": 320,
        "height": 240,
        "boxes": [
            {"x": 1, "y": 2, "width": 3, "height": 4, "score": 0.5679, "class": "car"}
            | {"foot": [2.5, 6.0], "distance": None, "lane": None}
        ],
    },
    {"image": str(Path("in") / "b.png"), "width": 64, "height": 48, "boxes": []},
)


RESULTS = (
    result_of(
        Track(1, Box.sized(1, 2, 3, 4), 0.567891, "detected", "car"),
        source=Path("a.png"),
        image=road(),
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


def test_with_lanes_boxes_have_their_distance_and_lane(tmp_path: Path) -> None:
    path = tmp_path / "boxes.json"
    finder = RoadFinder(None, LaneSettings(), 320, 240)
    bare = finder.update(finder.observe(Picture(road())))
    near = Track(1, Box.sized(1, 2, 3, 4), 0.5, state="detected", distance=23.4567, lane=-1)
    vehicles = (near, replace(near, distance=None, lane=None))
    write(Output("json", path), [result_of(*vehicles, found=bare)], video=None)
    [item] = read(path.read_text(encoding="utf-8"))
    assert item["lane"] is None
    assert [(box["distance"], box["lane"]) for box in item["boxes"]] == [(23.46, -1), (None, None)]
