"""Read and write video: frames with exact times, sound carried over, output complete or absent."""

from vdet.media.frame import ColorTags, Frame, VideoInfo
from vdet.media.reader import VideoReader
from vdet.media.writer import FrameWriter, NullWriter, VideoWriter

__all__ = [
    "ColorTags",
    "Frame",
    "FrameWriter",
    "NullWriter",
    "VideoInfo",
    "VideoReader",
    "VideoWriter",
]
