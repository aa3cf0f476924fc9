"""Every form of a material, and their speed against their accuracy."""
