"""Options that change settings."""

from pathlib import Path

import click
import pytest

from conftest import Run
from vdet.cli.options import SettingsSource, classes_option, model_option, settings_options


def test_changes_are_those_of_all_options_also_with_odd_names() -> None:
    @click.command()
    @model_option
    @classes_option
    @settings_options(model="detector.model", classes="classes")
    def command(source: SettingsSource) -> SettingsSource:
        return source

    source = command.main(["--model", "🚗\n.onnx", "--set", "output.crf=18"], standalone_mode=False)
    settings = source.load()
    assert (settings.detector.model, settings.output.crf) == ("🚗\n.onnx", 18)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (
            ("--clips", "c", "--margin", "-1"),
            "--margin: must be greater than or equal to 0 (got -1.0)",
        ),
        (("--counts", "c.csv", "--interval", "7min"), "--interval: 7min does not divide a day;"),
        (("--tracks", "t.csv", "--class", "plane"), "--class: plane: unknown class; known: car, "),
        (
            ("--tracks", "t.csv", "--begin", "foo"),
            "--begin: 'foo' is not a time; expected one such",
        ),
        (
            ("--tracks", "t.csv", "--model", "caf\udce9/net.onnx"),
            "--model: must be UTF-8; rename the file or folder, or use a relative path (got 'caf",
        ),
        (("--tracks", "t.csv", "--set", "clips.margin=-1"), "--set: clips.margin: must be greater"),
    ],
)
def test_a_wrong_value_is_reported_with_the_option_that_has_it(
    run: Run, options: tuple[str, ...], words: str
) -> None:
    result = run("detect-video", "in.mp4", "--no-video", *options, code=1)
    assert result.err.startswith(f"vdet: {words}")


def test_an_empty_file_is_called_empty(run: Run, tmp_path: Path) -> None:
    (tmp_path / "a.mp4").touch()
    result = run("detect-video", tmp_path / "a.mp4", "--no-video", "--tracks", tmp_path / "t.csv")
    assert result.err.endswith("a.mp4: is empty; use a file that plays\n")
