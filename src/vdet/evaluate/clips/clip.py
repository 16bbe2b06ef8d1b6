"""A video with its truth, and the boxes that are found in it."""

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

from vdet.config.schema import Settings
from vdet.errors import ImageError, VideoError
from vdet.evaluate.clips.following import follow_under_all
from vdet.evaluate.labelled_video import LabelledVideo, Row
from vdet.evaluate.truth import read_truth
from vdet.files import OutputFiles
from vdet.media import VideoReader
from vdet.pipeline.sinks.protocol import Output, SinkContext, open_sink
from vdet.track.track import Track

Advance = Callable[[int], object]
Progress = Callable[[int | None], Advance]


@dataclass(frozen=True, slots=True, eq=False)
class Clip:
    """A video and the truth of its first frames; `until` is the last of these, None for all."""

    video: Path
    truth_path: Path
    truth: LabelledVideo
    until: int | None


def open_clip(video: Path, truth_path: Path, until: int | None = None) -> Clip:
    """Read the truth of a video.

    Parameters
    ----------
    until
        Number of the last frame to look at, from 1; without it, the last that the truth knows of.

    Raises
    ------
    TruthError
        The truth cannot be used.
    """
    truth = read_truth(truth_path)
    if until is not None:
        truth = truth.until(until)
    return Clip(video, truth_path, truth, until or truth.last_frame or None)


def detect(
    clip: Clip,
    variants: Sequence[Settings],
    model: Path | None,
    progress: Progress,
    outputs: Sequence[Output] = (),
) -> list[LabelledVideo]:
    """Find and follow the vehicles of a clip under each of the settings, in one pass.

    Parameters
    ----------
    model
        Model file of the detector; None for the shipped one.
    outputs
        What else gets the results under the first of the settings.
    progress
        Called with the expected number of frames (None: unknown); what it returns is called with
        the number of frames done since the last call.

    Raises
    ------
    VideoError
        The video cannot be read or searched.
    TruthError
        The truth knows of frames beyond the end of the video.
    """
    rows: list[list[Row]] = [[] for _ in variants]
    frames = 0
    with ExitStack() as stack:
        files = stack.enter_context(OutputFiles())
        reader = stack.enter_context(
            VideoReader(clip.video, frames=clip.until, settings=variants[0].input)
        )
        context = SinkContext(files, variants[0], reader.info)
        sinks = [stack.enter_context(open_sink(output, context)) for output in outputs]
        advance = progress(reader.expected)
        try:
            for results in follow_under_all(reader, variants, model, reader.info):
                for sink in sinks:
                    sink.write(results[0])
                for row, result in zip(rows, results, strict=True):
                    row += [_row(result.frame.index + 1, track) for track in result.tracks]
                frames = results[0].frame.index + 1
                advance(1)
        except ImageError as error:
            raise VideoError(f"{clip.video}: {error}") from error
        rate = float(reader.info.rate)
    if clip.until is not None and frames < clip.until:
        read_truth(clip.truth_path, frame_count=frames)  # refuses it, and names the line
    return [LabelledVideo.from_rows(each, frame_count=frames, rate=rate) for each in rows]


def _row(number: int, track: Track) -> Row:
    box = track.box
    return Row(0, number, track.id, box.x, box.y, box.width, box.height, score=track.score)
