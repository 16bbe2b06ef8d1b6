"""`vdet ground`: the road plane of a camera, checked or taken from the lane of the settings."""

from pathlib import Path

import click

from vdet.cli import options
from vdet.cli.command import command
from vdet.cli.messages import print_lines
from vdet.cli.watching import Watched
from vdet.errors import ConfigError, counted, escaped
from vdet.files import check_output, write_whole

_YAML = (".yaml", ".yml")


@command("vdet ground ground.yaml", "vdet ground in.mp4 --lane --camera camera.yaml -o ground.yaml")
@click.argument("source", type=options.PATH, metavar="FILE|CLIP")
@options.option("-o, --output FILE", "File of the ground to write, .yaml, for --ground.")
@options.option("--lane", "Take the plane from the lane of the settings (lanes.*).")
@options.camera_option
@options.settings_options("lanes.lane_width=3.5")
@options.overwrite_option
def ground(
    source: Path,
    output: Path | None,
    lane: bool,
    camera: Path | None,
    choice: options.SettingsChoice,
    overwrite: bool,
) -> None:
    """Check the road plane of a camera, which turns pixels into metres, or write it.

    FILE has points of the road in pixels and in metres, and is checked. With --lane, the file is
    written for frames like those of CLIP: its points are the corners of the lane in the settings.
    """
    import yaml

    from vdet.lanes.camera import Undistorter, load_camera
    from vdet.lanes.top_view import TopView

    if source.suffix.lower() in _YAML:
        if output or lane:
            raise click.UsageError("a file of points is only checked; for --lane give a clip")
        print_lines(_described(source))
        return
    if output is None or not lane:
        raise click.UsageError("for a clip give -o ground.yaml and --lane")
    options.check_suffix(output, *_YAML, what="files of the ground")
    settings = choice.read()
    inputs = [source, *choice.inputs(settings, camera=camera)]
    check_output(output, overwrite=overwrite, inputs=inputs)
    lens = load_camera(camera) if camera else None
    image = Watched(tracks=None, start=None, end=None).first_image(source, settings)
    height, width = image.shape[:2]
    pixels, metres = TopView(settings.lanes, width, height).corners
    pixels = Undistorter(lens, width, height).distorted(pixels)
    pairs = zip(pixels.round(2).tolist(), metres.round(3).tolist(), strict=True)
    values = {
        "size": [width, height],
        **({"camera": str(camera.absolute())} if camera else {}),
        "points": [{"pixel": pixel, "metres": place} for pixel, place in pairs],
    }
    how = "from the lane of the settings"
    heading = (
        f"# The road plane of {escaped(source.name)}, written by vdet ground: {how}.\n"
        "# Look at it: vdet paths CLIP --no-paths --ground THIS_FILE -o grid.jpg\n"
    )
    text = yaml.safe_dump(values, sort_keys=False, default_flow_style=None)
    write_whole(output, heading + text, overwrite=overwrite)
    print_lines(f"{output}: {how}", _described(output))


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
