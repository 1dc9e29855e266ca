"""Light between diffuse walls without random numbers: readings, and their derivatives by the places of the walls."""
