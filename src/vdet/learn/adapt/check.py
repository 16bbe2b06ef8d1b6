"""What models find in the part of the footage that was kept back, as video."""

from collections.abc import Mapping, Sequence
from fractions import Fraction

from vdet.config.schema import Settings
from vdet.detect.svm.detector import SvmModel
from vdet.detect.svm.kind import with_search_of
from vdet.detect.svm.model import LinearModel
from vdet.errors import ImageError, VideoError
from vdet.evaluate.clips.clip import Variant, follow_variants
from vdet.evaluate.comparison import compare, pool
from vdet.evaluate.labelled_video import LabelledVideo
from vdet.evaluate.scores import score_comparison
from vdet.formats.rows import Row
from vdet.learn.adapt.footage import WatchedClip
from vdet.learn.adapt.report import CheckReport
from vdet.media import VideoReader
from vdet.pipeline.loop import Advance, Steps, no_steps


def check(
    clips: Sequence[WatchedClip],
    truths: Sequence[LabelledVideo],
    models: Mapping[str, LinearModel],
    settings: Settings,
    steps: Steps = no_steps,
    *,
    taught: bool = True,
) -> tuple[CheckReport, ...]:
    """Return how models, by name, do in the footage that was kept back.

    If a teacher has `taught` them, they are compared with its labels. With `truths`, one for each
    clip, they and the teacher are compared with these too.

    Raises
    ------
    VideoError
        A clip cannot be read or searched.
    """
    variants = [
        Variant(settings.model_copy(update={"detector": own}), SvmModel(model, own), (name,))
        for name, model in models.items()
        for own in [with_search_of(model, settings.svm)]
    ]
    frames = sum(len(clip.frames) - clip.learnt for clip in clips)
    advance = steps("checking", len(variants) * frames)
    found = [[_follow(clip, each, advance) for each in variants] for clip in clips]
    labels = [clip.kept_back(settings) for clip in clips] if taught else []
    reports = []
    if taught:
        reports += [
            _compare(name, "teacher", [each[number] for each in found], labels)
            for number, name in enumerate(models)
        ]
    if truths:
        kept = [_kept_back(truth, clip) for truth, clip in zip(truths, clips, strict=True)]
        reports += [
            _compare(name, "truth", [each[number] for each in found], kept)
            for number, name in enumerate(models)
        ]
        if taught:
            vehicles = [each.where(~each.ignored) for each in labels]
            reports.append(_compare("teacher", "truth", vehicles, kept))
    return tuple(reports)


def _kept_back(truth: LabelledVideo, clip: WatchedClip) -> LabelledVideo:
    """Return the truth of the frames that were watched and kept back."""
    frames = clip.frames[clip.learnt :]
    if not frames:
        return truth.where(slice(0))
    inside = (truth.frames >= frames[0].number) & (truth.frames <= frames[-1].number)
    return truth.where(inside)


def _compare(
    name: str, against: str, found: Sequence[LabelledVideo], labels: Sequence[LabelledVideo]
) -> CheckReport:
    pairs = zip(found, labels, strict=True)
    scores = score_comparison(pool([compare(each, label) for each, label in pairs]))
    return CheckReport.of(name, against, scores)


def _follow(clip: WatchedClip, variant: Variant, advance: Advance) -> LabelledVideo:
    """Return the vehicles that a variant shows in the frames that were kept back."""
    if clip.learnt == len(clip.frames):
        return LabelledVideo.from_rows([])
    rows: list[Row] = []
    start, count = Fraction(clip.frames[clip.learnt].time), len(clip.frames) - clip.learnt
    settings = variant.settings.input
    with VideoReader(clip.path, start=start, frames=count, settings=settings) as reader:
        try:
            for (result,) in follow_variants(reader, [variant], reader.info):
                for track in result.tracks:
                    box = track.box
                    place = (box.x, box.y, box.width, box.height)
                    row = Row(0, result.frame.index + 1, track.id, *place, score=track.score)
                    rows.append(row)
                advance(1)
        except ImageError as error:
            raise VideoError(f"{clip.path}: {error}") from error
        rate = float(reader.info.rate)
    return LabelledVideo.from_rows(rows, frame_count=clip.frames[-1].number, rate=rate)
