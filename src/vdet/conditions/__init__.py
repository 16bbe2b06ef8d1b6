"""What makes a result doubtful: typed findings about a video, and why."""
