"""The demo: a drawn road, both detectors on it, and what they find against the truth."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from vdet.config.loading import load_settings
from vdet.config.schema import Settings
from vdet.detect.factory import load_detector
from vdet.detect.svm.model import save_model
from vdet.evaluate.scores import Scores, score
from vdet.files import check_output, make_folder, staged
from vdet.labels.reading import read_predictions, read_tracks, read_truth
from vdet.learn.svm.dataset import find_patches
from vdet.learn.svm.metrics import TrainingMetrics
from vdet.learn.svm.training import train
from vdet.media.writer import may_replace_video
from vdet.progress import Steps, no_steps
from vdet.run.sinks.protocol import Output
from vdet.run.video import VideoJob, check_job, run_video
from vdet.synthetic import demo_scene, write_clip, write_patches, write_truth
from vdet.synthetic.scene import Scene
from vdet.traffic.counter import count_events
from vdet.traffic.layout import lay_out

PATCHES = 1200
"""Of each class."""

SEED = 5
"""Of what is drawn where no other seed is given."""

LINES = """\
# The line of the demo: one vehicle overtakes the camera there, and one is overtaken.
lines:
  - {name: right lanes, start: [0.45, 0.72], end: [0.99, 0.72], left: ahead, right: back}
drawn: true
"""


@dataclass(frozen=True, slots=True)
class DemoFiles:
    """The files of the demo in its folder."""

    folder: Path

    @property
    def clip(self) -> Path:
        """The road."""
        return self.folder / "road.mp4"

    @property
    def truth(self) -> Path:
        """The true boxes of the road, MOTChallenge columns."""
        return self.folder / "truth.txt"

    @property
    def lines(self) -> Path:
        """The line at which vehicles are counted."""
        return self.folder / "lines.yaml"

    @property
    def found(self) -> VideoJob:
        """The run of the network: the road with the vehicles, their tracks, counts and page."""
        outputs = {"video": "found.mp4", "tracks": "found.csv", "counts": "counts.csv"}
        return self._job(outputs | {"page": "page"})

    @property
    def patches(self) -> Path:
        """Folder of the labelled patches."""
        return self.folder / "patches"

    @property
    def model(self) -> Path:
        """The linear model that is trained on the patches."""
        return self.folder / "model.npz"

    @property
    def training(self) -> Path:
        """The metrics of the training."""
        return self.folder / "model.json"

    @property
    def found_by_model(self) -> VideoJob:
        """The run of the linear model: its tracks, and pictures of every stage of one frame."""
        return self._job({"tracks": "model.csv", "stages": "stages"})

    def _job(self, outputs: dict[str, str]) -> VideoJob:
        return VideoJob(
            self.clip, tuple(Output(sink, self.folder / name) for sink, name in outputs.items())
        )


@dataclass(frozen=True, slots=True)
class DemoRow:
    """What a detector found: its scores, and the number of vehicles that it counted."""

    detector: str
    scores: Scores
    counted: int


@dataclass(frozen=True, slots=True)
class DemoResult:
    """What the demo measured; `crossings` is the true number of vehicles at the line."""

    rows: tuple[DemoRow, ...]
    crossings: int
    training: TrainingMetrics

    def lines(self) -> Iterator[str]:
        """Yield the result as lines of text."""
        width = max(len(row.detector) for row in self.rows)
        yield f"{'':{width}}  precision  recall    F1  IDF1  id switches  counted at the line"
        for row in self.rows:
            scores = row.scores
            yield (
                f"{row.detector:{width}}  {scores.precision:9.2f}  {scores.recall:6.2f}  "
                f"{scores.f1:.2f}  {scores.idf1:.2f}  {scores.id_switches:11d}  "
                f"{row.counted} of {self.crossings}"
            )


def check_demo(files: DemoFiles, *, overwrite: bool) -> None:
    """Make the folder, and refuse to replace an earlier demo. Raises `OutputError`."""
    make_folder(files.folder)
    check_output(files.clip, overwrite=overwrite, may_replace=may_replace_video)
    for path in (files.truth, files.lines, files.model, files.training):
        check_output(path, overwrite=overwrite)
    for job in (files.found, files.found_by_model):
        check_job(replace(job, overwrite=overwrite))


def run_demo(
    files: DemoFiles,
    *,
    seed: int = SEED,
    overwrite: bool = False,
    announce: Callable[[str], object] = lambda _: None,
    steps: Steps = no_steps,
) -> DemoResult:
    """Draw a road, find its vehicles with both detectors, and compare them with the truth.

    The linear model is trained on drawn patches first.

    Parameters
    ----------
    seed
        Of everything that is drawn; the same seed gives the same data.
    overwrite
        Replace the files of an earlier demo.
    announce
        Called with a line before each step.
    steps
        Called at the start of each longer step.
    """
    scene = demo_scene(seed)
    announce("1/4 drawing a road with vehicles …")
    steps("drawing", None)
    write_clip(files.clip, scene, overwrite=overwrite)
    write_truth(files.truth, scene, overwrite=overwrite)
    with staged(files.lines, overwrite=overwrite) as temporary:
        temporary.write_text(LINES, encoding="utf-8")
    settings = load_settings(places={"counts": files.lines})

    def find(job: VideoJob, settings: Settings, model: Path | None = None) -> None:
        detector = load_detector(settings.detector, model)
        job = replace(job, at=scene.frames / scene.rate / 2, overwrite=overwrite)
        run_video(job, detector, settings, progress=partial(steps, "frames"))

    announce("2/4 finding the vehicles with the network …")
    find(files.found, settings)
    announce(f"3/4 drawing {2 * PATCHES:,} patches, and training a linear model on them …")
    steps("drawing", None)
    write_patches(
        files.patches, seed=seed, vehicles=PATCHES, non_vehicles=PATCHES, overwrite=overwrite
    )
    linear = load_settings(detector="svm")
    model, training = train(find_patches([files.patches]), linear, steps=steps)
    save_model(model, files.model, overwrite=overwrite)
    training.write(files.training, overwrite=overwrite)
    announce("4/4 finding the vehicles with the linear model …")
    find(files.found_by_model, linear, files.model)
    runs = {"network": files.found, f"linear model {files.model.name}": files.found_by_model}
    rows = (
        _row(name, output.path, files, scene, settings)
        for name, job in runs.items()
        for output in job.outputs
        if output.sink == "tracks"
    )
    return DemoResult(tuple(rows), _count(files.truth, scene, settings), training)


def _row(
    detector: str, tracks: Path, files: DemoFiles, scene: Scene, settings: Settings
) -> DemoRow:
    scores = score(read_predictions(tracks), read_truth(files.truth), rate=float(scene.rate))
    return DemoRow(detector, scores, _count(tracks, scene, settings))


def _count(tracks: Path, scene: Scene, settings: Settings) -> int:
    """Return how many vehicles of a file of tracks cross the line."""
    layout = lay_out(settings.counts, scene.camera.width, scene.camera.height)
    return len([*count_events(read_tracks(tracks, float(scene.rate)).frames, layout)])
