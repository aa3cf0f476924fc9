"""The figures of the three papers, computed, with what the papers say one sees in them."""
