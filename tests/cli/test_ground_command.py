"""`vdet ground`, and `--ground` of the commands that measure."""

import csv
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pytest

from conftest import Run
from lanes.poles import CORNERS, HEIGHT, WIDTH, ground_text, seen
from running import write_drive
from vdet.boxes import Float64Array
from vdet.lanes.camera import CalibratedCamera, Undistorter, save_camera
from vdet.lanes.ground import load_ground
from vdet.media.images import write_image

LINES = f"size: [{WIDTH}, {HEIGHT}]\nlines:\n" + "".join(
    f"  - {{name: {name}, start: {start}, end: {end}}}\n"
    for name, metres in (("near", 20.0), ("far", 40.0))
    for start, end in [seen(np.array([(-6.0, metres), (6.0, metres)])).round(1).tolist()]
)


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    write_image(tmp_path / "frame.png", np.full((HEIGHT, WIDTH, 3), 90, np.uint8))
    Path("ground.yaml").write_text(ground_text(seen(CORNERS), CORNERS))
    (tmp_path / "lines.yaml").write_text(LINES)
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


def test_a_file_of_points_is_checked(run: Run) -> None:
    result = run("ground", "ground.yaml")
    assert result.code == 0, result.err
    assert "ground.yaml: 4 points, off by 0.00 m" in result.out
    assert "the area is 38 m long" in result.out


def test_bad_points_are_refused_in_words(run: Run) -> None:
    Path("ground.yaml").write_text(ground_text(seen(CORNERS)[[0, 2, 1, 3]], CORNERS))
    for command in (
        ("ground", "ground.yaml"),
        ("paths", "frame.png", "--ground", "ground.yaml", "-o", "grid.png"),
        ("count", "tracks.csv", "--lines", "lines.yaml", "--ground", "ground.yaml"),
    ):
        write_tracks([ahead(12)])
        result = run(*command)
        assert result.code == 1
        assert "ground.yaml: points: the horizon would run between them" in result.err


def test_counts_have_the_speeds_at_their_lines(run: Run) -> None:
    write_tracks([ahead(12), ahead(9.0, -2.0)])
    places = ("--lines", "lines.yaml", "--ground", "ground.yaml")
    result = run("count", "tracks.csv", *places, "--counts", "counts.csv")
    assert result.code == 0, result.err
    with Path("counts.csv").open() as file:
        rows = [row for row in csv.DictReader(file) if row["id"] == "1"]
    assert [row["name"] for row in rows] == ["near", "far"]
    for row in rows:
        assert float(row["speed"]) == pytest.approx(43.2, rel=0.03)
        assert 0 < float(row["speed_sd"]) < 5
    assert rows[0]["mean_speed"] == ""
    assert float(rows[1]["mean_speed"]) == pytest.approx(43.2, rel=0.03)


def test_records_of_vehicles_have_speeds(run: Run, red: tuple[str, ...]) -> None:
    write_drive(Path("in.mp4"), 60)
    points = "".join(
        f"  - {{pixel: [{x}, {y}], metres: [{x / 10}, {-y / 10}]}}\n"
        for x, y in ((0, 0), (320, 0), (320, 240), (0, 240))
    )
    Path("plan.yaml").write_text(f"size: [320, 240]\npoints:\n{points}")
    outputs = ("--no-video", "--vehicles", "cars.csv", "--ground", "plan.yaml")
    result = run("detect-video", "in.mp4", *outputs, *red)
    assert result.code == 0, result.err
    with Path("cars.csv").open() as file:
        [row] = csv.DictReader(file)
    assert float(row["speed"]) == pytest.approx(3.6 * 2.5, rel=0.2)  # a pixel a frame, 0.1 m
    assert float(row["metres"]) == pytest.approx(0.1 * float(row["length"]), rel=0.3)
    assert float(row["speed_85"]) >= float(row["speed"])
    result = run("detect-video", "in.mp4", "--no-video", "--vehicles", "plan.yaml", *outputs[3:])
    assert result.code == 1


def test_the_plane_follows_from_the_lane_of_the_settings(run: Run) -> None:
    result = run("ground", "frame.png", "--lane", "-o", "new.yaml")
    assert result.code == 0, result.err
    ground = load_ground(Path("new.yaml")).ground(WIDTH, HEIGHT)
    corners = np.array([(0.2086, 0.93), (0.7898, 0.93), (0.4602, 0.63)]) * (WIDTH, HEIGHT)
    places = ground.place(corners + 0.5)
    assert float(np.hypot(*(places[1] - places[0]))) == pytest.approx(3.7, rel=0.01)
    assert float(places[2][1] - places[0][1]) == pytest.approx(37, rel=0.01)


def test_the_camera_of_a_lens_is_named_in_the_file(run: Run) -> None:
    matrix = ((1000.0, 0.0, 640.0), (0.0, 1000.0, 360.0), (0.0, 0.0, 1.0))
    camera = CalibratedCamera(WIDTH, HEIGHT, matrix, (-0.2, 0.0, 0.0, 0.0, 0.0), 0.2)
    save_camera(camera, Path("my: camera.yaml"))
    result = run("ground", "frame.png", "--lane", "--camera", "my: camera.yaml", "-o", "new.yaml")
    assert result.code == 0, result.err
    request = load_ground(Path("new.yaml"))
    assert request.camera == camera
    lens = Undistorter(camera, WIDTH, HEIGHT)
    corners = np.array([(0.2086, 0.93), (0.7898, 0.93)]) * (WIDTH, HEIGHT)
    places = request.ground(WIDTH, HEIGHT).place(lens.distorted(corners) + 0.5)
    assert float(np.hypot(*(places[1] - places[0]))) == pytest.approx(3.7, rel=0.01)
    arguments = ("ground", "frame.png", "--lane", "--camera", "my: camera.yaml", "--overwrite")
    refused = run(*arguments, "-o", "my: camera.yaml")
    assert (refused.code, "is the input itself" in refused.err) == (1, True)


def test_the_grid_in_metres_is_drawn(run: Run) -> None:
    for name, more in (("plain.png", ()), ("grid.png", ("--ground", "ground.yaml"))):
        assert run("paths", "frame.png", "-o", name, *more).code == 0
    assert Path("plain.png").read_bytes() != Path("grid.png").read_bytes()


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        (["ground.yaml", "-o", "new.yaml"], 2, "a file of points is only checked"),
        (["frame.png", "-o", "new.yaml"], 2, "give -o ground.yaml and --lane"),
        (["frame.png", "--lane"], 2, "give -o ground.yaml"),
        (["frame.png", "--lane", "-o", "new.txt"], 1, "written as .yaml"),
        (["frame.png", "--lane", "-o", "ground.yaml"], 1, "is there already"),
        (["none.yaml"], 1, "none.yaml: cannot be read"),
    ],
)
def test_wrong_use_is_refused(run: Run, arguments: list[str], code: int, message: str) -> None:
    result = run("ground", *arguments)
    assert result.code == code
    assert message in result.err
