"""What a study computes: scenes, varied parameters, load steps."""
