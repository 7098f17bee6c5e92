"""Which picture of which scene, and where what belongs to it is kept."""
