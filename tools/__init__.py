"""What makes the extension and its pictures: `tools.package`, `tools.walk`, `tools.screenshot`."""
