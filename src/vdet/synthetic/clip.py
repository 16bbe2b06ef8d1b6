"""A scene as a video file and a truth file."""

from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path

from vdet.config.schema import OutputSettings
from vdet.files import staged
from vdet.media import Frame, Picture, VideoInfo, VideoWriter
from vdet.media.writer import may_replace_video
from vdet.synthetic.render import Renderer
from vdet.synthetic.scene import Scene
from vdet.synthetic.truth import TrueBox, must_be_found, true_boxes

_CAR = 3  # class number in MOTChallenge
_CRF = 20  # of the video; it is material to be searched, so it is finer than what is shown


def frames(scene: Scene) -> Iterator[Frame]:
    """Render the frames of a scene, the first at 0 s."""
    renderer = Renderer(scene)
    for index in range(scene.frames):
        yield Frame(index, Fraction(index) / scene.rate, Picture(renderer.image(index)))


def write_clip(path: Path, scene: Scene, *, overwrite: bool = False) -> None:
    """Write a scene as an H.264 video without sound.

    Raises
    ------
    OutputError
        The file cannot be written, or its suffix is not that of a video.
    """
    info = VideoInfo(
        path=path,
        width=scene.camera.width,
        height=scene.camera.height,
        rate=scene.rate,
        time_base=1 / scene.rate,
        frames=scene.frames,
    )
    with (
        staged(path, overwrite=overwrite, may_replace=may_replace_video) as temporary,
        VideoWriter(temporary, info, OutputSettings(crf=_CRF), name=path) as writer,
    ):
        for frame in frames(scene):
            writer.write(frame)


def write_truth(path: Path, scene: Scene, *, overwrite: bool = False) -> None:
    """Write the true box of each vehicle, in the columns of MOTChallenge ground truth.

    One line per box: `frame, id, left, top, width, height, flag, class, visibility`; frames and
    pixels count from 1, the class is 3 (car). The flag is 1 for a vehicle that must be
    found and 0 for an ignore region (`must_be_found`).

    Raises
    ------
    OutputError
        The file cannot be written.
    """
    with (
        staged(path, overwrite=overwrite) as temporary,
        temporary.open("w", encoding="ascii", newline="\n") as file,
    ):
        for index in range(scene.frames):
            for box in true_boxes(scene, index):
                file.write(_line(index + 1, box, scene.camera.height))


def _line(number: int, vehicle: TrueBox, frame_height: int) -> str:
    box, flag = vehicle.box, int(must_be_found(vehicle, frame_height))
    place = f"{box.x + 1},{box.y + 1},{box.width},{box.height}"
    return f"{number},{vehicle.id},{place},{flag},{_CAR},{vehicle.visibility:.3f}\n"
