"""Contact of a pad with itself, the board and packages: how it is detected, and forces that keep walls apart."""
