"""Evaluation of a solution: fields, reactions, errors, files."""
