"""Commands on what is installed and kept on this machine."""
