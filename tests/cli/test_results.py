"""The files in which commands put what they found out."""

from pathlib import Path

import pytest

from vdet.cli.options import ResultFiles
from vdet.errors import OutputError, VideoError
from vdet.files import NO_FILES, file_ids


def test_a_page_and_numbers_that_cannot_be_written_are_refused_before_any_work(
    tmp_path: Path,
) -> None:
    folder, target = tmp_path / "a" / "b", tmp_path / "a.json"
    results = ResultFiles(str(target), page=folder, overwrite=False)
    results.check(NO_FILES)
    assert not list(tmp_path.iterdir()), "a run that fails leaves no folder"
    results.print(["F1"], {"f1": 0.5}, lambda: "precious")
    one, other = ResultFiles(str(target), overwrite=False), ResultFiles(None, False, folder)
    for kept in (results, one, other):
        with pytest.raises(OutputError, match="already exists; use overwrite=True"):
            kept.check(NO_FILES)
    ResultFiles(str(target), page=folder, overwrite=True).check(NO_FILES)
    with pytest.raises(OutputError, match="is an input of this run"):
        ResultFiles(str(target), overwrite=True).check(file_ids([target]))
    with pytest.raises(OutputError, match=r"page\.html: is used for two outputs"):
        ResultFiles(str(folder / "page.html"), page=folder, overwrite=True).check(NO_FILES)
    with pytest.raises(OutputError, match=r"the folder .*page\.html is not a folder"):
        ResultFiles(None, page=folder / "page.html", overwrite=True).check(NO_FILES)


def test_numbers_may_lie_in_the_new_folder_of_the_page(tmp_path: Path) -> None:
    results = ResultFiles(str(tmp_path / "a" / "a.json"), page=tmp_path / "a", overwrite=False)
    results.check(NO_FILES)
    results.print([], {"f1": 0.5}, lambda: "html")
    assert {file.name for file in (tmp_path / "a").iterdir()} == {"a.json", "page.html"}


def test_numbers_and_page_appear_together_or_not_at_all(tmp_path: Path) -> None:
    results = ResultFiles(str(tmp_path / "a.json"), page=tmp_path / "page", overwrite=False)

    def fail() -> str:
        raise VideoError("in.mp4: is gone")

    def write_meanwhile() -> str:
        (tmp_path / "page").mkdir()
        (tmp_path / "page" / "page.html").write_text("of another")
        return "ours"

    with pytest.raises(VideoError):
        results.print([], {}, fail)
    assert not list(tmp_path.iterdir())
    with pytest.raises(OutputError, match="appeared during the run"):
        results.print([], {}, write_meanwhile)
    assert [item.name for item in tmp_path.iterdir()] == ["page"]
    assert (tmp_path / "page" / "page.html").read_text() == "of another"
