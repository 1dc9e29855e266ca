"""What is read from a solution: fields, reactions, errors, files."""
