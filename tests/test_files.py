"""Files: outputs that are whole or absent, temporary files that are stale, limits, names."""

import itertools
import os
import resource
import signal
import subprocess
import sys
import tracemalloc
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from publishing import at_system_call, make_older, publish, texts, without_links
from running import with_modules
from vdet.errors import ConfigError, OutputError, printable
from vdet.files import _HOST, ENDING_SIGNALS, OutputFiles, file_ids, read_whole, staged

DIGITS = "1a2b3c4d" * 2


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_a_file_appears_when_the_block_ends_and_replaces_an_older_one_only_if_asked(
    tmp_path: Path,
) -> None:
    path = tmp_path / "out.txt"
    for text, overwrite in (("older", False), ("newer", True)):
        with staged(path, overwrite=overwrite) as temporary:
            temporary.write_text(text)
            assert temporary.parent.stat().st_mode & 0o777 == 0o700, "others can read it too soon"
            assert path.exists() == overwrite
        assert (names(tmp_path), path.read_text()) == (["out.txt"], text)
        if not overwrite:
            path.chmod(0o440)
    assert path.stat().st_mode & 0o777 == 0o440


@pytest.mark.parametrize("has_links", [True, False])
@pytest.mark.parametrize("kind", ["file", "empty file", "dangling link", "link"])
def test_what_appears_during_the_run_is_kept(
    kind: str, has_links: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if not has_links:
        monkeypatch.setattr("os.link", without_links)
    path = tmp_path / "out.txt"
    files = OutputFiles()
    files.stage(tmp_path / "first.txt").write_text("new")
    files.stage(path).write_text("new")
    if "link" in kind:
        path.symlink_to("none" if "dangling" in kind else tmp_path)
    else:
        path.write_text("theirs" if kind == "file" else "")
    with pytest.raises(OutputError, match="appeared during the run; use another"), files:
        pass
    assert names(tmp_path) == ["out.txt"]
    assert path.is_symlink() == ("link" in kind)
    assert path.is_symlink() or path.read_text() == ("theirs" if kind == "file" else "")


def test_a_link_is_replaced_and_not_what_it_leads_to(tmp_path: Path) -> None:
    (tmp_path / "precious").write_text("precious")
    (tmp_path / "out.txt").symlink_to("precious")
    with staged(tmp_path / "out.txt", overwrite=True) as temporary:
        temporary.write_text("new")
    assert (tmp_path / "precious").read_text() == "precious"
    assert (tmp_path / "out.txt").read_text() == "new"


class TestOutputFiles:
    """The files of one run appear together, or none does."""

    @staticmethod
    def write(folder: Path, files: OutputFiles, *numbers: int) -> None:
        for number in numbers:
            files.stage(folder / f"{number}.txt").write_text("new")

    @pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt, SystemExit])
    def test_none_appears_after_an_error(self, error: type[BaseException], tmp_path: Path) -> None:
        (tmp_path / "1.txt").write_text("old")

        def run() -> None:
            with OutputFiles() as files:
                self.write(tmp_path, files, 1, 2, 3)
                raise error

        with pytest.raises(error):
            run()
        assert names(tmp_path) == ["1.txt"]
        assert (tmp_path / "1.txt").read_text() == "old"

    def test_what_appeared_before_a_rename_that_fails_is_removed(self, tmp_path: Path) -> None:
        (tmp_path / "2.txt").write_text("old")
        (tmp_path / "3.txt").mkdir()
        refusal = r"3\.txt: is not a regular file and will not be replaced"
        with pytest.raises(OutputError, match=refusal), OutputFiles(overwrite=True) as files:
            self.write(tmp_path, files, 1, 2, 3, 4)
        assert names(tmp_path) == ["2.txt", "3.txt"]
        assert (tmp_path / "2.txt").read_text() == "old"


@pytest.fixture
def default_signals() -> Iterator[None]:
    """Ctrl-C raises `KeyboardInterrupt`, and what the test sets is undone."""
    handlers = {number: signal.getsignal(number) for number in ENDING_SIGNALS}
    signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    for number, handler in handlers.items():
        signal.signal(number, handler)


@pytest.fixture
def no_sync(monkeypatch: pytest.MonkeyPatch) -> None:
    """Files are not synced, which takes long and matters only when the power fails."""
    monkeypatch.setattr("os.fsync", lambda _: None)


def fail() -> None:
    raise OSError(5, "Input/output error")


ONCE = partial(signal.raise_signal, signal.SIGINT)


def twice() -> None:
    ONCE()
    ONCE()


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")  # `os.scandir`
@pytest.mark.usefixtures("default_signals", "no_sync")
class TestAtEverySystemCall:
    """What happens after any system call of publishing leaves no name without its file."""

    @pytest.mark.parametrize(
        ("act", "is_last", "has_links"),
        [
            *((fail, False, True), (fail, False, False)),
            *((ONCE, False, True), (ONCE, True, True)),
            *((twice, False, True), (twice, False, False)),
        ],
    )
    def test_an_error_or_a_signal_leaves_all_files_new_or_all_as_they_were(
        self,
        act: Callable[[], object],
        is_last: bool,
        has_links: bool,
        tmp_path: Path,
        monkeypatch: pytest.MonkeyPatch,
    ) -> None:
        if not has_links:
            monkeypatch.setattr("os.link", without_links)
        before = texts(make_older(tmp_path / "before"))
        publish(make_older(tmp_path / "after"))
        after = texts(tmp_path / "after")
        event, outcomes = "c_call" if act is fail else "c_return", []
        for number in itertools.count():
            folder, raised = make_older(tmp_path / str(number)), False
            acts: list[bool] = []

            def act_once(acts: list[bool] = acts) -> None:
                acts.append(True)
                act()

            try:
                with at_system_call(number, act_once, event=event) as begin:
                    publish(folder, is_last=is_last, before=begin)
            except (KeyboardInterrupt, OSError):
                raised = True
            found = texts(folder)
            outcomes.append((found == after, raised))
            if act is not ONCE:  # temporary files may be left, for the next run to remove
                found = {name: text for name, text in found.items() if ".vdet-" not in name}
            assert found in (before, after), f"after {number} calls"
            if not acts:
                break
        waited = [(True, not is_last)] if act is ONCE else []
        assert set(outcomes) >= {(False, True), *waited, (True, False)}
        assert not (is_last and (True, True) in outcomes)

    @pytest.mark.parametrize("options", [[], ["--no-links"]])
    def test_a_kill_leaves_each_file_as_it_was_or_new_also_after_the_next_run(
        self, options: list[str], tmp_path: Path
    ) -> None:
        command = [sys.executable, "-m", "publishing", str(tmp_path), *options]
        subprocess.run(command, env=with_modules(Path(__file__).parent), check=True)
        folders = sorted(tmp_path.iterdir(), key=lambda path: int(path.name))
        before, after = texts(make_older(tmp_path / "before")), texts(folders[-1])
        assert texts(folders[0]).items() >= before.items()
        for folder in folders[:-1]:
            for run in (list, partial(self.write_another, folder)):
                run()
                found = texts(folder)
                for name in before | after:
                    text = found.get(name)
                    assert text in (before.get(name), after.get(name)), (folder.name, name, text)
            publish(folder)
            (folder / "another.csv").unlink()
            assert texts(folder) == after
        assert len(folders) > 80

    @staticmethod
    def write_another(folder: Path) -> None:
        with staged(folder / "another.csv"):
            pass


@pytest.mark.parametrize("overwrite", [True, False])
def test_an_input_is_rejected_as_an_output_under_each_of_its_names(
    tmp_path: Path, overwrite: bool
) -> None:
    (tmp_path / "in.json").touch()
    (tmp_path / "hard.json").hardlink_to(tmp_path / "in.json")
    (tmp_path / "link.json").symlink_to("hard.json")
    inputs = file_ids([tmp_path / "in.json", tmp_path / "missing"])
    for name in ("in.json", "hard.json", "link.json"):
        with pytest.raises(OutputError, match="is an input of this run"):
            OutputFiles(overwrite=overwrite, inputs=inputs).check(tmp_path / name)
    OutputFiles(overwrite=True).check(tmp_path / "in.json")


def test_no_output_replaces_an_input(tmp_path: Path) -> None:
    for name in ("0.txt", "a.txt", "of-an-earlier-run.txt"):
        (tmp_path / name).write_text("precious")
    inputs = file_ids([tmp_path / "a.txt", tmp_path / "of-an-earlier-run.txt"])
    files = OutputFiles(overwrite=True, inputs=inputs)
    for path in (tmp_path / "0.txt", tmp_path / "a.txt"):
        files.stage(path).write_text("new")
    with pytest.raises(OutputError, match=r"a\.txt: is an input of this run"), files:
        pass
    with OutputFiles(overwrite=True, inputs=inputs) as files:
        (files.stage_folder(tmp_path, is_text) / "0.txt").write_text("new")
    texts = {path.name: path.read_text() for path in tmp_path.iterdir()}
    assert texts == {"0.txt": "new", "a.txt": "precious", "of-an-earlier-run.txt": "precious"}


@pytest.mark.parametrize("stem", ["x" * 250, "ü" * 125, "\udcff" * 250])
def test_names_may_have_any_length(tmp_path: Path, stem: str) -> None:
    path = tmp_path / f"{stem}.mp4"
    with staged(path) as temporary:
        temporary.write_text("whole")
    assert path.read_text() == "whole"


def test_what_may_not_be_replaced_is_refused_before_any_work(tmp_path: Path) -> None:
    """The message invites to replace only what may be replaced."""
    path, pipe = tmp_path / "out.txt", tmp_path / "pipe"
    path.touch()
    os.mkfifo(pipe)
    OutputFiles(overwrite=True).check(path)
    with pytest.raises(OutputError, match="already exists; use overwrite=True"):
        OutputFiles().check(path)
    for overwrite in (True, False):
        with pytest.raises(OutputError, match="is not a regular file and will not be replaced"):
            OutputFiles(overwrite=overwrite).check(pipe)


def test_a_folder_that_the_work_makes_may_be_missing(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    OutputFiles().check(tmp_path / "a" / "b" / "out.txt", makes_folder=True)
    with pytest.raises(OutputError, match="file is not a folder"):
        OutputFiles().check(tmp_path / "file" / "b" / "out.txt", makes_folder=True)
    assert names(tmp_path) == ["file"]


def test_an_endless_file_takes_no_more_memory_than_the_limit() -> None:
    tracemalloc.start()
    with pytest.raises(
        ConfigError, match="/dev/zero: is larger than 3,000,000 bytes, too large for a letter"
    ):
        read_whole(Path("/dev/zero"), limit=3_000_000, what="letter", error=ConfigError)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 7_500_000


@given(st.text(max_size=200))
def test_a_name_is_shown_on_one_line_without_control_characters(name: str) -> None:
    shown = printable(name)
    assert shown.isprintable()
    assert len(shown) <= 81
    assert shown == name or not name.isprintable() or name.startswith(shown[:-1])


def is_text(path: Path) -> bool:
    return path.suffix == ".txt"


class TestFolder:
    """`OutputFiles.stage_folder`: very many files, which appear together too."""

    def test_there_may_be_more_of_them_than_files_can_be_open(self, tmp_path: Path) -> None:
        soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
        resource.setrlimit(resource.RLIMIT_NOFILE, (200, hard))
        try:
            with OutputFiles() as files:
                folder = files.stage_folder(tmp_path, is_text)
                for number in range(300):
                    (folder / f"{number}.txt").touch()
        finally:
            resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))
        assert len(names(tmp_path)) == 300

    def test_what_is_there_is_kept_unless_it_is_overwritten(self, tmp_path: Path) -> None:
        for name in ("a.txt", "of-an-earlier-run.txt", "mine.png"):
            (tmp_path / name).write_text("old")
        (tmp_path / "folder.txt").mkdir()
        (tmp_path / "link.txt").symlink_to("mine.png")

        def write(overwrite: bool) -> None:
            with OutputFiles(overwrite=overwrite) as files:
                (files.stage_folder(tmp_path, is_text) / "a.txt").write_text("new")
                files.stage(tmp_path / "b.csv").write_text("of the same run, beside the folder's")

        with pytest.raises(OutputError, match=r"a\.txt: appeared during the run"):
            write(overwrite=False)
        kept = ["a.txt", "folder.txt", "link.txt", "mine.png"]
        assert names(tmp_path) == [*kept, "of-an-earlier-run.txt"]
        assert (tmp_path / "a.txt").read_text() == "old"
        write(overwrite=True)
        assert names(tmp_path) == sorted([*kept, "b.csv"])
        assert (tmp_path / "a.txt").read_text() == "new"
        write(overwrite=True)
        assert names(tmp_path) == sorted([*kept, "b.csv"])

    @pytest.mark.parametrize("is_old", [True, False])
    def test_a_failed_run_leaves_no_folder_of_its_own(self, tmp_path: Path, is_old: bool) -> None:
        path = tmp_path / "found"
        if is_old:
            path.mkdir()
        files = OutputFiles()
        (files.stage_folder(path) / "a.txt").touch()
        files.stage(tmp_path / "pictures" / "day" / "a.png")
        files.__exit__(KeyboardInterrupt, None, None)
        assert names(tmp_path) == (["found"] if is_old else [])
        with OutputFiles() as files:
            files.stage_folder(path)
        assert path.is_dir(), "a run that ends well leaves it, also without a file"


def test_what_a_killed_run_left_is_removed_and_that_of_a_running_one_is_kept(
    tmp_path: Path,
) -> None:
    path = tmp_path / "a.csv"
    code = f"""if True:
        import os, pathlib, vdet.files
        with vdet.files.staged(pathlib.Path({str(path)!r})):
            os._exit(1)
    """
    subprocess.run([sys.executable, "-c", code], check=False)
    assert [left.name for left in tmp_path.glob(".vdet-*/*")] == ["a.csv"]
    (tmp_path / "precious").mkdir()
    (tmp_path / f".vdet-{_HOST}-{DIGITS}").symlink_to("precious")
    with OutputFiles() as files:
        mine = files.stage_folder(tmp_path)
        with staged(tmp_path / "b.mp4"):
            assert mine.is_dir()
        assert len(list(tmp_path.glob(".vdet-*"))) == 2, "mine, and the link, which is not a folder"
    assert (tmp_path / "precious").is_dir()
    assert "b.mp4" in names(tmp_path)
    assert "a.csv" not in names(tmp_path)


def test_folders_below_a_staged_one_share_its_lock_and_appear_with_it(tmp_path: Path) -> None:
    with OutputFiles() as files:
        for folder in (tmp_path / "out", *(tmp_path / "out" / str(n) for n in range(3))):
            (files.stage_folder(folder) / "a.txt").write_text(folder.name)
        assert len(list(tmp_path.rglob(".vdet-*"))) == 1
    found = {str(path.relative_to(tmp_path)): path.read_text() for path in tmp_path.rglob("*.txt")}
    assert found == {"out/a.txt": "out"} | {f"out/{n}/a.txt": str(n) for n in range(3)}
    assert not list(tmp_path.rglob(".*"))
