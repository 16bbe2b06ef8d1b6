"""Counting: which vehicles cross lines, and enter, leave and stay in zones.

The counts of a video depend only on its tracks (`FrameTracks`), live or from a file. The rule:

1. The position of a vehicle is its ground point, the middle of the lower edge of its whole
   box, in each frame that shows it.
2. Near a line or the border of a zone, a vehicle is on neither side. Farther away, its side is
   settled after 0.1 seconds, or at once if two consecutive frames, or its last frame, show it one
   box height away.
3. A crossing is a change of the settled side where the path meets the line between its ends. Its
   time is interpolated between the two frames before and after it.
4. The directions are left and right, seen from the start of a line towards its end.
5. A crossing back counts only one box height away from the line, or if it is at least one box
   height away from the previous crossing.
6. Vehicles seen for less than `traffic.min_seen_seconds` do not count, nor do vehicles that stand
   the whole time, never half their size away from where they were first seen. Once a vehicle
   counts, its earlier events count too.
7. The class of a vehicle is that of the last frame of its track; of several tracks, the one that
   shows it largest decides.
8. A vehicle first seen within a second of another's last frame, near its last or expected
   position, is treated as the same vehicle: its tracks share one number. This does not apply to
   vehicles that leave at the edge of the frame. A track that was not shown for half a second and
   then reverses direction continues as another vehicle, as does one that jumps farther than a
   vehicle can. A moving vehicle that is lost and not found again continues for 0.3 seconds.
9. Only events are stored. All totals, flows and stays are computed from them.

`crossings` joins the tracks of each vehicle to a path, has the lines and zones in the frame, and
computes the crossings of one path and one line or zone, without state. `counter` collects the
events while frames are processed, and `counting` those of saved tracks, also of files that follow
one another. `counts` has the events and the tables computed from them, `clock` the start time of a
video and the intervals of all tables and pages, and `output` the files. `records` has a record and
the best image of each vehicle, `speeds` its speeds, and `survey` the tables of a workbook.
"""
