"""Crossings counted on drawn roads, as in docs/comparison.md: `python -m benchmarks.comparison`.

With `pip install supervision trackers`, the rows of LineZone and ByteTrack are measured too.
"""

import tempfile
from collections import defaultdict
from collections.abc import Iterator, Sequence
from importlib.util import find_spec
from pathlib import Path
from statistics import fmean
from typing import Any

import vdet
from benchmarks.drawn_traffic import true_labels
from vdet.config.kinds import NetworkSettings
from vdet.config.scene import LineSettings, TrafficSettings
from vdet.config.schema import Settings
from vdet.evaluate.scores import Scores, score
from vdet.labels.label import SavedTracks
from vdet.run.steps import FrameResult
from vdet.synthetic import Scene, pole_scene, write_clip
from vdet.track.track import Track

SEEDS = (1, 2, 3, 4)
LINES = (
    LineSettings(name="north", start=(0.2, 0.45), end=(0.9, 0.45), left="out", right="in"),
    LineSettings(name="south", start=(0.02, 0.8), end=(0.98, 0.8), left="in", right="out"),
)
EVERY_FRAME = Settings(detector=NetworkSettings(stride=1), traffic=TrafficSettings(lines=LINES))

Row = tuple[int, Scores | None]
"""Crossings that were counted, and the scores of the tracks."""


def rows_of_road(seed: int, folder: Path) -> Iterator[tuple[str, Row]]:
    """Yield the name and the figures of each way to count on a road."""
    scene, clip = pole_scene(seed), folder / f"{seed}.mp4"
    write_clip(clip, scene)
    true = true_labels(scene, range(scene.frames))
    followed = vdet.follow(clip, settings=EVERY_FRAME)
    results = list(followed)
    shown = [result.frame_tracks.boxes for result in results]
    assert followed.counts is not None
    crossings = sum(total.count for total in followed.counts.totals)
    yield "vdet", (crossings, score(_labels(shown), true))
    if not (find_spec("supervision") and find_spec("trackers")):
        return
    import supervision

    feet = [supervision.Position.BOTTOM_CENTER]
    tracks = [boxes.to_supervision() for boxes in shown]
    yield "vdet, LineZone", (crossings_of(tracks, scene), None)
    yield "vdet, LineZone with feet", (crossings_of(tracks, scene, triggering_anchors=feet), None)
    for name, limits in (
        ("ByteTrack", {}),
        ("ByteTrack, 0.4", {"track_activation_threshold": 0.4, "high_conf_det_threshold": 0.4}),
    ):
        tracks = list(byte_tracks(results, float(scene.rate), **limits))
        boxes = [vdet.Boxes(item.xyxy, item.confidence, ids=item.tracker_id) for item in tracks]
        count = crossings_of(tracks, scene, triggering_anchors=feet)
        yield name, (count, score(_labels(boxes), true))


def byte_tracks(results: Sequence[FrameResult], rate: float, **limits: float) -> Iterator[Any]:
    """Yield what ByteTrack follows in the detections of each frame."""
    from trackers import ByteTrackTracker

    tracker = ByteTrackTracker(frame_rate=rate, **limits)
    for result in results:
        found = tracker.update(result.detections.to_supervision())
        yield found[found.tracker_id != -1] if len(found) else found


def crossings_of(tracks: Sequence[Any], scene: Scene, **options: Any) -> int:
    """Return the crossings that LineZone counts at all lines."""
    import supervision as sv

    size, count = (scene.camera.width, scene.camera.height), 0
    for line in LINES:
        ends = (
            sv.Point(*(a * b for a, b in zip(end, size, strict=True)))
            for end in (line.start, line.end)
        )
        zone = sv.LineZone(*ends, **options)
        for frame in tracks:
            if len(frame):
                zone.trigger(frame)
        count += zone.in_count + zone.out_count
    return count


def _labels(frames: Sequence[vdet.Boxes]) -> SavedTracks:
    return SavedTracks(
        {
            number: [Track(box.id or 0, box.box, box.score, "detected") for box in boxes]
            for number, boxes in enumerate(frames)
            if len(boxes)
        }
    )


def main() -> None:
    """Print a row for each way to count."""
    rows: dict[str, list[Row]] = defaultdict(list)
    with tempfile.TemporaryDirectory() as name:
        for seed in SEEDS:
            for way, row in rows_of_road(seed, Path(name)):
                rows[way].append(row)
    for way, found in rows.items():
        scores = [some for _, some in found if some]
        text = f"{way:<26}{sum(count for count, _ in found):>3} crossings"
        if scores:
            means = (fmean(getattr(some, key) for some in scores) for key in ("f1", "idf1"))
            text += "   F1 {:.3f}   IDF1 {:.3f}".format(*means)
            text += f"   {sum(some.id_switches for some in scores)} id switches"
        print(text)


if __name__ == "__main__":
    main()
