"""From frames to outputs: the loop over the frames of a video, and single images."""
