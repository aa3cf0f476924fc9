"""Integrals over the hemisphere: directional albedo, importance sampling, and the bound on a uniform part."""
