"""`vdet ground`: checks the points of the road in the settings of a camera."""

from vdet.cli import options
from vdet.cli.command import command
from vdet.cli.messages import print_lines
from vdet.errors import ConfigError, counted


@command("vdet ground -c gate.yaml")
@options.settings_options("camera.size=[960,540]")
def ground(choice: options.SettingsChoice) -> None:
    """Check the points of the ground, which turn pixels into metres.

    They are `camera.ground` in the settings: four or more points of the road, in pixels and in
    metres.
    """
    from vdet.lanes.ground import ground_of

    camera = choice.read().camera
    fitted = ground_of(camera, *(camera.size or (1000, 1000)))
    if fitted is None:
        raise ConfigError("camera.ground: has no points; give four or more with -c FILE")
    print_lines(
        f"{counted(len(camera.ground), 'point')}, off by {fitted.error:.2f} m "
        f"({fitted.pixel_error:.1f} px, root mean square); the area is {fitted.length:.0f} m long, "
        f"a row of pixels there is {100 * fitted.row:.0f} cm"
    )
