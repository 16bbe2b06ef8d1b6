from pathlib import Path

from vdet.evaluate.output import RunName, table


def test_the_first_column_is_to_the_left_and_the_others_to_the_right() -> None:
    assert table(("name", "n"), [["a", "100"], ["longer", "1"]]) == [
        "name      n",
        "a       100",
        "longer    1",
    ]


def test_a_run_names_its_detector_model_and_settings() -> None:
    name = RunName("net", Path("x/a.onnx"), None, ("b=1",))
    assert name.line.endswith(", detector net, model a.onnx, settings default b=1")
    assert name.values["model"] == "x/a.onnx"
