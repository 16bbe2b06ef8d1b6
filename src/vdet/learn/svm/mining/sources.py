"""What patches are cut out of: the frames of labelled videos, and labelled pictures."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from vdet.boxes import Float64Array
from vdet.config.schema import Settings
from vdet.detect.protocol import DetectorModel
from vdet.detect.svm.windows import Windows
from vdet.errors import ImageError, TruthError, VideoError
from vdet.labels.pictures import LabelledPicture
from vdet.labels.reading import read_labelled_pictures, read_truth
from vdet.labels.roles import Roles
from vdet.labels.video import LabelledVideo
from vdet.learn.svm.mining.choosing import FrameLabels, cut_sides
from vdet.learn.svm.mining.searching import WindowSearch, search_windows
from vdet.media import VideoReader
from vdet.media.images import Image
from vdet.progress import Progress
from vdet.run.loop import peek


@dataclass(frozen=True, slots=True)
class LabelledFrame:
    """A frame or a picture with its windows.

    Attributes
    ----------
    name
        Beginning of the names of its patches.
    number
        It decides, with the seed of the settings, which windows are chosen.
    """

    name: str
    number: int
    image: Image
    windows: Windows
    labels: FrameLabels


@dataclass(frozen=True, slots=True)
class VideoSource:
    """A labelled video.

    The frames `first` to `last` are used, counted from 1: one in `every`, and all that cut a
    vehicle off. If `last` is None, the last frame is that of the truth. If `numbers` is given, in
    ascending order, these frames are used instead.
    """

    path: Path
    truth: Path
    every: int = 4
    first: int = 1
    last: int | None = None
    numbers: tuple[int, ...] = ()

    def frames(
        self, model: DetectorModel | None, settings: Settings, progress: Progress
    ) -> Iterator[LabelledFrame]:
        """Yield the frames to use; `progress` gets the number of frames that are read.

        Raises
        ------
        TruthError
            The truth cannot be used, or has nothing about these frames.
        VideoError
            The video cannot be read or searched.
        """
        roles = Roles.from_settings(settings)
        truth = read_truth(self.truth, roles)
        last = self._last(truth)
        number = 0
        with VideoReader(self.path, frames=last, settings=settings.input) as reader:
            info, advance = reader.info, progress(last)
            images, frames = peek(reader)
            search = self._search(model, info.width, info.height, images)
            for frame in frames:
                number = frame.index + 1
                rows = truth.frame(number)
                labels = _frame_labels(rows)
                if self._uses(number, labels.vehicles, info.width):
                    yield LabelledFrame(
                        f"frame{number:06}",
                        frame.index,
                        frame.image,
                        search(frame.image),
                        labels,
                    )
                advance(1)
        if number < last:
            read_truth(self.truth, roles, frame_count=number)  # raises an error with the line

    def _last(self, truth: LabelledVideo) -> int:
        if self.numbers:
            return self.numbers[-1]
        last = min(self.last or truth.last_frame, truth.last_frame)
        if last < self.first:
            raise TruthError(
                f"{self.truth}: covers the frames up to {truth.last_frame}; mine some of these"
            )
        return last

    def _uses(self, number: int, vehicles: Float64Array, width: int) -> bool:
        """Tell whether a frame is used. One that cuts a vehicle off is rare and hard to learn."""
        if self.numbers:
            return number in self.numbers
        is_regular = (number - self.first) % self.every == 0
        cuts_off = any(cut_sides(box, width).any() for box in vehicles)
        return number >= self.first and (is_regular or cuts_off)

    def _search(
        self, model: DetectorModel | None, width: int, height: int, images: list[Image]
    ) -> WindowSearch:
        try:
            return search_windows(model, width, height, images)
        except ImageError as error:
            raise VideoError(f"{self.path}: {error}") from error


@dataclass(frozen=True, slots=True)
class PictureSource:
    """A set of labelled pictures: a folder, or a COCO file."""

    path: Path

    def frames(
        self,
        model: DetectorModel | None,
        settings: Settings,
        progress: Progress,
    ) -> Iterator[LabelledFrame]:
        """Yield all pictures; `progress` gets their number.

        Raises
        ------
        TruthError
            The labels cannot be used.
        ImageError
            A picture cannot be read or searched.
        """
        pictures = read_labelled_pictures(self.path, Roles.from_settings(settings)).pictures
        advance = progress(len(pictures))
        for number, labelled in enumerate(pictures):
            image = labelled.read()
            height, width = image.shape[:2]
            try:
                windows = search_windows(model, width, height, [image])(image)
            except ImageError as error:
                raise ImageError(f"{labelled.path}: {error}") from error
            labels = _frame_labels(labelled)
            yield LabelledFrame(f"picture{number + 1:06}", number, image, windows, labels)
            advance(1)


def _frame_labels(labelled: LabelledVideo | LabelledPicture) -> FrameLabels:
    boxes, ignored = labelled.boxes, labelled.ignored
    return FrameLabels(boxes[~ignored], boxes[ignored])
