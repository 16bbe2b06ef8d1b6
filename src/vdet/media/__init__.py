"""Video and images: frames with exact times, copied audio, limited sizes."""

from vdet.media.frame import ColorTags, Frame, Picture, Planes, VideoInfo

__all__ = ["ColorTags", "Frame", "Picture", "Planes", "VideoInfo"]
