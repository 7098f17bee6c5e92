"""What the artist touches: settings, buttons, panels, the command line."""
