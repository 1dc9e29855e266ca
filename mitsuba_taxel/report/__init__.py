"""Web pages of studies, pictures of sensors, and display in notebooks."""
