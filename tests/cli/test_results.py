"""The files in which commands put what they found out."""

from pathlib import Path

import pytest

from vdet.cli.options import ResultFiles
from vdet.errors import OutputError, VideoError
from vdet.files import NO_FILES


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
