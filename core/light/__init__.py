"""The light that is asked for: an environment, its place on the patches, its parts (paper 6)."""
