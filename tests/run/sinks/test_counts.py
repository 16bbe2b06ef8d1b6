"""The sink `counts`, and the running counts in the video."""

import json
from pathlib import Path

import numpy as np
import pytest

from red_cars import SETTINGS
from run.red_runs import outputs, read, run_red
from running import rows_of
from vdet.config.scene import LineSettings, TrafficSettings, ZoneSettings
from vdet.config.schema import Settings
from vdet.run.sinks import Output
from vdet.run.video import Run

GATE, YARD = 100 / 320, 110 / 320
COUNTS_AT = TrafficSettings(
    lines=(LineSettings(name="gate", start=(GATE, 0), end=(GATE, 1), left="out", right="in"),),
    zones=(ZoneSettings(name="yard", points=((YARD, 0), (1, 0), (1, 1), (YARD, 1))),),
)
"""The middle of the red car goes from 72 to 131 in 60 frames."""


def with_counts(counts: TrafficSettings = COUNTS_AT) -> Settings:
    return SETTINGS.model_copy(update={"traffic": counts})


def test_a_run_counts_the_red_car(red_clip: Path, tmp_path: Path) -> None:
    wanted = (
        Output("counts", tmp_path / "c.csv"),
        Output("counts", tmp_path / "c.json"),
        *outputs(tracks=tmp_path / "t.jsonl"),
    )
    run_red(Run(red_clip, wanted), with_counts())
    rows = rows_of(tmp_path / "c.csv")
    assert [(row["name"], row["direction"]) for row in rows] == [
        ("gate", "out"), ("yard", "enter"), ("yard", "vanish"),
    ]  # fmt: skip
    assert list(rows[0]) == [
        *("time", "clock", "frame", "name", "direction"),
        *("id", "vehicle", "class", "score", "seconds"),
        *("speed", "speed_sd", "mean_speed", "source"),
    ]
    assert float(rows[0]["time"]) == pytest.approx(28 / 25, abs=0.3)  # boxes are means of ten
    assert int(rows[0]["frame"]) == pytest.approx(25 * float(rows[0]["time"]), abs=1)
    assert rows[0]["seconds"] == ""
    assert float(rows[2]["seconds"]) == pytest.approx(
        float(rows[2]["time"]) - float(rows[1]["time"]), abs=0.002
    )
    whole = json.loads((tmp_path / "c.json").read_text())
    assert [event["time"] for event in whole["events"]] == [float(row["time"]) for row in rows]
    assert {(t["name"], t["direction"]): t["count"] for t in whole["totals"]} == {
        ("gate", "out"): 1, ("gate", "in"): 0, ("yard", "enter"): 1, ("yard", "exit"): 0,
        ("yard", "appear"): 0, ("yard", "vanish"): 1,
    }  # fmt: skip
    assert whole["zones"][0]["max"] == 1


def test_running_counts_are_drawn_if_asked_for(red_clip: Path, tmp_path: Path) -> None:
    drawn = COUNTS_AT.model_copy(update={"draw": True})
    for name, counts in (("plain.mp4", COUNTS_AT), ("drawn.mp4", drawn)):
        run_red(Run(red_clip, outputs(video=tmp_path / name)), with_counts(counts))
    plain, shown = read(tmp_path / "plain.mp4"), read(tmp_path / "drawn.mp4")
    changes = [
        np.abs(a.image.astype(int) - b.image).max(axis=2) > 60
        for a, b in zip(plain, shown, strict=True)
    ]
    assert all(change[150:230, 98:103].any() for change in changes), "the line is not drawn"
    first, last = shown[5].image[:, :95].astype(int), shown[-1].image[:, :95]
    assert (np.abs(first - last).max(axis=2) > 60).any(), "the number stays"
