"""Settings with which tests find vehicles quickly in the small clip, with the small model.

There is one set of windows, about as large as the nearest vehicle, and boxes are made and followed
as in the original system. The model has seen few patches. So a window needs a higher probability,
and a region less heat than usual.
"""

QUICK = (
    "detector.kind=svm",
    "detector.search.probability=0.5",
    "detector.search.windows=[{size: 80, overlap: 0.875, top: 380, bottom: 520}]",
    "detector.search.perspective.sizes=[]",
    "detector.stride=1",
    "detector.heat={frames: 4, threshold: 0.1, votes: null}",
    "detector.score.middle=0.1",
    "detector.min_score_still=0",
    "detector.min_size_still=[0.04, 0.07]",
    "tracker.kind=rules",
    "tracker.confident_peak=0.35",
    "tracker.confident_detections_needed=2",
)
QUICK_OPTIONS = tuple(word for assignment in QUICK for word in ("--set", assignment))


def only_windows(settings: str) -> tuple[str, ...]:
    """Return the options for one set of windows and no others."""
    search = f"{{perspective: {{sizes: []}}, windows: [{{{settings}}}]}}"
    return ("--set", "detector.kind=svm", "--set", f"detector.search={search}")


FEW_OPTIONS = ("--set", "tracker.confirm_seconds=5", "--set", "output.preset=ultrafast")
"""Options with which a run takes little time and shows no vehicle."""
