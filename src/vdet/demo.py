"""The whole system on a made-up road: patches, training, detection, comparison with the truth."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from vdet.config.schema import Settings
from vdet.detect.factory import load_detector
from vdet.detect.svm.model import save_model
from vdet.evaluate.predictions import read_predictions
from vdet.evaluate.scores import Scores, score
from vdet.evaluate.truth import read_truth
from vdet.files import check_output, make_folder
from vdet.learn.dataset import find_patches
from vdet.learn.report import TrainingReport
from vdet.learn.training import train
from vdet.pipeline.loop import Progress, VideoJob, check_job, no_progress, run_video
from vdet.pipeline.sinks.protocol import Output
from vdet.synthetic.clip import write_clip, write_truth
from vdet.synthetic.patches import write_patches
from vdet.synthetic.random_scenes import demo_scene

PATCHES = 1200
"""Of each class."""


@dataclass(frozen=True, slots=True)
class DemoFiles:
    """What the demo leaves in its folder."""

    folder: Path

    @property
    def patches(self) -> Path:
        """Folder of the labelled patches."""
        return self.folder / "patches"

    @property
    def clip(self) -> Path:
        """The road, as the camera saw it."""
        return self.folder / "road.mp4"

    @property
    def truth(self) -> Path:
        """Where the vehicles really are, MOTChallenge columns."""
        return self.folder / "truth.txt"

    @property
    def model(self) -> Path:
        """Trained on the patches."""
        return self.folder / "model.npz"

    @property
    def report(self) -> Path:
        """Of the training."""
        return self.folder / "model.json"

    @property
    def result(self) -> Path:
        """The road with the found vehicles drawn in."""
        return self.folder / "found.mp4"

    @property
    def tracks(self) -> Path:
        """The found vehicles, a record a frame."""
        return self.folder / "found.jsonl"

    @property
    def stages(self) -> Path:
        """Folder of pictures of every stage at one moment."""
        return self.folder / "stages"

    @property
    def job(self) -> VideoJob:
        """What is made of the road."""
        outputs = {"video": self.result, "tracks": self.tracks, "stages": self.stages}
        return VideoJob(self.clip, tuple(Output(sink, path) for sink, path in outputs.items()))


@dataclass(frozen=True, slots=True)
class DemoResult:
    """What the demo found out, and where to look at it."""

    training: TrainingReport
    scores: Scores
    frames: int
    seconds: float


def check_demo(files: DemoFiles, *, overwrite: bool) -> None:
    """Make the folder, and refuse to write over an earlier demo. Raises `OutputError`."""
    make_folder(files.folder)
    for path in (files.clip, files.truth, files.model, files.report):
        check_output(path, overwrite=overwrite)
    check_job(files.job, overwrite=overwrite)


def run_demo(
    files: DemoFiles,
    settings: Settings,
    *,
    seed: int = 1,
    say: Callable[[str], object] = lambda _: None,
    progress: Progress = no_progress,
) -> DemoResult:
    """Make the data, train on them, detect in the clip, and compare with the truth.

    Parameters
    ----------
    seed
        Of everything that is drawn; the same seed gives the same data.
    say
        Told what comes next, a line a step.
    progress
        As `run_video` takes it, for the longer steps.
    """
    say(f"1/4 drawing {2 * PATCHES} patches and a road with vehicles …")
    write_patches(files.patches, seed=seed, vehicles=PATCHES, non_vehicles=PATCHES)
    scene = demo_scene(seed)
    write_clip(files.clip, scene)
    write_truth(files.truth, scene)
    say("2/4 training …")
    patches = find_patches([files.patches])
    model, report = train(patches, settings, progress=progress(len(patches)))
    save_model(model, files.model)
    report.write(files.report)
    say("3/4 finding the vehicles …")
    job = replace(files.job, at=scene.frames / scene.rate / 2)
    detector = load_detector(settings.detector, files.model)
    summary = run_video(job, detector, settings, progress=progress)
    say("4/4 comparing with the truth …")
    scores = score(read_predictions(files.tracks), read_truth(files.truth), rate=float(scene.rate))
    return DemoResult(report, scores, summary.frames, summary.seconds)
