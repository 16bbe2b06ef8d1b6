"""Find and follow vehicles in road video on an ordinary CPU."""

import os

__version__ = "0.1.0"

MAX_PICTURE_PIXELS = 2**25
"""A picture of more pixels is not read: an 8K frame has fewer, a decompression bomb many more."""
MAX_PICTURE_SIDE = 2**15

# OpenCV takes its limits from here, and only when it is first imported: before any module of ours.
os.environ.setdefault("OPENCV_IO_MAX_IMAGE_PIXELS", str(MAX_PICTURE_PIXELS))
os.environ.setdefault("OPENCV_IO_MAX_IMAGE_WIDTH", str(MAX_PICTURE_SIDE))
os.environ.setdefault("OPENCV_IO_MAX_IMAGE_HEIGHT", str(MAX_PICTURE_SIDE))
