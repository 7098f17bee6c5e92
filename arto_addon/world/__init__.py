"""The light to relight with: the scene's world as a map, as a background, as lamps (paper 6)."""
