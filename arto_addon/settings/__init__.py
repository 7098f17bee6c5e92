"""What the artist may choose: each setting said once, in a table that needs no Blender."""
