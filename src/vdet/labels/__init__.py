"""Files of tracks and of labelled boxes: a module for each format, with its writer and reader."""
