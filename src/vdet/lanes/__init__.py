"""Lanes: camera calibration, undistortion, and the lane that the vehicle drives in.

The modules in the order in which data flows through them:

1. `calibration` fits a camera to photographs of a chessboard.
2. `camera` is this camera and its file. It removes the lens distortion from frames and boxes.
3. `top_view` warps an undistorted frame to the road as seen from above, in metres.
4. `paint` marks the painted pixels of this view, and finds those that may belong to the lane.
5. `curves` fits the two lines of the lane to them by least squares, and checks the result.
6. `road` does steps 2 to 5 for all frames of a video, smooths the lane over time, computes where
   on the road a vehicle is, and draws the lane.
"""
