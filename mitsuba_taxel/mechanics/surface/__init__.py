"""The deformed surface as triangles, smooth or with a finish."""
