"""What `vdet info` says of a video, or of a picture."""

from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

from vdet.cli.options import Facts
from vdet.detect.svm.horizon import DEFAULT_HORIZON, seen_horizon
from vdet.media.images import read_image
from vdet.media.inspection import VideoReport, inspect_video
from vdet.run.loop import FIRST_FRAMES
from vdet.run.sinks.overlay import time_text


def clip_facts(path: Path) -> Facts:
    """Describe a video. Raises `VideoError`."""
    report = inspect_video(path, FIRST_FRAMES)
    horizon = seen_horizon(report.images)
    return Facts(list(_clip_lines(report, horizon)), _clip_values(report, horizon))


def picture_facts(path: Path) -> Facts:
    """Describe a picture. Raises `ImageError`."""
    image = read_image(path)
    height, width = image.shape[:2]
    horizon = seen_horizon([image])
    lines = [
        f"{path}: a picture",
        f"size: {width}×{height}, upright",
        _horizon_line(horizon, height),
    ]
    values = {
        "file": str(path),
        "kind": "picture",
        "width": width,
        "height": height,
        "horizon": horizon,
    }
    return Facts(lines, values)


def _clip_lines(report: VideoReport, horizon: float | None) -> Iterator[str]:
    info = report.info
    yield f"{info.path}: a video"
    yield f"container: {report.container}, {report.size / 1e6:.1f} MB"
    yield f"codec: {report.codec}, {report.pixels}"
    turned = f"; stored pictures are turned by {info.orientation.rotation}° counter-clockwise"
    yield f"size: {info.width}×{info.height}, upright{turned if info.orientation.rotation else ''}"
    yield f"frames: {'unknown' if info.frames is None else f'about {info.frames}'}"
    yield f"rate: {float(info.rate):.6g} frames/s on average"
    yield f"length: {'unknown' if info.duration is None else time_text(info.duration)}"
    yield from (f"sound {number}: {sound}" for number, sound in enumerate(report.sounds, start=1))
    yield f"lost in .mp4: {'; '.join(report.lost) or 'nothing'}"
    yield _horizon_line(horizon, info.height)


def _clip_values(report: VideoReport, horizon: float | None) -> dict[str, Any]:
    info = report.info
    return {
        "file": str(info.path),
        "kind": "video",
        "container": report.container,
        "bytes": report.size,
        "codec": report.codec,
        "pixel_format": report.pixels,
        "width": info.width,
        "height": info.height,
        **asdict(info.orientation),
        "frames": info.frames,
        "rate": float(info.rate),
        "start": float(info.start),
        "seconds": None if info.duration is None else float(info.duration),
        "sounds": list(report.sounds),
        "tags": {name: value for name, value in asdict(info.tags).items() if value},
        "lost": list(report.lost),
        "horizon": horizon,
    }


def _horizon_line(horizon: float | None, height: int) -> str:
    if horizon is None:
        return (
            f"horizon: not found, so it is taken at {DEFAULT_HORIZON:.2f} of the height; if that "
            "is wrong, set detector.search.perspective.horizon"
        )
    return f"horizon: at {horizon:.2f} of the height, row {round(horizon * height)}"
