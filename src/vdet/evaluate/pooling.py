"""Several videos scored as one."""

from collections.abc import Sequence
from dataclasses import replace

from vdet.evaluate.comparison import ComparedFrame, Comparison, joined


def pool(comparisons: Sequence[Comparison]) -> Comparison:
    """Join the comparisons of several videos; the scores of the result are their total.

    A vehicle or track of one video is never that of another, whatever its id. The length is known
    only where every video's is.
    """
    frames: list[ComparedFrame] = []
    vehicles = tracks = 0
    for one in comparisons:
        frames += [
            replace(frame, vehicles=frame.vehicles + vehicles, tracks=frame.tracks + tracks)
            for frame in one.frames
        ]
        vehicles += len(one.vehicle_ids)
        tracks += len(one.track_ids)
    seconds = [one.seconds for one in comparisons if one.seconds is not None]
    return Comparison(
        tuple(frames),
        joined(one.vehicle_ids for one in comparisons),
        joined(one.track_ids for one in comparisons),
        sum(seconds) if len(seconds) == len(comparisons) else None,
    )
