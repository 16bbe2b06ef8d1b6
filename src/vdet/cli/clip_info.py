"""What `vdet info` says of a video, or of a picture."""

from collections.abc import Iterator
from dataclasses import asdict
from fractions import Fraction
from pathlib import Path
from typing import Any

from vdet.cli.options import Facts
from vdet.detect.svm.horizon import DEFAULT_HORIZON, seen_horizon
from vdet.media.images import read_image
from vdet.media.inspection import SoundReport, VideoReport, inspect_video
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
    yield f"container: {report.container}{_size(report.size)}"
    profile = f", profile {report.profile}" if report.profile else ""
    yield f"codec: {report.codec}{profile}"
    yield f"size: {info.width}×{info.height}, upright{_turned(report)}"
    if info.pixel_aspect != 1:
        yield f"pixels: {float(info.pixel_aspect):.4g} times as wide as high"
    yield f"frames: {'unknown' if info.frames is None else f'about {info.frames}'}"
    yield f"rate: {_rate(info.rate)} frames/s on average{_usual(report)}"
    length = "unknown" if info.duration is None else time_text(info.duration)
    begins = f"; its first frame is at {float(info.start):.3f} s" if info.start else ""
    yield f"length: {length}{begins}"
    yield f"pixel format: {report.pixels}, {report.bits} bits"
    tags = ", ".join(f"{key} {name}" for key, name in report.colors.items())
    yield f"colours: {tags or 'not tagged'}"
    for number, sound in enumerate(report.sounds, start=1):
        yield f"sound {number}: {_sound(sound)}"
    if not report.sounds:
        yield "sound: none"
    yield f"kept in .mp4: {'; '.join(report.kept)}"
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
        "profile": report.profile,
        "width": info.width,
        "height": info.height,
        "rotation": info.orientation.rotation,
        "mirrored": info.orientation.mirrored,
        "pixel_aspect": float(info.pixel_aspect),
        "frames": info.frames,
        "rate": float(info.rate),
        "usual_rate": float(report.guessed_rate) if report.guessed_rate else None,
        "start": float(info.start),
        "seconds": None if info.duration is None else float(info.duration),
        "pixel_format": report.pixels,
        "bits": report.bits,
        "colors": report.colors,
        "sounds": [asdict(sound) for sound in report.sounds],
        "tags": {name: value for name, value in asdict(info.tags).items() if value},
        "kept": list(report.kept),
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


def _turned(report: VideoReport) -> str:
    turn = report.info.orientation
    mirrored = "mirrored" if turn.mirrored else ""
    turned = f"turned by {turn.rotation}° counter-clockwise" if turn.rotation else ""
    how = " and ".join(filter(None, (mirrored, turned)))
    return f"; stored pictures are {how}" if how else ""


def _usual(report: VideoReport) -> str:
    usual = report.guessed_rate
    if not usual or abs(usual / report.info.rate - 1) < Fraction(1, 1000):
        return ""
    return f", {_rate(usual)} from frame to frame: times vary, or frames are missing"


def _rate(rate: Fraction) -> str:
    return f"{float(rate):.3f}".rstrip("0").rstrip(".")


def _size(size: int) -> str:
    return f", {size / 1e6:.1f} MB" if size else ""


def _sound(sound: SoundReport) -> str:
    language = f", {sound.language}" if sound.language else ""
    channels = "1 channel" if sound.channels == 1 else f"{sound.channels} channels"
    return f"{sound.codec}, {sound.rate} Hz, {channels}{language}"
