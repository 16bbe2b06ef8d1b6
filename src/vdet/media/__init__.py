"""Video and pictures: frames with exact times, sound carried over, sizes limited."""

from vdet.media.frame import ColorTags, Frame, Picture, Planes, VideoInfo

__all__ = ["ColorTags", "Frame", "Picture", "Planes", "VideoInfo"]
