"""`vdet demo`: the whole system on a drawn road: patches, training, detection, evaluation."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import click

from vdet.cli.command import Command
from vdet.cli.messages import print_lines, print_message, progress_steps
from vdet.cli.options import PATH, overwrite_option, read_settings, settings_options
from vdet.config.schema import Settings
from vdet.detect.factory import load_detector
from vdet.detect.svm.model import save_model
from vdet.files import check_output, make_folder
from vdet.media.writer import may_replace_video
from vdet.pipeline.loop import Steps, VideoJob, check_job, no_steps, run_video
from vdet.pipeline.sinks.protocol import Output
from vdet.synthetic import demo_scene, write_clip, write_patches, write_truth

if TYPE_CHECKING:
    from vdet.evaluate.scores import Scores
    from vdet.learn.report import TrainingReport

PATCHES = 1200
"""Of each class."""


@click.command(
    cls=Command,
    examples=(
        "vdet demo",
        "vdet demo folder --seed 2 --overwrite",
    ),
)
@click.argument("folder", default=Path("demo"), type=PATH, metavar="[DIR]")
@click.option(
    "--seed",
    default=1,
    show_default=True,
    type=click.IntRange(min=0),
    metavar="N",
    help="Seed of everything that is drawn.",
)
@settings_options("training.C=1e-4")
@overwrite_option
@click.pass_obj
def demo(
    quiet: bool,
    *,
    folder: Path,
    seed: int,
    config_name: str | None,
    assignments: tuple[str, ...],
    overwrite: bool,
) -> None:
    """Try the whole program on a drawn road.

    Patches and a road with vehicles are drawn, a model is trained, the vehicles are found and
    compared with the truth. All files are written into DIR, or into demo where it is not given.
    """
    settings = read_settings(config_name, assignments)
    files = DemoFiles(folder)
    check_demo(files, overwrite=overwrite)
    with progress_steps("", quiet=quiet) as steps:
        result = run_demo(
            files,
            settings,
            seed=seed,
            overwrite=overwrite,
            report_step=(lambda _: None) if quiet else print_message,
            steps=steps,
        )
    for split in result.training.splits:
        print_lines(f"patches, {split.split} split: test accuracy {split.test_accuracy:.3f}")
    scores = result.scores
    print_lines(
        f"video: {result.frames} frames in {result.seconds:.1f} s "
        f"({result.frames / result.seconds:.1f} frames/s)",
        f"found boxes against the truth: precision {scores.precision:.2f}, "
        f"recall {scores.recall:.2f}, F1 {scores.f1:.2f} at IoU 0.5; "
        f"IDF1 {scores.idf1:.2f}, {scores.id_switches} id switches",
        "",
        "Look at",
        f"  {files.result}  the road with the vehicles found",
        f"  {files.stages}/  every stage of one frame as a picture",
        f"  {files.tracks}  the boxes, a record for each frame; {files.truth} has the true ones",
        f"  {files.report}  what training measured",
        "Then try your own:  vdet detect-video in.mp4 out.mp4",
    )


@dataclass(frozen=True, slots=True)
class DemoFiles:
    """The files of the demo in its folder."""

    folder: Path

    @property
    def patches(self) -> Path:
        """Folder of the labelled patches."""
        return self.folder / "patches"

    @property
    def clip(self) -> Path:
        """The road."""
        return self.folder / "road.mp4"

    @property
    def truth(self) -> Path:
        """The true boxes of the road, MOTChallenge columns."""
        return self.folder / "truth.txt"

    @property
    def model(self) -> Path:
        """The model that is trained on the patches."""
        return self.folder / "model.npz"

    @property
    def report(self) -> Path:
        """The report of the training."""
        return self.folder / "model.json"

    @property
    def result(self) -> Path:
        """The road with the found vehicles drawn in."""
        return self.folder / "found.mp4"

    @property
    def tracks(self) -> Path:
        """The found vehicles, a record for each frame."""
        return self.folder / "found.jsonl"

    @property
    def stages(self) -> Path:
        """Folder of pictures of every stage at one moment."""
        return self.folder / "stages"

    @property
    def job(self) -> VideoJob:
        """The detection in the road."""
        outputs = {"video": self.result, "tracks": self.tracks, "stages": self.stages}
        return VideoJob(self.clip, tuple(Output(sink, path) for sink, path in outputs.items()))


@dataclass(frozen=True, slots=True)
class DemoResult:
    """What the demo measured."""

    training: "TrainingReport"
    scores: "Scores"
    frames: int
    seconds: float


def check_demo(files: DemoFiles, *, overwrite: bool) -> None:
    """Make the folder, and refuse to replace an earlier demo. Raises `OutputError`."""
    make_folder(files.folder)
    check_output(files.clip, overwrite=overwrite, may_replace=may_replace_video)
    for path in (files.truth, files.model, files.report):
        check_output(path, overwrite=overwrite)
    check_job(replace(files.job, overwrite=overwrite))


def run_demo(
    files: DemoFiles,
    settings: Settings,
    *,
    seed: int = 1,
    overwrite: bool = False,
    report_step: Callable[[str], object] = lambda _: None,
    steps: Steps = no_steps,
) -> DemoResult:
    """Draw the data, train on them, detect in the clip, and compare with the truth.

    Parameters
    ----------
    seed
        Of everything that is drawn; the same seed gives the same data.
    overwrite
        Replace the files of an earlier demo.
    report_step
        Called with a line before each step.
    steps
        Called at the start of each longer step.
    """
    from vdet.evaluate.predictions import read_predictions
    from vdet.evaluate.scores import score
    from vdet.evaluate.truth import read_truth
    from vdet.learn.dataset import find_patches
    from vdet.learn.training import train

    report_step(f"1/4 drawing {2 * PATCHES} patches and a road with vehicles …")
    steps("drawing", None)
    write_patches(
        files.patches, seed=seed, vehicles=PATCHES, non_vehicles=PATCHES, overwrite=overwrite
    )
    scene = demo_scene(seed)
    write_clip(files.clip, scene, overwrite=overwrite)
    write_truth(files.truth, scene, overwrite=overwrite)
    report_step("2/4 training …")
    patches = find_patches([files.patches])
    model, report = train(patches, settings, steps=steps)
    save_model(model, files.model, overwrite=overwrite)
    report.write(files.report, overwrite=overwrite)
    report_step("3/4 finding the vehicles …")
    job = replace(files.job, at=scene.frames / scene.rate / 2, overwrite=overwrite)
    detector = load_detector(settings.detector, files.model)
    summary = run_video(job, detector, settings, progress=partial(steps, "frames"))
    report_step("4/4 comparing with the truth …")
    scores = score(read_predictions(files.tracks), read_truth(files.truth), rate=float(scene.rate))
    return DemoResult(report, scores, summary.frames, summary.seconds)
