"""Where to put a light so that it shines in a pixel."""
