"""The motion tracker: vehicles move steadily, also while they are hidden or not detected.

For each vehicle a Kalman filter (`state`) estimates where it is in the next frame. Then

1.  a detection belongs to the vehicle whose expected box it overlaps most, all pairs taken
    together (`pairing`). The less certain the expected box is, the farther off its detection
    may be. The less they look alike, the less an overlap is worth. Present vehicles
    choose first, then those not yet sure;
2.  a box that is cut off by the frame's side is measured by its inner edge only (`state`);
3.  a detection that belongs to no vehicle may be a new one, unless it is a part of one
    (`association`);
4.  a new vehicle is shown if there is enough evidence for it (`vehicle`);
5.  a vehicle without a detection is remembered for a while, and keeps its id;
6.  a new vehicle that is sure, and near the expected place of a lost one, is the same vehicle if it
    looks like it, does not drive the other way and was not there before; of two tracks of one
    vehicle the one with the higher score stays, under the id that was not lost for longer; of two
    that were apart for half a second and now show one vehicle, the one that was lost later is
    lost (`association`);
7.  what a frame shows is known when the frames after it were searched: each vehicle from its first
    detection to its last, where both what came before and what came after put it (`vehicle`). A
    gap between two detections is bridged if it is short, and if no other vehicle covers most of
    this one meanwhile. Where nothing came after a frame yet, a vehicle is shown by prediction.

All times are seconds, so that tracks do not depend on the frame rate.
"""
