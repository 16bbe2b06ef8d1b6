"""All ways in which planes are coded."""

import pytest

from vdet.media.frame import Coding

CODINGS = {
    "BT.601": Coding(),
    "BT.601, full range": Coding(full_range=True),
    "BT.709": Coding("bt709"),
    "BT.709, full range": Coding("bt709", full_range=True),
}
in_any_coding = pytest.mark.parametrize("coding", CODINGS.values(), ids=CODINGS)
