"""`vdet ground`: the road plane of a camera, checked or fitted."""

import re
from pathlib import Path
from typing import TYPE_CHECKING

import click

from vdet.cli import options
from vdet.cli.command import command
from vdet.cli.messages import print_lines
from vdet.cli.watching import Watched, watch_options
from vdet.errors import ConfigError, counted, escaped
from vdet.files import check_output, write_whole

if TYPE_CHECKING:
    from vdet.boxes import Float64Array
    from vdet.polygons import Segment

_YAML = (".yaml", ".yml")
_NUMBER = r"\s*(\d{1,5}(?:\.\d{1,3})?)\s*"
_LENGTH = re.compile(f"{_NUMBER},{_NUMBER},{_NUMBER},{_NUMBER}={_NUMBER}", re.ASCII)

Known = tuple["Segment", float]
"""Two points in pixels, and their distance in metres."""


def _parse_length(text: str) -> Known:
    match = _LENGTH.fullmatch(text)
    if not match or not float(match[5]) or match.group(1, 2) == match.group(3, 4):
        raise click.BadParameter(f"{text!r} is not X1,Y1,X2,Y2=METRES, as in 412,655,868,655=7.2")
    x1, y1, x2, y2, metres = map(float, match.groups())
    return ((x1, y1), (x2, y2)), metres


@command(
    "vdet ground ground.yaml",
    "vdet ground in.mp4 --length 412,655,868,655=7.2 -o ground.yaml",
    "vdet ground in.mp4 --lane --camera camera.yaml -o ground.yaml",
)
@click.argument("source", type=options.INPUT, metavar="FILE|CLIP")
@options.option("-o, --output FILE", "File of the ground to write, .yaml, for --ground.")
@options.option(
    "--length X1,Y1,X2,Y2=METRES",
    "Fit the plane to the traffic of CLIP and to a length on the road: two points in pixels.",
    _parse_length,
)
@watch_options
@options.option("--lane", "Fit the plane to the lane of the settings (lanes.*).")
@options.camera_option
@options.settings_options("detector.stride=2", options.model_option)
@options.overwrite_option
def ground(
    source: Path,
    output: Path | None,
    length: Known | None,
    watched: Watched,
    lane: bool,
    camera: Path | None,
    choice: options.SettingsChoice,
    overwrite: bool,
) -> None:
    """Check or fit the road plane of a camera, which turns pixels into metres.

    FILE has points of the road in pixels and in metres, and is checked. Without such points, the
    plane is fitted to CLIP and written: with --length from two streams of vehicles that cross at a
    right angle, or from one stream and --camera, and with --lane from the settings of the lane.
    """
    import yaml

    if source.suffix.lower() in _YAML:
        if output or length or lane:
            raise click.UsageError("a file of points is only checked; for a fit give a clip")
        print_lines(_described(source))
        return
    if output is None or (length is None) != lane:
        raise click.UsageError("for a clip give -o ground.yaml, and either --length or --lane")
    options.check_suffix(output, *_YAML, what="files of the ground")
    choice.read()
    check_output(output, overwrite=overwrite)
    pixels, metres, size, how = _fit(source, length, watched, camera, choice)
    pairs = zip(pixels.round(2).tolist(), metres.round(3).tolist(), strict=True)
    values = {
        "size": list(size),
        **({"camera": str(camera.absolute())} if camera else {}),
        "points": [{"pixel": pixel, "metres": place} for pixel, place in pairs],
    }
    heading = (
        f"# The road plane of {escaped(source.name)}, written by vdet ground: {how}.\n"
        "# Look at it: vdet paths CLIP --no-paths --ground THIS_FILE -o grid.jpg\n"
    )
    text = yaml.safe_dump(values, sort_keys=False, default_flow_style=None)
    write_whole(output, heading + text, overwrite=overwrite)
    print_lines(f"{output}: {how}", _described(output))


def _fit(
    clip: Path,
    length: Known | None,
    watched: Watched,
    camera: Path | None,
    choice: options.SettingsChoice,
) -> "tuple[Float64Array, Float64Array, tuple[int, int], str]":
    """Return points in pixels and in metres, the size of the frames, and how they were found."""
    import numpy as np

    from vdet.lanes.camera import Undistorter, load_camera
    from vdet.lanes.top_view import TopView
    from vdet.lanes.vanishing import traffic_plane

    settings = choice.read()
    lens = load_camera(camera) if camera else None
    height, width = watched.first_image(clip, settings).shape[:2]
    undistorter = Undistorter(lens, width, height)
    if length is None:
        pixels, metres = TopView(settings.lanes, width, height).corners
        how = "from the lane of the settings"
        return undistorter.distorted(pixels), metres, (width, height), how
    records = watched.records(clip, width, settings, choice)
    focal = float(lens.matrix_for(width, height)[0, 0]) if lens else None
    paths = [undistorter.points(np.array(each.path, np.float64)) for each in records]
    ends = undistorter.points(np.array(length[0], np.float64)).tolist()
    try:
        plane = traffic_plane(paths, ((ends[0], ends[1]), length[1]), (width, height), focal)
    except ConfigError as error:
        raise ConfigError(f"{clip}: {error}") from error
    how = (
        f"from {counted(len(records), 'vehicle')}; focal length {plane.focal:.0f} px, "
        f"camera {plane.above_ground:.1f} m above the road"
    )
    return undistorter.distorted(plane.pixels), plane.metres, (width, height), how


def _described(path: Path) -> str:
    """Return what a file of the ground says, in words; the errors are those of its fit."""
    from vdet.lanes.ground import load_ground

    request = load_ground(path)
    size = request.points.size
    if size is None:
        raise ConfigError(f"{path}: size: is missing; give width and height of the frames")
    fitted = request.ground(*size)
    return (
        f"{path}: {counted(len(request.points.points), 'point')}, off by {fitted.error:.2f} m "
        f"({fitted.pixel_error:.1f} px, root mean square); the area is {fitted.length:.0f} m long, "
        f"a row of pixels there is {100 * fitted.row:.0f} cm"
    )
