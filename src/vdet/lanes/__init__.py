"""Lanes: camera calibration, undistortion, and the lane that the vehicle drives in.

The modules in the order in which data flows through them:

1. `calibration` fits a camera to photographs of a chessboard. `camera_file` writes and reads it.
2. `camera` describes the camera, and removes its lens distortion from frames and boxes.
3. `top_view` warps an undistorted frame to the road as seen from above, in metres.
4. `paint` marks the painted pixels of this view, and finds those that may belong to the lane.
5. `curves` fits the two lines of the lane to painted pixels, by least squares.
6. `frame_fit` does steps 4 and 5 for one frame, and checks that the result can be a lane.
7. `road` does steps 2 to 6 for all frames of a video, and smooths the lane over time.

`lane` is the result for one frame and its JSON form. `drawing` draws it. `position` tells where on
the road a vehicle is.
"""
