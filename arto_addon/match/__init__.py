"""Looking for the light of a picture: what is asked, the work, and what is made of it."""
