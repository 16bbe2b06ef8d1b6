"""Find and follow vehicles in road video on an ordinary CPU.

The names below are the public API; `docs/api.md` shows them in use. They are loaded when they are
first used: importing vdet itself does nothing else.
"""

TYPE_CHECKING = False  # as in `typing`, which a module of the current folder could replace here
if TYPE_CHECKING:
    from vdet.api import (
        Box,
        Detections,
        Detector,
        DetectorKind,
        DetectorModel,
        DetectorSettings,
        Frame,
        FrameResult,
        RunTotals,
        Settings,
        SinkContext,
        SinkKind,
        Track,
        Tracker,
        TrackerKind,
        TrackerSettings,
        VdetError,
        VideoDetector,
        VideoTracker,
        detect_image,
        detect_video,
        follow,
        load_settings,
    )

from vdet.version import __version__ as __version__  # noqa: E402

__all__ = [
    "Box",
    "Detections",
    "Detector",
    "DetectorKind",
    "DetectorModel",
    "DetectorSettings",
    "Frame",
    "FrameResult",
    "RunTotals",
    "Settings",
    "SinkContext",
    "SinkKind",
    "Track",
    "Tracker",
    "TrackerKind",
    "TrackerSettings",
    "VdetError",
    "VideoDetector",
    "VideoTracker",
    "detect_image",
    "detect_video",
    "follow",
    "load_settings",
]


def __getattr__(name: str) -> object:
    if name not in __all__:
        raise AttributeError(f"module 'vdet' has no attribute {name!r}")
    from vdet import api

    return getattr(api, name)
