"""What makes the extension, the site and pictures: `package`, `site`, `walk`, `screenshot`."""
