"""Files and text: written whole or not at all, read as users wrote them; tables as text, Markdown and CSV."""
