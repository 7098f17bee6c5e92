"""What is done with a relit picture: its files, its place in the compositor, and comparing it."""
