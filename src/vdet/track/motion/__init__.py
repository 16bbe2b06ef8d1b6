"""The motion tracker: vehicles move steadily, also while they are hidden or not detected.

For each vehicle a Kalman filter (`state`) estimates where it is in the next frame. Then

1.  a detection belongs to the vehicle whose expected box it overlaps most, all pairs taken
    together (`association`). The less certain the expected box is, the farther off its detection
    may be. Present vehicles choose first, then lost ones, then those not yet shown;
2.  a box that is cut off by the frame's side is measured by its inner edge only (`state`);
3.  a detection that belongs to no vehicle may be a new one, unless it is a part of one
    (`association`);
4.  a new vehicle is shown when there is enough evidence for it (`vehicle`);
5.  a vehicle without a detection is shown by prediction for a short time; not behind another one
    that covers most of it. It is remembered for longer, and keeps its id;
6.  a new vehicle near the expected place of a lost one is the same vehicle; of two tracks of one
    vehicle the one with the higher score stays, under the older id (`association`).

All times are seconds, so that tracks do not depend on the frame rate.
"""
