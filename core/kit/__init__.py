"""The light kit: softboxes, suns, pictures and flags over a base, as data and as light."""
