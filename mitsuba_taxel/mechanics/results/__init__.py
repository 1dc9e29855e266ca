"""Evaluation of a solution: fields, reactions, contact pressure, largest strain, and files."""
