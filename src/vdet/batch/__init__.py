"""Many videos in one run: inputs, plan, run, manifest. A bad file does not stop the others."""
