"""Records of vehicles as Parquet, and the questions of the page on batches, which run here."""

import os
import sys
from pathlib import Path
from typing import Any

import pytest

from doc_pages import blocks
from traffic.passing import WIDTH, frame, summarize, track
from vdet.boxes import Box
from vdet.errors import PackageError
from vdet.files import OutputFiles
from vdet.run.sinks import Output
from vdet.run.sinks.protocol import check_sinks
from vdet.traffic.records import join_records, records_content

BOX = Box.sized(5, 5, 30, 30)


def write_all(folder: Path) -> Path:
    """Write the records of two videos."""
    path = folder / "found" / "all.parquet"
    path.parent.mkdir()
    truck = track(1, BOX, class_name="truck", lane=0, distance=18.4)
    others = [frame(at, truck, track(2, BOX)) for at in (1, 2, 3)]
    parts = {"a": [frame(0, truck), *others], "b": [frame(at, track(1, BOX)) for at in (0, 1, 2)]}
    content = {
        name: records_content(summarize(frames, WIDTH), path) for name, frames in parts.items()
    }
    join_records(content, path)
    return path


def test_columns_have_their_types_whatever_is_known(tmp_path: Path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    every, few = parquet.read_table(write_all(tmp_path)), tmp_path / "few.parquet"
    names = ("video", "id", "class", "clock", "first", "lane", "speed")
    assert [str(every.schema.field(name).type) for name in names] == [
        "string", "int64", "string", "string", "double", "int64", "double",
    ]  # fmt: skip
    assert every.column("video").to_pylist() == ["a", "a", "b"]
    for vehicles in ((), summarize([frame(0, track(1, BOX))], WIDTH)):
        join_records({os.fsdecode(b"a\xff.mp4"): records_content(vehicles, few)}, few)
        assert parquet.read_schema(few) == every.schema
    assert parquet.read_table(few).column("video").to_pylist() == ["a\\udcff.mp4"]


def test_the_questions_of_the_page_on_batches_are_answered(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for package in ("pyarrow", "duckdb"):
        pytest.importorskip(package)
    write_all(tmp_path)
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {}
    for block in blocks("batch.md"):
        exec(block, names)
    assert names["ahead"] == [("a", 0.0, 0.12, 18.4)]
    assert names["by_hour"] == [(None, "truck", 1, None), (None, None, 2, None)]


def test_without_pyarrow_one_line_says_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    output = Output("vehicles", tmp_path / "a.parquet")
    with pytest.raises(PackageError, match=r"^pyarrow is not .*its extra .parquet"):
        check_sinks([output], OutputFiles())
