"""What comes back: the capture set on disk, its basis images, and what they say (paper 4)."""
