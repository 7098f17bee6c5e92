"""What makes the extension and its pictures: `tools.package` and `tools.screenshot`."""
