"""What cannot be is refused by every command, before any work, and in words that say why."""

import shlex
import shutil
from pathlib import Path

import numpy as np
import pytest

from cli.test_count_command import LINES, write_tracks
from conftest import Run
from labels.writers import Boxed, Labelled, write_coco
from running import write_drive
from vdet.detect.onnx.detector import SHIPPED
from writing import write_image

SVM = SHIPPED.with_name("svm.npz")
REGION = "--set 'regions=[{name: a, points: [[0, 0], [1, 0], [1, 1]]}]'"
BELOW = (
    "--set 'detector.search.windows=[{size: 80, overlap: 0.875, top: 900, bottom: 990}]' "
    "--set detector.search.perspective.sizes=[]"
)
NAMES = "video image tracks json labels vehicles counts flows conditions stages crops clips page"
ENDINGS = "with -d, pass only the ending of the names:"

WRONG_USAGE = {
    "calibrate set -o c.yaml --pattern=9x": "--pattern",
    "calibrate set -o c.yaml --pattern=9x6x3": "--pattern",
    "calibrate set -o c.yaml --pattern=2x6": "--pattern",
    "count t.csv": "no lines or zones to count at; add a settings file with -c FILE",
    "count t.csv -c lines.yaml --size big": "'big' is not two numbers",
    "detect-video in.mp4 --tracks x.csv": "pass either OUT or --no-video",
    "detect-video in.mp4 out.mp4 --no-video": "pass either OUT or --no-video",
    "detect-video in.mp4 --no-video": "no output; add one",
    "detect-video in.mp4 --no-video --counts x.csv": "--counts needs lines or zones; add a settin",
    "detect-video in.mp4 out.mp4 --stages x": "--stages and --at must be used together",
    "detect-video in.mp4 out.mp4 --start 5 --end 5": "--end must be later",
    "detect-video in.mp4 out.mp4 --start soon": "is not a time",
    "detect-video in.mp4 out.mp4 --start 1:-5": "is not a time",
    "detect-video in.mp4 out.mp4 --start 999999999:00:00": "is not a time",
    f"detect-video in.mp4 out.mp4 --threads {'9' * 30}": "is not in the range",
    "detect-video in.mp4 out.mp4 --skip-existing": "require -d",
    "detect-video in.mp4 out.mp4 --jobs 2": "require -d",
    "detect-video in.mp4 out.mp4 --scheduler tcp://x:1": "require -d",
    "detect-video in.mp4 b.mp4 c.mp4": "for several videos a folder: vdet detect-video ",
    "detect-video in.mp4 a.mp4 --sink tracks": "tracks: expected NAME=FILE, as in tracks=out.csv",
    "detect-video in.mp4 a.mp4 --sink =a.csv": "=a.csv: expected NAME=FILE",
    "detect-video in.mp4 -d out --no-video": "no output; add one",
    "detect-video in.mp4 -d out --tracks all.txt": f"tracks: {ENDINGS} .txt, .csv, .jso",
    "detect-video in.mp4 -d out --sink tracks=a.csv": f"tracks: {ENDINGS} .txt, .csv, .jsonl",
    "detect-video in.mp4 -d out --sink video=.avi": f"video: {ENDINGS} .mp4, .mov, .mkv",
    "detect-video in.mp4 -d out --sink json=.json": "json: cannot be written with -d",
    "detect-video in.mp4 -d out --stages x --at 1": "stages: cannot be written with -d",
    "detect-video in.mp4 -d out --overwrite --skip-existing": "cannot be used together",
    "detect-video in.mp4 -d out --jobs 2 --scheduler tcp://x:1": "--jobs and --scheduler cannot be",
    "eval video in.mp4": "pass one --truth for each video (videos: 1, truths: 0)",
    "eval video in.mp4 --truth gt.txt --truth gt.txt": "truths: 2)",
    "mine in.mp4 --truth gt.txt -o m.zip --until 3 --from 4": "--until must not be before --from",
    "mine in.mp4 --truth a.txt --truth b.txt -o m.zip": "(videos: 1, truths: 2)",
    "review in.mp4 --tracks-from t.csv -o page": "no lines or zones to review",
    "train-net -o a.onnx": "nothing to learn from; pass DATA or --video",
}
REFUSED = {
    "count t.csv -c none.yaml": "none.yaml: not found",
    "count t.csv -c lines.yaml --size 320x200": "for frames of 320×240",
    "count t.csv -c lines.yaml --counts c.txt": "must end in .csv, .json",
    "count t.csv -c lines.yaml --counts t.csv": "is an input of this run",
    "count none.csv -c lines.yaml": "none.csv",
    "count t.txt -c lines.yaml": "has no times; pass the frame rate",
    "count back.csv -c lines.yaml": "back.csv:3: frame 1 is at 0.04 s; times must be",
    "count t.csv -c short.yaml": "short.yaml:1:1: traffic: gate: is shorter than 1 %",
    "count t.csv -c half.yaml": "pass the size of the frames, as in --size 1280x720",
    "count t.csv -c lines.yaml --interval 7min": "7min does not divide a day",
    "count t.csv -c lines.yaml --begin now": "'now' is not a time",
    "count t.csv -c lines.yaml --set \"camera.clock.pattern='%Y%m%d'\"": (
        "t.csv: its name does not match camera.clock.pattern"
    ),
    "count t.csv u.csv -c lines.yaml --begin '2026-05-01 07:00'": (
        "u.csv: has no clock, and the file before does not say how long its video is; use .jsonl"
    ),
    "detect-image frame.png twin/frame.png -o out": "is used for two outputs; rename one",
    "detect-image frame.png -o x.png --json x.png --overwrite": "is used for two outputs",
    "detect-image frame.png -o twin --json twin/frame.png --overwrite": "is used for two outputs",
    "detect-image frame.png twin/frame.png --sink image=x.png": (
        "x.png: is for one image; for several, use a folder"
    ),
    "detect-image frame.png --sink video=x.mp4": "x.mp4: the sink video is for videos",
    "detect-image none.png --json -": "none.png: not found",
    "detect-image twin/none --json -": "none: contains no images (.bmp, .jpeg, .jpg, .png, ",
    "detect-video in.mp4 --no-video --stages x --at 50": (
        "in.mp4: 50.00 s is beyond its end; it ends at "
    ),
    "detect-video in.mp4 --no-video --stages x --at 0.2 --frames 2": "no frame at 0.20 s or later",
    "detect-video in.mp4 --no-video --stages x --at 0 --start 50": "50.00 s is beyond its end",
    "detect-video in.mp4 a.mp4 --sink tallies=a.csv": (
        f"tallies: unknown sink; known: {', '.join(NAMES.split())}"
    ),
    "detect-video in.mp4 a.mp4 --sink image=a.png": "a.png: the sink image is for images",
    "detect-video in.mp4 a.mp4 --sink json=a.json": "a.json: the sink json is for images",
    "detect-video in.mp4 a.mp4 --sink tracks=a.json": "a.json: tracks must end in .txt, .csv, .js",
    "detect-video in.mp4 a.mp4 --sink tracks=none/a.csv": (
        "none/a.csv: the folder none does not exist; create it first"
    ),
    "detect-video in.mp4 a.mp4 --sink tracks=u.csv": "u.csv: already exists; use --overwrite to",
    "detect-video in.mp4 a.mp4 --tracks x.txt --sink tracks=x.txt": (
        "x.txt: is used for two outputs; rename one"
    ),
    "detect-video in.mp4 -d out --tracks .csv --sink tracks=.csv": "both would be written to",
    "detect-video in.mp4 --no-video --clips c --margin -1": (
        "--margin: must be greater than or equal to 0 (got -1.0)"
    ),
    "detect-video in.mp4 --no-video --counts c.csv --interval 7min": (
        "--interval: 7min does not divide a day;"
    ),
    "detect-video in.mp4 --no-video --tracks x.csv --class plane": (
        "--class: plane: unknown class; known: car, truck, bus, motorcycle, bicycle, vehicle; det"
    ),
    "detect-video in.mp4 --no-video --tracks x.csv -c svm --class car": "--class: has no effect",
    "detect-video in.mp4 --no-video --tracks x.csv --model caf\udce9/net.onnx": (
        "--model: must be UTF-8; rename the file or folder, or use a relative path (got 'caf"
    ),
    "detect-video in.mp4 --no-video --tracks x.csv --set clips.margin=-1": (
        "--set: clips.margin: must be greater"
    ),
    "detect-video empty.mp4 --no-video --tracks x.csv": "is empty; use a file that plays",
    "draw frame.png -o a.svg": "no lines or zones to count at; add them to the settings",
    "draw frame.png -o a.txt": "a.txt: outputs must end in .html, .jpg, .png, .svg",
    "draw frame.png -o lines.html -c wide.yaml": "whose aspect ratio",
    "draw frame.png -o frame.png -c lines.yaml --overwrite": "frame.png",
    "draw frame.png -o a.html --tracks-from t.txt": "t.txt: has no times",
    "eval images none": "none: labelled images not found",
    "eval images set --page set/a.png": "the folder set/a.png is not a folder",
    "eval images set --set detector.kind=sonar": "sonar: unknown detector",
    f"eval images set {REGION}": "regions: this command uses whole frames",
    f"eval tracks t.txt gt.txt {REGION}": "regions: this command uses whole frames; remove the ",
    "eval tracks t.txt gt.txt --json old.npz": "old.npz: already exists; use --overwrite to ",
    "eval tracks t.txt gt.txt --json gt.txt --overwrite": "gt.txt: is an input of this run",
    "eval tracks t.txt gt.txt --json x/page.html --page x": "page.html: is used for two outputs",
    "eval tracks t.txt gt.txt --page old": "old/page.html: already exists; use --overwrite to ",
    "eval tracks t.txt short.txt": "short.txt:2: ",
    "eval video in.mp4 --truth none.txt": "none.txt: cannot be read",
    "eval video in.mp4 --truth gt.txt -c svm --set detector.features.hog.cell=8": "no shipped mod",
    f"eval video in.mp4 --truth gt.txt --model {SVM} --set detector.features.patch=48": (
        "was trained with other features"
    ),
    "info in.mp4": "in.mp4: must be .npz or .onnx; ffprobe describes videos and images",
    "info none.onnx": "none.onnx: cannot be",
    "mine in.mp4 --truth gt.txt -o m.zip --from 10": "gt.txt: ends at frame 9; begin earlier",
    "mine in.mp4 --truth gt.txt -o m.npz": "m.npz: patches must end in .zip",
    "mine in.mp4 --truth none.txt -o m.zip": "none.txt: cannot be read",
    f"mine in.mp4 --truth gt.txt -o m.zip {BELOW}": "in.mp4: no search window fits into 320×240",
    f"mine in.mp4 --truth gt.txt -o m.zip {REGION}": "regions: this command uses whole frames",
    "train set -o old.npz": "already exists; use --overwrite",
    "train set -o m.json": "models must end in .npz",
    "train-net set -o a.pt": "a.pt: networks must end in .onnx",
}


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with an input of each kind."""
    folder = tmp_path_factory.mktemp("inputs")
    write_drive(folder / "in.mp4", 12)
    (folder / "twin" / "none").mkdir(parents=True)
    (folder / "old").mkdir()
    for image in (folder / "frame.png", folder / "twin" / "frame.png"):
        write_image(image, np.full((240, 320, 3), 90, np.uint8))
    write_coco(folder / "set", {"a": Labelled(320, 240, (Boxed("car", (120, 120, 60, 40)),))})
    for name in ("t.csv", "u.csv"):
        write_tracks(folder / name)
    columns = "frame,time,id,x,y,width,height"
    texts = {
        "t.txt": "1,1,1,1,40,40,1,-1,-1,-1\n",
        "back.csv": f"{columns}\n0,0.08,1,1,1,40,40\n1,0.04,1,1,1,40,40\n",
        "gt.txt": "".join(f"{n},1,1,1,100,100,1,3,1\n" for n in range(1, 10)),
        "short.txt": "1,1,1,1,100,100,1,3,1\n1,1,1\n",
        "lines.yaml": LINES,
        "wide.yaml": LINES.replace("240]", "100]").replace("[320, 0], ", ""),
        "half.yaml": "traffic: {lines: [{name: gate, start: [0.5, 0], end: [0.5, 1]}]}",
        "short.yaml": "traffic: {lines: [{name: gate, start: [1, 0.5], end: [0.999, 0.5]}]}",
        "old.npz": "precious",
        "old/page.html": "precious",
        "empty.mp4": "",
    }
    for name, text in texts.items():
        (folder / name).write_text(text)
    return folder


def contents(folder: Path) -> dict[Path, bytes]:
    return {path.relative_to(folder): path.read_bytes() for path in folder.rglob("*.*")}


@pytest.mark.parametrize(
    ("command", "code", "words"),
    [
        *((command, 2, words) for command, words in WRONG_USAGE.items()),
        *((command, 1, words) for command, words in REFUSED.items()),
    ],
)
def test_what_cannot_be_is_said_before_any_work(
    run: Run, files: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    command: str, code: int, words: str,
) -> None:  # fmt: skip
    shutil.copytree(files, tmp_path / "in")
    monkeypatch.chdir(tmp_path / "in")
    result = run(*shlex.split(command))
    assert (result.code, result.out) == (code, "")
    assert words in result.err
    assert code == 2 or result.err.count("\n") == 1
    assert contents(tmp_path / "in") == contents(files)
