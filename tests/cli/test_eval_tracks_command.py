"""`vdet eval tracks`."""

import json
from pathlib import Path

import pytest

import vdet
from conftest import Run


def write(path: Path, frames: range, ending: str) -> Path:
    path.write_text("".join(f"{frame},1,1,1,100,100,{ending}\n" for frame in frames))
    return path


@pytest.fixture
def found(tmp_path: Path) -> Path:
    return write(tmp_path / "found.txt", range(3, 13), "1,-1,-1,-1")


def test_prints_a_table_and_writes_numbers_and_a_page(
    run: Run, found: Path, tmp_path: Path
) -> None:
    truth = write(tmp_path / "gt.txt", range(1, 11), "1,3,1")
    results = ("--json", tmp_path / "a.json", "--page", tmp_path / "page")
    result = run("eval", "tracks", found, truth, *results)
    assert (result.code, result.err) == (0, "")
    assert result.out.splitlines()[3].split()[5:10] == ["1.000", "0", "2", "0.800", "0.889"]
    values = json.loads((tmp_path / "a.json").read_text())
    assert (values["precision"], values["recall"]) == (1, 0.8)
    keys = "f1 ap50 ap50_95 mean_iou mota idf1 hota deta assa id_switches fragmentations"
    assert set(keys.split()) <= set(values)
    more = json.loads(run("eval", "tracks", found, truth, "--until", "11", "--json", "-").out)
    assert (values["false_positives"], more["false_positives"]) == (0, 1)
    html = (tmp_path / "page" / "page.html").read_text()
    assert "frames 1–10 compared" in html
    assert f"compared with {truth} by vdet {vdet.__version__}" in html
