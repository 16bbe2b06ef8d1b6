"""The motion tracker: vehicles move steadily, also while they are hidden or not detected.

For each vehicle, a Kalman filter (`state`) predicts its box in the next frame. Then

1.  detections are assigned to vehicles by the overlap with their predicted boxes, with the largest
    total (`pairing`). The more uncertain the prediction, the farther away the detection may be. The
    less they look alike, the less an overlap is worth. Present vehicles choose first, then
    unconfirmed ones;
2.  a box that is cut off by the side of the frame is measured only by its inner edge (`state`);
3.  an unassigned detection may be a new vehicle, unless it is a part of one (`association`);
4.  a new vehicle is shown when there is enough evidence for it (`vehicle`);
5.  a vehicle without a detection is remembered for a while, and keeps its id;
6.  a newly confirmed vehicle near the expected position of a lost one is the same vehicle if it
    looks alike, does not drive the other way and was not there before. Of two tracks of one
    vehicle, the one with the higher score stays, with the id that has not been lost for longer. Of
    two tracks that were apart for half a second and now show one vehicle, the lower-ranking one is
    lost (`association`);
7.  a frame is shown when later frames have been searched: each vehicle from its first detection to
    its last, with boxes smoothed over earlier and later detections (`vehicle`). A short gap between
    two detections is bridged, unless another vehicle covers most of this one meanwhile. Without
    later frames, a vehicle is shown by prediction.

All times are in seconds, so that tracks do not depend on the frame rate.
"""
