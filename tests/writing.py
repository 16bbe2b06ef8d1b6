"""Writes the pictures that tests read."""

from pathlib import Path

import cv2

from vdet.boxes import Image


def write_image(path: Path, image: Image) -> None:
    """Write a picture in the format that the suffix names."""
    assert cv2.imwrite(str(path), image)
