"""Make docs/vdet.jpg and docs/counts.jpg: the program on a ray-traced motorway, and counts.

What is drawn over the motorway comes from `vdet detect-video` with its default detector.
"""

import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import cv2
import numpy as np
from docs.picture.counting import counted_frame
from docs.picture.scene import Motorway, Vehicle
from docs.picture.shapes import HATCHBACK, LORRY, OFF_ROADER, SALOON, VAN

from vdet.media import VideoReader
from vdet.media.images import Image, write_image

FOLDER = Path(__file__).parents[1]
FRAMES = 22


def vehicles(time: float) -> tuple[Vehicle, ...]:
    """Return the vehicles; `time` is seconds, 0 in the last frame."""
    return (
        Vehicle(OFF_ROADER, 15.5 + 0.7 * time, -3.6, (28, 62, 120), "VD ET 1"),
        Vehicle(HATCHBACK, 18 - time, 3.9, (110, 16, 22), "VD ET 2"),
        Vehicle(SALOON, 28 + time, 0.15, (226, 228, 228), "VD ET 3"),
        Vehicle(SALOON, 46 - 2 * time, 3.75, (52, 58, 66), "VD ET 4"),
        Vehicle(VAN, 46 + 2 * time, -3.6, (238, 238, 236), "VD ET 5"),
        Vehicle(LORRY, 85 - 2 * time, 3.8, (20, 88, 150)),
    )


def write_frames(folder: Path) -> None:
    """Write the frames of the clip, 25 a second, with the blur and the noise of a camera."""
    coarse, fine = Motorway(scale=1), Motorway(scale=2)
    rng = np.random.default_rng(0)
    for number in range(FRAMES):
        road = fine if number == FRAMES - 1 else coarse
        image = road.image(vehicles((number + 1 - FRAMES) / 25))
        image = cv2.GaussianBlur(image, (0, 0), 0.6) + rng.normal(0.5, 1.5, image.shape)
        write_image(folder / f"{number:03}.png", np.clip(image, 0, 255).astype(np.uint8))


def last_frame_with_vehicles(folder: Path) -> Image:
    """Run `vdet detect-video` on the frames and return the last frame of its video."""
    video = folder / "found.mp4"
    program = [sys.executable, "-m", "vdet", "detect-video", folder / "%03d.png", video, "--lanes"]
    settings = ("output.crf=6", "draw.label=[id, score]")
    subprocess.run([*program, *(word for each in settings for word in ("--set", each))], check=True)
    with VideoReader(video) as reader:
        *_, last = reader
    return last.image


def main() -> None:
    """Write the pictures."""
    with TemporaryDirectory() as name:
        write_frames(Path(name))
        pictures = {"vdet.jpg": last_frame_with_vehicles(Path(name))}
        pictures["counts.jpg"] = counted_frame(Path(name))
    for target, image in pictures.items():
        _, data = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, 88])
        (FOLDER / target).write_bytes(data.tobytes())


if __name__ == "__main__":
    main()
