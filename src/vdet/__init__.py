"""Find and follow vehicles in road video on an ordinary CPU.

The public API is `vdet.api.__all__`; `docs/api.md` shows it in use. Its names are loaded when they
are first used: importing vdet itself does nothing else.
"""

TYPE_CHECKING = False  # as in `typing`, which a module of the current folder could replace here
if TYPE_CHECKING:
    from vdet.api import *  # noqa: F403

from vdet.version import __version__ as __version__  # noqa: E402


def __dir__() -> list[str]:
    return sorted({*globals(), *__getattr__("__all__")})  # type: ignore[misc]


_DEPRECATED = {
    "DetectorModel": "vdet.detect.detectors",
    "Event": "vdet.traffic.counts",
    "Frame": "vdet.media",
    "Output": "vdet.run.sinks",
    "Picture": "vdet.media",
    "SinkContext": "vdet.run.sinks.protocol",
    "Step": "vdet.run.steps",
    "StepContext": "vdet.run.steps",
    "VideoDetector": "vdet.detect.detectors",
    "VideoTracker": "vdet.track.track",
}
"""Names that vdet 1.0 exported, with their modules."""


def __getattr__(name: str) -> object:
    from importlib import import_module
    from importlib.util import find_spec

    if module := _DEPRECATED.get(name):
        from warnings import warn

        text = f"vdet.{name} will be removed in vdet 2.0; use {module}.{name}"
        warn(text, DeprecationWarning, stacklevel=2)
        return getattr(import_module(module), name)
    # A module is imported after this, as in `from vdet import cli`, without the API.
    if name == "__all__" or not (name.startswith("__") or find_spec(f"vdet.{name}")):
        api = import_module("vdet.api")
        if name == "__all__" or name in api.__all__:
            return getattr(api, name)
    raise AttributeError(f"module 'vdet' has no attribute {name!r}")
