"""A labelled video, and the vehicles that are found in it under one or several settings.

The search takes nearly all the time, so settings that search alike share it: every frame is
searched once for them, and only what follows the search runs for each.
"""

import itertools
import threading
from collections import deque
from collections.abc import Hashable, Iterable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from vdet.boxes import Box
from vdet.config.schema import Settings
from vdet.detect.protocol import DetectorModel, VideoDetector, stage_pictures_of
from vdet.errors import VideoError
from vdet.files import OutputFiles
from vdet.labels.label import Label
from vdet.labels.reading import read_truth
from vdet.labels.roles import DEFAULT_ROLES, Roles
from vdet.labels.video import LabelledVideo
from vdet.lanes.road import LaneRequest
from vdet.media import Frame, Picture, VideoInfo, VideoReader
from vdet.media.images import Image
from vdet.progress import Progress
from vdet.regions import Regions, lay_regions
from vdet.run.loop import Pipeline, build, named_errors, peek
from vdet.run.result import FrameResult
from vdet.run.sinks.protocol import Output, SinkContext, open_sinks
from vdet.track.track import Track

_KEPT = 4
"""Searches that are kept for the other settings; each runs at most two ahead of the results."""


@dataclass(frozen=True, slots=True, eq=False)
class Clip:
    """A video and the truth of its first frames; `until` is the last of these, None for all."""

    video: Path
    truth_path: Path
    truth: LabelledVideo
    until: int | None
    roles: Roles = DEFAULT_ROLES


@dataclass(frozen=True, slots=True, eq=False)
class Variant:
    """Settings to compare with others, and the detector that was loaded with them.

    `assignments` are those in which the settings differ from the others, as `--set` takes them.
    """

    settings: Settings
    model: DetectorModel
    assignments: tuple[str, ...] = ()


def open_clip(
    video: Path, truth_path: Path, until: int | None = None, roles: Roles = DEFAULT_ROLES
) -> Clip:
    """Read the truth of a video.

    Parameters
    ----------
    until
        Number of the last frame to use, from 1; None: the last that the truth covers.
    roles
        What the labels of the truth mean.

    Raises
    ------
    TruthError
        The truth cannot be used.
    """
    truth = read_truth(truth_path, roles)
    if until is not None:
        truth = truth.until(until)
    return Clip(video, truth_path, truth, until or truth.last_frame or None, roles)


def find_tracks(
    clip: Clip,
    variants: Sequence[Variant],
    progress: Progress,
    outputs: Sequence[Output] = (),
    *,
    lanes: LaneRequest | None = None,
    overwrite: bool = False,
) -> list[tuple[LabelledVideo, LabelledVideo]]:
    """Find and follow the vehicles of a clip under each of the settings, in one pass.

    Returns the tracks and the truth for each of them. Vehicles of the truth that stand outside the
    regions are ignored.

    Parameters
    ----------
    progress
        Called with the expected number of frames (None: unknown); what it returns is called with
        the number of frames done since the last call.
    outputs
        Outputs that get the results under the first of the settings.
    lanes
        If it is given, the lane is found too, for the outputs.
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
    rows: list[list[Label]] = [[] for _ in variants]
    frames = 0
    with ExitStack() as stack:
        files = stack.enter_context(OutputFiles(overwrite=overwrite))
        reader = stack.enter_context(
            VideoReader(clip.video, frames=clip.until, settings=variants[0].settings.input)
        )
        images, read = peek(reader)
        advance = progress(reader.expected)
        with named_errors(clip.video, VideoError):
            pipelines = build_variants(variants, reader.info, images, lanes)
            del images  # else they stay in memory for the whole run
            context = SinkContext(
                files,
                variants[0].settings,
                reader.info,
                stage_pictures=stage_pictures_of(pipelines[0].detector),
            )
            sinks = stack.enter_context(open_sinks(outputs, context))
            for results in follow_together(pipelines, read, clip.video):
                for sink in sinks:
                    sink.write(results[0])
                for row, result in zip(rows, results, strict=True):
                    row += [_label(result.frame.index + 1, track) for track in result.tracks]
                frames = results[0].frame.index + 1
                advance(1)
        if clip.until is not None and frames < clip.until:
            read_truth(
                clip.truth_path, clip.roles, frame_count=frames
            )  # raises an error with the line
        info, truth = reader.info, clip.truth.until(frames)
    return [
        (
            LabelledVideo.of(each, frame_count=frames, rate=float(info.rate)),
            _in_regions(truth, lay_regions(variant.settings.regions, info.width, info.height)),
        )
        for each, variant in zip(rows, variants, strict=True)
    ]


def _in_regions(truth: LabelledVideo, regions: Regions | None) -> LabelledVideo:
    """Return the truth of a video, in which vehicles outside the regions are ignored."""
    if regions is None:
        return truth
    outside = [not regions.contains(Box(*sides).foot) for sides in truth.boxes.tolist()]
    return replace(truth, ignored=truth.ignored | np.array(outside, np.bool_))


def build_variants(
    variants: Sequence[Variant],
    video: VideoInfo,
    images: Sequence[Image],
    lanes: LaneRequest | None = None,
) -> list[Pipeline]:
    """Build what the frames go through under each of the settings; `images` are from `peek`.

    Those that search alike share their search. Errors as of `vdet.run.loop.build`.
    """
    searches: dict[Hashable, SharedSearch] = {}
    pipelines = []
    for each in variants:
        own = build(each.model, each.settings, video, images, lanes=lanes)
        key = each.settings.detector.search_key, own.stride, each.settings.regions
        search = searches.setdefault(key, SharedSearch(own.detector))
        pipelines.append(replace(own, detector=SharingDetector(search, own.detector)))
    return pipelines


def follow_together(
    pipelines: Sequence[Pipeline], frames: Iterable[Frame], source: Path
) -> Iterator[tuple[FrameResult, ...]]:
    """Yield for each frame the results of all pipelines; none depends on the others."""
    copies = itertools.tee(frames, len(pipelines))
    runs = [pipeline.follow(copy, source) for pipeline, copy in zip(pipelines, copies, strict=True)]
    return zip(*runs, strict=True)


class SharedSearch:
    """The search of a detector; each frame is searched once, for several that search alike."""

    def __init__(self, detector: VideoDetector) -> None:
        self._detector = detector
        self._lock = threading.Lock()
        self._latest: deque[tuple[int | None, Any]] = deque(maxlen=_KEPT)

    def search(self, picture: Picture, index: int | None) -> Any:
        """Return the candidates of a frame."""
        with self._lock:
            for known, candidates in self._latest:
                if known == index:
                    return candidates
            candidates = self._detector.search(picture, index)
            self._latest.append((index, candidates))
            return candidates


class SharingDetector:
    """A detector that takes its candidates from a `SharedSearch`."""

    def __init__(self, search: SharedSearch, detector: VideoDetector) -> None:
        self.search = search.search
        self.detect = detector.detect
        self.stage_pictures = stage_pictures_of(detector)


def _label(number: int, track: Track) -> Label:
    return Label(0, track.box.pixels, frame=number, id=track.id, score=track.score)
