"""The paper, rerun: its figures and tables from this package, beside the paper's own numbers."""
