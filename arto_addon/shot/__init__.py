"""The shot, which is a picture of a scene, and where the shot's files are kept."""
