"""Lanes: camera calibration, undistortion, lane finding, lane drawing.

`calibration` makes a `camera` of chessboard photographs, `preview` shows how well, `camera_file`
keeps it; `undistortion` straightens frames, and boxes in them. `view` shows the road from above,
`mask` picks the paint, `search` and `fit` put `curves` through it, `sighting` judges them, `track`
smooths them over frames; `finder` is all this in order, and gives a `lane`. `drawing` draws it.
"""
