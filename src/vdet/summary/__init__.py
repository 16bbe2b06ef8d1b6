"""What is known of each vehicle after a video: a record, and its best picture."""
