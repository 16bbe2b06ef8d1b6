"""The demo: both detectors on synthetic roads, compared with the ground truth."""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from vdet.config.loading import load_settings
from vdet.config.scene import NOWHERE
from vdet.config.schema import Settings
from vdet.detect.svm.detector import load_svm
from vdet.detect.svm.model import save_model
from vdet.errors import OutputError
from vdet.evaluate.results import table
from vdet.evaluate.scores import score
from vdet.files import make_folder, write_whole
from vdet.labels.reading import read_tracks, read_truth
from vdet.learn.svm.mining import MiningLimits, VideoSource, mine
from vdet.learn.svm.patches import find_patches
from vdet.learn.svm.training import train
from vdet.run.sinks import Output
from vdet.run.video import Run, run_video
from vdet.synthetic import Scene, busy_road, demo_scene, pole_scene, write_clip, write_truth
from vdet.traffic.counting import count_files
from vdet.workers import Progress

ROADS = 6
"""Number of synthetic roads to train the linear model on."""

ROAD, TRUTH = "road.mp4", "truth.txt"
"""The synthetic video of a moving camera, and its ground truth."""

POLE, POLE_TRUTH, GATE = "pole.mp4", "pole.txt", "gate.yaml"
"""The same from a pole, and the lines for counting."""

PATCHES, MODEL = "patches.zip", "model.npz"
"""The patches for the linear model, and the model with its metrics."""

_GATE = """\
# The lines of the demo, as fractions of the frame.
traffic:
  lines:
    - {name: north, start: [0.2, 0.45], end: [0.9, 0.45], left: out, right: in}
    - {name: south, start: [0.02, 0.8], end: [0.98, 0.8], left: in, right: out}
  draw: true
"""
_BY_NETWORK = {"video": "found.mp4", "tracks": "found.csv"}
_ON_POLE = {"video": "counted.mp4", "tracks": "pole.csv", "flows": "flows.csv", "page": "page"}
_LIMITS = MiningLimits(per_vehicle=2, false_alarms=6, parts=3, probability=0)
"""Few, because drawn cars are alike."""
_BY_MODEL = {"tracks": "model.csv", "stages": "stages"}


def run_demo(
    folder: Path,
    *,
    seed: int,
    overwrite: bool,
    announce: Callable[[str], object],
    progress: Progress,
) -> list[str]:
    """Render two roads, detect and count their vehicles, and compare them with the ground truth.

    The linear model is first trained on patches mined from other synthetic roads.

    Parameters
    ----------
    seed
        Seed of the scenes; the same seed gives the same data.
    overwrite
        Replace the files of an earlier demo.
    announce
        Called with a line of text before each part.
    progress
        Called at the start of each longer step.

    Returns
    -------
    Lines of text: the scores of each detector, and the flows from line to line.
    """
    make_folder(folder)
    if not overwrite and any(folder.iterdir()):
        raise OutputError(f"{folder}: is not empty; choose another folder, or use --overwrite")

    def draw(scene: Scene, clip: Path, truth: Path) -> None:
        write_clip(clip, scene, overwrite=overwrite)
        write_truth(truth, scene, overwrite=overwrite)

    def find(clip: str, outputs: dict[str, str], settings: Settings) -> None:
        paths = tuple(Output(sink, folder / name) for sink, name in outputs.items())
        run = Run(folder / clip, paths, settings, at=middle, overwrite=overwrite)
        run_video(run, progress=progress)

    scene, pole, rng = demo_scene(seed), pole_scene(seed), np.random.default_rng(seed)
    middle = scene.frames / scene.rate / 2
    announce("1/4 drawing two synthetic roads with vehicles …")
    progress("drawing", None)
    draw(scene, folder / ROAD, folder / TRUTH)
    draw(pole, folder / POLE, folder / POLE_TRUTH)
    write_whole(folder / GATE, _GATE, overwrite=overwrite)
    announce("2/4 finding and counting the vehicles with the network …")
    find(ROAD, _BY_NETWORK, load_settings())
    counting = load_settings([folder / GATE])
    find(POLE, _ON_POLE, counting)
    announce(f"3/4 drawing {ROADS} more roads, and training a linear model on patches of them …")
    linear = load_settings(detector="svm")
    make_folder(folder / "training")
    roads = [folder / "training" / f"road{number}.mp4" for number in range(1, ROADS + 1)]
    sources = [VideoSource(road, road.with_suffix(".txt"), every=2) for road in roads]
    for source in sources:
        draw(busy_road(rng), source.path, source.truth)
    model = load_svm(linear.svm, None)  # only the positions of its windows matter
    mine(
        sources,
        folder / PATCHES,
        linear,
        model,
        limits=_LIMITS,
        overwrite=overwrite,
        progress=progress,
    )
    learnt, _ = train(find_patches([folder / PATCHES]), linear, progress=progress)
    save_model(learnt, folder / MODEL, overwrite=overwrite)
    announce("4/4 finding the vehicles with the linear model …")
    chosen = linear.svm.model_copy(update={"model": str(folder / MODEL)})
    find(ROAD, _BY_MODEL, linear.model_copy(update={"detector": chosen}))
    truth, scores = read_truth(folder / TRUTH), []
    for name, outputs in (("network", _BY_NETWORK), (f"linear model {MODEL}", _BY_MODEL)):
        metrics = score(read_tracks(folder / outputs["tracks"]), truth)
        ratios = (metrics.precision, metrics.recall, metrics.f1, metrics.idf1)
        scores.append([name, *(f"{ratio:.2f}" for ratio in ratios), str(metrics.id_switches)])
    compared = table(("", "precision", "recall", "F1", "IDF1", "id switches"), scores)
    flows = _flows(folder, pole, counting)
    return [*compared, "", *table(("from", "to", "vehicles", "true"), flows)]


def _flows(folder: Path, scene: Scene, settings: Settings) -> list[list[str]]:
    """Return the flows seen from the pole: vehicles counted, and true ones."""
    size = scene.camera.width, scene.camera.height
    flows: dict[tuple[str, str], list[int]] = {}
    for number, (name, rate) in enumerate(
        ((_ON_POLE["tracks"], None), (POLE_TRUTH, float(scene.rate)))
    ):
        (video,) = count_files([folder / name], settings, size, rate).values()
        for row in video.flows():
            flows.setdefault((row.origin, row.destination or NOWHERE), [0, 0])[number] += row.count
    return [[*way, *map(str, numbers)] for way, numbers in flows.items()]
