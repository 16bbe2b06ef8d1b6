"""Points of the ground in the commands that measure."""

from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pytest

from conftest import Run
from lanes.poles import CORNERS, HEIGHT, WIDTH, ground_text, seen
from running import rows_of
from vdet.boxes import Float64Array
from writing import write_image

LINES = "\ntraffic:\n  lines:\n" + "".join(
    f"  - {{name: {name}, start: {start}, end: {end}}}\n"
    for name, metres in (("near", 20.0), ("far", 40.0))
    for start, end in [seen(np.array([(-6.0, metres), (6.0, metres)])).round(1).tolist()]
)


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    write_image(tmp_path / "frame.png", np.full((HEIGHT, WIDTH, 3), 90, np.uint8))
    Path("gate.yaml").write_text(ground_text(seen(CORNERS), CORNERS) + LINES)
    return tmp_path


def write_tracks(ways: Iterable[Float64Array]) -> None:
    """Write the tracks of vehicles at these places, 25 a second, with boxes of 40 × 40 pixels."""
    rows = [
        (index, f"{index / 25:.6f},{number},{x - 20:.0f},{y - 40:.0f},40,40,{x:.2f},{y:.2f}")
        for number, places in enumerate(ways, start=1)
        for index, (x, y) in enumerate((seen(places) + 0.5).tolist())
    ]
    heading = "frame,time,id,x,y,width,height,foot_x,foot_y"
    text = "\n".join([heading, *(f"{index},{rest}" for index, rest in sorted(rows))])
    Path("tracks.csv").write_text(text + "\n")


def ahead(speed: float, aside: float = 1.0) -> Float64Array:
    times = np.arange(0, 3, 0.04)
    return np.column_stack([np.full(len(times), aside), 14 + speed * times])


def test_a_file_is_checked_with_the_fit_of_its_points(run: Run) -> None:
    result = run("info", "-c", "gate.yaml", code=0)
    assert "lines: near; far" in result.out
    fit = "ground: 4 points, off by 0.00 m (0.0 px, root mean square), over 38 m"
    assert fit in result.out
    fractions = ground_text(seen(CORNERS) / (WIDTH, HEIGHT), CORNERS)
    Path("gate.yaml").write_text(fractions.replace(f"[{WIDTH}, {HEIGHT}]", "null"))
    assert "px" not in run("info", "-c", "gate.yaml", code=0).out


def test_bad_points_are_refused_in_words(run: Run) -> None:
    Path("gate.yaml").write_text(ground_text(seen(CORNERS)[[0, 2, 1, 3]], CORNERS) + LINES)
    write_tracks([ahead(12)])
    for command in (("info",), ("count", "tracks.csv")):
        result = run(*command, "-c", "gate.yaml")
        assert result.code == 1
        assert "camera.ground: the horizon is between the points" in result.err


def test_counts_have_the_speeds_at_their_lines(run: Run) -> None:
    write_tracks([ahead(12), ahead(9.0, -2.0)])
    run("count", "tracks.csv", "-c", "gate.yaml", "--counts", "counts.csv", code=0)
    rows = [row for row in rows_of(Path("counts.csv")) if row["id"] == "1"]
    assert [row["name"] for row in rows] == ["near", "far"]
    for row in rows:
        assert float(row["speed"]) == pytest.approx(43.2, rel=0.03)
        assert 0 < float(row["speed_sd"]) < 5
    assert rows[0]["mean_speed"] == ""
    assert float(rows[1]["mean_speed"]) == pytest.approx(43.2, rel=0.03)
