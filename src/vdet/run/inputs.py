"""The files that a command reads, which none of its outputs may replace."""

from pathlib import Path

from vdet.config.schema import Settings
from vdet.files import FileIds, file_ids
from vdet.media.images import IMAGE_SUFFIXES, numbered_images
from vdet.regions import check_masks

_DATA_SUFFIXES = IMAGE_SUFFIXES | {".csv", ".json", ".txt", ".yaml", ".yml"}


def input_files(*paths: Path, settings: Settings | None = None) -> FileIds:
    """Identify the files at `paths`, and the model file, masks and picture of the settings.

    A folder stands for the images and labels in it, recursively, and a pattern such as
    `img_%04d.png` for its images. Raises `VideoError` if there is none of these, `ImageError` or
    `ConfigError` if a mask cannot be used.
    """
    files: list[Path] = []
    for path in paths:
        if path.is_dir():
            files += (file for file in path.rglob("*") if file.suffix.lower() in _DATA_SUFFIXES)
        else:
            files += numbered_images(path) or [path]
    if settings:
        check_masks(settings.regions)
        masks = (region.mask for region in settings.regions)
        named = [settings.detector.model, settings.survey.picture, *masks]
        files += map(Path, filter(None, named))
    return file_ids(files)
