"""The video in a page, and links that jump to a moment in it."""

import os
from dataclasses import dataclass
from html import escape
from pathlib import Path
from urllib.parse import quote

from vdet.files import escaped
from vdet.pages.frame import paragraph

STYLE = """
.player { margin-top: 18px; }
.player video { width: 100%; max-height: 70vh; display: block; border-radius: 8px;
  background: #000; scroll-margin-top: 12px; }
"""

SCRIPT = """<script>
const video = document.querySelector("video");
if (video) {
  const fail = () => { document.getElementById("unplayable").hidden = false; };
  video.addEventListener("error", fail);
  if (video.error) fail();
  document.addEventListener("click", event => {
    const link = event.target.closest("[data-time]");
    if (!link || video.error || event.ctrlKey || event.metaKey || event.shiftKey) return;
    event.preventDefault();
    video.currentTime = Number(link.dataset.time);
    video.scrollIntoView({ block: "nearest" });
  });
}
</script>
"""


@dataclass(frozen=True, slots=True)
class Player:
    """The video that a page shows.

    Attributes
    ----------
    path
        The video, relative to the working folder or absolute.
    is_drawn
        Whether it is an output, with the vehicles drawn in; else it is the source.
    start
        Time of the frame with which it begins, seconds, as the tracks count it.
    """

    path: Path
    is_drawn: bool
    start: float


def player_html(player: Player | None, folder: Path) -> str:
    """Return the video of a page in `folder`, and a line that says which it is."""
    if player is None:
        return paragraph("There is no video to show: the source is none, and this run wrote none.")
    name = escaped(player.path.name)
    what = (
        f"{name}, with the vehicles drawn in."
        if player.is_drawn
        else f"{name}, the source: this run wrote no video."
    )
    return (
        f'<div class="player"><video controls playsinline preload="metadata" '
        f'src="{escape(link_to(player.path, folder))}"></video></div>'
        '<p id="unplayable" hidden>This browser cannot play the video, or it is no longer there. '
        "The page keeps the way to it: move both together.</p>"
        + paragraph(f"{what} A click on a vehicle or on a time jumps there.")
    )


def jump(player: Player | None, folder: Path, time: float) -> str:
    """Return the attributes of a link to a moment; `time` in seconds as the tracks count it."""
    if player is None:
        return ""
    seconds = f"{max(0.0, time - player.start):.3f}"
    return f'href="{escape(link_to(player.path, folder))}#t={seconds}" data-time="{seconds}"'


def link_to(path: Path, folder: Path) -> str:
    """Return the address of a file for a page in `folder`: relative, or absolute if it must be."""
    try:
        relative = os.path.relpath(os.path.abspath(path), os.path.abspath(folder))  # noqa: PTH100
    except ValueError:  # another drive of Windows
        return path.absolute().as_uri()
    return quote(os.fsencode(relative.replace(os.sep, "/")))
