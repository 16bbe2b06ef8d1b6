from pathlib import Path

import pytest

from vdet.config.kinds import HeatSettings, NetworkSettings, PerspectiveSettings, SearchSettings
from vdet.config.loading import find_config, load_settings
from vdet.config.schema import Settings, SvmSettings, SvmTrainingSettings, TrainSettings
from vdet.errors import ConfigError


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "my.yaml"


def load(path: Path, text: str, *assignments: str) -> Settings:
    path.write_text(text, encoding="utf-8")
    return load_settings([path], assignments, detector="svm")


def refusal(path: Path, text: str, *assignments: str) -> list[str]:
    """Return the lines of the error, without the file's folder."""
    with pytest.raises(ConfigError) as error:
        load(path, text, *assignments)
    return str(error.value).replace(f"{path.parent}/", "").split("\n")


def test_a_layer_changes_what_it_names_and_nothing_else(path: Path) -> None:
    text = (
        "detector:\n  heat: {frames: 5, threshold: 2}\n  search: {perspective: {sizes: [0.5]}}\n"
        "train: {svm: {C: 1e-3}}\ntracker:\n"
    )
    frames = "detector.heat.frames=6", "detector.heat.frames=7"
    assert load(path, text, *frames) == Settings(
        detector=SvmSettings(
            heat=HeatSettings(frames=7, threshold=2),
            search=SearchSettings(perspective=PerspectiveSettings(sizes=(0.5,))),
        ),
        train=TrainSettings(svm=SvmTrainingSettings(C=0.001)),
    )


def test_all_errors_are_given_at_once(path: Path) -> None:
    text = (
        "detector: {heat: {frames: 0, votes: -1}, search: {windows: [{size: 64, overlap: 0.5}]}}\n"
        "train:\n  svm: {C: -1}\ntrakcer: {}\n"
    )
    assert sorted(refusal(path, text, "output.crf=99")) == [
        "assignments: output.crf: must be less than or equal to 51 (got 99)",
        "my.yaml:1:19: detector.heat.frames: must be greater than or equal to 1 (got 0)",
        "my.yaml:1:30: detector.heat.votes: must be greater than or equal to 0 (got -1)",
        "my.yaml:1:61: detector.search.windows[0].bottom: is required",
        "my.yaml:1:61: detector.search.windows[0].top: is required",
        "my.yaml:3:9: train.svm.C: must be greater than 0 (got -1)",
        "my.yaml:4:1: trakcer: unknown setting; did you mean tracker?",
    ]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("detector: {heat: {x: 3}}", "1:19: detector.heat.x: unknown setting; known settings: fr"),
        ("detector: {features: {hog: {cel: 3}}}", "1:29: detector.features.hog.cel: unknown set"),
        ("detector: {heat: 3}", "1:12: detector.heat: must be a section, key: value (got 3)"),
        ("detector: {heat: {threshold: 1e999}}", "1:19: detector.heat.threshold: must be a finit"),
        ("detector: {features: {patch: 62}}", "1:12: detector.features: patch must be a multiple"),
        (
            "detector: {search: {windows: [{size: 64, overlap: 0.8, top: 0, bottom: 63}]}}",
            "1:31: detector.search.windows[0]: bottom must be at least top + size",
        ),
        ("trakcer: {}", "1:1: trakcer: unknown setting; did you mean tracker?"),
        ("'': 1", "1:1: : unknown setting; known settings: detector, tracker, "),
        ("draw: {label: score}", "1:8: draw.label: must be a list (got"),
        ("draw: {label: [speed]}", "1:16: draw.label[0]: must be 'id', 'class', 'score' or "),
        ("draw: {trails: 0}", "1:8: draw.trails: must be greater than 0 (got 0)"),
    ],
)
def test_a_mistake_is_explained_in_one_line(path: Path, text: str, message: str) -> None:
    (line,) = refusal(path, text)
    assert line.startswith(f"my.yaml:{message}")


@pytest.mark.parametrize(
    ("assignment", "message"),
    [
        ("detector.heat.frames" + ".a" * 5000 + "=3", "detector.heat.frames: must be a valid int"),
        ("detector.search.windows.0.size=64", "detector.search.windows: must be a list (got"),
        ("tracker.0=3", "tracker.0: unknown setting of tracker.kind: motion; known settings: kind"),
        ("9" * 5000 + "=3", "9999"),
    ],
)
def test_a_mistake_in_an_assignment_is_explained_in_one_line(
    path: Path, assignment: str, message: str
) -> None:
    (line,) = refusal(path, "", assignment)
    assert line.startswith(f"assignments: {message}")


def test_a_shipped_config_is_found_by_its_name_and_another_by_its_path(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "my.yaml").touch()
    (tmp_path / "seed").touch()
    assert load_settings([find_config("default")]) == load_settings([find_config("net")])
    assert find_config("my.yaml") == Path("my.yaml")
    assert (find_config("seed").name, find_config("./seed")) == ("seed.yaml", Path("seed"))
    for name in ("no", "seed.yaml", "../configs/seed"):
        with pytest.raises(ConfigError) as error:
            find_config(name)
        shipped = "ahead, default, project-camera, seed, svm"
        assert str(error.value) == f"{name}: not found; shipped settings files are: {shipped}"


def test_all_ways_to_choose_the_linear_model_look_ahead_equally() -> None:
    shipped = load_settings([find_config("svm")])
    ways = [
        load_settings(assignments=["detector.model=mine.npz"]),
        load_settings(assignments=["detector.kind=svm"]),
        load_settings(detector="svm"),
    ]
    assert [way.tracker for way in ways] == [shipped.tracker] * 3
    assert load_settings(detector="svm", assignments=["tracker.kind=rules"]).tracker.look_ahead == 0


def test_classes_have_our_names_or_lower_case() -> None:
    texts = ["detector.classes=[Car, Lorry, van, Golf Cart]", "classes=[Truck, golf cart]"]
    settings = load_settings(assignments=texts)
    assert isinstance(settings.detector, NetworkSettings)
    assert settings.detector.classes == ("car", "truck", "golf cart")
    assert settings.classes == ("truck", "golf cart")


def test_unquoted_words_and_times_are_accepted_and_numbers_are_refused_with_advice() -> None:
    line = "start: [0, 0], end: [1, 1]"
    settings = load_settings(
        assignments=[
            "input.begin=2026-05-01T07:00:00", f"traffic.lines=[{{name: no, {line}}}]",
            "clips.exact=yes", "lanes.enabled=off",
        ]
    )  # fmt: skip
    assert settings.input.begin == "2026-05-01T07:00:00"
    assert (settings.traffic.lines[0].name, settings.clips.exact) == ("no", True)
    assert not settings.lanes.enabled
    with pytest.raises(ConfigError, match=r"lines\[0\].name: must be text; quote it \(got 12\)"):
        load_settings(assignments=[f"traffic.lines=[{{name: 12, {line}}}]"])
