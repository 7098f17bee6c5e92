"""The light that is asked for: the scene's world as a map, as a background, as lamps (paper 6)."""
