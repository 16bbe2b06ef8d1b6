"""The tracker of the original system, which turns regions of the heatmap into cars by these rules.

The code and the tests use these numbers. The constants are the original's; all of them are
settings, under `tracker` with `kind: rules`. A region is a detection, and its peak is the
strength of the detection.

1.  Regions narrower or lower than 50 px are ignored.
2.  A region's cars are those whose centroid it contains.
3.  Several cars: only those count whose latest image is found within 50 px of where it was.
4.  If those overlap by more than 40 px they become one new car, shown at once.
5.  Otherwise they stay apart and move to where they were found.
6.  One car, and a peak above 4: it needs only 3 detections in a row to be shown.
7.  One car, and a region wider than 200 px or than 2/3 of the car: the region is added to it.
8.  No car inside, one within 50 px, no other region near it: a region of good size (as in 7) is
    added to it.
9.  Another region near it, the two about as wide as the car and under 250 px: both are added as
    one.
10. The same, but not under 250 px: the car becomes two, both shown at once.
11. No car near: a new car. It needs 3 detections if the peak is above 4, else 10.
12. A car shown before, left without a region and inside another car, is absorbed by that one.
13. A car shown before and left without a region is looked for by its image within 50 px.
14. Shown is a car detected in this frame and for enough frames in a row.
15. Deleted is a car missed in this frame with fewer than 7 detections so far,
16. one whose last 12 detections were all by its image,
17. and one missed 5 frames in a row.
"""
