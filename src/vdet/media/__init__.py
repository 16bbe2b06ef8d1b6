"""Video and pictures: frames with exact times, sound carried over, sizes limited."""

from importlib import import_module
from typing import TYPE_CHECKING

from vdet.media.frame import ColorTags, Frame, Picture, Planes, VideoInfo

if TYPE_CHECKING:
    from vdet.media.reader import VideoReader
    from vdet.media.writer import VideoWriter

__all__ = ["ColorTags", "Frame", "Picture", "Planes", "VideoInfo", "VideoReader", "VideoWriter"]

_LATER = {"VideoReader": "vdet.media.reader", "VideoWriter": "vdet.media.writer"}


def __getattr__(name: str) -> object:
    """Import what reads and writes video when it is first used: pictures need none of it."""
    if name not in _LATER:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_LATER[name]), name)
