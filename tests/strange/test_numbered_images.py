"""Numbered pictures in place of a video file."""

from fractions import Fraction
from pathlib import Path

import cv2
import pytest

from clips import draw_frame
from strange.conftest import Process, assert_whole


def write_pictures(pattern: Path, numbers: range) -> Path:
    pattern.parent.mkdir(exist_ok=True)
    for number in numbers:
        path = pattern.with_name(pattern.name % number)
        assert cv2.imwrite(str(path), draw_frame(number, 160, 96))
    return pattern


@pytest.mark.parametrize("suffix", ["png", "jpg", "bmp", "tiff", "webp"])
def test_numbered_images_are_a_video(suffix: str, tmp_path: Path, process: Process) -> None:
    pattern = tmp_path / "pictures 100%" / f"img_%02d.{suffix}"
    write_pictures(pattern, range(9, 12))  # not from 0, and with more digits
    shown = process(pattern, "--set", "input.frame_rate=29.97")
    assert_whole(shown, [9, 10, 11], Fraction(2997, 100))
    assert shown.warnings == []


def test_numbers_may_rise_by_a_step_and_an_assumed_rate_is_reported(
    tmp_path: Path, process: Process
) -> None:
    pattern = write_pictures(tmp_path / "50% [a]{b}~*?" / "0_%04d.png", range(6, 18, 3))
    shown = process(pattern.parent)
    assert_whole(shown, [6, 9, 12, 15])
    (warning,) = shown.warnings
    assert "25 images per second are assumed" in warning
