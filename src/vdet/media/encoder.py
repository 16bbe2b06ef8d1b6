"""Encode frames as H.264 into one container, next to the sound of their source."""

from contextlib import suppress
from fractions import Fraction
from pathlib import Path
from typing import Self

import av

from vdet.config.schema import OutputSettings
from vdet.media.frame import UNSPECIFIED, Frame, VideoInfo
from vdet.media.pixels import to_i420
from vdet.media.sound import SoundCopy

_FINEST = 10_000_000  # ticks a second; more is not safe in mp4 players
_BT601 = 6  # matrix code of ITU-T H.273
_LIMITED = 1  # av.video.reformatter.ColorRange.MPEG


class Encoder:
    """An open output file of the kind that its suffix names; a context manager.

    It is complete only if that is left without an exception.

    The first frame is shown at second 0, every other exactly as long after it as in the source
    (mkv: to the millisecond); the last one is shown for one period of the average rate.

    Raises
    ------
    VideoError
        The sound is to be copied, and its file cannot be opened.
    av.FFmpegError
        The file cannot be written (from every method).
    """

    def __init__(
        self,
        path: Path,
        info: VideoInfo,
        settings: OutputSettings,
        *,
        origin: Fraction,
        whole_sound: bool,
        threads: int | None = None,
    ) -> None:
        self._origin = origin
        self._whole_sound = whole_sound
        self._threads = threads
        self._period = 1 / info.rate
        self._time_base = info.time_base
        if info.time_base.denominator > _FINEST:
            self._time_base = Fraction(1, _FINEST)
        self._last = -1
        self._container = av.open(
            str(path.absolute()), mode="w", container_options={"movflags": "+faststart"}
        )
        self._stream = self._add_picture(info, settings)
        self._sound = SoundCopy(info.path, self._container, origin) if info.has_sound else None

    def write(self, frame: Frame) -> None:
        """Encode `frame`, and copy the sound up to it."""
        picture = to_i420(frame.image)
        since = frame.time - self._origin
        self._last = max(self._last + 1, round(since / self._time_base))
        picture.pts = self._last
        picture.time_base = self._time_base
        picture.duration = round(self._period / self._time_base)
        self._container.mux(self._stream.encode(picture))
        if self._sound:
            self._sound.copy(since)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        try:
            if kind is None:
                self._finish()
        finally:
            with suppress(av.FFmpegError):
                self._container.close()
            if self._sound:
                self._sound.close()

    def _finish(self) -> None:
        """Write what is left: frames that the encoder holds, sound, the file's index."""
        self._container.mux(self._stream.encode(None))
        if self._sound:
            end = self._last * self._time_base + self._period
            self._sound.copy(None if self._whole_sound else end)
        self._container.close()

    def _add_picture(self, info: VideoInfo, settings: OutputSettings) -> av.VideoStream:
        options = {"preset": settings.preset, "crf": str(settings.crf)}
        stream = self._container.add_stream(settings.codec, rate=info.rate, options=options)
        context = stream.codec_context
        context.width = info.width + info.width % 2
        context.height = info.height + info.height % 2
        context.thread_count = self._threads or 0
        context.pix_fmt = "yuv420p"
        context.time_base = self._time_base
        context.sample_aspect_ratio = info.pixel_aspect
        context.color_primaries = info.color.primaries
        context.color_trc = info.color.transfer
        if info.color.matrix != UNSPECIFIED:
            context.colorspace = _BT601
            context.color_range = _LIMITED
        return stream
