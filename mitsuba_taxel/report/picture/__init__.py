"""Pictures of scenes: pads cut open, parts and rays."""
