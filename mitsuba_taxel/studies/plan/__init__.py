"""Definition of a study: scenes, varied parameters, load steps."""
