"""The review of counts: strips that show what passed, corrections, and the estimate by them."""
