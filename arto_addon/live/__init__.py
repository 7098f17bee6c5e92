"""Live light: the shot follows the world while the artist's hand is on it."""
