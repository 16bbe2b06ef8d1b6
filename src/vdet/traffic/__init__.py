"""Counting: which vehicles cross lines, and enter, leave and stay in zones.

The counts of a video follow from its tracks alone (`FrameTracks`), live or from a file. The rule:

1. A vehicle is where its foot is, the middle of the lower edge of its whole box, in every frame
   that shows it.
2. Near a line or the border of a zone it is on neither side. Beyond, its side is settled
   after 0.1 seconds, or one height of its box away in two frames, or in the last one in which it
   is seen.
3. A crossing is a change of the settled side whose path meets the line between its ends. Its time
   is interpolated between the two frames before and after it.
4. Directions are the left and the right of someone who looks from the start to the end of a line.
5. A way back counts only one height of the box away from the line, or where it meets the line one
   height or more from where the vehicle crossed before.
6. Vehicles that are seen for less than `counts.confirmed` do not count. Once a vehicle is
   confirmed, what it did before counts too.
7. The class of a vehicle is that with the highest sum of scores over all its frames.
8. A vehicle that is first seen within a second of the end of another, and where that
   one would be, is taken for the same: it takes over its side and whether it was counted. An event
   that rests on this is `stitched`. A vehicle that moves out at the edge of the frame has no such
   successor.
9. Events are what is stored. All totals follow from them.

`borders` places lines and zones in a frame and holds what a vehicle does at one of them, `counter`
follows the vehicles, `counts` has the events, what follows from them, and their files.
"""
