"""Integrals over the hemisphere: directional albedo, importance sampling, the bound on a uniform part."""
