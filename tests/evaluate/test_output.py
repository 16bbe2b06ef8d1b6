from pathlib import Path

from vdet.evaluate.output import RunName, table


def test_the_first_column_is_to_the_left_and_the_others_to_the_right() -> None:
    assert table(("name", "n"), [["a", "100"], ["longer", "1"]]) == [
        "name      n",
        "a       100",
        "longer    1",
    ]


def test_a_run_says_what_its_model_was_trained_on_where_that_is_known() -> None:
    first, second = RunName("net", Path("x/a.onnx"), None, ("b=1",), ("idd", "uk")).lines()
    assert first.endswith(", detector net, model a.onnx, settings default b=1")
    assert second == "trained on idd, uk"
    assert len(RunName("net", Path("x/a.onnx"), None, ()).lines()) == 1
