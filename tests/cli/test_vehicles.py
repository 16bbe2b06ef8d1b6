"""`--vehicles`, `--crops` and `--page` of `vdet detect-video`, for one video and for many."""

import json
from pathlib import Path
from urllib.parse import unquote

import pytest

from conftest import Run
from pages.html import Elements
from running import names, rows_of, write_drive

NASTY = "<img src=x onerror=alert(1)>"
ENDS = ("--vehicles", ".cars.csv", "--crops", ".crops", "--page", ".page")


@pytest.fixture
def clips(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = tmp_path / "clips"
    (folder / "day").mkdir(parents=True)
    write_drive(folder / f"{NASTY}.mp4", 12)
    write_drive(folder / "day" / "a.mp4", 8)
    monkeypatch.chdir(tmp_path)
    return folder


def addresses_in(page: Path) -> list[str]:
    """Return where a page leads to, also by the links that its script makes."""
    html = page.read_text(encoding="utf-8")
    text = html.partition('id="vehicles"')[2].partition(">")[2].partition("</script>")[0]
    table = json.loads(text)
    made = [*table["pages"], *table["picture"]]
    every = [*Elements(html).addresses(), *filter(None, made)]
    return [address for address in every if not address.startswith("data:")]


def test_many_videos_have_their_own_and_a_table_and_a_page_over_all(
    run: Run, clips: Path, tmp_path: Path, red: tuple[str, ...]
) -> None:
    run("detect-video", clips, "-d", "found", *ENDS, "--jobs", "1", *red, code=0)
    found = names(tmp_path / "found")
    crops = [name for name in found if ".crops/" in name]
    assert [name.partition(".crops/")[0] for name in crops] == [NASTY, "day/a"]
    ends = (".cars.csv", ".mp4", ".page/page.html", ".page/vehicle-1.webp")
    of_each = {f"{name}{end}" for name in (NASTY, "day/a") for end in ends}
    assert set(found) - set(crops) == of_each | {"all.cars.csv", "index.html", "manifest.jsonl"}
    assert [row["video"] for row in rows_of(Path("found/all.cars.csv"))] == [NASTY, "day/a"]
    for page in Path("found").rglob("*.html"):
        addresses = addresses_in(page)
        assert addresses
        if page.name == "index.html":
            assert sum(address.endswith(".webp") for address in addresses) == len(crops)
        for address in addresses:
            assert (page.parent / unquote(address.partition("#")[0])).is_file(), address
