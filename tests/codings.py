"""All ways in which planes are coded."""

import pytest

from vdet.media.frame import Coding

LIMITED, FULL, HD = Coding(), Coding(full_range=True), Coding("bt709")
CODINGS = {
    "BT.601": LIMITED,
    "BT.601, full range": FULL,
    "BT.709": HD,
    "BT.709, full range": Coding("bt709", full_range=True),
}
in_any_coding = pytest.mark.parametrize("coding", CODINGS.values(), ids=CODINGS)
