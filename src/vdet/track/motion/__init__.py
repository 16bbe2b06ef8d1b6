"""Vehicles followed by their motion: the default tracker.

For each vehicle a Kalman filter (`state`) tells where it is expected in the next frame. There

1.  a region belongs to the vehicle whose expected box it overlaps most, all pairs taken together
    (`pairing`); vehicles that are present choose first, then lost ones, then those not yet shown;
2.  a region that fits two vehicles together better than one of them is shared by both;
3.  of a view cut off by the frame's side only the inner edge counts (`views`);
4.  a region that is no vehicle's may be a new one, unless it is a part of one (`overlapping`);
5.  a new vehicle is shown when there is evidence enough for it (`vehicle`);
6.  a vehicle without a region is shown where it is expected, for a few frames; not behind another
    one that covers most of it. It is remembered for longer, and keeps its id;
7.  a new vehicle near to where a lost one is expected is that one; of two that turn out to be one
    the surer stays, or the older (`identity`).
"""

from vdet.track.motion.tracker import MotionTracker

__all__ = ["MotionTracker"]
