"""`--sink NAME=FILE` on every command that has it."""

from pathlib import Path

import pytest

from conftest import Run
from red_cars import CAR, road
from vdet.media.images import read_image
from writing import write_image


@pytest.fixture
def out(tmp_path: Path) -> Path:
    """An empty folder."""
    folder = tmp_path / "out"
    folder.mkdir()
    return folder


def test_a_sink_for_one_picture(run: Run, tmp_path: Path, out: Path, red: tuple[str, ...]) -> None:
    image = tmp_path / "red.png"
    write_image(image, road(CAR))
    sink = ("--sink", f"image={out}/a.png", *red)
    run("detect-image", image, *sink, code=0)
    assert (read_image(out / "a.png") != read_image(image)).any()
    before = (out / "a.png").read_bytes()
    twin = image.with_name("twin.png")
    write_image(twin, road())
    several = run("detect-image", twin, image, *sink, "--overwrite")
    assert several.code == 1
    assert "a.png: is for one image; for several, use a folder" in several.err
    assert (out / "a.png").read_bytes() == before
