"""Commands on one scene without a reading: to write, check and draw it, its parts and plugins."""
