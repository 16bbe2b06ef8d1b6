"""A day of files: their counts are reviewed from one list, and pages, clips and rows are linked."""

from pathlib import Path

from browser import ENTER, browser
from cli.test_count_command import LINES
from conftest import Run
from running import rows_of, write_drive


def test_the_pages_of_a_day_are_linked(run: Run, tmp_path: Path, red: tuple[str, ...]) -> None:
    day, out = tmp_path / "day", tmp_path / "out"
    for name in ("a", "b"):
        (day / name).mkdir(parents=True)
        write_drive(day / name / f"{name}.mp4", 60)
    settings = tmp_path / "lines.yaml"
    settings.write_text(LINES)
    (day / "c.mp4").write_bytes(b"no video")
    pages = ("--review", ".review", "--page", ".page", "--clips", ".clips")
    outputs = (*pages, "--counts", ".counts.csv", "--flows", ".flows.csv")
    run("detect-video", day, "-d", out, "--no-video", *red, "-c", settings, *outputs, code=3)
    for table in ("counts", "flows"):
        of_each = [rows_of(out / f"{name}/{name}.{table}.csv") for name in ("a", "b")]
        assert of_each[0] == of_each[1] != []

    with browser(tmp_path) as window:
        window.visit(out / "reviews.html")
        rows = (
            "return [...document.querySelectorAll('tr')].map(row => [...row.children]"
            ".filter(cell => cell.checkVisibility()).map(cell => cell.textContent))"
        )
        heading = ["video", "vehicles", "minutes"]
        assert window.run(rows) == [heading, ["a/a", "1", "1"], ["b/b", "1", "1"]]
        assert window.text(".problems li").startswith("c failed: ")
        window.open(out / "b/b.review/review.html")
        window.type(ENTER)
        window.visit(out / "reviews.html")
        # The storage of one page reaches another in its own time.
        window.wait(
            "dispatchEvent(new Event('focus'));"
            "return document.querySelector('th:last-child').checkVisibility()"
        )
        checked = [[*heading, "checked"], ["a/a", "1", "1", ""], ["b/b", "1", "1", "1"]]
        assert window.run(rows) == checked

        window.visit(out / "index.html")
        links = window.run("return [...document.links].map(link => decodeURI(link.pathname))")
        assert all(Path(link).is_file() for link in links)
        clips = [link for link in links if "/a/a.clips/clip-" in link]
        assert len(clips) == 1
        reviews = ("reviews.html", "a/a.review/review.html", "b/b.review/review.html")
        assert {str(out / review) for review in reviews} < set(links)
        window.visit(out / "a/a.page/page.html")
        texts = window.run("return [...document.links].map(link => link.textContent)")
        lists = [("a/a.page/page.html", "index.html"), ("b/b.review/review.html", "reviews.html")]
        for page, listed in lists:
            window.visit(out / page)
            assert window.run("return document.links[0].href") == (out / listed).as_uri()
        assert texts.count("clip") == texts.count("Check the counts") == 1
