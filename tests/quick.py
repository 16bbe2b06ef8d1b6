"""Settings with which tests find vehicles quickly in the small clip, by the small model.

One set of windows, about as large as the nearest vehicle, and the original's outlines and rules;
and since the model has seen few patches, only what it is surer of counts, but less heat makes a
region, and less of it a confident one.
"""

QUICK = (
    "detector.search.probability=0.5",
    "detector.search.windows=[{size: 80, step: 1, top: 380, bottom: 520}]",
    "detector.search.perspective.sizes=[]",
    "detector.search.alternate=1",
    "detector.heat={frames: 4, weight: coverage, shrink: 4, blur: 15}",
    "detector.heat.threshold=0.1",
    "detector.heat.regions=outline",
    "detector.score.middle=0.1",
    "detector.stills={strength: 0, width: 0.04, height: 0.07}",
    "tracker.method=rules",
    "tracker.confident_peak=0.3",
    "tracker.confident_detections_needed=2",
)
QUICK_OPTIONS = tuple(word for assignment in QUICK for word in ("--set", assignment))


def only_windows(settings: str) -> tuple[str, ...]:
    """Give the options for one set of windows, and no others."""
    none = "detector.search.perspective.sizes=[]"
    return ("--set", f"detector.search.windows=[{{{settings}}}]", "--set", none)


FEW_OPTIONS = (
    *only_windows("size: 160, step: 8, top: 300, bottom: 620"),
    "--set",
    "detector.search.probability=1",
    "--set",
    "output.preset=ultrafast",
)
"""Options with which a run costs next to nothing, for tests of anything but what is found."""
