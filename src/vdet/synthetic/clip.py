"""Scenes → a video and its truth, as files."""

from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path

from vdet.config.schema import OutputSettings
from vdet.files import replacing
from vdet.media import Frame, VideoInfo, VideoWriter
from vdet.synthetic.render import Renderer
from vdet.synthetic.scene import Scene
from vdet.synthetic.truth import TrueBox, truth

SMALLEST = (40, 24)
"""Width and height in pixels of a 720-row frame from which on a vehicle counts."""

_CAR = 3  # class of MOTChallenge


def frames(scene: Scene) -> Iterator[Frame]:
    """Render the frames of a scene, the first at 0 s."""
    renderer = Renderer(scene)
    for index in range(scene.frames):
        yield Frame(index, Fraction(index) / scene.rate, renderer.image(index))


def write_clip(path: Path, scene: Scene) -> None:
    """Write a scene as an H.264 video without sound.

    Raises
    ------
    OutputError
        The file cannot be written, or its suffix is not one of a video.
    """
    info = VideoInfo(
        path=path,
        width=scene.camera.width,
        height=scene.camera.height,
        rate=scene.rate,
        time_base=1 / scene.rate,
        frames=scene.frames,
    )
    with VideoWriter(path, info, OutputSettings()) as writer:
        for frame in frames(scene):
            writer.write(frame)


def write_truth(path: Path, scene: Scene) -> None:
    """Write where every vehicle is, in the columns of MOTChallenge ground truth.

    One line a box: `frame, id, left, top, width, height, flag, class, visibility`; frames and
    pixels count from 1, the class is 3 (car). The flag is 1 for a vehicle that counts and 0 for
    an ignore region (`counts`).

    Raises
    ------
    OutputError
        The file cannot be written.
    """
    with replacing(path) as temporary, temporary.open("w", encoding="ascii", newline="\n") as file:
        for index in range(scene.frames):
            for box in truth(scene, index):
                file.write(_line(index + 1, box, scene.camera.height))


def counts(vehicle: TrueBox, frame_height: int) -> bool:
    """Tell whether a vehicle is to be found: large enough, and at least half of it not hidden.

    The smallest size is `SMALLEST` in a frame of 720 rows and grows with the frame. A vehicle that
    the frame's edge cuts counts by the size of its part inside.
    """
    width, height = (length * frame_height / 720 for length in SMALLEST)
    large = vehicle.box.width >= width and vehicle.box.height >= height
    return large and vehicle.hidden <= 0.5


def _line(number: int, vehicle: TrueBox, frame_height: int) -> str:
    box, flag = vehicle.box, int(counts(vehicle, frame_height))
    place = f"{box.x + 1},{box.y + 1},{box.width},{box.height}"
    return f"{number},{vehicle.id},{place},{flag},{_CAR},{vehicle.visibility:.3f}\n"
