"""Pictures of scenes: sectioned pads, parts and rays."""
