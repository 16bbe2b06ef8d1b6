"""What cannot be mined; `cli/test_mine_command.py` looks at the patches."""

from dataclasses import replace
from pathlib import Path

import pytest

from vdet.config.schema import Settings, SvmSettings
from vdet.detect.svm.detector import load_svm
from vdet.errors import DataError
from vdet.learn.svm.mining import Most, VideoSource, mine
from vdet.synthetic.scene import Scene
from vdet.synthetic.truth import write_truth

MODEL = load_svm(SvmSettings(), None)


@pytest.fixture
def video(clip_path: Path, scene: Scene, tmp_path: Path) -> VideoSource:
    write_truth(tmp_path / "gt.txt", replace(scene, frames=5))
    return VideoSource(clip_path, tmp_path / "gt.txt", every=2)


@pytest.mark.parametrize(
    ("count", "most", "words"),
    [
        (1, Most(0, 0, 0), r"road\.mp4: no window shows a vehicle or a false alarm"),
        (2, Most(probability=0), "2 sources are named road; rename them"),
    ],
)
def test_what_cannot_be_mined_is_an_error_and_leaves_nothing(
    count: int, most: Most, words: str, video: VideoSource, tmp_path: Path
) -> None:
    with pytest.raises(DataError, match=words):
        mine([video] * count, tmp_path / "mined.zip", Settings(), MODEL, most=most)
    assert not (tmp_path / "mined.zip").exists()
