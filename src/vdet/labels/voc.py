"""Pascal VOC: `JPEGImages`, and `Annotations` with an XML file for each.

Source: Everingham et al., "The Pascal Visual Object Classes (VOC) Challenge", 2010, and the readme
of its development kit.
"""

from collections.abc import Iterator
from pathlib import Path

from vdet.labels.formats import PictureFormat
from vdet.labels.label import Label
from vdet.labels.parsing import parse_number, read_bytes
from vdet.labels.pictures import LabelledPicture, labelled_pairs
from vdet.labels.xml_reader import Element, read_xml


def read_voc_pictures(folder: Path) -> Iterator[LabelledPicture]:
    """Yield every picture that has a file in `Annotations`.

    Pixels count from 1, and the last row and column belong to the box. An object that is
    `difficult` is an ignore region, as in the VOC challenge.

    Raises
    ------
    TruthError
        A file has no picture, is broken XML, declares a document type, or is of another form.
    """
    for file, picture in labelled_pairs(folder / "Annotations", ".xml", folder / "JPEGImages"):
        yield _labelled(picture, file)


def _labelled(picture: Path, file: Path) -> LabelledPicture:
    labels: list[Label] = []
    size: list[tuple[int, int] | None] = [None]

    def take(opened: list[Element]) -> None:
        match [each.name for each in opened]:
            case ["annotation", "object", "bndbox"]:
                opened[-2].values.update(opened[-1].values)
            case ["annotation", "object"]:
                labels.append(_label(opened[-1]))
            case ["annotation", "size"]:
                size[0] = opened[-1].size

    read_xml(file, read_bytes(file), "annotation", take)
    return LabelledPicture(picture, file, tuple(labels), size[0])


def _label(element: Element) -> Label:
    left, top, right, bottom = (
        parse_number(element.value(side)) for side in ("xmin", "ymin", "xmax", "ymax")
    )
    difficult = element.values.get("difficult", ["0"])[0].strip() == "1"
    name = element.value("name")
    return Label(element.line, (left - 1, top - 1, right, bottom), name, ignored=difficult)


VOC_PICTURES = PictureFormat("Pascal VOC", ("JPEGImages", "Annotations"), read_voc_pictures)
