import json
from pathlib import Path

import pytest

from vdet.errors import OutputError
from vdet.evaluate.output import RunName, check_outputs, run_lines, share, table
from vdet.files import write_json


def test_the_first_column_is_to_the_left_and_the_others_to_the_right() -> None:
    assert table(("name", "n"), [["a", "100"], ["longer", "1"]]) == [
        "name      n",
        "a       100",
        "longer    1",
    ]


def test_a_table_without_rows_is_its_headings() -> None:
    assert table(("name", "n"), []) == ["name  n"]


def test_a_run_says_what_its_model_was_trained_on_where_that_is_known() -> None:
    first, second = run_lines(RunName("net", Path("x/a.onnx"), None, ("b=1",), ("idd", "uk")))
    assert first.endswith(", detector net, model a.onnx, settings default b=1")
    assert second == "trained on idd, uk"
    assert len(run_lines(RunName("net", Path("x/a.onnx"), None, ()))) == 1


def test_a_missing_share_is_a_dash() -> None:
    assert (share(0.12345), share(None), share(0.5, 1)) == ("0.123", "–", "0.5")


def test_the_folder_of_a_page_is_created(tmp_path: Path) -> None:
    check_outputs(None, tmp_path / "a" / "b", overwrite=False, inputs=[])
    assert (tmp_path / "a" / "b").is_dir()


def test_an_earlier_page_is_kept(tmp_path: Path) -> None:
    (tmp_path / "page.html").write_text("precious")
    with pytest.raises(OutputError, match=r"page\.html: is there already; give --overwrite"):
        check_outputs(None, tmp_path, overwrite=False, inputs=[])
    check_outputs(None, tmp_path, overwrite=True, inputs=[])


def test_earlier_numbers_are_kept(tmp_path: Path) -> None:
    target = str(tmp_path / "a.json")
    write_json({"f1": 0.5}, target)
    assert json.loads(Path(target).read_text()) == {"f1": 0.5}
    with pytest.raises(OutputError, match="is there already"):
        check_outputs(target, None, overwrite=False, inputs=[])


def test_a_file_cannot_be_the_folder_of_a_page(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(OutputError, match="cannot be made a folder"):
        check_outputs(None, tmp_path / "file", overwrite=True, inputs=[])


def test_numbers_never_replace_an_input(tmp_path: Path) -> None:
    truth = tmp_path / "gt.txt"
    truth.write_text("precious")
    with pytest.raises(OutputError, match="is the input itself"):
        check_outputs(str(truth), None, overwrite=True, inputs=[truth])


def test_numbers_go_to_standard_output_for_a_dash(capsys: pytest.CaptureFixture[str]) -> None:
    write_json({"recall": None}, "-")
    assert json.loads(capsys.readouterr().out) == {"recall": None}
