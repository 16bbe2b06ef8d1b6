"""Counting: which vehicles cross lines, and enter, leave and stay in zones.

The counts of a video follow from its tracks alone (`FrameTracks`), live or from a file. The rule:

1. A vehicle is at its foot, the middle of the lower edge of its whole box, in each frame that
   shows it.
2. Near a line or the border of a zone it is on neither side. Farther away, its side is settled
   after 0.1 seconds, or where two frames show it one height of its box away, or where its last
   frame does.
3. A crossing is a change of the settled side whose path meets the line between its ends. Its time
   is interpolated between the two frames before and after it.
4. The directions are the left and the right of someone who looks from the start to the end of a
   line.
5. A way back counts only one height of the box away from the line, or where it meets the line one
   height or more from where the vehicle crossed before.
6. Vehicles that are seen for less than `traffic.min_seen_seconds` do not count, nor those that
   stand the whole time: that are never half their size away from where they are first seen. Once
   a vehicle counts, its earlier events count too.
7. The class of a vehicle is that of the last frame of its track; of several tracks, of the one
   that shows it largest.
8. A vehicle that is first seen within a second after another was last seen, and near the place
   where that one was or would be, is taken for the same vehicle: its tracks have one number. A
   vehicle that moves out at the edge of the frame has no such successor. A track that was not
   shown for half a second and then drives the other way goes on as another vehicle. One that
   has moved, is lost and has no successor drives on for 0.3 seconds.
9. Only events are stored. All totals, flows and stays follow from them.

`linking` makes a path of the tracks of each vehicle. `crossings` places lines and zones in the
frame; what it finds is a pure function of one path and one of them. `counter` puts the events
together, `counts` has the events and the tables that follow from them, `clock` the moment at which
a video begins and the intervals of all tables and pages, `count_files` writes all of it.
"""
