"""Batches of scenes over varied parameters, and the store of their results."""
