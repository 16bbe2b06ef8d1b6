"""What a video file is, and what of it a written video keeps or loses."""

from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from fractions import Fraction
from itertools import islice
from pathlib import Path

from av.container import InputContainer
from av.stream import Disposition
from av.video.format import VideoFormat
from av.video.reformatter import ColorPrimaries, ColorRange, Colorspace, ColorTrc
from av.video.stream import VideoStream

from vdet.errors import VideoError
from vdet.files import printable
from vdet.media.demux import is_pipe, open_input
from vdet.media.frame import VideoInfo
from vdet.media.hdr import HDR_TRANSFERS
from vdet.media.images import Image
from vdet.media.probe import moving_streams, picture_stream
from vdet.media.reader import VideoReader
from vdet.media.sound import held_sounds

TARGET = "mp4"
"""The container for which losses are told."""

_OF_THE_FILE = frozenset(
    (
        *("major_brand", "minor_version", "compatible_brands", "encoder", "handler_name"),
        *("vendor_id", "language", "duration", "comment", "creation_time", "location", "title"),
        *("timecode", "com.apple.quicktime.location.iso6709"),
    )
)
"""Tags that tell of the file and not of the recording, and those that are kept or replaced."""


@dataclass(frozen=True, slots=True)
class SoundReport:
    """A stream of sound; `held` says whether an .mp4 can hold it."""

    codec: str
    rate: int
    channels: int
    language: str | None
    held: bool


@dataclass(frozen=True, slots=True)
class VideoReport:
    """A video file.

    Attributes
    ----------
    info
        Size and rotation, rates, times and tags.
    images
        The first frames, BGR uint8 `(H, W, 3)`.
    container, codec, profile
        As FFmpeg names them; the profile is None where the codec has none.
    pixels, bits
        FFmpeg's name of the pixel format, and the bits of a colour value.
    colors
        How colours are tagged: primaries, transfer, matrix, range; those that are.
    guessed_rate
        Frames a second from one frame to the next; the average (`info.rate`) is lower where frames
        are missing.
    size
        Bytes of the file; 0 where that is unknown.
    kept, lost
        What an .mp4 that vdet writes keeps of the file, and what it loses.
    """

    info: VideoInfo
    images: tuple[Image, ...]
    container: str
    codec: str
    profile: str | None
    pixels: str
    bits: int
    colors: dict[str, str]
    guessed_rate: Fraction | None
    size: int
    sounds: tuple[SoundReport, ...]
    kept: tuple[str, ...]
    lost: tuple[str, ...]


def inspect_video(path: Path, frames: int) -> VideoReport:
    """Open a video, decode its first `frames` frames, and describe it.

    Raises
    ------
    VideoError
        It cannot be read, or only once.
    """
    if is_pipe(path):
        raise VideoError(f"{path}: can be read only once; write it into a file first")
    with VideoReader(path) as reader:
        info, images = reader.info, tuple(frame.image for frame in islice(reader, frames))
    with open_input(path) as container:
        stream = picture_stream(container, path)
        context = stream.codec_context
        form = context.format
        sounds = _sounds(container, path)
        return VideoReport(
            info=info,
            images=images,
            container=container.format.long_name,
            codec=context.name,
            profile=context.profile,
            pixels=form.name if form else "unknown",
            bits=_bits(form),
            colors=_colors(stream),
            guessed_rate=stream.guessed_rate,
            size=max(0, container.size or 0),
            sounds=sounds,
            kept=tuple(_kept(info, sounds)),
            lost=tuple(_lost(container, stream, info, sounds)),
        )


def _sounds(container: InputContainer, path: Path) -> tuple[SoundReport, ...]:
    streams = container.streams.audio
    held = held_sounds(path, TARGET) if streams else {}
    found = []
    for stream in streams:
        context = stream.codec_context
        name, rate, channels = (
            (context.name, context.sample_rate, context.channels) if context else ("unknown", 0, 0)
        )
        holds = held.get(stream.index, False)
        found.append(SoundReport(name, rate or 0, channels or 0, stream.language, holds))
    return tuple(found)


def _bits(form: VideoFormat | None) -> int:
    return max((component.bits for component in form.components), default=8) if form else 8


def _colors(stream: VideoStream) -> dict[str, str]:
    context = stream.codec_context
    codes = {
        "primaries": (context.color_primaries, ColorPrimaries),
        "transfer": (context.color_trc, ColorTrc),
        "matrix": (context.colorspace, Colorspace),
        "range": (context.color_range, ColorRange),
    }
    found = {}
    for key, (code, names) in codes.items():
        if code == (0 if key == "range" else 2):
            continue
        name = str(int(code))
        with suppress(ValueError):
            name = names(code).name
        found[key] = _COMMON.get((key, int(code)), name)
    return found


_COMMON = {
    ("transfer", 16): "PQ",
    ("transfer", 18): "HLG",
    ("matrix", 1): "BT709",
    ("matrix", 5): "BT601",
    ("matrix", 6): "BT601",
    ("range", 1): "limited",
    ("range", 2): "full",
}
"""Names as most people know them, by the codes of ITU-T H.273; the range as FFmpeg counts it."""


def _kept(info: VideoInfo, sounds: Sequence[SoundReport]) -> Iterator[str]:
    yield "every frame at its time"
    for number, sound in enumerate(sounds, start=1):
        if sound.held:
            yield f"sound {number} ({sound.codec}), as it is"
    names = {"creation_time": "creation time", "timecode": "time code"}
    for field in ("creation_time", "location", "title", "timecode"):
        if getattr(info.tags, field):
            yield names.get(field, field)


def _lost(
    container: InputContainer,
    stream: VideoStream,
    info: VideoInfo,
    sounds: Sequence[SoundReport],
) -> Iterator[str]:
    yield from _lost_of_pictures(stream, info)
    for number, sound in enumerate(sounds, start=1):
        if not sound.held:
            yield f"sound {number} ({sound.codec}): .{TARGET} cannot hold it, .mkv may"
    others = len(moving_streams(container)) - 1
    if others > 0:
        yield f"video streams other than the first: {others}"
    stills = Disposition.attached_pic | Disposition.timed_thumbnails
    counts = Counter(
        "cover picture" if each.disposition & stills else each.type
        for each in container.streams
        if each.disposition & stills or each.type not in ("video", "audio")
    )
    for kind, count in counts.items():
        name = kind if kind == "cover picture" else f"{kind} stream"
        yield f"{count} {name}{'s' if count > 1 else ''}"
    if chapters := container.chapters():
        yield f"chapters: {len(chapters)}"
    if tags := sorted(tag for tag in container.metadata if tag.lower() not in _OF_THE_FILE):
        yield f"tags: {', '.join(printable(tag) for tag in tags)}"


def _lost_of_pictures(stream: VideoStream, info: VideoInfo) -> Iterator[str]:
    context = stream.codec_context
    form = context.format
    if context.color_trc in HDR_TRANSFERS:
        yield f"HDR ({HDR_TRANSFERS[context.color_trc]}): written as standard range (BT.709)"
    if form is None:
        return
    if _bits(form) > 8:
        yield f"{_bits(form)} bits a colour value: written with 8"
    is_grey = len(form.components) < 3
    if not is_grey and (form.is_rgb or form.chroma_width(16) > 8 or form.chroma_height(16) > 8):
        yield "colour at full resolution: written with half of it (4:2:0)"
    if len(form.components) == 4:
        yield "transparency"
    if info.width % 2 or info.height % 2:
        width, height = info.width + info.width % 2, info.height + info.height % 2
        yield f"its odd size: written as {width}×{height}, the last row or column repeated"
