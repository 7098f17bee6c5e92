"""What is done with a relit picture: write, show in the compositor, composite and compare."""
