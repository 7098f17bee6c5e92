"""What makes the extension and its pictures: `python -m tools.package`, `python -m tools.screenshot`."""
