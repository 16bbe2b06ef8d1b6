"""Options that change settings."""

from vdet.cli.options import SettingsSource


def test_changes_are_those_of_all_options_also_with_odd_names() -> None:
    source = SettingsSource((), ("output.crf=18",), {"detector.model": "🚗.onnx", "classes": ()})
    assert source.changes == ("output.crf=18", 'detector.model="🚗.onnx"')
    settings = source.load()
    assert (settings.detector.model, settings.output.crf) == ("🚗.onnx", 18)
