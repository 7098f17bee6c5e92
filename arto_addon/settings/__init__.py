"""The settings that the artist may choose, each described once. This folder needs no Blender."""
