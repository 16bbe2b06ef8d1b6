"""The files in which commands put what they found out."""

from pathlib import Path

import pytest

from vdet.cli.results import Results
from vdet.errors import OutputError
from vdet.files import record_input, recorded_inputs


def test_the_folder_of_a_page_is_made_and_an_earlier_page_is_kept(tmp_path: Path) -> None:
    folder = tmp_path / "a" / "b"
    Results(None, page=folder, overwrite=False).check()
    (folder / "page.html").write_text("precious")
    with pytest.raises(OutputError, match=r"page\.html: is there already; give --overwrite"):
        Results(None, page=folder, overwrite=False).check()
    Results(None, page=folder, overwrite=True).check()
    with pytest.raises(OutputError, match="cannot be made a folder"):
        Results(None, page=folder / "page.html", overwrite=True).check()


def test_earlier_numbers_and_inputs_are_kept(tmp_path: Path) -> None:
    target = tmp_path / "a.json"
    Results(str(target), overwrite=False).print(["F1"], {"f1": 0.5})
    with pytest.raises(OutputError, match="is there already"):
        Results(str(target), overwrite=False).check()
    with recorded_inputs():
        record_input(target)
        with pytest.raises(OutputError, match="is the input itself"):
            Results(str(target), overwrite=True).check()
