"""Scores of videos as lines of text, and as plain JSON values."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict
from typing import Any

from vdet.evaluate.clips.evaluate import ClipResult, RunResult, best
from vdet.evaluate.mistakes import Mistake
from vdet.evaluate.output import ABSENT, RunName, plain_run, share, table
from vdet.evaluate.scores import Scores

LARGEST = 10
"""Most mistakes listed for a video."""

HEADINGS = (
    *("precision", "recall", "F1", "AP50", "AP50:95", "IoU"),
    *("MOTA", "IDF1", "HOTA", "switches", "false tracks"),
)


def key_figures(scores: Scores) -> list[str]:
    """Return the texts under `HEADINGS`."""
    found = (scores.precision, scores.recall, scores.f1, scores.ap50, scores.ap50_95)
    followed = (scores.mean_iou, scores.mota, scores.idf1, scores.hota)
    ratios = [share(value) for value in (*found, *followed)]
    return [*ratios, str(scores.id_switches), str(scores.false_tracks)]


def result_lines(runs: Sequence[RunResult]) -> Iterator[str]:
    """Yield runs as lines: one run in full, several (a sweep) with a row each."""
    if len(runs) > 1:
        yield from sweep_lines(runs)
        return
    (run,) = runs
    yield from table(("video", *HEADINGS), list(clip_rows(run)))
    yield ""
    yield from map(frames_line, run.clips)
    yield from detail_lines(run.total)
    for clip in run.clips:
        yield from mistake_lines(clip)


def frames_line(clip: ClipResult) -> str:
    """Return which frames of a video were compared."""
    left_out = f"; left out: {clip.left_out} boxes found in later ones" if clip.left_out else ""
    return f"{clip.name}: frames 1–{clip.until} compared{left_out}"


def clip_rows(run: RunResult) -> Iterator[list[str]]:
    """Yield a row of text for each video, and one for the total of several."""
    for clip in run.clips:
        yield [clip.name, *key_figures(clip.scores)]
    if len(run.clips) > 1:
        yield ["total", *key_figures(run.total)]


def sweep_lines(runs: Sequence[RunResult]) -> Iterator[str]:
    """Yield a row for each setting, and the best one by F1."""
    yield from table(("setting", *HEADINGS), sweep_rows(runs))
    top = best(runs)
    yield ""
    yield f"best F1: {setting_name(top)} ({share(top.total.f1)})"


def sweep_rows(runs: Iterable[RunResult]) -> list[list[str]]:
    """Return a row of text for the total of each run."""
    return [[setting_name(run), *key_figures(run.total)] for run in runs]


def setting_name(run: RunResult) -> str:
    """Return the assignments that tell a run from the others."""
    return " ".join(run.assignments)


def detail_lines(scores: Scores) -> list[str]:
    """Return the numbers that are not key figures."""
    delay = ABSENT if scores.mean_delay is None else f"{scores.mean_delay:.1f} frames"
    rate = scores.false_tracks_per_minute
    per_minute = "" if rate is None else f" ({rate:.1f} a minute)"
    boxes = (
        f"boxes: {scores.vehicle_boxes} true ones (vehicles: {scores.vehicles}); "
        f"{scores.matches} found, {scores.misses} missed, {scores.false_positives} false alarms"
    )
    tracks = (
        f"tracks: {scores.tracks}, of which {scores.false_tracks} false{per_minute}; "
        f"{scores.id_switches} id switches, {scores.fragmentations} fragmentations"
    )
    vehicles = (
        f"vehicles: {scores.mostly_tracked} mostly tracked, {scores.partly_tracked} partly, "
        f"{scores.mostly_lost} mostly lost, {scores.never_found} never found; "
        f"mean time to the first detection {delay}"
    )
    further = (
        f"also: MOTP {share(scores.motp)}, IDP {share(scores.idp)}, IDR {share(scores.idr)}, "
        f"DetA {share(scores.deta)}, AssA {share(scores.assa)}"
    )
    return [boxes, tracks, vehicles, further]


def mistake_lines(clip: ClipResult) -> Iterator[str]:
    """Yield the largest mistakes of a video as a table; nothing if there are none."""
    if clip.mistakes:
        yield ""
        yield f"largest of {len(clip.mistakes)} mistakes in {clip.name}"
        headings = ("what", "frames", "boxes", "best IoU")
        yield from table(headings, [mistake_row(mistake) for mistake in clip.mistakes[:LARGEST]])


def mistake_row(mistake: Mistake) -> list[str]:
    """Return a mistake as a row of text: what, frames, boxes, best IoU."""
    return [
        mistake_name(mistake),
        frame_span(mistake),
        str(mistake.boxes),
        share(mistake.overlap, 2),
    ]


def frame_span(mistake: Mistake) -> str:
    """Write the frames of a mistake."""
    return f"{mistake.first}–{mistake.last}" if mistake.boxes > 1 else str(mistake.first)


def mistake_name(mistake: Mistake) -> str:
    """Name what was lost."""
    return (
        f"vehicle {mistake.id} missed"
        if mistake.kind == "missed"
        else f"false alarm, track {mistake.id}"
    )


def plain(runs: Sequence[RunResult], name: RunName) -> dict[str, Any]:
    """Return runs as values for JSON.

    Beside the detector, one run has `total` and `videos`; several have these each, with their
    `settings`, in `sweep`.
    """
    if len(runs) == 1:
        return plain_run(name) | _plain_result(runs[0])
    return {
        **plain_run(name),
        "sweep": [
            {"settings": dict(text.split("=", 1) for text in run.assignments), **_plain_result(run)}
            for run in runs
        ],
    }


def _plain_result(run: RunResult) -> dict[str, Any]:
    videos = [{"video": clip.name, **plain_clip(clip)} for clip in run.clips]
    return {"total": asdict(run.total), "videos": videos}


def plain_clip(clip: ClipResult) -> dict[str, Any]:
    """Return the scores of a video and its mistakes as values for JSON."""
    lost = [{**asdict(mistake), "boxes": mistake.boxes} for mistake in clip.mistakes]
    frames = {"until": clip.until, "left_out": clip.left_out}
    return {**asdict(clip.scores), **frames, "mistakes": lost}
