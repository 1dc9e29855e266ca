"""Contact of a pad with indenters, itself, the board and packages."""
