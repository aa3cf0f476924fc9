"""Scenes: what a camera sees of materials, and the cheapest forms that it cannot tell from the truth."""
