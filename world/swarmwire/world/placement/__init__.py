"""Initial placement: the layout of arenas, and the places of obstacles, lights and robots."""
