"""What is kept: the reflectance field on disk, tile by tile, and its smaller copies (paper 5)."""
