"""A page for a browser in which anyone turns the light of a shot."""
