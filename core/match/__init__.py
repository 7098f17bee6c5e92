"""The light that makes a shot look like a picture."""
