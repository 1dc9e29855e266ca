"""Whether a pad touches itself or what is near it."""
