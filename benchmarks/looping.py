"""A short video → a long one: its packets again and again, each time later."""

from fractions import Fraction
from pathlib import Path

import av


def loop_video(source: Path, target: Path, frames: int) -> None:
    """Write a video of at least so many frames, without its sound; nothing is encoded anew."""
    written, offset = 0, 0
    with av.open(str(target), "w") as output:
        stream: av.VideoStream | None = None
        while written < frames:
            with av.open(str(source)) as reader:
                video = reader.streams.video[0]
                stream = stream or output.add_stream_from_template(video)
                length = 0
                for packet in reader.demux(video):
                    if packet.dts is None or packet.pts is None:
                        continue
                    length = max(length, packet.pts + _duration(packet, video))
                    packet.pts += offset
                    packet.dts += offset
                    packet.stream = stream
                    output.mux(packet)
                    written += 1
            offset += length


def _duration(packet: "av.Packet[av.VideoStream]", video: av.VideoStream) -> int:
    rate, base = video.average_rate or Fraction(25), packet.time_base or Fraction(1, 25)
    return packet.duration or round(1 / (rate * base))
