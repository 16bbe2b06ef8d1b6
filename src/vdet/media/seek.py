"""Where decoding may begin, so that a part of a video needs not be decoded from its first frame.

The index of an MP4 or MOV file says where its key frames are, and how many frames come before. In
any other file, the packets before the part are read and counted, and not decoded. Where frames do
not pair with packets, or not surely, nothing is found: interlaced video, codecs that are not in
`_CODECS`, packets without times, damage, and pipes.
"""

from dataclasses import dataclass
from itertools import pairwise

import av
from av.container import InputContainer
from av.video.stream import VideoStream

from vdet.media.restarts import continuous_packets

_CODECS = frozenset((
    "av1", "h264", "hevc", "libdav1d", "mjpeg", "mpeg1video", "mpeg2video", "mpeg4", "png", "vp9",
))  # fmt: skip
_MAX_TRIES = 3


@dataclass(frozen=True, slots=True)
class Entry:
    """A key frame, from which on all frames can be decoded.

    Attributes
    ----------
    pts
        Its time, in units of the time base.
    index
        Number of frames that are shown before it.
    packets
        Number of packets of the stream that come before it, after a seek to `target`.
    target
        Where to seek, in units of the time base; None: from the beginning of the file.
    """

    pts: int
    index: int
    packets: int = 0
    target: int | None = None


def find_entry(
    container: InputContainer, stream: VideoStream, first: av.VideoFrame, time: int
) -> Entry | None:
    """Return the last entry that is not after `time`; None where frames cannot be counted surely.

    Parameters
    ----------
    container
        Just opened; it is read from.
    first
        The first frame of the file.
    time
        In units of the time base.
    """
    codec = stream.codec_context.name
    if first.pts is None or time <= first.pts or first.interlaced_frame or codec not in _CODECS:
        return None
    # Fragments have no index at first, and edit lists may have changed it.
    if 0 < stream.frames == len(stream.index_entries):
        return _find_by_index(container, stream, time)
    return _find_by_reading(container, stream, first.pts, time)


def _find_by_index(container: InputContainer, stream: VideoStream, time: int) -> Entry | None:
    index = list(stream.index_entries)
    if any(later.timestamp <= earlier.timestamp for earlier, later in pairwise(index)):
        return None
    target = time
    for _ in range(_MAX_TRIES):
        container.seek(target, stream=stream)
        found = (packet for packet in container.demux(stream) if packet.pts is not None)
        key = next(found, None)
        if key is None or key.pts is None or key.dts is None or not key.is_keyframe:
            return None
        if key.pts <= time:
            before = [entry for entry in index if entry.timestamp < key.dts]
            shown = sum(not entry.is_discard for entry in before)
            for packet in found:  # it may be shown before the key frame
                if packet.dts is None or packet.dts >= key.pts:
                    break
                shown += (packet.pts or 0) < key.pts and not packet.is_discard
            return Entry(key.pts, shown, target=target)
        target = key.dts - 1
    return None


def _find_by_reading(
    container: InputContainer, stream: VideoStream, first: int, time: int
) -> Entry | None:
    errors: list[None] = []
    times: list[int] = []
    key: tuple[int, int] | None = None
    found = continuous_packets(container, stream, on_error=lambda: errors.append(None))
    for number, packet in enumerate(each for each in found if each.stream_index == stream.index):
        if packet.pts is None or packet.is_corrupt or errors:
            return None
        if packet.dts is not None and packet.dts > time:
            break
        if packet.is_keyframe and packet.pts <= time:
            key = number, packet.pts
        if not packet.is_discard:
            times.append(packet.pts)
    if key is None:
        return None
    packets, pts = key
    return Entry(pts, sum(first <= each < pts for each in times), packets)
