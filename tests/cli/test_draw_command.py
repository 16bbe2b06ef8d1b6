"""`vdet draw`: the page, and pictures of the scene."""

import json
from pathlib import Path
from typing import Any
from zipfile import ZipFile

import cv2
import numpy as np
import pytest

from conftest import Run
from pages.html import Elements
from running import write_drive
from vdet.media.images import read_image
from writing import write_image

LINES = """
camera: {size: [320, 240]}
output: {crf: 30}
traffic: {lines: [{name: gate, start: [100, 20], end: [100, 220]}]}
"""


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Six cars that go to the right, 4 pixels a frame, before a grey picture."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "lines.yaml").write_text(LINES)
    write_tracks(tmp_path / "tracks.csv", 0)
    write_image(tmp_path / "frame.png", np.full((240, 320, 3), 90, np.uint8))
    return tmp_path


def write_tracks(path: Path, begins: int) -> None:
    rows = [
        f"{n},{begins + n / 25:.6f},{number},{4 * n},{40 + 20 * number},40,20"
        for n in range(60)
        for number in range(1, 7)
    ]
    path.write_text("\n".join(["frame,time,id,x,y,width,height", *rows, ""]))


def data_of(page: str) -> dict[str, Any]:
    text = Path(page).read_text("utf-8").split('id="data">')[1].split("</script>")[0]
    data: dict[str, Any] = json.loads(text)
    return data


def test_a_page_has_the_vehicles_that_the_run_finds(run: Run, red: tuple[str, ...]) -> None:
    write_drive(Path("in.mp4"), 50)
    result = run("draw", "in.mp4", "-o", "gate.html", *red, "-c", "lines.yaml")
    assert (result.code, result.out) == (0, "gate.html: written, 1 vehicle\n"), result.err
    data = data_of("gate.html")
    assert (data["name"], data["size"]) == ("lines.yaml", [320, 240])
    assert "  crf: 30" in data["rest"]["other"]
    assert Elements(Path("gate.html").read_text("utf-8")).addresses() == []


def test_the_picture_shows_no_vehicle_that_moves(run: Run) -> None:
    write_drive(Path("in.mp4"), 150)
    Path("none.csv").write_text("frame,time,id,x,y,width,height\n")
    far = LINES.replace("[100, 20], end: [100, 220]", "[5, 5], end: [5, 20]")
    Path("far.yaml").write_text(far)
    given = ("--tracks-from", "none.csv", "-c", "far.yaml")
    result = run("draw", "in.mp4", "-o", "place.png", *given)
    assert (result.code, result.out) == (0, "place.png: written, 0 vehicles\n"), result.err
    image = cv2.imread("place.png")
    assert image is not None
    blue, green, red = image[60:].astype(int).transpose(2, 0, 1)
    assert not (red - np.maximum(blue, green) > 60).any()


@pytest.mark.parametrize("begins", [0, 100])
@pytest.mark.parametrize(
    ("part", "vehicles"),
    [(("--start", "1"), 6), (("--start", "10"), 0), (("--end", "1"), 6), (("--end", "0"), 0)],
)
def test_a_part_of_saved_tracks_is_used(
    run: Run, begins: int, part: tuple[str, str], vehicles: int
) -> None:
    """Times of a part are seconds from the first frame, whenever that is."""
    write_tracks(Path("tracks.csv"), begins)
    result = run("draw", "frame.png", "--tracks-from", "tracks.csv", *part, "-o", "gate.html")
    said = f"gate.html: written, {vehicles} vehicles"
    assert (result.code, result.out.splitlines()[:1]) == (0, [said])


def test_saved_tracks_must_be_of_frames_of_this_size(run: Run, red: tuple[str, ...]) -> None:
    write_drive(Path("in.mp4"), 50)
    run("detect-video", "in.mp4", *red, "--no-video", "--tracks", "t.jsonl", code=0)
    Path("in.mp4").rename("moved.mp4")
    result = run("draw", "moved.mp4", "--tracks-from", "t.jsonl", "-o", "gate.html", code=0)
    assert result.err == "vdet: warning: t.jsonl: is of in.mp4, not moved.mp4\n"
    text = Path("t.jsonl").read_text().replace('"width": 320', '"width": 640', 1)
    Path("t.jsonl").write_text(text)
    result = run("draw", "moved.mp4", "--tracks-from", "t.jsonl", "-o", "other.html", code=1)
    assert result.err == "vdet: t.jsonl: is of 640×240 frames, not 320×240\n"


def test_the_page_has_only_the_classes_that_are_counted(run: Run) -> None:
    for name, vehicles in (("vehicle", 6), ("truck", 0)):
        output = f"{name}.html"
        command = ("draw", "frame.png", "--tracks-from", "tracks.csv", "-o", output)
        result = run(*command, "--set", f"classes=[{name}]")
        assert result.out.splitlines()[:1] == [f"{output}: written, {vehicles} vehicles"]


def test_a_picture_has_lines_and_numbers_only_where_no_survey_adds_its_own(run: Run) -> None:
    given = ("frame.png", "--tracks-from", "tracks.csv", "-c", "lines.yaml")
    run("draw", *given, "-o", "place.png", code=0)
    changed = (read_image(Path("place.png")) != 90).any(axis=2)
    assert changed[40:200, 100].all()
    assert not changed[60:180, 130:180].any()  # no arrow of a flow
    run("draw", "frame.png", "-o", "plain.png", code=0)
    assert (read_image(Path("plain.png")) == 90).all()
    count = ("count", "tracks.csv", "-c", "lines.yaml", "--counts", "c.xlsx", "--overwrite")
    pictures = []
    for name in ("frame.png", "place.png"):
        run(*count, "--set", f"survey.picture={name}", code=0)
        with ZipFile("c.xlsx") as book:
            picture = Path(book.extract("xl/media/image1.jpeg"))
        pictures.append(read_image(picture).astype(int))
    assert np.abs(pictures[0] - pictures[1]).max() < 60
    run("draw", *given, "-o", "place.svg", code=0)
    drawn = Elements(Path("place.svg").read_text("utf-8"))
    assert drawn.text.split() == ["6", "gate", "left", "6", "right", "0"]
