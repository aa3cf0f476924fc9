"""Tables of f_r: their grids, how they are computed, looked up and planned, and the error that they state."""
