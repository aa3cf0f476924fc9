"""Surfaces as height maps, rays on their facets, and a goniometer that measures the BRDF of these facets."""
