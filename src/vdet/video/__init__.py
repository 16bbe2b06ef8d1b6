"""Read and write video: frames with exact times, sound carried over, output complete or absent."""

from vdet.video.frame import ColorTags, Frame, VideoInfo
from vdet.video.reader import VideoReader
from vdet.video.writer import FrameWriter, NullWriter, VideoWriter

__all__ = [
    "ColorTags",
    "Frame",
    "FrameWriter",
    "NullWriter",
    "VideoInfo",
    "VideoReader",
    "VideoWriter",
]
