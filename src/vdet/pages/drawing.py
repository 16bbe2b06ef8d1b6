"""The outputs of `vdet draw`: the page, and an image of the traffic."""

import base64
import zlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from markupsafe import Markup

from vdet.boxes import Image
from vdet.config.classes import UNKNOWN, is_chosen
from vdet.config.loading import in_pixels
from vdet.config.scene import APPROACHES
from vdet.config.schema import Settings
from vdet.findings import Finding
from vdet.media.images import encode_image
from vdet.pages.render import TEMPLATES, jpeg_uri, render
from vdet.pages.traffic import DrawnMark, traffic_marks, with_marks
from vdet.track.track import FrameTracks
from vdet.traffic.counting import count_frames
from vdet.traffic.counts import Counts
from vdet.traffic.crossings import VehiclePath, lines_and_zones, link_tracks

_SECTIONS = {"ground": "camera", "regions": "other", "lines": "traffic", "zones": "traffic"}
"""The lists that the page edits, and their section in the settings file."""


class Drawing:
    """A frame of a camera with the paths of its vehicles.

    Parameters
    ----------
    image
        The frame, BGR uint8 `(H, W, 3)`.
    frames
        The tracks of its vehicles.
    values
        Values of the settings files so far, as of `given_values`.
    findings
        Reasons to doubt the tracks.

    Attributes
    ----------
    paths
        Paths of the vehicles that count, of the classes in the settings.
    """

    def __init__(
        self,
        image: Image,
        frames: Sequence[FrameTracks],
        settings: Settings,
        values: Mapping[str, Any],
        findings: Sequence[Finding] = (),
    ) -> None:
        height, width = image.shape[:2]
        self._image, self._frames, self._size = image, frames, (width, height)
        self._settings, self._values, self._findings = settings, values, findings
        minimum, linked = settings.traffic.min_seen_seconds, link_tracks(frames, width, height)
        self.paths: list[VehiclePath] = [
            path
            for path in linked
            if path.seconds >= minimum and is_chosen(path.class_name, settings.classes)
        ]

    def output(self, path: Path, name: str) -> bytes:
        """Return the content of a file by the suffix of `path`: a page or an image.

        `.svg` has counts and flows. Other images have none, so that a survey can add its own.
        `name` is the name of the settings file that the page saves. Raises `ConfigError`.
        """
        if path.suffix.lower() == ".html":
            return self._page(name).encode("utf-8", "backslashreplace")
        if path.suffix.lower() != ".svg":
            return encode_image(with_marks(self._image, self._marks(counts=[])), path)
        marks = self._marks([count_frames(self._frames, self._settings, self._size)])
        width, height = self._size
        svg = render("traffic.svg", picture=self._image, width=width, height=height, marks=marks)
        return svg.encode("utf-8", "backslashreplace")

    def _page(self, name: str) -> str:
        shapes, other_settings = split(self._values, self._size)
        lens = self._settings.camera.lens
        times = [frame.time for frame in self._frames]
        data = {
            "name": name,
            "size": self._size,
            "focal": lens and lens.matrix_for(*self._size)[0][0],
            "span": (times[0], times[-1]) if times else (0, 0),
            "picture": jpeg_uri(self._image),
            "paths": pack_paths(self.paths),
            "places": shapes,
            "approaches": APPROACHES,
            "rest": other_settings,
        }
        scripts = ((TEMPLATES / script).read_text("utf-8") for script in ("yaml.js", "draw.js"))
        script = Markup("\n".join(scripts))
        return render("draw.html", data=data, name=name, script=script, findings=self._findings)

    def _marks(self, counts: Sequence[Counts]) -> list[DrawnMark]:
        lines, zones = lines_and_zones(self._settings.traffic, *self._size)
        paths = {
            key: path.points.tolist() for path in self.paths for key in np.unique(path.ids).tolist()
        }
        return traffic_marks(self._size, (*lines, *zones), counts, paths)


def split(
    values: Mapping[str, Any], size: tuple[int, int]
) -> tuple[dict[str, list[Any]], dict[str, list[str]]]:
    """Return the shapes in settings, in pixels, and the other settings as lines of YAML."""
    whole = in_pixels(values, *size)
    sections = {"camera": whole.pop("camera"), "traffic": whole.pop("traffic", None) or {}}
    sections["other"] = whole
    shapes = {kind: sections[name].pop(kind, None) or [] for kind, name in _SECTIONS.items()}
    del sections["camera"]["size"]
    other_settings = {
        name: [line if name == "other" else f"  {line}" for line in _yaml_lines(section)]
        for name, section in sections.items()
    }
    return shapes, other_settings


def _yaml_lines(values: Mapping[str, Any]) -> list[str]:
    text = yaml.dump(dict(values), Dumper=_Dumper, sort_keys=False, allow_unicode=True)
    return text.splitlines() if values else []


class _Dumper(yaml.SafeDumper):
    """Writes lists on one line, except lists of sections."""

    def represent_sequence(self, tag: str, sequence: Any, flow_style: Any = None) -> Any:
        is_flat = not any(isinstance(item, dict) for item in sequence)
        return super().represent_sequence(tag, sequence, is_flat or flow_style)


def pack_paths(paths: Sequence[VehiclePath]) -> dict[str, Any]:
    """Return paths as values for JSON: four rows of int32, each number minus the one before it.

    They are deflated. Times are µs since the first row, ground points are hundredths of a pixel.
    """
    changes = [np.empty((4, 0))]
    for path in paths:
        times = 1e6 * (path.times - path.times[0])
        rows = np.rint(np.vstack([times, 100 * path.points.T, path.heights]))
        changes.append(np.diff(rows, prepend=0))
    numbers = np.hstack(changes).astype("<i4")
    vehicles = [
        (
            path.vehicle,
            path.class_name or UNKNOWN,
            path.size,
            path.times[0],
            path.seen,
            len(path.times),
        )
        for path in paths
    ]
    data = base64.b64encode(zlib.compress(numbers.tobytes())).decode("ascii")
    return {"vehicles": vehicles, "data": data}
