"""Other programs on the same cases, side by side with this one."""
