"""Files: atomic writing, reading of text and tables from users, tables as text and Markdown."""
