"""What many tests need: the program, a small model, a small road clip, the real data set."""

import logging
import os

if disabled := os.environ.get("OPENCV_CPU_DISABLE"):  # before the first import of OpenCV
    # Its names have hyphens. For one that it does not know, it prints a line in each process.
    os.environ["OPENCV_CPU_DISABLE"] = disabled.replace("_", "-")

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import settings

from drawn_patches import write_patches
from running import Outcome
from vdet.cli import main
from vdet.config.schema import Settings, SvmSettings, SvmTrainingSettings, TrainSettings
from vdet.detect.svm.model import save_model
from vdet.learn.svm.patches import find_patches
from vdet.learn.svm.training import train
from vdet.synthetic import Scene, demo_scene, write_clip

# Seeded, so that a run of the tests says the same twice; and no test is a timing.
settings.register_profile("vdet", derandomize=True, deadline=None)
settings.load_profile("vdet")


Run = Callable[..., Outcome]


@pytest.fixture(autouse=True)
def logs() -> Iterator[None]:
    """Keep how the program sets up its log to one test."""
    log = logging.getLogger("vdet")
    before = log.handlers, log.propagate, log.level
    yield
    log.handlers, log.propagate, log.level = before


@pytest.fixture
def run(capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Run:
    """Run `vdet` with arguments, in this process; it must end with `code`, if that is given."""
    monkeypatch.delenv("VDET_DEBUG", raising=False)

    def run_it(*arguments: str | Path, code: int | None = None) -> Outcome:
        found = main([str(argument) for argument in arguments])
        captured = capfd.readouterr()
        assert code in (None, found), captured.err
        return Outcome(found, captured.out, captured.err)

    return run_it


@pytest.fixture(scope="session")
def patches_path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of generated patches, 160 of each class."""
    folder = tmp_path_factory.mktemp("patches")
    write_patches(folder, seed=5, each=80)
    return folder


@pytest.fixture(scope="session")
def model_path(patches_path: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A model with the default features, trained on generated patches and nothing made of them."""
    path = tmp_path_factory.mktemp("model") / "model.npz"
    plain = SvmTrainingSettings(augmentation=False)
    settings = Settings(detector=SvmSettings(), train=TrainSettings(svm=plain))
    model, _ = train(find_patches([patches_path]), settings, jobs=1)
    save_model(model, path)
    return path


@pytest.fixture(scope="session")
def scene() -> Scene:
    """A second and a bit of the demo's road, 320×180 pixels."""
    return replace(demo_scene(1, width=320, height=180), frames=30)


@pytest.fixture(scope="session")
def clip_path(scene: Scene, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """`scene` as a video file."""
    path = tmp_path_factory.mktemp("clip") / "road.mp4"
    write_clip(path, scene)
    return path


@pytest.fixture(scope="session")
def real_data() -> Path:
    """The folder of the real data set; the test is skipped where it is not found."""
    root = Path(__file__).parents[1]
    places = [os.environ.get("VDET_DATA"), root / "data", root.parent / "shared" / "data"]
    for place in places:
        if place and (Path(place) / "vehicles.zip").exists():
            return Path(place)
    pytest.skip("the real data set is not here; data/README.md tells where to get it")
