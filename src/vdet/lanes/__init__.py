"""Lanes: camera calibration, undistortion, and the lane that the vehicle drives in.

The modules in the order in which data flows through them:

1. `calibration` fits a camera to photographs of a chessboard.
2. `camera` is this camera and its file. It removes the lens distortion from frames and boxes, and
   warps an undistorted frame to the road as seen from above, in metres.
3. `curves` marks the painted pixels of this view, finds those that may belong to the lane, fits its
   two lines to them by least squares, and checks the result.
4. `road` does steps 2 and 3 for all frames of a video, smooths the lane over time, computes where
   on the road a vehicle is, and draws the lane.
"""
