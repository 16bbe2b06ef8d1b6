"""`vdet calibrate`."""

from pathlib import Path

import numpy as np
import pytest

from conftest import Run
from lanes.chessboards import CAMERA, photographs
from vdet.config.loading import load_settings
from writing import write_image


@pytest.fixture(scope="session")
def boards(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of six photographs of a board and one of a wall."""
    folder = tmp_path_factory.mktemp("boards")
    for number, image in enumerate(photographs(CAMERA, 6)):
        write_image(folder / f"board{number}.png", image)
    write_image(folder / "wall.png", np.full((480, 640, 3), 99, np.uint8))
    return folder


def test_makes_a_camera_of_a_folder_and_names_what_it_skipped(
    run: Run, boards: Path, tmp_path: Path
) -> None:
    result = run("calibrate", boards, "-o", tmp_path / "camera.yaml", code=0)
    camera = load_settings([tmp_path / "camera.yaml"]).camera.lens
    assert camera is not None
    assert camera.matrix[0][0] == pytest.approx(560, rel=0.01)
    assert "wall.png: not used: no board of 9×6 inner corners found" in result.err
    assert "640×480, focal length 56" in result.out
    assert "6 of 7 photographs used" in result.out
