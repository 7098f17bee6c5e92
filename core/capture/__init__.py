"""What comes back: the capture set on disk, its basis images, and their moments (paper 4)."""
