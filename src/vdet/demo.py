"""The demo: a drawn road, both detectors on it, and what they find against the truth."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from vdet.config.loading import load_settings
from vdet.config.schema import Settings
from vdet.detect.factory import load_detector
from vdet.detect.svm.kind import load_svm
from vdet.detect.svm.model import save_model
from vdet.evaluate.output import table
from vdet.evaluate.scores import score
from vdet.files import any_file, check_output, make_folder, write_whole
from vdet.labels.reading import read_predictions, read_truth
from vdet.learn.svm.choosing import Most
from vdet.learn.svm.dataset import find_patches
from vdet.learn.svm.mining import VideoSource, mine
from vdet.learn.svm.training import train
from vdet.media.writer import may_replace_video
from vdet.progress import Steps, no_steps
from vdet.run.sinks.protocol import Output
from vdet.run.video import VideoJob, check_job, run_video
from vdet.synthetic.random_scenes import busy_road, demo_scene
from vdet.synthetic.render import write_clip
from vdet.synthetic.truth import write_truth
from vdet.traffic.counting import count_files

ROADS = 6
"""Drawn roads that the linear model learns from."""

SEED = 5
"""Default seed of what is drawn."""

ROAD, TRUTH, LINE = "road.mp4", "truth.txt", "lines.yaml"
"""The drawn video, its true boxes, and the line at which vehicles are counted."""

PATCHES, MODEL, METRICS = "patches.zip", "model.npz", "model.json"
"""The patches for the linear model, the model, and the metrics of its training."""

_LINE = """\
# The line of the demo: one vehicle overtakes the camera there, and one is overtaken.
lines:
  - {name: right lanes, start: [0.45, 0.72], end: [0.99, 0.72], left: ahead, right: back}
drawn: true
"""
_BY_NETWORK = {"video": "found.mp4", "tracks": "found.csv", "counts": "counts.csv", "page": "page"}
_MOST = Most(per_vehicle=2, false_alarms=6, parts=3)  # drawn vehicles are alike: few suffice
_BY_MODEL = {"tracks": "model.csv", "stages": "stages"}


def check_demo(folder: Path, *, overwrite: bool) -> None:
    """Make the folder, and refuse to replace an earlier demo. Raises `OutputError`."""
    make_folder(folder)
    names = (ROAD, TRUTH, LINE, PATCHES, MODEL, METRICS)
    learnt = [path for each in _roads_to_learn(folder) for path in (each.path, each.truth)]
    for path in (*(folder / name for name in names), *learnt):
        may_replace = may_replace_video if path.suffix == ".mp4" else any_file
        check_output(path, overwrite=overwrite, makes_folder=True, may_replace=may_replace)
    for outputs in (_BY_NETWORK, _BY_MODEL):
        check_job(_job(folder, outputs, overwrite=overwrite))


def _job(folder: Path, outputs: dict[str, str], *, overwrite: bool) -> VideoJob:
    paths = tuple(Output(sink, folder / name) for sink, name in outputs.items())
    return VideoJob(folder / ROAD, paths, overwrite=overwrite)


def run_demo(
    folder: Path,
    *,
    seed: int = SEED,
    overwrite: bool = False,
    announce: Callable[[str], object] = lambda _: None,
    steps: Steps = no_steps,
) -> list[str]:
    """Draw a road, find its vehicles with both detectors, and compare them with the truth.

    The linear model is first trained on patches that are mined from other drawn roads.

    Parameters
    ----------
    seed
        Seed of everything that is drawn; the same seed gives the same data.
    overwrite
        Replace the files of an earlier demo.
    announce
        Called with a line of text before each part.
    steps
        Called at the start of each longer step.

    Returns
    -------
    The comparison as lines of text: the scores of each detector, and how many vehicles it counted
    at the line, of how many that crossed it.
    """
    check_demo(folder, overwrite=overwrite)
    scene = demo_scene(seed)
    announce("1/4 drawing a road with vehicles …")
    steps("drawing", None)
    write_clip(folder / ROAD, scene, overwrite=overwrite)
    write_truth(folder / TRUTH, scene, overwrite=overwrite)
    write_whole(folder / LINE, _LINE, overwrite=overwrite)
    settings = load_settings(places={"counts": folder / LINE})
    size = scene.camera.width, scene.camera.height
    truth, rate = read_truth(folder / TRUTH), float(scene.rate)

    def count(tracks: Path) -> int:
        return len(count_files([tracks], settings.counts, size, rate)[str(tracks)].events)

    crossings = count(folder / TRUTH)

    def find(
        name: str, outputs: dict[str, str], settings: Settings, model: Path | None
    ) -> list[str]:
        job = replace(_job(folder, outputs, overwrite=overwrite), at=scene.frames / scene.rate / 2)
        detector = load_detector(settings.detector, model)
        run_video(job, detector, settings, progress=partial(steps, "frames"))
        tracks = folder / outputs["tracks"]
        found = score(read_predictions(tracks), truth, rate=rate)
        ratios = (found.precision, found.recall, found.f1, found.idf1)
        counted = f"{count(tracks)} of {crossings}"
        return [name, *(f"{ratio:.2f}" for ratio in ratios), str(found.id_switches), counted]

    announce("2/4 finding the vehicles with the network …")
    by_network = find("network", _BY_NETWORK, settings, None)
    announce(f"3/4 drawing {ROADS} more roads, and training a linear model on patches of them …")
    linear = load_settings(assignments=["train.mine.probability=0"], detector="svm")
    sources, rng = _roads_to_learn(folder), np.random.default_rng(seed)
    make_folder(folder / "training")
    for source in sources:
        busy = busy_road(rng)
        write_clip(source.path, busy, overwrite=overwrite)
        write_truth(source.truth, busy, overwrite=overwrite)
    model = load_svm(linear.svm, None)  # only the places of its windows matter
    mine(sources, folder / PATCHES, linear, model, most=_MOST, overwrite=overwrite, steps=steps)
    learnt, metrics = train(find_patches([folder / PATCHES]), linear, steps=steps)
    save_model(learnt, folder / MODEL, overwrite=overwrite)
    metrics.write(folder / METRICS, overwrite=overwrite)
    announce("4/4 finding the vehicles with the linear model …")
    by_model = find(f"linear model {MODEL}", _BY_MODEL, linear, folder / MODEL)
    return table(
        ("", "precision", "recall", "F1", "IDF1", "id switches", "counted at the line"),
        [by_network, by_model],
    )


def _roads_to_learn(folder: Path) -> tuple[VideoSource, ...]:
    training = folder / "training"
    return tuple(
        VideoSource(training / f"road{number}.mp4", training / f"road{number}.txt", every=2)
        for number in range(1, ROADS + 1)
    )
