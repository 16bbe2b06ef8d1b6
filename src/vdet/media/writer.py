"""Write frames as H.264 into one container, next to the sound of their source."""

import contextlib
import logging
from collections.abc import Iterator
from dataclasses import asdict
from fractions import Fraction
from pathlib import Path
from typing import Final, Self

import av
from av.video.reformatter import ColorRange

from vdet.config.schema import OutputSettings
from vdet.errors import OutputError, VideoError
from vdet.media.coding import Coding
from vdet.media.demux import begins_like_mp4, is_pipe, open_input
from vdet.media.frame import UNSPECIFIED, Frame, Picture, Planes, VideoInfo
from vdet.media.sound import SoundCopy
from vdet.version import __version__

_log = logging.getLogger("vdet")

VIDEO_SUFFIXES = (".mp4", ".mov", ".mkv")

_CODEC: Final = "libx264"
_MARK = "made by vdet"
_FINEST = 10_000_000  # ticks a second; more is not safe in mp4 players
_MATRICES = {"bt601": 6, "bt709": 1}  # codes of ITU-T H.273


def may_replace_video(path: Path) -> bool:
    """Return whether a file may be replaced by a video: one that vdet wrote, or no video.

    `VideoWriter` marks what it writes in the comment of the file. What cannot be opened but begins
    like an MP4 file is kept: it may be a recording that was cut off, and could be repaired.
    """
    if not path.is_file():
        return path.is_symlink()  # it leads nowhere
    try:
        with open_input(path) as container:
            tags = {key.lower(): value for key, value in container.metadata.items()}
    except VideoError:
        return not begins_like_mp4(path)
    return tags.get("comment", "").startswith(_MARK)


class VideoWriter:
    """Writes frames as H.264, yuv420p, with the sound of their source; a context manager.

    The file is complete only when the ``with`` block has ended without an exception. For an output
    that appears complete or not at all, write to a file from `vdet.files.OutputFiles`.

    The first frame is shown at second 0, every other exactly as long after it as in the source
    (mkv: to the millisecond), the last for one period of the average rate. Sides of odd length grow
    by one pixel, the last row or column repeated: 4:2:0 needs even ones. Colours are coded as the
    planes of the source are (`VideoInfo.coding`), and tagged so if the source was tagged at all.
    Planes that were not changed are encoded as they were decoded. Sound packets are copied,
    not encoded again. Creation time, location and title are kept.

    Parameters
    ----------
    path
        The file to write, .mp4, .mov or .mkv.
    info
        Of the source; frames must have its width and height.
    settings
        Codec, preset and quality.
    name
        The name of the file in messages, where that is not `path`.
    whole_sound
        True: the sound goes on to its own end. False: it ends with the last frame written, which
        is right where the frames are only a part of the source.
    threads
        Of the encoder; None lets it choose.

    Attributes
    ----------
    size
        Bytes of pictures that were encoded until now.

    Raises
    ------
    OutputError
        The suffix is another, or the file cannot be written (from every method).
    VideoError
        No frame was written (at the end), or the source of the sound cannot be opened.
    """

    def __init__(
        self,
        path: Path,
        info: VideoInfo,
        settings: OutputSettings,
        *,
        name: Path | None = None,
        whole_sound: bool = True,
        threads: int | None = None,
    ) -> None:
        self._name = name or path
        if path.suffix.lower() not in VIDEO_SUFFIXES:
            suffixes = ", ".join(VIDEO_SUFFIXES)
            raise OutputError(f"{self._name}: videos are written as {suffixes}; name it so")
        self._info = info
        self._whole_sound = whole_sound
        self._period = 1 / info.rate
        is_fine = info.time_base.denominator > _FINEST
        self._time_base = Fraction(1, _FINEST) if is_fine else info.time_base
        self._origin: Fraction | None = None  # time of the first frame
        self._last = -1
        self._sound: SoundCopy | None = None
        self.size = 0
        with self._naming_the_file():
            self._container = av.open(
                str(path.absolute()), mode="w", container_options={"movflags": "+faststart"}
            )
        self._container.metadata["comment"] = f"{_MARK} {__version__}"
        kept = {name: value for name, value in asdict(info.tags).items() if value}
        self._container.metadata.update(kept)
        self._stream = self._add_picture(info, settings, threads)

    def write(self, frame: Frame) -> None:
        """Encode the next frame, and copy the sound up to it; times must increase."""
        with self._naming_the_file():
            if self._origin is None:
                self._origin = frame.time
                self._sound = self._open_sound(frame.time)
            since = frame.time - self._origin
            self._last = max(self._last + 1, round(since / self._time_base))
            picture = _to_encode(frame.picture, self._info.coding)
            picture.pts = self._last
            picture.time_base = self._time_base
            picture.duration = round(self._period / self._time_base)
            packets = self._stream.encode(picture)
            self.size += sum(packet.size for packet in packets)
            self._container.mux(packets)
            if self._sound:
                self._sound.copy(since)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        with self._naming_the_file():
            try:
                if kind is None:
                    self._finish()
            finally:
                with contextlib.suppress(av.FFmpegError):
                    self._container.close()
                if self._sound:
                    self._sound.close()

    def _finish(self) -> None:
        """Write what is left: frames that the encoder holds back, sound, the file's index."""
        if self._origin is None:
            raise VideoError(f"{self._name}: there was no frame to write; check the times given")
        self._container.mux(self._stream.encode(None))
        if self._sound:
            end = self._last * self._time_base + self._period
            self._sound.copy(None if self._whole_sound else end)
        self._container.close()

    @contextlib.contextmanager
    def _naming_the_file(self) -> Iterator[None]:
        try:
            yield
        except av.FFmpegError as error:
            raise OutputError(f"{self._name}: cannot be written: {error.strerror}") from error

    def _open_sound(self, origin: Fraction) -> SoundCopy | None:
        """Return a copy of the sound of the source, if it has any that can be read again."""
        source = self._info.path
        if not self._info.has_sound:
            return None
        if is_pipe(source):
            _log.warning("%s: its sound is left out: a pipe can be read only once", source)
            return None
        return SoundCopy(source, self._container, origin)

    def _add_picture(
        self, info: VideoInfo, settings: OutputSettings, threads: int | None
    ) -> av.VideoStream:
        options = {"preset": settings.preset, "crf": str(settings.crf)}
        stream = self._container.add_stream(_CODEC, rate=info.rate, options=options)
        context = stream.codec_context
        context.width = info.width + info.width % 2
        context.height = info.height + info.height % 2
        context.thread_count = threads or 0
        context.pix_fmt = "yuv420p"
        context.time_base = self._time_base
        context.sample_aspect_ratio = info.pixel_aspect
        context.color_primaries = info.color.primaries
        context.color_trc = info.color.transfer
        if info.color.matrix != UNSPECIFIED:
            context.colorspace = _MATRICES[info.coding.matrix]
            context.color_range = ColorRange.MPEG
        if info.coding.full_range:
            context.color_range = ColorRange.JPEG
        return stream


def _to_encode(picture: Picture, coding: Coding) -> av.VideoFrame:
    """Return a picture of even sides that the encoder may have."""
    planes = picture.planes
    if planes is None or planes.coding != coding or picture.width % 2 or picture.height % 2:
        planes = Planes.of_image(picture.image, coding)
    return (planes if planes.is_own else planes.copy()).picture
