"""Video and pictures: frames with exact times, sound carried over, sizes limited."""

from vdet.media.frame import ColorTags, Frame, Picture, Planes, VideoInfo
from vdet.media.reader import VideoReader
from vdet.media.writer import VideoWriter

__all__ = ["ColorTags", "Frame", "Picture", "Planes", "VideoInfo", "VideoReader", "VideoWriter"]
