"""Pascal VOC: `JPEGImages`, and `Annotations` with an XML file for each.

Source: Everingham et al., "The Pascal Visual Object Classes (VOC) Challenge", 2010, and the readme
of its development kit.
"""

from pathlib import Path
from xml.etree import ElementTree as ET

from vdet.labels.documents import read_xml, size_of, text_of
from vdet.labels.label import Label, Size, line_error
from vdet.labels.parsing import parse_corners, read_bytes
from vdet.labels.pictures import PictureFormat

_SIDES = ("xmin", "ymin", "xmax", "ymax")


def read_voc(file: Path, _picture: Path) -> tuple[tuple[Label, ...], Size | None]:
    """Read the objects of a picture, and its size.

    Pixels count from 1, and the last row and column belong to the box. An object that is
    `difficult` is an ignore region, as in the VOC challenge.

    Raises
    ------
    TruthError
        The file is broken XML, declares a document type, or is of another form.
    """
    root = read_xml(file, read_bytes(file), "annotation")
    place, labels = "size", list[Label]()
    try:
        size = size_of(root.find("size"))
        for number, element in enumerate(root.iterfind("object"), start=1):
            place = f"object {number}"
            labels.append(_label(place, element))
    except ValueError as error:
        raise line_error(file, place, str(error)) from error
    return tuple(labels), size


def _label(place: str, element: ET.Element) -> Label:
    left, top, right, bottom = parse_corners([text_of(element, f"bndbox/{s}") for s in _SIDES])
    box, name = (left - 1, top - 1, right, bottom), text_of(element, "name")
    return Label(place, box, name, ignored=element.findtext("difficult", "").strip() == "1")


VOC_PICTURES = PictureFormat(
    "Pascal VOC", ("JPEGImages", "Annotations"), ".xml", lambda _: read_voc
)
