"""A labelled video, and the vehicles that are found in it under one or several settings.

The search takes nearly all the time, so settings that search alike share it: every frame is
searched once for them, and only what follows the search runs for each.
"""

from collections.abc import Iterable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

from vdet.config.schema import Settings
from vdet.detect.protocol import DetectorModel
from vdet.errors import ImageError, VideoError
from vdet.files import OutputFiles
from vdet.labels.rows import Row
from vdet.labels.truth import read_truth
from vdet.labels.video import LabelledVideo
from vdet.media import Frame, VideoInfo, VideoReader
from vdet.progress import Progress
from vdet.run.loop import peek
from vdet.run.result import FrameResult
from vdet.run.sinks.protocol import Output, SinkContext, open_sink
from vdet.run.stride import follow_frame, search_frame
from vdet.run.threads import single_threaded_libraries
from vdet.track.factory import make_tracker
from vdet.track.track import Track


@dataclass(frozen=True, slots=True, eq=False)
class Clip:
    """A video and the truth of its first frames; `until` is the last of these, None for all."""

    video: Path
    truth_path: Path
    truth: LabelledVideo
    until: int | None


@dataclass(frozen=True, slots=True, eq=False)
class Variant:
    """Settings to compare with others, and the detector that was loaded with them.

    `assignments` are those in which the settings differ from the others, as `--set` takes them.
    """

    settings: Settings
    model: DetectorModel
    assignments: tuple[str, ...] = ()


def open_clip(video: Path, truth_path: Path, until: int | None = None) -> Clip:
    """Read the truth of a video.

    Parameters
    ----------
    until
        Number of the last frame to use, from 1; None: the last that the truth covers.

    Raises
    ------
    TruthError
        The truth cannot be used.
    """
    truth = read_truth(truth_path)
    if until is not None:
        truth = truth.until(until)
    return Clip(video, truth_path, truth, until or truth.last_frame or None)


def find_tracks(
    clip: Clip,
    variants: Sequence[Variant],
    progress: Progress,
    outputs: Sequence[Output] = (),
    *,
    overwrite: bool = False,
) -> list[LabelledVideo]:
    """Find and follow the vehicles of a clip under each of the settings, in one pass.

    Parameters
    ----------
    progress
        Called with the expected number of frames (None: unknown); what it returns is called with
        the number of frames done since the last call.
    outputs
        Outputs that get the results under the first of the settings.
    overwrite
        Replace outputs that are there.

    Raises
    ------
    VideoError
        The video cannot be read or searched.
    TruthError
        The truth covers frames beyond the end of the video.
    OutputError
        An output cannot be written.
    """
    rows: list[list[Row]] = [[] for _ in variants]
    frames = 0
    with ExitStack() as stack:
        files = stack.enter_context(OutputFiles(overwrite=overwrite))
        reader = stack.enter_context(
            VideoReader(clip.video, frames=clip.until, settings=variants[0].settings.input)
        )
        context = SinkContext(files, variants[0].settings, reader.info)
        sinks = [stack.enter_context(open_sink(output, context)) for output in outputs]
        advance = progress(reader.expected)
        try:
            for results in follow_variants(reader, variants, reader.info):
                for sink in sinks:
                    sink.write(results[0])
                for row, result in zip(rows, results, strict=True):
                    row += [_row(result.frame.index + 1, track) for track in result.tracks]
                frames = results[0].frame.index + 1
                advance(1)
        except ImageError as error:
            raise VideoError(f"{clip.video}: {error}") from error
        if clip.until is not None and frames < clip.until:
            read_truth(clip.truth_path, frame_count=frames)  # raises an error with the line
        rate = float(reader.info.rate)
    return [LabelledVideo.from_rows(each, frame_count=frames, rate=rate) for each in rows]


def follow_variants(
    frames: Iterable[Frame], variants: Sequence[Variant], video: VideoInfo
) -> Iterator[list[FrameResult]]:
    """Return for each frame a result for each of the settings, in their order.

    The results under one of the settings do not depend on the others, and are those of
    `vdet.run.loop.follow_frames`.

    Raises
    ------
    ImageError
        Such frames cannot be searched.
    """
    images, frames = peek(frames)
    size = video.width, video.height
    detectors = [each.model.for_video(*size, images) for each in variants]
    del images  # else they stay in memory for the whole run
    trackers = [make_tracker(each.settings, *size) for each in variants]
    sections = [each.settings.detector for each in variants]
    keys = [(section.search_key, section.stride_at(video.rate)) for section in sections]
    searchers = dict(zip(keys, detectors, strict=True))
    with single_threaded_libraries():
        for position, frame in enumerate(frames):
            searches = {
                key: search_frame(searcher, frame, position, stride=key[1])
                for key, searcher in searchers.items()
            }
            results = []
            for key, detector, tracker in zip(keys, detectors, trackers, strict=True):
                found = searches[key]
                searched = found is not None
                detections, tracks = follow_frame(detector, tracker, found, frame)
                results.append(
                    FrameResult(
                        video.path, frame, detections, tracks, None, detector, searched=searched
                    )
                )
            yield results


def _row(number: int, track: Track) -> Row:
    box = track.box
    return Row(0, number, track.id, box.x, box.y, box.width, box.height, score=track.score)
