"""Which model the light of a pixel gets: evidence, choice and search, tile by tile (paper 5)."""
