"""What a video file is, and what of it a written video loses."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

from av.audio.stream import AudioStream
from av.container import InputContainer

from vdet.errors import VideoError
from vdet.media.coding import HDR_TRANSFERS
from vdet.media.demux import is_pipe, open_input
from vdet.media.frame import VideoInfo
from vdet.media.images import Image
from vdet.media.probe import moving_streams, picture_stream
from vdet.media.reader import VideoReader
from vdet.media.sound import held_sounds


@dataclass(frozen=True, slots=True)
class VideoReport:
    """A video file.

    Attributes
    ----------
    info
        Size and rotation, rate, times and tags.
    images
        The first frames, BGR uint8 `(H, W, 3)`.
    container, codec, pixels
        The container, the codec and the pixel format, as FFmpeg names them.
    size
        Bytes of the file; 0 where that is unknown.
    sounds
        Codec, rate and language of each stream of sound.
    lost
        What an .mp4 that vdet writes does not keep of the file.
    """

    info: VideoInfo
    images: tuple[Image, ...]
    container: str
    codec: str
    pixels: str
    size: int
    sounds: tuple[str, ...]
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
        context = picture_stream(container, path).codec_context
        return VideoReport(
            info=info,
            images=images,
            container=container.format.long_name,
            codec=context.name,
            pixels=context.pix_fmt or "unknown",
            size=max(0, container.size or 0),
            sounds=tuple(map(_sound, container.streams.audio)),
            lost=tuple(_lost(container, path)),
        )


def _sound(stream: AudioStream) -> str:
    context = stream.codec_context
    form = f"{context.name}, {context.sample_rate} Hz" if context else "unknown"
    return form if stream.language in (None, "und") else f"{form}, {stream.language}"


def _lost(container: InputContainer, path: Path) -> Iterator[str]:
    context = picture_stream(container, path).codec_context
    if name := HDR_TRANSFERS.get(context.color_trc):
        yield f"HDR ({name})"
    if context.format and (bits := max(each.bits for each in context.format.components)) > 8:
        yield f"{bits} bits a colour value"
    held = held_sounds(path, "mp4") if container.streams.audio else set()
    for number, stream in enumerate(container.streams.audio, start=1):
        if stream.index not in held:
            yield f"sound {number}"
    if others := len(container.streams) - len(container.streams.audio) - 1:
        moving = len(moving_streams(container)) - 1
        yield f"streams other than the first video and sound: {others}, {moving} of them video"
