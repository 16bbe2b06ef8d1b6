"""Rounds of learning: each adds the false alarms of the model of the round before."""

import tempfile
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from vdet.config.schema import Settings
from vdet.detect.svm.detector import SvmModel
from vdet.detect.svm.kind import with_search_of
from vdet.detect.svm.model import LinearModel
from vdet.errors import DataError
from vdet.evaluate.labelled_video import LabelledVideo
from vdet.learn.adapt.footage import WatchedClip
from vdet.learn.adapt.labels import write_labels
from vdet.learn.adapt.student import Learnt, between, learn
from vdet.learn.mining import MiningJob, VideoSource, mine
from vdet.pipeline.loop import Steps, no_steps
from vdet.workers import Workers


@dataclass(frozen=True, slots=True, eq=False)
class Lesson:
    """A clip and the labels of its frames to learn from."""

    clip: WatchedClip
    labels: LabelledVideo


def learn_in_rounds(
    start: LinearModel,
    lessons: Sequence[Lesson],
    settings: Settings,
    *,
    workers: Workers,
    steps: Steps = no_steps,
) -> list[Learnt]:
    """Let a model learn until it finds hardly any new false alarm; return what each round learnt.

    Raises
    ------
    VideoError
        A clip cannot be read or searched.
    DataError
        There is too little to learn from.
    """
    with tempfile.TemporaryDirectory(prefix="vdet-") as name:
        folder = Path(name)
        for number, lesson in enumerate(lessons):
            write_labels(lesson.labels, folder / f"{number}.txt")
        rounds: list[Learnt] = []
        model, archives = start, list[Path]()
        for number in range(settings.adapt.rounds):
            new = _mine_round(number, model, lessons, folder, settings=settings, steps=steps)
            alarms = sum(each.false_alarms for each in new)
            if rounds and alarms < settings.adapt.fewest * rounds[-1].non_vehicles:
                break
            if not rounds and not sum(each.vehicles for each in new):
                raise DataError(
                    "no vehicle to learn from: the teacher finds none, or none that a window fits; "
                    "give more footage, or smaller windows in detector.search.perspective.sizes"
                )
            archives += [each.archive for each in new]
            learnt = learn(start, archives, settings, workers=workers, steps=steps)
            rounds.append(learnt)
            model = between(start, learnt.model, settings.adapt.shares[0])
    return rounds


@dataclass(frozen=True, slots=True)
class _Mined:
    archive: Path
    vehicles: int
    false_alarms: int


def _mine_round(
    number: int,
    model: LinearModel,
    lessons: Sequence[Lesson],
    folder: Path,
    *,
    settings: Settings,
    steps: Steps,
) -> list[_Mined]:
    """Cut patches out of all clips; those of vehicles in the first round alone."""
    if number:
        mining = settings.mining.model_copy(update={"per_vehicle": 0})
        settings = settings.model_copy(update={"mining": mining})
    detector = SvmModel(model, with_search_of(model, settings.svm))
    most = max(1, settings.adapt.frames // len(lessons))
    mined = []
    for each, lesson in enumerate(lessons):
        clip = lesson.clip
        archive = folder / f"round{number}_{each}.zip"
        source = VideoSource(clip.path, folder / f"{each}.txt", numbers=clip.sample(most))
        with suppress(DataError):  # nothing to learn from this clip
            found = mine(
                MiningJob((source,), archive),
                settings,
                detector,
                steps=lambda name, total: steps(f"round {number + 1}, mining {name}", total),
            )
            mined.append(_Mined(archive, found.vehicles, found.false_alarms + found.parts))
    return mined
