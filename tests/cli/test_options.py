"""Options that change settings."""

import click

from vdet.cli.options import SettingsSource, classes_option, model_option, settings_options


def test_changes_are_those_of_all_options_also_with_odd_names() -> None:
    @click.command()
    @model_option
    @classes_option
    @settings_options
    def command(source: SettingsSource) -> SettingsSource:
        return source

    source = command.main(["--model", "🚗\n.onnx", "--set", "output.crf=18"], standalone_mode=False)
    settings = source.load()
    assert (settings.detector.model, settings.output.crf) == ("🚗\n.onnx", 18)
