"""A shot and its worlds made small enough for a page in a browser, and what the page shows."""
